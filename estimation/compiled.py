"""Run the step of a method (`estimation.step`) over arrays, interpreted or compiled by numba.

Why numba's own cache on disk is not enough: numba finds stored code by the name and the source of
one function. It does not see a change of a function that is called from another file: in a test
with numba 0.68, the next process ran the old code and gave a wrong result. For a function that
gets the called function by a closure the result is right, but numba compiles it again in every
process (about 1 s for a method, instead of 7 ms from the disk). So the step is a global of a copy
of one loop, and the name of the copy contains a hash of all source on which the code depends.

The environment variable `NUMBA_CACHE_DIR` sets the folder of the compiled code. If it is not set,
numba stores the code beside the source, or in the user's cache folder if that is read-only.
"""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.step import State, Step, below

F = TypeVar("F", bound=Callable[..., Any])

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
    """True for the samples that are processed, shape (n,). Others do not change the estimate."""


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

    def is_compiled(self, samples: int) -> bool:
        """Return the choice for an array of this length. Call it once per array: it counts."""
        if samples < WORTH_LOADING_STEP or not find_spec("numba"):
            return False
        if "numba" in sys.modules:
            return True
        self.interpreted += samples
        return self.interpreted >= WORTH_LOADING_NUMBA


choice = CompilationChoice()
"""The `CompilationChoice` of this process. All arrays of samples share it."""


def load_compiler() -> None:
    """Load numba, if it is installed, so that arrays are processed by compiled code from now on."""
    with suppress(ImportError):
        import numba  # noqa: F401


def sweep(law: Law, state: State, samples: Samples) -> Floats:
    """Apply the step of a method to n samples, and return the estimate after each sample.

    `state` is updated in place. The results of compiled and interpreted code are identical to the
    bit, because both do the same operations in the same order, without fused multiply-add.

    The result has the shape (n, 2 m + 1). A row has the m estimated values, their m standard
    deviations, and 1 if the sample did not change the estimate (`held`), otherwise 0.
    """
    if choice.is_compiled(len(samples.f)):
        return compiled_sweep(law, state, samples)
    return interpreted_sweep(law, state, samples)


def interpreted_sweep(law: Law, state: State, samples: Samples) -> Floats:
    """`sweep` in interpreted code."""
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
    """`sweep` in compiled code; ImportError without numba."""
    loop = compiled(law.step, samples.phi.shape[1])
    record = to_record(state)
    table = np.empty((len(samples.f), 2 * len(state.theta) + 1))
    loop(to_record(law.parameters), record, *samples, table)
    update_from(record[0], state)
    return table


@cache
def compiled(step: Step, regressors: int) -> Callable[..., None]:
    """Return `_template` compiled for a step and a number of regressors."""
    from numba.np.unsafe.ndarray import to_fixed_tuple

    # also the source of other packages, for a step that is not of this package
    modules = {function.__module__ for function in called_functions(step)}
    source = "".join(inspect.getsource(sys.modules[module]) for module in sorted(modules))
    known = {
        "_step": own_copy(step, called_by_machine_code, [(below, compiled_below())]),
        "_regressors": regressors,
        "_to_fixed_tuple": to_fixed_tuple,
    }
    loop = FunctionType(_template.__code__, known)
    loop.__module__ = __name__
    loop.__qualname__ = f"{step.__module__}.{step.__name__}.{regressors}.{digest(source)}"
    return machine_code(loop)


