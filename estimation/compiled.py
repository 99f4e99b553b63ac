"""A step function over arrays: interpreted, or compiled with numba (the `fast` extra)."""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Callable, MutableSequence, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.unrolled import Helpers, unrolled

Floats = NDArray[np.float64]
State = MutableSequence[float]
Parameters = Sequence[float]
Regressors = Sequence[float]
Step = Callable[[Parameters, State, Regressors, float, float], None]
"""(parameters, state, phi, f, dt): moves the state on by one sample, in place.

Before it, the state says that nothing is held; a step that holds the estimate says so.
"""

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
    """A step with all that it needs."""

    step: Step
    helpers: Helpers
    parameters: list[float]
    width: int
    """How many entries of the state are its answer; the last of them says whether it holds."""


def sweep(law: Law, state: list[float], samples: Samples) -> Floats:
    """The answer after each sample, shape (n, width); the state is moved on in place.

    Compiled code gives the interpreter's numbers to the bit: both run the same operations in
    the same order, without fused multiply-add.
    """
    if len(samples.f) >= WORTH_COMPILING and find_spec("numba"):
        return compiled_sweep(law, state, samples)
    return interpreted_sweep(law, state, samples)


def interpreted_sweep(law: Law, state: list[float], samples: Samples) -> Floats:
    """`sweep` by the interpreter."""
    step, _ = unrolled(law.step, law.helpers, samples.phi.shape[1])
    width, held = law.width, law.width - 1
    columns = (column.tolist() for column in samples)
    answers = []
    for phi, f, dt, taken in zip(*columns, strict=True):
        state[held] = 0.0 if taken else 1.0
        if taken:
            step(law.parameters, state, phi, f, dt)
        answers.append(state[:width])
    return np.array(answers, dtype=np.float64).reshape(-1, width)


def compiled_sweep(law: Law, state: list[float], samples: Samples) -> Floats:
    """`sweep` as machine code.

    Raises
    ------
    ImportError
        numba is not installed.
    """
    loop = compiled(law.step, law.helpers, samples.phi.shape[1])
    after = np.array(state)
    answers: Floats = loop(np.array(law.parameters), after, *samples, law.width)
    state[:] = after.tolist()
    return answers


@cache
def compiled(step: Step, helpers: Helpers, regressors: int) -> Callable[..., Floats]:
    """The loop over a step as machine code: (parameters, state, *samples, width) -> answers."""
    import numba

    plain, called = unrolled(step, helpers, regressors)
    for helper in called:
        numba.extending.register_jitable(helper)
    # numba's disk cache looks neither into called functions nor past a closure. So the step
    # is a global of a copy of `_template`, and the copy's name carries the source of the
    # modules of the step and its helpers, and of this package, whose constants they import.
    modules = {function.__module__ for function in (step, *helpers)}
    source = "".join(inspect.getsource(sys.modules[module]) for module in sorted(modules))
    digest = hashlib.sha256((source + package_source()).encode()).hexdigest()[:16]
    loop = FunctionType(_template.__code__, {"np": np, "_step": numba.njit(plain)})
    loop.__module__ = __name__
    loop.__qualname__ = f"{step.__module__}.{step.__name__}.{regressors}.{digest}"
    return numba.njit(cache=True)(loop)


@cache
def package_source() -> str:
    """All of this package's modules."""
    files = sorted(Path(__file__).parent.rglob("*.py"))
    return "".join(file.read_text(encoding="utf-8") for file in files)


def _step(parameters: Floats, state: Floats, phi: Floats, f: float, dt: float) -> None:
    """Stands for the estimator's step in `_template`."""
    raise NotImplementedError


def _template(
    parameters: Floats,
    state: Floats,
    phi: Floats,
    f: Floats,
    dt: Floats,
    taken: NDArray[np.bool_],
    width: int,
) -> Floats:
    answers = np.empty((len(f), width))
    for n in range(len(f)):
        state[width - 1] = 0.0 if taken[n] else 1.0
        if taken[n]:
            _step(parameters, state, phi[n], f[n], dt[n])
        for column in range(width):
            answers[n, column] = state[column]
    return answers
