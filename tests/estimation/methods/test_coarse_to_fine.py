from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from estimation.methods.coarse_to_fine import UNKNOWN, CoarseToFine
from estimation.methods.multi_estimator import MultiEstimator


def weighted_fit(s, rate):
    """Return numpy's least squares with the weights of (11), and its relative deviations."""
    weight = np.exp(-2.0 * rate * 1e-3 * np.arange(len(s.x))[::-1])
    rows, root = np.column_stack((s.v, s.x)), np.sqrt(weight)
    theta, *_ = np.linalg.lstsq(rows * root[:, None], s.f * root, rcond=None)
    inverse = np.linalg.inv(rows.T @ (weight[:, None] * rows))
    spread = inverse @ (rows.T @ (weight[:, None] ** 2 * rows)) @ inverse
    return theta, np.sqrt(np.diag(spread))


@settings(
    max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    b=st.floats(-400.0, 400.0),
    k=st.floats(100.0, 3e5),
    seed=st.integers(0, 99),
    start=st.floats(1e-3, 1e4),
)
def test_agrees_with_least_squares_wherever_the_environment_and_the_first_grid_are(
    palpation, b, k, seed, start
):
    s = palpation(seconds=1.0, b=b, k=k, noise=0.02, seed=seed)
    estimator = CoarseToFine(10.0, spacing=(start, 50.0 * start))
    estimate = estimator.run(*s)
    theta, std = weighted_fit(s, 10.0)
    assert abs(estimate.b[-1] - theta[0]) < 0.02 * std[0]
    assert abs(estimate.k[-1] - theta[1]) < 0.02 * std[1]
    assert estimate.b_std[-1] == pytest.approx(0.02 * std[0], rel=0.3)
    assert estimate.k_std[-1] == pytest.approx(0.02 * std[1], rel=0.3)


def test_the_spacing_is_below_the_interval_but_not_far_below(palpation):
    estimator = CoarseToFine(10.0)
    estimator.run(*palpation(noise=0.02))
    estimate, grid = estimator.estimate, estimator.grid
    for spacing, std in ((grid.b.spacing, estimate.b_std), (grid.k.spacing, estimate.k_std)):
        assert 0.1 * std < spacing < std
    for axis, value in ((grid.b, estimate.b), (grid.k, estimate.k)):
        assert np.abs(axis.values - value).min() < 1e-9 * axis.spacing + 1e-9


def test_selects_the_same_candidate_as_the_multi_estimator_on_its_grid(palpation):
    s = palpation(seconds=0.2, noise=0.5)
    estimator = CoarseToFine(10.0)
    for i, (x, v, f, dt) in enumerate(zip(*s, strict=True)):
        grid = estimator.grid
        estimate = estimator.update(x, v, f, dt)
        if i % 20 == 5:
            fixed = MultiEstimator(grid, 10.0)
            fixed.run(s.x[: i + 1], s.v[: i + 1], s.f[: i + 1], 1e-3)
            assert estimate[:2] == pytest.approx(fixed.estimate[:2], rel=1e-9, abs=1e-9)


def test_the_grid_follows_a_jump_of_three_decades_within_a_third_of_a_second(palpation):
    soft, hard = palpation(k=300.0), palpation(k=300_000.0)
    estimator = CoarseToFine(10.0)
    estimator.run(*soft)
    narrow = estimator.grid.k.spacing
    estimates = estimator.run(*hard)
    assert narrow < 1e-2
    np.testing.assert_allclose(estimates.k[330:], 300_000.0, rtol=0.05)
    back = estimator.run(*soft)
    np.testing.assert_allclose(back.k[-500:], 300.0, rtol=0.05)


def test_a_damping_that_the_data_do_not_determine_is_zero():
    estimator = CoarseToFine(10.0)
    estimator.run(np.full(500, 4e-3), np.zeros(500), np.full(500, 8.4), 1e-3)
    assert estimator.estimate[:3] == (0.0, pytest.approx(2100.0, rel=1e-3), UNKNOWN)


def test_the_interval_has_its_nominal_coverage_of_the_environment(palpation):
    ratios = []
    for seed in range(40):
        e = CoarseToFine(10.0).run(*palpation(seconds=1.0, noise=0.02, seed=seed))
        ratios.append([(e.b[-1] - 20.0) / e.b_std[-1], (e.k[-1] - 2100.0) / e.k_std[-1]])
    assert np.std(ratios, axis=0) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"forgetting_rate": -1.0}, "forgetting rate"),
        ({"patience": 0.0}, "patience"),
        ({"spacing": (1.0, 0.0)}, "spacing"),
        ({"spacing": (1.0, math.nan)}, "spacing"),
        ({"half": 1}, "half"),
        ({"correlation": 0.9}, "correlation"),
    ],
)
def test_a_parameter_out_of_range_is_refused(settings, word):
    with pytest.raises(ValueError, match=word):
        CoarseToFine(**{"forgetting_rate": 10.0, **settings})
