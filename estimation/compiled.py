"""Apply the step of a method to arrays of samples.

A step is the function with which an estimation method processes one sample (`estimation.step`). A
step is interpreted by Python, or compiled by numba. The extra `fast` of the package installs numba.
"""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.machine_code import called_by_machine_code, machine_code
from estimation.own_copies import called_functions, calls, own_copy, used_globals
from estimation.records import to_record, update_from
from estimation.step import State, Step, below

WORTH_LOADING_NUMBA = 200_000
"""Number of samples that the interpreter processes while numba is loaded, about 0.6 s."""
WORTH_LOADING_STEP = 3_000
"""Number of samples that the interpreter processes while a compiled step is loaded, about 7 ms."""


class Samples(NamedTuple):
    """Regressors, force and time of n samples, as the input of an estimation method."""

    phi: Floats
    """Regressors, shape (n, regressors)."""
    f: Floats
    """Force [N], shape (n,)."""
    dt: Floats
    """Time since the previous sample [s], shape (n,)."""
    open: NDArray[np.bool_]
    """True for the samples that are processed, shape (n,). The other samples do not change the
    estimate."""


class Law(NamedTuple):
    """The function with which a method processes one sample, and its constant settings."""

    step: Step
    parameters: Any


class CompilationChoice:
    """Decide whether samples are processed by interpreted or by compiled code.

    Compiled code is faster, but the library numba must be loaded first. The rule is to load numba
    when the number of samples reaches `WORTH_LOADING_NUMBA`. The interpreter needs about as much
    time for this number of samples as for loading numba. The best decision would need the number of
    all later samples, which is not known. With the rule, the total time is at most twice the time
    with the best decision (ski rental problem).

    Arrays of fewer than `WORTH_LOADING_STEP` samples are always interpreted, and are not counted.
    """

    def __init__(self) -> None:
        self.interpreted = 0
        """Number of samples that were interpreted so far, in all arrays that are not short."""

    def is_compiled(self, samples: int) -> bool:
        """Return whether an array with this number of samples is processed by compiled code.

        Code is compiled after a certain number of samples, which this method counts. Therefore,
        call it only once for each array.
        """
        if samples < WORTH_LOADING_STEP or not find_spec("numba"):
            return False
        if "numba" in sys.modules:
            return True
        self.interpreted += samples
        return self.interpreted >= WORTH_LOADING_NUMBA


choice = CompilationChoice()
"""The `CompilationChoice` of this process. All arrays of samples share it."""


def sweep(law: Law, state: State, samples: Samples) -> Floats:
    """Apply the step of a method to n samples, and return the estimate after each sample.

    `state` is updated in place. The results of compiled and interpreted code are identical to the
    bit, because both do the same operations in the same order, without fused multiply-add.

    Returns
    -------
    Array of shape (n, 2 m + 1). A row has the m estimated values, their m standard deviations,
    and 1 if the sample did not change the estimate (`held`), otherwise 0.
    """
    if choice.is_compiled(len(samples.f)):
        return compiled_sweep(law, state, samples)
    return interpreted_sweep(law, state, samples)


def interpreted_sweep(law: Law, state: State, samples: Samples) -> Floats:
    """Apply the step of a method to n samples in interpreted code; `sweep` describes the result."""
    step, parameters = interpreted(law.step), law.parameters
    theta, std = state.theta, state.std
    columns = (column.tolist() for column in samples)
    values: list[float] = []
    for phi, f, dt, is_open in zip(*columns, strict=True):
        state.held = not is_open
        if is_open:
            step(parameters, state, phi, f, dt)
        values += theta
        values += std
        values.append(state.held)
    table = np.fromiter(values, np.float64, len(values))
    return table.reshape(-1, 2 * len(theta) + 1)


def compiled_sweep(law: Law, state: State, samples: Samples) -> Floats:
    """Apply the step of a method to n samples in compiled code; `sweep` describes the result.

    Raises
    ------
    ImportError
        numba is not installed.
    """
    loop = compiled(law.step, samples.phi.shape[1])
    record = to_record(state)
    table = np.empty((len(samples.f), 2 * len(state.theta) + 1))
    loop(to_record(law.parameters), record, *samples, table)
    update_from(record[0], state)
    return table


interpreted = cache(own_copy)
"""Return the copy of a step that the interpreter uses. Each step is copied only once.

`estimation.own_copies` explains why a copy is needed.
"""


