"""Contract of all estimators: `estimation.testing`, and checks with hypothesis or the plant."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation import (
    METHODS,
    MODELS,
    AdaptiveIdentification,
    Estimator,
    MultiEstimator,
    RecursiveLeastSquares,
    paper_preset,
)
from estimation.compiled import CompilationChoice, numbers
from estimation.step import State
from estimation.testing import CHECKS, check_compiled_equals_interpreted, check_estimator

PRESET = paper_preset("medium")
VARIANTS = {
    "rls by the sample": lambda: RecursiveLeastSquares(0.98, (100.0, 100.0)),
    "ai exact": lambda: AdaptiveIdentification(PRESET.adaptation_gain, "exact"),
    "me that never forgets": lambda: MultiEstimator(PRESET.grid, 0.0),
}
ESTIMATORS = {name: lambda name=name: METHODS[name](PRESET) for name in METHODS} | VARIANTS
LINEAR = [
    name
    for name, make in METHODS.items()
    if make(replace(PRESET, model=MODELS["datum"])).model is MODELS["datum"]
]


INTERPRETED = [check for check in CHECKS if check is not check_compiled_equals_interpreted]


@pytest.mark.parametrize("check", INTERPRETED, ids=lambda check: check.__name__)
@pytest.mark.parametrize("name", ESTIMATORS)
def test_keeps_the_contract(name, check):
    check(ESTIMATORS[name]())


@pytest.mark.parametrize("name", LINEAR)
def test_keeps_the_contract_with_a_model_of_three_regressors(name):
    for check in INTERPRETED:
        check(METHODS[name](replace(PRESET, model=MODELS["stiffening"])))


@pytest.mark.parametrize("name", ESTIMATORS)
def test_compiled_and_interpreted_give_the_same_numbers_to_the_bit(name):
    pytest.importorskip("numba", reason="needs the `fast` extra")
    check_compiled_equals_interpreted(ESTIMATORS[name]())


@pytest.mark.parametrize("name", ESTIMATORS)
def test_a_batch_that_is_compiled_is_the_same_as_its_pieces(name, palpation, monkeypatch):
    pytest.importorskip("numba", reason="needs the `fast` extra")
    s = palpation(seconds=7.0, noise=0.1)
    whole, pieces = ESTIMATORS[name](), ESTIMATORS[name]()
    monkeypatch.setattr(CompilationChoice, "is_compiled", lambda choice, samples: True)
    expected = whole.run(*s)[:5]
    monkeypatch.setattr(CompilationChoice, "is_compiled", lambda choice, samples: False)
    parts = [pieces.run(*(c[i : i + 1000] for c in s))[:5] for i in range(0, len(s.x), 1000)]
    got = [np.concatenate(column) for column in zip(*parts, strict=True)]
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(got, expected, strict=True))


@dataclass(frozen=True, slots=True)
class NoParameters:
    none: float = 0.0


def divides(parameters, state, phi, f, dt):
    state.theta[1] = f / phi[1]


def diverges(parameters, state, phi, f, dt):
    state.theta[1] += (f - phi[1] * state.theta[1]) * phi[1] * 1e12


SAMPLES = []


def remembers(parameters, state, phi, f, dt):
    SAMPLES.append(f)
    state.theta[0] = float(len(SAMPLES))


@pytest.mark.parametrize(
    ("step", "expected"),
    [
        (divides, pytest.raises(ZeroDivisionError)),
        (diverges, pytest.raises(AssertionError, match="not finite")),
        (remembers, pytest.raises(AssertionError, match="update and run differ")),
    ],
)
def test_an_estimator_that_breaks_the_contract_fails_it(step, expected):
    broken = type("Broken", (Estimator,), {"step": staticmethod(step)})
    with expected:
        check_estimator(broken(NoParameters(), State([0.0, 0.0], [math.nan] * 2, False)))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(-6, 3), name=st.sampled_from([*ESTIMATORS]))
def test_is_finite_for_all_signals(seed, size, name):
    rng = np.random.default_rng(seed)
    x, v, f = rng.normal(size=(3, 300)) * 10.0 ** rng.uniform(-6.0, size, (3, 1))
    x *= rng.integers(0, 2, 300)
    v *= rng.integers(0, 2, 300)
    estimator = ESTIMATORS[name]()
    estimates = estimator.run(x, v, f, rng.uniform(1e-5, 0.1, 300))
    assert np.isfinite(estimates[:2]).all()
    assert not np.isinf(numbers(estimator.state)).any()


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    gap=st.floats(0.1, 1e5),
    name=st.sampled_from([name for name in ESTIMATORS if "never forgets" not in name]),
    at=st.integers(1500, 1700),
)
def test_recovers_from_a_gap_in_the_data(seed, gap, name, at):
    if name in ("hc_double", "hc_log"):
        gap = min(gap, 1e3)
    rng = np.random.default_rng(seed)
    t = np.arange(4000) * 1e-3
    x = 5e-3 + 3e-3 * np.sin(7.0 * t)
    v = 21e-3 * np.cos(7.0 * t)
    f = 10.0 * v + 5000.0 * x + rng.normal(0.0, 0.02, t.size)
    dt = np.full(t.size, 1e-3)
    dt[at] = gap
    estimator = ESTIMATORS[name]()
    estimates = estimator.run(x, v, f, dt)
    assert np.isfinite(estimates[:2]).all()
    assert not np.isinf(numbers(estimator.state)).any()
    assert estimates.k[-1] == pytest.approx(5000.0, rel=0.05)


@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize("name", LINEAR)
@pytest.mark.parametrize("model", [model for model in MODELS.values() if model.further])
def test_a_linear_estimator_supports_any_model(name, model, palpation):
    s = palpation(seconds=6.0 if name == "rls" else 1.0)
    a, x3 = np.gradient(s.v, 1e-3), s.x**3
    signals = {"f0": np.ones_like(s.x), "m": a, "k3": x3, "tau": -np.gradient(s.f, 1e-3)}
    truth = {"f0": 2.0, "m": 0.3, "k3": 2e7, "tau": 0.02}[model.further[0]]
    regressor = signals[model.further[0]]
    f = s.f + truth * regressor
    estimator = METHODS[name](replace(PRESET, model=model))
    estimates = estimator.run(s.x, s.v, f, s.dt, regressor[:, np.newaxis])
    assert np.isfinite(estimates[:2]).all()
    if name == "rls":
        assert estimates.further[model.further[0]].value[-1] == pytest.approx(truth, rel=1e-3)
        assert estimates.k[-1] == pytest.approx(2100.0, rel=1e-3)
    with pytest.raises(ValueError, match=f"but the model {model.name} has 1"):
        estimator.run(s.x, s.v, f, s.dt)
