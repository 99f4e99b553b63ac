import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.checks import checked_samples
from estimation.methods.kalman_filter import RandomWalkKalman, process_noise
from estimation.model import WITH_DATUM

SIZES = (0.025, 5e-3)
Q = process_noise(0.05, 1e-3, SIZES)
P0 = tuple(1e4 / size**2 for size in SIZES)
CEILING = tuple(1.0 / size**2 for size in SIZES)


def filtered(samples, q, p0):
    """Return the estimates of filterpy for parameters that are random walks."""
    from filterpy.kalman import KalmanFilter

    oracle = KalmanFilter(dim_x=len(q), dim_z=1)
    oracle.P, oracle.R = np.diag(p0), np.eye(1)
    estimates = []
    for phi, f, dt in zip(samples.phi, samples.f, samples.dt, strict=True):
        oracle.Q, oracle.H = np.diag(q) * dt, phi[None, :]
        oracle.predict()
        oracle.update(f)
        estimates.append(oracle.x.ravel().copy())
    return np.array(estimates)


def test_filters_a_random_walk_as_filterpy_does(palpation):
    signals = palpation(seconds=0.5, noise=0.02, jitter=0.3)
    estimates = RandomWalkKalman(Q, P0, ceiling=(1e30, 1e30)).run(*signals)
    expected = filtered(checked_samples(*signals), Q, P0)
    np.testing.assert_allclose(estimates.b, expected[:, 0], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(estimates.k, expected[:, 1], rtol=1e-6, atol=1e-6)


def test_further_parameters_are_random_walks_too(palpation):
    signals = palpation(seconds=0.5, noise=0.02)
    further = np.ones((len(signals.x), 1))
    estimates = RandomWalkKalman((*Q, 1.0), (*P0, 1e4), (1e30,) * 3, WITH_DATUM).run(
        *signals, further
    )
    expected = filtered(checked_samples(*signals, further), (*Q, 1.0), (*P0, 1e4))
    np.testing.assert_allclose(estimates.k, expected[:, 1], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(estimates.further["f0"].value, expected[:, 2], rtol=1e-6, atol=1e-7)


def test_process_noise_has_the_time_constant_of_its_memory():
    n, memory = 3000, 0.05
    k = np.where(np.arange(n) < 2000, 2000.0, 20_000.0)
    x = np.full(n, SIZES[1])
    estimates = RandomWalkKalman(Q, P0, CEILING).run(x, np.zeros(n), k * x, 1e-3)
    left = (k[2000:] - estimates.k[2000:]) / 18_000.0
    assert np.argmax(left < np.exp(-1.0)) * 1e-3 == pytest.approx(memory, rel=0.05)


@settings(max_examples=30)
@given(st.floats(1e-5, 1e5), st.integers(1, 200))
def test_a_variance_without_information_stops_at_the_ceiling(dt, n):
    estimator = RandomWalkKalman(Q, CEILING, tuple(4.0 * value for value in CEILING))
    estimator.run(np.zeros(n), np.zeros(n), np.ones(n), dt)
    p = np.diag(estimator.scaled_covariance)
    np.testing.assert_allclose(p, np.minimum(1.0 + np.divide(Q, CEILING) * dt * n, 4.0), rtol=1e-9)


def test_damping_stays_in_a_hold(palpation):
    signals = palpation(seconds=2.0, noise=0.02)
    rng = np.random.default_rng(1)
    n = 10_000
    x = 5e-3 + rng.normal(0.0, 1e-6, n)
    v = np.diff(x, prepend=x[0]) / 1e-3
    estimator = RandomWalkKalman(Q, P0, CEILING)
    estimator.run(*signals)
    held = estimator.run(x, v, 20.0 * v + 2100.0 * x + rng.normal(0.0, 0.02, n), 1e-3)
    assert np.all(np.abs(held.b - 20.0) < 3.0)
    assert np.all(np.abs(held.k - 2100.0) < 10.0)


def test_interval_covers_the_truth(palpation):
    hits = []
    for seed in range(40):
        estimator = RandomWalkKalman(Q, P0, CEILING)
        estimator.run(*palpation(seconds=1.0, noise=0.02, seed=seed))
        got = estimator.estimate
        hits += [abs(got.b - 20.0) < 1.96 * got.b_std, abs(got.k - 2100.0) < 1.96 * got.k_std]
    assert np.mean(hits) > 0.87


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"process_noise": (0.0, 1.0)}, "process noise"),
        ({"initial_covariance": (1.0,)}, "initial covariance"),
        ({"ceiling": (1.0, float("nan"))}, "ceiling"),
    ],
)
def test_refuses_settings_out_of_range(settings, message):
    with pytest.raises(ValueError, match=message):
        RandomWalkKalman(**{"process_noise": Q, "initial_covariance": P0, **settings})


def test_refuses_a_memory_of_zero():
    with pytest.raises(ValueError, match="memory"):
        process_noise(0.0, 1e-3, SIZES)
