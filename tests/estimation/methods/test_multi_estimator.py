from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation import Axis, Grid, MultiEstimator, paper_preset
from estimation.methods.multi_estimator import TIE

PAPER = paper_preset().grid
SMALL = Grid(b=Axis(-60.0, 60.0, 13), k=Axis(500.0, 4000.0, 36))


@dataclass
class PlainBank:
    """Evaluate (10)-(11) for all candidates, with the documented rule for ties."""

    grid: Grid
    forgetting_rate: float

    def winners(self, x, v, f, dt):
        b, k = (
            axis.ravel()
            for axis in np.meshgrid(self.grid.b.values, self.grid.k.values, indexing="ij")
        )
        monitoring = np.zeros(b.size)
        motion = np.zeros(2)
        force = 0.0
        b_zero = self.grid.b.values[self.grid.b.nearest_zero]
        k_zero = self.grid.k.values[self.grid.k.nearest_zero]
        b_span = self.grid.b.last - self.grid.b.first
        k_span = self.grid.k.last - self.grid.k.first
        distance = ((b - b_zero) / b_span) ** 2 + ((k - k_zero) / k_span) ** 2
        rate = 2.0 * self.forgetting_rate
        for xn, vn, fn, dtn in zip(x, v, f, dt, strict=True):
            decay = math.exp(-rate * dtn)
            weight = (1.0 - decay) / rate if rate else dtn
            error = b * vn + k * xn - fn
            monitoring = decay * monitoring + weight * error**2
            motion = decay * motion + weight * np.array([vn, xn]) ** 2
            force = decay * force + weight * fn**2
            largest = force + motion @ np.array([b_span, k_span]) ** 2
            yield b, k, monitoring, monitoring + (TIE * largest + 1e-100) * distance


def assert_same_winners(grid, rate, x, v, f, dt):
    estimates = MultiEstimator(grid, rate).run(x, v, f, dt)
    bank = PlainBank(grid, rate).winners(x, v, f, np.broadcast_to(dt, np.shape(x)))
    for n, (b, k, _, total) in enumerate(bank):
        winner = np.argmin(total)
        assert estimates.b[n] == pytest.approx(b[winner], abs=1e-9)
        assert estimates.k[n] == pytest.approx(k[winner], abs=1e-9)


def test_equals_an_exhaustive_search_for_a_noisy_palpation(palpation):
    assert_same_winners(PAPER, 10.0, *palpation(seconds=1.0, noise=0.1, jitter=0.3))


@pytest.mark.parametrize(("b", "k"), [(600.0, 1000.0), (-490.0, 33000.0), (0.0, 90000.0)])
def test_equals_an_exhaustive_search_for_a_plant_outside_the_grid(palpation, b, k):
    assert_same_winners(PAPER, 10.0, *palpation(seconds=0.4, b=b, k=k, noise=0.1))


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1), rate=st.sampled_from([0.0, 10.0, 300.0]), log=st.integers(-4, 1)
)
def test_equals_an_exhaustive_search_for_random_signals(seed, rate, log):
    rng = np.random.default_rng(seed)
    x, v, f = rng.normal(size=(3, 40)) * np.array([[5e-3], [0.05], [10.0 ** (log + 1)]])
    assert_same_winners(SMALL, rate, x, v, f, rng.uniform(1e-4, 5e-3, 40))


t = np.arange(60) * 1e-3
DEGENERATE = {
    "nothing": (0 * t, 0 * t, 0 * t),
    "force without motion": (0 * t, 0 * t, 3.0 + 0 * t),
    "hold": (4e-3 + 0 * t, 0 * t, 8.0 + 0 * t),
    "velocity without displacement": (0 * t, 0.02 + 0 * t, 0.4 + 0 * t),
    "motion without force": (4e-3 * np.sin(9 * t), 0.036 * np.cos(9 * t), 0 * t),
    "exponential of Lemma 1": (
        5e-3 * np.exp(-40 * t),
        -0.2 * np.exp(-40 * t),
        20 * -0.2 * np.exp(-40 * t) + 10 * np.exp(-40 * t),
    ),
    "plant midway between candidates": (
        5e-3 * np.sin(50 * t),
        0.25 * np.cos(50 * t),
        1.25 * np.cos(50 * t) + 1550 * 5e-3 * np.sin(50 * t),
    ),
}


@pytest.mark.parametrize("name", DEGENERATE)
@pytest.mark.parametrize("rate", [0.0, 10.0])
def test_equals_an_exhaustive_search_for_degenerate_signals(name, rate):
    assert_same_winners(SMALL, rate, *DEGENERATE[name], 1e-3)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("spread", [1e-3, 1e-4, 1e-5])
