"""The misfit flags estimates that do not describe the body, and no others."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, lfilter

from estimation import MatchedFilter, Misfit, Regression, paper_preset, scaled_preset
from estimation.misfit import LARGEST_MISFIT
from estimation.model import STIFFENING, Model

RATE = 1000.0
T = np.arange(6000) / RATE
DEPTH = 5e-3
X = 0.5 * DEPTH * (1.0 - np.cos(2.0 * np.pi * T))
V = np.pi * DEPTH * np.sin(2.0 * np.pi * T)


def misfits(x, f, model: Model | None = None, names=("rls", "kalman")) -> np.ndarray:
    """Return the misfit of each estimator after two cycles, shape (samples, estimators)."""
    conditioner = MatchedFilter(20.0, model=model) if model else MatchedFilter(20.0)
    regression = conditioner.run(x, f, 1.0 / RATE)
    preset = scaled_preset(*regression[:4])
    preset = replace(preset, estimators=names, model=model or preset.model)
    bank = preset.bank()
    estimates = bank.run(*regression)
    values = Misfit(bank).run(regression, estimates, bank.opened)
    return np.column_stack(list(values.values()))[2000:]


def noise(seed: int, size: float) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, size, len(T))


def bouncing(seed: int):
    """Return the record of a tip on a rigid stop: the force changes, the position does not."""
    wanted = 6e-3 * np.sin(2.0 * np.pi * T) + 1e-3
    return np.minimum(wanted, 0.0) + noise(seed, 2e-6), 2000.0 * np.maximum(wanted, 0.0)


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 1000),
    k=st.floats(200.0, 20000.0),
    loss=st.floats(0.0, 0.5),
    share=st.floats(0.0, 0.05),
    filtered=st.booleans(),
)
def test_a_linear_body_is_not_flagged_with_white_or_filtered_noise(seed, k, loss, share, filtered):
    f = k * X + k * loss / (2.0 * np.pi) * V + noise(seed, share * k * DEPTH)
    if filtered:
        f = lfilter(*butter(3, 20.0, fs=RATE), f)
    assert misfits(X, f).max() < LARGEST_MISFIT


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("stiffening", [1.0, 3.0])
def test_a_body_whose_stiffness_doubles_is_flagged(seed, stiffening):
    k = 1500.0
    f = k * X + stiffening * k / (3.0 * DEPTH**2) * X**3 + noise(seed, 0.02)
    assert misfits(X, f).min() > LARGEST_MISFIT
    assert misfits(X, f, STIFFENING, ("rls",)).max() < LARGEST_MISFIT


def test_bouncing_on_a_rigid_stop_is_flagged():
    x, f = bouncing(0)
    assert misfits(x, f + noise(1, 0.02)).min() > 0.5


@pytest.mark.parametrize("names", [("hc_double", "rls"), ("hc_log", "rls")])
@pytest.mark.parametrize("seed", range(3))
def test_hunt_crossley_fits_its_own_body_and_kelvin_voigt_does_not(names, seed):
    f = 4e5 * X**1.8 * (1.0 + 2.0 * V) + noise(seed, 0.02)
    hunt_crossley, kelvin_voigt = misfits(X, f, names=names).T
    assert hunt_crossley[2000:].max() < LARGEST_MISFIT
    assert kelvin_voigt.min() > LARGEST_MISFIT


@pytest.mark.parametrize("name", ["hc_double", "hc_log"])
def test_hunt_crossley_is_flagged_on_a_rigid_stop(name):
    x, f = bouncing(0)
    assert misfits(x + 7e-3, f + noise(1, 0.02), names=(name,)).min() > 0.2


def test_a_relaxing_body_is_flagged():
    decay = math.exp(-1.0 / (0.2 * RATE))
    relaxing = lfilter([1.0, -1.0], [1.0, -decay], X)
    assert misfits(X, 1500.0 * (X + relaxing) + noise(0, 0.02)).min() > LARGEST_MISFIT


def test_one_sample_at_a_time_gives_the_same_misfit():
    bank = replace(paper_preset("soft"), estimators=("rls", "me", "hc_double")).bank()
    f = 2000.0 * X + 3.0 * V + noise(0, 0.05)
    further = np.zeros((len(T), 0))
    regression = Regression(X, V, f, np.full(len(T), 1.0 / RATE), further)
    estimates = bank.run(*regression)
    whole = Misfit(bank).run(regression, estimates, bank.opened)
    bank.reset()
    one = Misfit(bank)
    for i, sample in enumerate(zip(X.tolist(), V.tolist(), f.tolist(), strict=True)):
        present = bank.update(*sample, 1.0 / RATE)
        is_open = bank.gate is None or bank.gate.is_open
        values = one.update(*sample, 1.0 / RATE, (), present, is_open)
        expected = [series[i] for series in whole.values()]
        np.testing.assert_array_equal(values, expected)


def test_the_misfit_is_held_without_contact():
    bank = paper_preset("soft").bank()
    estimates = bank.update(2e-3, 0.1, 4.0, 1e-3)
    misfit = Misfit(bank)
    for _ in range(200):
        before = misfit.update(2e-3, 0.1, 4.0, 1e-3, (), estimates)
    for _ in range(200):
        assert misfit.update(0.0, 0.1, 50.0, 1e-3, (), estimates, is_open=False) == before


def test_an_estimate_of_zero_explains_nothing():
    bank = paper_preset("soft").bank()
    nothing = {name: e.estimate._replace(b=0.0, k=0.0) for name, e in bank.items()}
    misfit = Misfit(bank)
    for x in X.tolist():
        values = misfit.update(x, 0.0, 2000.0 * x, 1e-3, (), nothing)
    assert values == pytest.approx([1.0] * 3, abs=0.01)


@pytest.mark.parametrize("window", [0.0, -1.0, math.inf, math.nan])
def test_the_window_must_be_positive(window):
    with pytest.raises(ValueError, match="window must be positive"):
        Misfit(paper_preset("soft").bank(), window)
