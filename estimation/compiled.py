"""A step function over arrays: interpreted, or compiled with numba (the `fast` extra)."""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from types import FunctionType
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
State = tuple[float, ...]
Step = Callable[[State, State, float, float, float, float], State]
"""(parameters, state, v, x, f, dt) -> state; a state begins with (b, k)."""
Helpers = tuple[Callable[..., Any], ...]

WORTH_COMPILING = 20_000
"""From this many samples on, loading numba costs less than interpreting."""


def sweep(
    step: Step,
    helpers: Helpers,
    parameters: State,
    state: State,
    samples: tuple[Floats, Floats, Floats, Floats],
) -> Floats:
    """The state after each sample of (v, x, f, dt), as rows of shape (n, len(state)).

    Compiled code gives the interpreter's numbers to the bit: both run the same operations in
    the same order, without fused multiply-add.
    """
    n = len(samples[0])
    if n >= WORTH_COMPILING and find_spec("numba"):
        return compiled(step, helpers)(parameters, state, *samples)
    return interpreted(step, parameters, state, samples)


def interpreted(
    step: Step, parameters: State, state: State, samples: tuple[Floats, Floats, Floats, Floats]
) -> Floats:
    """`sweep` by the interpreter."""
    states = np.empty((len(samples[0]), len(state)))
    for n, sample in enumerate(zip(*(channel.tolist() for channel in samples), strict=True)):
        state = step(parameters, state, *sample)
        states[n] = state
    return states


@cache
def compiled(step: Step, helpers: Helpers) -> Callable[..., Floats]:
    """`sweep` of one step function as machine code: (parameters, state, v, x, f, dt) -> states.

    Raises
    ------
    ImportError
        numba is not installed.
    """
    import numba

    for helper in helpers:
        numba.extending.register_jitable(helper)
    # numba's disk cache looks neither into called functions nor past a closure. So the step
    # is a global of a copy of `_template`, and the copy's name carries the source of the
    # modules of the step and its helpers, their constants included.
    modules = {function.__module__ for function in (step, *helpers)}
    source = "".join(inspect.getsource(sys.modules[module]) for module in sorted(modules))
    loop = FunctionType(_template.__code__, {"np": np, "_step": numba.njit(step)})
    loop.__module__ = __name__
    loop.__qualname__ = f"{step.__module__}.{hashlib.sha256(source.encode()).hexdigest()[:16]}"
    return numba.njit(cache=True)(loop)


def _step(parameters: State, state: State, v: float, x: float, f: float, dt: float) -> State:
    """Stands for the estimator's step in `_template`."""
    raise NotImplementedError


def _template(
    parameters: State, state: State, v: Floats, x: Floats, f: Floats, dt: Floats
) -> Floats:
    states = np.empty((len(x), len(state)))
    for n in range(len(x)):
        state = _step(parameters, state, v[n], x[n], f[n], dt[n])
        for column in range(len(state)):
            states[n, column] = state[column]
    return states
