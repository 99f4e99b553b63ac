from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.methods.grid import Axis, Grid
from estimation.methods.multi_estimator import TIE, MultiEstimator
from estimation.methods.switching import SwitchingMultiEstimator

SMALL = Grid(b=Axis(-60.0, 60.0, 13), k=Axis(500.0, 4000.0, 36))
FINE = Grid(b=Axis(-1200.0, 1200.0, 10_001), k=Axis(0.0, 60_000.0, 10_001))


def plain_supervisor(grid, rate, hysteresis, dwell, x, v, f, dt):
    """Return sigma after each sample, by integration of all candidates' signals."""
    b, k = (a.ravel() for a in np.meshgrid(grid.b.values, grid.k.values, indexing="ij"))
    monitoring, force, since = np.zeros(b.size), 0.0, math.inf
    sigma = int(np.argmin(np.hypot(b, k)))
    for xn, vn, fn in zip(x, v, f, strict=True):
        decay = math.exp(-2.0 * rate * dt)
        weight = (1.0 - decay) / (2.0 * rate)
        monitoring = decay * monitoring + weight * (b * vn + k * xn - fn) ** 2
        force = decay * force + weight * fn**2
        since += dt
        signal = monitoring + TIE * force
        best = int(np.argmin(signal))
        if since >= dwell and signal[sigma] > (1.0 + hysteresis) * signal[best]:
            sigma, since = best, 0.0
        yield b[sigma], k[sigma]


@pytest.mark.parametrize(("hysteresis", "dwell"), [(0.1, 0.0), (0.5, 0.0), (0.02, 0.0095)])
def test_switches_as_a_supervisor_that_evaluates_all_candidates(palpation, hysteresis, dwell):
    s = palpation(seconds=1.0, noise=2.0)
    estimator = SwitchingMultiEstimator(SMALL, 10.0, hysteresis, dwell)
    estimates = estimator.run(*s)
    expected = [*plain_supervisor(SMALL, 10.0, hysteresis, dwell, s.x, s.v, s.f, 1e-3)]
    np.testing.assert_allclose(np.column_stack((estimates.b, estimates.k)), expected, atol=1e-9)
    assert len(np.unique(estimates.b)) > 2


def test_sigma_and_the_count_of_switches_are_those_of_the_estimates(palpation):
    estimator = SwitchingMultiEstimator(SMALL, 10.0)
    estimates = estimator.run(*palpation(seconds=0.5, noise=1.0))
    pairs = np.column_stack((estimates.b, estimates.k))
    start = SwitchingMultiEstimator(SMALL, 10.0).estimate
    changes = (np.diff(np.vstack((start[:2], pairs)), axis=0) != 0.0).any(axis=1)
    assert estimator.switches == changes.sum() > 2
    i, j = estimator.sigma
    assert (SMALL.b.values[i], SMALL.k.values[j]) == pytest.approx(pairs[-1])


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), hysteresis=st.floats(0.0, 2.0), scale=st.floats(0.01, 100.0))
def test_sigma_is_never_worse_than_the_hysteresis_allows_and_no_scale_changes_it(
    seed, hysteresis, scale
):
    x, v, f = np.random.default_rng(seed).normal(size=(3, 40)) * [[5e-3], [0.05], [5.0]]
    plain, scaled, multi = (
        SwitchingMultiEstimator(SMALL, 10.0, hysteresis),
        SwitchingMultiEstimator(SMALL, 10.0, hysteresis),
        MultiEstimator(SMALL, 10.0),
    )
    for sample in zip(x, v, f, strict=True):
        plain.update(*sample, 1e-3)
        best = multi.update(*sample, 1e-3)
        scaled.update(*(scale * value for value in sample), 1e-3)
        assert plain.sigma == scaled.sigma
        bound = (1.0 + hysteresis) * (
            multi.monitoring_signal(best.b, best.k) + TIE * plain.state.ff
        )
        got = plain.monitoring_signal(plain.estimate.b, plain.estimate.k)
        assert got <= bound * (1.0 + 1e-9)


def test_hysteresis_prevents_chattering(palpation):
    s = palpation(noise=0.02)
    counts = []
    for hysteresis in (0.0, 0.1, 0.5):
        estimator = SwitchingMultiEstimator(FINE, 10.0, hysteresis)
        estimator.run(*s)
        counts.append(estimator.switches)
        assert estimator.estimate.k == pytest.approx(2100.0, abs=10.0)
    assert counts[0] > 10 * counts[1] > 10 * counts[2]


def test_two_switches_are_a_dwell_time_apart(palpation):
    s = palpation(noise=2.0)
    estimates = SwitchingMultiEstimator(SMALL, 10.0, 0.0, dwell=0.0495).run(*s)
    moved = (np.diff(estimates.b) != 0.0) | (np.diff(estimates.k) != 0.0)
    assert np.diff(np.nonzero(moved)[0]).min() == 50


def test_the_interval_includes_the_error_of_hysteresis_and_grid(palpation):
    inside = 0
    for seed in range(40):
        s = palpation(seconds=0.5, b=12.0, k=2034.0, noise=0.02, seed=seed)
        e = SwitchingMultiEstimator(SMALL, 10.0).run(*s)
        inside += abs(e.b[-1] - 12.0) < 1.96 * e.b_std[-1]
        inside += abs(e.k[-1] - 2034.0) < 1.96 * e.k_std[-1]
    assert inside >= 74


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"hysteresis": -0.1}, "hysteresis"),
        ({"hysteresis": math.nan}, "hysteresis"),
        ({"dwell": -1.0}, "dwell"),
        ({"correlation": 0.0}, "correlation"),
    ],
)
def test_a_parameter_out_of_range_is_refused(settings, word):
    with pytest.raises(ValueError, match=word):
        SwitchingMultiEstimator(SMALL, 10.0, **settings)
