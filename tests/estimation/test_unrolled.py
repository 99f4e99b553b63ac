from __future__ import annotations

import inspect
import traceback
from dataclasses import replace

import numpy as np
import pytest

from estimation import METHODS, MODELS, paper_preset
from estimation.linear_gain import correct
from estimation.unrolled import unrolled

SIZES = range(2, 6)


def inner(state, phi):
    """A helper: the quadratic form phi' A phi of a symmetric A, held packed."""
    m = len(phi)
    total = 0.0
    for i in range(m):
        for j in range(i + 1):
            term = state[i * (i + 1) // 2 + j] * phi[i] * phi[j]
            if i == j:
                total += term
            else:
                total += 2.0 * term
    return total


def plain(a, b):
    """A helper without phi."""
    total = 0.0
    for i in range(3):
        total += a * b**i
    return total


def step(parameters, state, phi, f, dt):
    """Loops of bounds of their own, nested, a branch that is empty, and a value that changes."""
    m = len(phi)
    at = 2 * m + 1
    total = inner(state, phi)
    for i in range(m):
        factor = parameters[0]
        for j in range(i, m):
            factor *= 1.0 + dt * phi[j] * (i + 1)
        if factor > f:
            total -= factor
        elif i % 2 == 1 and m > 2:
            total += plain(factor, dt)
        state[at + i] = total / (i + 1.0)
    n = 0
    while n < len(phi):
        state[n] += f * phi[n]
        n += 1
    for i in range(1, m, 2):
        state[i] -= state[i - 1]


def fails(parameters, state, phi, f, dt):
    for i in range(len(phi)):
        state[i] = 1.0
        state[i] /= f  # this very line


def loops_by_state(parameters, state, phi, f, dt):
    for i in range(int(state[0])):
        state[1] += phi[i]


def loops_by_a_value(parameters, state, phi, f, dt):
    n = 0
    n = n + 2
    for i in range(n):
        state[i] = f


def same(function, helpers, m, seed):
    """Whether the unrolled function does what the one as written does, to the bit."""
    rng = np.random.default_rng(seed)
    made, _ = unrolled(function, helpers, m)
    parameters, phi = rng.normal(1.0, 0.3, 10).tolist(), rng.normal(size=m).tolist()
    state = rng.normal(1.0, 0.1, 10 * m * m).tolist()
    expected = state.copy()
    for _ in range(3):
        made(parameters, state, phi, 1.3, 1e-3)
        function(parameters, expected, phi, 1.3, 1e-3)
    return state == expected


@pytest.mark.parametrize("m", SIZES)
def test_gives_the_same_numbers_as_the_function_as_written(m):
    assert all(same(step, (inner, plain), m, seed) for seed in range(20))


@pytest.mark.parametrize("m", SIZES)
def test_so_does_the_correction_of_all_linear_gains(m):
    assert all(same(correct, (), m, seed) for seed in range(20))


@pytest.mark.parametrize("model", [MODELS["kelvin-voigt"], MODELS["inertia"]])
@pytest.mark.parametrize("name", METHODS)
def test_so_does_every_method(name, model, palpation):
    estimator = METHODS[name](replace(paper_preset(), model=model))
    m, state = estimator.model.regressors, estimator.state.copy()
    constant = [1.0] if estimator.constant else []
    s = palpation(seconds=0.2, noise=0.1)
    signals = np.column_stack((s.v, s.x, np.gradient(s.v, 1e-3), s.f, s.dt)).tolist()
    for *phi, f, dt in signals:
        type(estimator).step(estimator.parameters, state, phi[:m] + constant, f, dt)
        estimator.advance(phi[:m], f, dt)
    assert repr(estimator.state) == repr(state)


def loops_of(function):
    """How many counted loops are in a function's code."""
    return sum(name == "range" for name in function.__code__.co_names)


@pytest.mark.parametrize("m", SIZES)
def test_no_loop_over_the_regressors_is_left(m):
    made, (made_inner, made_plain) = unrolled(step, (inner, plain), m)
    assert loops_of(step) == 1
    assert loops_of(inner) == 1
    assert loops_of(made) == loops_of(made_inner) == 0
    assert made.__globals__["inner"] is made_inner
    assert made_plain is plain


def test_is_made_once():
    assert unrolled(step, (inner, plain), 3) is unrolled(step, (inner, plain), 3)
    assert unrolled(step, (inner, plain), 3) is not unrolled(step, (inner, plain), 4)


def test_leaves_the_function_as_written():
    before = step.__code__, step.__globals__["inner"]
    unrolled(step, (inner, plain), 5)
    assert (step.__code__, step.__globals__["inner"]) == before


def test_a_traceback_shows_the_line_that_was_written():
    made, _ = unrolled(fails, (), 2)
    with pytest.raises(ZeroDivisionError) as caught:
        made([], [0.0, 0.0], [1.0, 1.0], 0.0, 1e-3)
    last = traceback.extract_tb(caught.tb)[-1]
    assert last.filename == __file__
    assert last.name == "fails"
    assert last.line.endswith("# this very line")


@pytest.mark.parametrize("function", [loops_by_state, loops_by_a_value])
def test_a_range_that_is_no_constant_is_refused(function):
    lines, first = inspect.getsourcelines(function)
    line = first + next(n for n, text in enumerate(lines) if text.lstrip().startswith("for "))
    with pytest.raises(AssertionError, match=f"line {line}: no constant range"):
        unrolled(function, (), 2)