def looped(
    loop: Callable[..., None],
    constants: tuple[float, ...],
    inputs: tuple[NDArray[Any], ...],
    outputs: tuple[NDArray[Any], ...],
) -> None:
    """Call `loop(*constants, *inputs, *outputs)`, interpreted or compiled, equal to the bit.

    The function loops over n samples and writes into the outputs, arrays of shape (n,). Its code
    must follow the rules in `estimation.step`.
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
    """Return a compiled copy of a function that `looped` calls."""
    called = {name: own_copy(value, called_by_machine_code) for name, value in calls(loop).items()}
    copy = FunctionType(loop.__code__, {**used_globals(loop), **called})
    copy.__module__ = __name__
    copy.__qualname__ = f"{loop.__module__}.{loop.__name__}.{digest()}"
    return machine_code(copy)


def digest(further: str = "") -> str:
    """Return a hash of the source of this package and of further source."""
    return hashlib.sha256((further + package_source()).encode()).hexdigest()[:16]


@cache
def package_source() -> str:
    """Return the source text of all modules of this package as one string."""
    files = sorted(Path(__file__).parent.rglob("*.py"))
    return "".join(file.read_text(encoding="utf-8") for file in files)


def machine_code(function: FunctionType) -> Callable[..., Any]:
    """Compile a function with numba, or load its compiled code from disk by its qualified name."""
    import numba

    njit: Any = partial(numba.njit, error_model="numpy", no_cfunc_wrapper=True)
    try:
        compiled = njit(cache=True)(function)
    except RuntimeError:  # numba has found no folder for its cache: each process compiles again
        compiled = njit()(function)
    folder = compiled.stats.cache_path
    if not (folder and any(Path(folder).glob(f"*{compiled.__qualname__}*.nbi"))):
        announce()
    result: Callable[..., Any] = compiled
    return result


def called_by_machine_code(function: FunctionType) -> Any:
    """Compile a function that only other compiled functions call.

    The wrappers for calls from Python and C, a quarter of the compilation time, are left out.
    """
    import numba

    njit: Any = numba.njit
    return njit(error_model="numpy", no_cfunc_wrapper=True, no_cpython_wrapper=True)(function)


@cache
def announce() -> None:
    """Say on a terminal that functions are being compiled, at most once per process."""
    if sys.stderr and sys.stderr.isatty():
        print("compiling estimators; later runs use the compiled code", file=sys.stderr)


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


# Placeholders, which `compiled` replaces in copies of `_template`.
_regressors = 2


def _step(parameters: Any, state: Any, phi: Any, f: float, dt: float) -> None:
    raise NotImplementedError


def _to_fixed_tuple(row: Any, length: int) -> Any:
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


def own_copy(
    function: F,
    finish: Callable[[FunctionType], Any] = lambda copy: copy,
    replaced: Sequence[tuple[Any, Any]] = (),
) -> F:
    """Return a copy of a function. The functions that it calls as globals are also copied.

    `finish` is applied to each copy, for example a compiler. `replaced` contains pairs (old, new)
    of global objects. The steps of several methods call the same functions, for example `correct`,
    but with objects of different classes. Shared functions would have two problems:

    - Python optimises a function for the classes of the arguments in previous calls. If the class
      changes from call to call, the function becomes slower.
    - numba compiles a function for the types of its arguments. It confuses two record types if one
      record starts with the same fields as the other.
    """
    done: dict[Callable[..., Any], Any] = {}

    def copied(original: Any) -> Any:
        if original not in done:
            names = used_globals(original)  # few globals fit into the processor's cache
            called = {name: copied(value) for name, value in calls(original).items()}
            constants = {name: new for old, new in replaced for name in names if names[name] is old}
            copy = FunctionType(
                original.__code__.replace(),  # the interpreter specialises this copy only
                {"__name__": original.__module__, **names, **called, **constants},
                original.__name__,
                original.__defaults__,
                original.__closure__,
            )
            done[original] = finish(copy)
        return done[original]

    made: F = copied(function)
    return made


interpreted = cache(own_copy)
"""Return the copy of a step that the interpreter uses. Each step is copied only once."""


def used_globals(function: Callable[..., Any]) -> dict[str, Any]:
    """Return the objects that a function uses as globals of its module, by their global names."""
    known = function.__globals__
    return {name: known[name] for name in names_in(function.__code__) if name in known}


def names_in(code: CodeType) -> set[str]:
    """Return the names of all globals and attributes in a code object and the code inside it."""
    inner = (value for value in code.co_consts if isinstance(value, CodeType))
    return set(code.co_names).union(*map(names_in, inner))


def calls(function: Callable[..., Any]) -> dict[str, FunctionType]:
    """Return the functions that a function uses as globals of its module, by their global names."""
    used = used_globals(function)
    return {name: value for name, value in used.items() if isinstance(value, FunctionType)}


def called_functions(function: Callable[..., Any]) -> set[Callable[..., Any]]:
    """Return the function itself, and all functions that it calls directly or indirectly."""
    return {function}.union(*(called_functions(value) for value in calls(function).values()))


def to_record(values: Any) -> NDArray[np.void]:
    """Convert a dataclass to an array of shape (1,) with one numpy record, which numba can use.

    Each field of the dataclass is a number, a vector, a matrix, or another such dataclass.
    """
    record = np.zeros(1, record_type(values))
    _fill(record[0], values)
    return record


def update_from(record: np.void, values: Any) -> None:
    """Copy the values of a numpy record into the fields of the dataclass `values`."""
    for field in fields(values):
        value = getattr(values, field.name)
        if is_dataclass(value):
            update_from(record[field.name], value)
        else:
            setattr(values, field.name, record[field.name].tolist())


def numbers(values: Any) -> NDArray[np.float64]:
    """Return all n numbers in the fields of a dataclass as one array, shape (n,)."""
    parts = []
    for field in fields(values):
        value = getattr(values, field.name)
        parts.append(numbers(value) if is_dataclass(value) else np.ravel(value))
    return np.concatenate(parts).astype(np.float64)


def record_type(values: Any) -> np.dtype[np.void]:
    """Return a structured numpy type with the field names, types and shapes of a dataclass."""
    return np.dtype(
        [(field.name, *_type_of(getattr(values, field.name))) for field in fields(values)],
        align=True,
    )


def _type_of(value: Any) -> tuple[Any, tuple[int, ...]]:
    if is_dataclass(value):
        return record_type(value), ()
    array = np.asarray(value)
    return array.dtype, array.shape


def _fill(record: Any, values: Any) -> None:
    for field in fields(values):
        value = getattr(values, field.name)
        if is_dataclass(value):
            _fill(record[field.name], value)
        else:
            record[field.name] = value
