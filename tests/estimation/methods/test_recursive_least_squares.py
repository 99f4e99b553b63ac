from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from estimation import RecursiveLeastSquares
from estimation.compiled import numbers
from estimation.model import WITH_DATUM

P0 = (1.6e7, 4e8)


def test_equals_a_kalman_filter_with_fading_memory(palpation):
    from filterpy.kalman import KalmanFilter

    s = palpation(noise=0.05)
    estimates = RecursiveLeastSquares(0.98, (100.0, 100.0)).run(*s)

    oracle = KalmanFilter(dim_x=2, dim_z=1)
    oracle.x = np.zeros((2, 1))
    oracle.P = np.diag([100.0, 100.0])
    oracle.Q = np.zeros((2, 2))
    oracle.R = np.eye(1)
    oracle.alpha = math.sqrt(1.0 / 0.98)
    expected = []
    for x, v, f in zip(s.x, s.v, s.f, strict=True):
        oracle.predict()
        oracle.update(np.array([[f]]), H=np.array([[v, x]]))
        expected.append(oracle.x.ravel().copy())

    np.testing.assert_allclose(np.column_stack(estimates[:2]), expected, rtol=1e-9, atol=1e-9)


def test_without_forgetting_equals_statsmodels_recursive_least_squares(palpation):
    from statsmodels.regression.recursive_ls import RecursiveLS

    s = palpation(noise=0.05)
    estimates = RecursiveLeastSquares(1.0, (1e12, 1e12)).run(*s)
    oracle = RecursiveLS(s.f, np.column_stack((s.v, s.x))).fit().recursive_coefficients.filtered
    np.testing.assert_allclose(np.array(estimates[:2])[:, 50:], oracle[:, 50:], rtol=1e-6)


def test_finds_the_parameters_of_a_noise_free_plant(palpation):
    estimates = RecursiveLeastSquares(0.98, (100.0, 100.0)).run(*palpation())
    assert estimates.b[-1] == pytest.approx(20.0, rel=1e-6)
    assert estimates.k[-1] == pytest.approx(2100.0, rel=1e-6)


def test_with_a_sample_period_forgets_in_time_not_in_samples(palpation):
    s = palpation()
    coarse = RecursiveLeastSquares(0.98, (100.0, 100.0), sample_period=1e-3)
    fine = RecursiveLeastSquares(0.98, (100.0, 100.0), sample_period=1e-3)
    coarse.update(s.x[0], s.v[0], s.f[0], 1e-3)
    fine.update(s.x[0], s.v[0], s.f[0], 1e-3)
    coarse.update(0.0, 0.0, 0.0, 7e-3)
    for _ in range(7):
        fine.update(0.0, 0.0, 0.0, 1e-3)
    for name in ("U", "D"):
        np.testing.assert_allclose(
            getattr(coarse.state, name), getattr(fine.state, name), rtol=1e-12, err_msg=name
        )


def test_a_nominal_period_forgets_by_beta():
    per_sample = RecursiveLeastSquares(0.98, (100.0, 100.0))
    per_time = RecursiveLeastSquares(0.98, (100.0, 100.0), sample_period=1e-3)
    for x in (1e-3, 2e-3, 4e-3):
        per_sample.update(x, 0.01, 3.0, 1e-3)
        per_time.update(x, 0.01, 3.0, 1e-3)
    np.testing.assert_allclose(numbers(per_sample.state), numbers(per_time.state), rtol=1e-12)


def test_ten_minutes_without_motion_leave_the_estimate_finite_with_a_note(palpation):
    estimator = RecursiveLeastSquares(0.98, (100.0, 100.0))
    moving = estimator.run(*palpation())
    before = estimator.estimate
    assert estimator.note(moving) is None
    n = 600_000
    resting = estimator.run(np.zeros(n), np.zeros(n), np.zeros(n), 1e-3)
    assert estimator.estimate == before
    assert np.isfinite(numbers(estimator.state)).all()
    assert "forgetting is suspended" in estimator.note(resting)
    estimator.run(*palpation(k=4400.0))
    assert estimator.estimate.k == pytest.approx(4400.0, rel=1e-4)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((0.0, (1.0, 1.0)), "forgetting"),
        ((1.01, (1.0, 1.0)), "forgetting"),
        ((math.nan, (1.0, 1.0)), "forgetting"),
        ((0.98, (0.0, 1.0)), "covariance"),
        ((0.98, (1.0, math.inf)), "covariance"),
        ((0.98, (1.0, 1.0), 0.0), "period"),
        ((0.98, (1.0, 1.0), -1e-3), "period"),
    ],
)
def test_a_parameter_out_of_range_is_refused(arguments, word):
    with pytest.raises(ValueError, match=word):
        RecursiveLeastSquares(*arguments)


def test_with_a_third_regressor_finds_the_datum(palpation):
    s = palpation()
    estimator = RecursiveLeastSquares(0.98, (*P0, 1e4), model=WITH_DATUM)
    estimator.run(s.x, s.v, s.f + 1.5, s.dt, np.ones((len(s.x), 1)))
    found = [value for value, _ in estimator.values.values()]
    np.testing.assert_allclose(found, [20.0, 2100.0, 1.5], rtol=1e-6)


def test_keeps_the_precision_that_the_direct_covariance_loses():
    rng = np.random.default_rng(0)
    x = 1.0 + 1e-6 * rng.normal(size=40)
    v = np.ones(40)
    f = 3.0 * v + 2.0 * x
    information, product = [[Fraction(1, 10**12), 0], [0, Fraction(1, 10**12)]], [0, 0]
    for z, force in zip(np.column_stack((v, x)).tolist(), f.tolist(), strict=True):
        for i in range(2):
            product[i] += Fraction(z[i]) * Fraction(force)
            for j in range(2):
                information[i][j] += Fraction(z[i]) * Fraction(z[j])
    (a, b), (_, c) = information
    exact = float((c * product[0] - b * product[1]) / (a * c - b * b))

    plain, p = np.zeros(2), np.diag([1e12, 1e12])
    for phi, force in zip(np.column_stack((v, x)), f, strict=True):
        gain = p @ phi / (1.0 + phi @ p @ phi)
        plain += gain * (force - phi @ plain)
        p -= np.outer(gain, phi @ p)
    error = abs(RecursiveLeastSquares(1.0, (1e12, 1e12)).run(x, v, f, 1e-3).b[-1] - exact)
    assert error < 1e-3
    assert abs(plain[0] - exact) > 100.0 * error