@cache
def compiled(step: Step, regressors: int) -> Callable[..., None]:
    """Return a compiled function that calls a step for each of n samples.

    A step processes one sample (`estimation.step`). The arguments of the returned function are the
    constant settings and the state of the step (two numpy records), the arrays of `Samples`, and
    an array into which the estimates are written. `sweep` describes the columns of this array.

    Parameters
    ----------
    step
        The step to compile.
    regressors
        Number of regressors in a sample.
    """
    from numba.np.unsafe.ndarray import to_fixed_tuple

    # The key of numba's disk cache depends on the name of the function, but not on the functions
    # that it calls, or on closures. So the step is a global of a copy of `_template`. The name of
    # this copy contains a hash of the source of this package, and of all modules with functions
    # that the step calls.
    modules = {function.__module__ for function in called_functions(step)}
    source = "".join(inspect.getsource(sys.modules[module]) for module in sorted(modules))
    digest = hashlib.sha256((source + package_source()).encode()).hexdigest()[:16]
    known = {
        "_step": own_copy(step, called_by_machine_code, [(below, compiled_below())]),
        "_regressors": regressors,
        "_to_fixed_tuple": to_fixed_tuple,
    }
    loop = FunctionType(_template.__code__, known)
    loop.__module__ = __name__
    loop.__qualname__ = f"{step.__module__}.{step.__name__}.{regressors}.{digest}"
    return machine_code(loop)


def looped(
    loop: Callable[..., None],
    constants: tuple[float, ...],
    inputs: tuple[NDArray[Any], ...],
    outputs: tuple[NDArray[Any], ...],
) -> None:
    """Call a function that loops over n samples, either interpreted or compiled.

    The results of interpreted and compiled code are identical to the bit.

    Parameters
    ----------
    loop
        Function that is called as `loop(*constants, *inputs, *outputs)` and writes into the
        outputs. Its code must follow the rules in `estimation.step`.
    constants
        Numbers that are the same for all samples.
    inputs
        Arrays that the function reads.
    outputs
        Arrays that the function writes, shape (n,), of floating-point numbers or integers.
    """
    if choice.is_compiled(len(outputs[0])):
        compiled_loop(loop)(*constants, *inputs, *outputs)
        return
    lists: list[list[float]] = [[0.0] * len(output) for output in outputs]
    loop(*constants, *(column.tolist() for column in inputs), *lists)
    for output, values in zip(outputs, lists, strict=True):
        output[:] = values


@cache
def compiled_loop(loop: Callable[..., None]) -> Callable[..., None]:
    """Return a compiled copy of a function that loops over n samples and that `looped` calls."""
    called = {name: own_copy(value, called_by_machine_code) for name, value in calls(loop).items()}
    copy = FunctionType(loop.__code__, {**used_globals(loop), **called})
    copy.__module__ = __name__
    digest = hashlib.sha256(package_source().encode()).hexdigest()[:16]
    copy.__qualname__ = f"{loop.__module__}.{loop.__name__}.{digest}"
    return machine_code(copy)


@cache
def compiled_below() -> object:
    """Return the object that replaces the global constant `estimation.step.below` in compiled code.

    Loops over n regressors have the form `for i in below[n]`. In interpreted code, `below[n]` is
    the tuple (0, 1, ..., n - 1). In compiled code, `below[n]` is `range(n)`.
    """
    import operator

    from numba.core import types
    from numba.core.imputils import lower_constant
    from numba.extending import models, overload, register_model, typeof_impl

    class Below:
        """Class of the object that replaces `estimation.step.below` in compiled code."""

    class BelowType(types.Type):
        """The type that numba assigns to objects of the class `Below`."""

    kind = BelowType("below")
    typeof_impl.register(Below)(lambda value, context: kind)
    register_model(BelowType)(models.OpaqueModel)

    @lower_constant(BelowType)  # type: ignore[no-untyped-call, untyped-decorator]
    def lower(context: Any, builder: Any, kind: Any, value: Any) -> Any:
        return context.get_dummy_value()

    @overload(operator.getitem)
    def item(table, n):  # type: ignore[no-untyped-def]  # numba compares the signatures
        return (lambda table, n: range(n)) if table is kind else None

    return Below()


@cache
def package_source() -> str:
    """Return the source text of all modules of this package as one string.

    numba stores compiled functions on the disk, by name. Each name contains a hash of this string.
    If a module changes, the name changes, and the function is compiled again.
    """
    files = sorted(Path(__file__).parent.rglob("*.py"))
    return "".join(file.read_text(encoding="utf-8") for file in files)


_regressors = 2
"""Placeholder for the number of regressors; `compiled` replaces it in copies of `_template`."""


def _step(parameters: Any, state: Any, phi: Any, f: float, dt: float) -> None:
    """Placeholder for a step, which processes one sample. `compiled` inserts the real step."""
    raise NotImplementedError


def _to_fixed_tuple(row: Any, length: int) -> Any:
    """Placeholder for the numba function `to_fixed_tuple`. `compiled` inserts this function."""
    raise NotImplementedError


def _template(
    parameters: Any,
    states: Any,
    phi: Floats,
    f: Floats,
    dt: Floats,
    is_open: NDArray[np.bool_],
    table: Floats,
) -> None:
    record, state = parameters[0], states[0]
    size = len(state.theta)
    for n in range(len(f)):
        state.held = not is_open[n]
        if is_open[n]:
            _step(record, state, _to_fixed_tuple(phi[n], _regressors), f[n], dt[n])
        for i in range(size):
            table[n, i] = state.theta[i]
            table[n, size + i] = state.std[i]
        table[n, 2 * size] = 1.0 if state.held else 0.0