def test_the_signal_of_nearly_collinear_data_is_the_smallest_within_the_documented_bound(
    seed, spread
):
    """Equation (11) in extended precision, in which the sums have no rounding errors that count."""
    rng = np.random.default_rng(seed)
    x = 4e-3 * np.exp(0.01 * np.arange(300))
    v = 10.0 * x * (1.0 + spread * rng.normal(size=300))
    f = 20.0 * v + 2100.0 * x + rng.normal(0.0, 0.05, 300)
    estimator = MultiEstimator(PAPER, 10.0)
    estimator.run(x, v, f, 1e-3)
    weights = np.exp(np.longdouble(-0.02) * np.arange(299, -1, -1)) * np.longdouble(1e-3)
    b, k = (a[..., None] for a in np.ix_(PAPER.b.values, PAPER.k.values))
    signals = (weights * (b * v.astype(np.longdouble) + k * x - f) ** 2).sum(axis=-1)
    got = signals[
        round((estimator.estimate.b - PAPER.b.first) / PAPER.b.spacing),
        round((estimator.estimate.k - PAPER.k.first) / PAPER.k.spacing),
    ]
    ranges = (PAPER.b.last - PAPER.b.first, PAPER.k.last - PAPER.k.first)
    bound = (weights * (f**2 + (ranges[0] * v) ** 2 + (ranges[1] * x) ** 2)).sum()
    assert got - signals.min() <= 2.0 * TIE * bound
    if spread >= 1e-3:
        assert got == signals.min()
    assert bound < 500.0 * (weights * f**2).sum()  # less than 1e-6 of the integral of f^2


def test_a_damping_that_the_data_do_not_determine_is_zero():
    estimator = MultiEstimator(PAPER, 10.0)
    estimator.run(np.full(500, 4e-3), np.zeros(500), np.full(500, 8.4), 1e-3)
    assert estimator.estimate[:2] == (0.0, 2100.0)


def test_before_any_sample_the_estimate_is_the_candidate_nearest_zero():
    assert MultiEstimator(PAPER, 10.0).estimate[:2] == (0.0, 1500.0)


def test_a_hundred_million_candidates_resolve_what_7913_cannot(palpation):
    fine = Grid(b=Axis(-500.0, 500.0, 10_001), k=Axis(1500.0, 39900.0, 10_001))
    assert fine.candidates > 10**8
    estimator = MultiEstimator(fine, 10.0)
    estimator.run(*palpation(b=-13.21, k=2229.7))
    assert estimator.estimate.b == pytest.approx(-13.21, abs=fine.b.spacing)
    assert estimator.estimate.k == pytest.approx(2229.7, abs=fine.k.spacing)


def test_the_note_names_the_edge_of_the_estimate(palpation):
    inside, edge, corner = (MultiEstimator(PAPER, 10.0) for _ in range(3))
    within = inside.run(*palpation())
    edge.run(*palpation(k=1000.0))
    outside = corner.run(*palpation(b=900.0, k=90_000.0))
    assert (inside.at_edge, inside.note(within)) == ((), None)
    assert edge.at_edge == ("k",)
    assert corner.at_edge == ("b", "k")
    assert "edge in b in 98% of the samples and in k in 100% of the" in corner.note(outside)


def test_ties_are_the_candidates_within_the_margin(palpation):
    s = palpation(seconds=0.3, noise=0.3)
    estimator = MultiEstimator(SMALL, 10.0)
    estimator.run(*s)
    *_, (b, k, monitoring, _) = PlainBank(SMALL, 10.0).winners(*s)
    expected = np.column_stack((b, k))[monitoring <= 1.5 * monitoring.min()]
    got = estimator.ties(0.5)
    assert len(expected) > 1
    np.testing.assert_allclose(got, expected)
    assert [*estimator.estimate[:2]] in estimator.ties(0.0).tolist()


def test_ties_on_a_fine_grid_are_counted_without_an_exhaustive_search(palpation):
    fine = Grid(b=Axis(-500.0, 500.0, 10_001), k=Axis(1500.0, 39900.0, 10_001))
    estimator = MultiEstimator(fine, 10.0)
    estimator.run(*palpation(seconds=0.3, noise=0.3))
    first, last = estimator.tied_rows(0.1)
    tied = estimator.ties(0.1)
    assert len(tied) == np.maximum(0, last - first + 1).sum() > 100
    bound = 1.1 * estimator.monitoring_signal(*estimator.estimate[:2])
    assert (estimator.monitoring_signal(*tied.T) <= bound * (1.0 + 1e-6)).all()
    beyond = fine.k.values[last[5000] + 1]
    assert estimator.monitoring_signal(fine.b.values[5000], beyond) > bound


def test_monitoring_signal_is_the_integral_of_the_squared_error(palpation):
    s = palpation(seconds=0.2, noise=0.1)
    estimator = MultiEstimator(SMALL, 10.0)
    estimator.run(*s)
    *_, (b, k, monitoring, _) = PlainBank(SMALL, 10.0).winners(*s)
    np.testing.assert_allclose(estimator.monitoring_signal(b, k), monitoring, rtol=1e-9)


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: Axis(0.0, 1.0, 1), "two candidates"),
        (lambda: Axis(1.0, 1.0, 5), "must increase"),
        (lambda: Axis(0.0, math.nan, 5), "must increase"),
        (lambda: MultiEstimator(PAPER, -1.0), "forgetting rate"),
        (lambda: MultiEstimator(PAPER, 10.0).ties(-0.1), "margin"),
    ],
)
def test_a_parameter_out_of_range_is_refused(make, word):
    with pytest.raises(ValueError, match=word):
        make()
