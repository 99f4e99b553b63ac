"""A step over arrays of samples: interpreted, or compiled with numba (the `fast` extra)."""

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

from estimation.own_copies import called_functions, own_copy
from estimation.records import to_record, update_from
from estimation.step import State, Step, below

Floats = NDArray[np.float64]

WORTH_COMPILING = 20_000
"""From this many samples on, loading numba costs less than interpreting."""


class Samples(NamedTuple):
    """What a step takes in, sample by sample."""

    phi: Floats
    """Regressors, shape (n, regressors)."""
    f: Floats
    """Force [N], shape (n,)."""
    dt: Floats
    """Time since the sample before [s], shape (n,)."""
    open: NDArray[np.bool_]
    """Whether the sample is taken in, or the estimate held; shape (n,)."""


class Law(NamedTuple):
    """A step with its parameters."""

    step: Step
    parameters: Any


def sweep(law: Law, state: State, samples: Samples) -> Floats:
    """The estimate after each sample; the state is updated in place.

    Compiled code gives the interpreter's numbers to the bit: both run the same operations in
    the same order, without fused multiply-add.

    Returns
    -------
    Array of shape (n, 2 m + 1): the m values of `theta`, those of `std`, and `held`.
    """
    if len(samples.f) >= WORTH_COMPILING and find_spec("numba"):
        return compiled_sweep(law, state, samples)
    return interpreted_sweep(law, state, samples)


def interpreted_sweep(law: Law, state: State, samples: Samples) -> Floats:
    """`sweep` by the interpreter."""
    step, parameters = interpreted(law.step), law.parameters
    theta, std = state.theta, state.std
    columns = (column.tolist() for column in samples)
    answers: list[float] = []
    for phi, f, dt, taken in zip(*columns, strict=True):
        state.held = not taken
        if taken:
            step(parameters, state, phi, f, dt)
        answers += theta
        answers += std
        answers.append(state.held)
    table = np.fromiter(answers, np.float64, len(answers))
    return table.reshape(-1, 2 * len(theta) + 1)


def compiled_sweep(law: Law, state: State, samples: Samples) -> Floats:
    """`sweep` as machine code.

    Raises
    ------
    ImportError
        numba is not installed.
    """
    loop = compiled(law.step, samples.phi.shape[1])
    record = to_record(state)
    answers = np.empty((len(samples.f), 2 * len(state.theta) + 1))
    loop(to_record(law.parameters), record, *samples, answers)
    update_from(record[0], state)
    return answers


interpreted = cache(own_copy)
"""A step for the interpreter."""


@cache
def compiled(step: Step, regressors: int) -> Callable[..., None]:
    """The loop over a step as machine code: (parameters, state, *samples, answers)."""
    import numba
    from numba.np.unsafe.ndarray import to_fixed_tuple

    # numba's disk cache looks neither into called functions nor past a closure. So the step
    # is a global of a copy of `_template`, and the copy's name carries the source of the
    # modules of all functions that it calls, and of this package, whose constants they import.
    modules = {function.__module__ for function in called_functions(step)}
    source = "".join(inspect.getsource(sys.modules[module]) for module in sorted(modules))
    digest = hashlib.sha256((source + package_source()).encode()).hexdigest()[:16]
    known = {
        "_step": own_copy(step, numba.njit(error_model="numpy"), [(below, compiled_below())]),
        "_regressors": regressors,
        "_to_fixed_tuple": to_fixed_tuple,
    }
    loop = FunctionType(_template.__code__, known)
    loop.__module__ = __name__
    loop.__qualname__ = f"{step.__module__}.{step.__name__}.{regressors}.{digest}"
    return numba.njit(cache=True, error_model="numpy")(loop)


@cache
def compiled_below() -> object:
    """What stands for `below` in compiled code: its item n is `range(n)`."""
    import operator

    from numba.core import types
    from numba.core.imputils import lower_constant
    from numba.extending import models, overload, register_model, typeof_impl

    class Below:
        """What stands for `below`."""

    class BelowType(types.Type):
        """Its type."""

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
    """All of this package's modules."""
    files = sorted(Path(__file__).parent.rglob("*.py"))
    return "".join(file.read_text(encoding="utf-8") for file in files)


_regressors = 2
"""Stands for the number of regressors in `_template`."""


def _step(parameters: Any, state: Any, phi: Any, f: float, dt: float) -> None:
    """Stands for the estimator's step in `_template`."""
    raise NotImplementedError


def _to_fixed_tuple(row: Any, length: int) -> Any:
    """Stands for numba's function of this name in `_template`."""
    raise NotImplementedError


def _template(
    parameters: Any,
    states: Any,
    phi: Floats,
    f: Floats,
    dt: Floats,
    taken: NDArray[np.bool_],
    answers: Floats,
) -> None:
    given, state = parameters[0], states[0]
    size = len(state.theta)
    for n in range(len(f)):
        state.held = not taken[n]
        if taken[n]:
            _step(given, state, _to_fixed_tuple(phi[n], _regressors), f[n], dt[n])
        for i in range(size):
            answers[n, i] = state.theta[i]
            answers[n, size + i] = state.std[i]
        answers[n, 2 * size] = 1.0 if state.held else 0.0
