from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from estimation import METHODS, RecursiveLeastSquares, linear_gain, paper_preset
from estimation.linear_gain import (
    DIFFUSE,
    LinearGainEstimator,
    LinearGainParameters,
    LinearGainState,
    correct,
    linear_gain_state,
)
from estimation.model import KELVIN_VOIGT, WITH_DATUM

DT = 4e-3
NOISE = 0.1
SEEDS = range(300)


@dataclass(frozen=True, slots=True)
class GradientParameters(LinearGainParameters):
    rate: float
    sizes: tuple[float, ...]


class Gradient(LinearGainEstimator):
    """Estimator with a gain that does not follow from a Riccati equation: normalised gradient."""

    @staticmethod
    def step(parameters, state, phi, f, dt):
        sizes = parameters.sizes
        size = 1.0
        for i in range(len(phi)):
            size += (phi[i] / sizes[i]) * (phi[i] / sizes[i])
        for i in range(len(phi)):
            state.L[i] = parameters.rate / (sizes[i] * sizes[i]) * phi[i] / size
        correct(parameters, state, phi, f, dt)


SIZES = (25e-3, 6e-3, 1.0)


def gradient(rate=0.5, correlation=1.0, model=KELVIN_VOIGT):
    m = model.regressors
    guess = [1.0 / size**2 for size in SIZES[:m]]
    parameters = GradientParameters(correlation, rate, SIZES[:m])
    return Gradient(parameters, LinearGainState(**linear_gain_state(guess)), model)


def gain_of(phi, rate=0.5):
    """Return the gain of `Gradient`, in numpy."""
    scaled = phi / np.array(SIZES[: len(phi)])
    return rate * scaled / np.array(SIZES[: len(phi)]) / (1.0 + scaled @ scaled)


def motion(seconds=4.0):
    t = DT * np.arange(round(seconds / DT))
    x = 5e-3 + 3e-3 * np.sin(8.0 * t) + 1e-3 * np.sin(31.0 * t)
    return x, 24e-3 * np.cos(8.0 * t) + 31e-3 * np.cos(31.0 * t)


@pytest.fixture(scope="module")
def repeated():
    """Return final estimates, covariances and noise variances of repetitions with new noise."""
    x, v = motion()
    found = []
    for seed in SEEDS:
        noise = np.random.default_rng(seed).normal(0.0, NOISE, x.size)
        estimator = gradient()
        estimator.run(x, v, 20.0 * v + 2100.0 * x + noise, DT)
        found.append((estimator.state.theta, estimator.covariance, estimator.state.noise))
    return tuple(map(np.array, zip(*found, strict=True)))


def test_covariance_is_the_spread_over_repetitions(repeated):
    estimates, covariances, _ = repeated
    reported = covariances.mean(axis=0)
    spread = np.cov(estimates.T)
    np.testing.assert_allclose(np.sqrt(np.diag(reported)), np.std(estimates, axis=0), rtol=0.12)
    correlation = [c[0, 1] / np.sqrt(c[0, 0] * c[1, 1]) for c in (reported, spread)]
    assert correlation[0] == pytest.approx(correlation[1], abs=0.2)
    np.testing.assert_allclose(estimates.mean(axis=0), (20.0, 2100.0), rtol=0.02)


def test_intervals_have_their_nominal_coverage(repeated):
    estimates, covariances, _ = repeated
    stds = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    inside = np.abs(estimates - (20.0, 2100.0)) < 1.96 * stds
    assert np.all(np.abs(inside.mean(axis=0) - 0.95) < 0.05)


def test_noise_variance_is_found(repeated):
    *_, noise = repeated
    assert noise.mean() == pytest.approx(NOISE**2, rel=0.03)
    assert noise.std() < 0.1 * NOISE**2


@pytest.mark.parametrize("model", [KELVIN_VOIGT, WITH_DATUM])
def test_covariance_is_that_of_the_matrix_recursion(model, palpation):
    s = palpation(seconds=0.3, noise=NOISE)
    m = model.regressors
    estimator = gradient(model=model)
    c, theta = DIFFUSE * np.diag([1.0 / size**2 for size in SIZES[:m]]), np.zeros(m)
    phis = np.column_stack((s.v, s.x, np.ones_like(s.x)))[:, :m]
    for phi, f in zip(phis, s.f, strict=True):
        estimator.update(phi[1], phi[0], f, 1e-3, phi[2:])
        gain = gain_of(phi)
        keep = np.eye(m) - np.outer(gain, phi)
        c = keep @ c @ keep.T + np.outer(gain, gain)
        theta += gain * (f - phi @ theta)
        np.testing.assert_allclose(estimator.state.theta, theta, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(estimator.state.L, gain, rtol=1e-12)
    noise = estimator.state.noise
    got = np.array(estimator.covariance) / noise
    scale = np.sqrt(np.outer(np.diag(c), np.diag(c)))
    np.testing.assert_allclose(got / scale, c / scale, atol=1e-6)
    stds = [std for _, std in estimator.values.values()]
    np.testing.assert_allclose(stds, np.sqrt(np.diag(estimator.covariance)), rtol=1e-12)


def test_without_forgetting_it_is_ordinary_least_squares(palpation, monkeypatch):
    import statsmodels.api as sm

    monkeypatch.setattr(linear_gain, "DIFFUSE", 1.0)  # the first guess is what P0 says
    s = palpation(seconds=3.0, noise=NOISE)
    estimator = RecursiveLeastSquares(1.0, (1e8, 1e9))
    estimator.run(*s)
    oracle = sm.OLS(s.f, np.column_stack((s.v, s.x))).fit()
    stds = [std for _, std in estimator.values.values()]
    np.testing.assert_allclose(estimator.state.theta, oracle.params, rtol=1e-6)
    unscaled = np.array(estimator.covariance) / estimator.state.noise
    np.testing.assert_allclose(unscaled, oracle.normalized_cov_params, rtol=1e-5)
    assert estimator.state.noise == pytest.approx(oracle.scale, rel=0.1)
    np.testing.assert_allclose(stds, oracle.bse, rtol=0.05)


@pytest.mark.parametrize("beta", [1.0, 0.99])
def test_for_recursive_least_squares_it_is_the_covariance_due_to_noise_and_initial_guess(
    beta, palpation
):
    s = palpation(seconds=1.0, noise=NOISE)
    first = np.diag([1e5, 1e6])
    estimator = RecursiveLeastSquares(beta, tuple(np.diag(first)))
    estimator.run(*s)
    phi = np.column_stack((s.v, s.x))
    weight = beta ** np.arange(len(phi) - 1, -1, -1.0)
    prior = beta ** len(phi) * np.linalg.inv(first)
    p = np.linalg.inv((phi.T * weight) @ phi + prior)
    noisy = (phi.T * weight**2) @ phi + prior @ (DIFFUSE * first) @ prior
    got = np.array(estimator.covariance) / estimator.state.noise
    np.testing.assert_allclose(got, p @ noisy @ p, rtol=1e-5)


def test_correlated_noise_widens_intervals_by_its_correlation():
    run = 8
    x, v = motion()
    estimates, reported = [], []
    for seed in SEEDS[:150]:
        noise = np.repeat(np.random.default_rng(seed).normal(0.0, NOISE, x.size // run), run)
        estimator = gradient(0.05, float(run))
        estimator.run(x, v, 20.0 * v + 2100.0 * x + noise, DT)
        estimates.append(estimator.state.theta)
        reported.append(np.sqrt(np.diag(estimator.covariance)))
    np.testing.assert_allclose(np.mean(reported, axis=0), np.std(estimates, axis=0), rtol=0.2)


def test_correlation_scales_only_variances(palpation):
    s = palpation(seconds=0.5, noise=NOISE)
    plain, wide = gradient().run(*s), gradient(correlation=4.0).run(*s)
    assert np.array_equal(plain.k, wide.k)
    np.testing.assert_allclose(wide.k_std, 2.0 * plain.k_std, rtol=1e-12)


def test_the_error_of_the_initial_guess_does_not_count_as_noise(palpation):
    signals = palpation(seconds=1.0, noise=NOISE)
    estimator = RecursiveLeastSquares(0.99, (1e8, 1e12))
    estimator.run(*signals)
    assert estimator.state.noise == pytest.approx(NOISE**2, rel=0.2)


@pytest.mark.usefixtures("interpreted")
def test_noise_variance_follows_noise_that_changes(palpation):
    x, v, f, dt = palpation(seconds=8.0, noise=0.05)
    late = np.random.default_rng(1).normal(0.0, 0.4, 4000)
    estimator = gradient()
    estimator.run(x[:4000], v[:4000], f[:4000], dt[:4000])
    assert estimator.state.noise == pytest.approx(0.05**2, rel=0.2)
    estimator.run(x[4000:], v[4000:], f[4000:] + late, dt[4000:])
    assert estimator.state.noise == pytest.approx(0.4**2 + 0.05**2, rel=0.2)


def test_a_sample_with_zero_gain_does_not_change_the_noise():
    estimator = gradient()
    estimator.update(0.0, 0.0, 100.0, DT)
    assert estimator.state.noise == 0.0
    assert estimator.state.theta == [0.0, 0.0]


@pytest.mark.parametrize("correlation", [0.5, -1.0, np.nan, np.inf])
def test_a_correlation_below_one_is_refused(correlation):
    with pytest.raises(ValueError, match="correlation must be at least 1"):
        gradient(correlation=correlation)


@pytest.mark.parametrize(("name", "gap"), [("rls", 20.0), ("kalman", 0.3)])
def test_after_a_gap_the_interval_has_its_nominal_coverage(name, gap):
    before, after = 200, 251
    inside = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        dt = np.full(before + after, DT)
        dt[before] = gap
        t = rng.uniform(0.0, 1.0) + np.cumsum(dt)
        x = 5e-3 + 3e-3 * np.sin(8.0 * t) + 0.5e-3 * np.sin(31.0 * t)
        v = 24e-3 * np.cos(8.0 * t) + 15.5e-3 * np.cos(31.0 * t)
        f = 20.0 * v + 2100.0 * x + rng.normal(0.0, 0.02, len(t))
        estimates = METHODS[name](paper_preset("soft")).run(x, v, f, dt)
        at = before + np.round(np.array([0.3, 0.5, 1.0]) / DT).astype(int)
        for truth, value, std in (
            (20.0, estimates.b, estimates.b_std),
            (2100.0, estimates.k, estimates.k_std),
        ):
            inside.append(np.abs(value[at] - truth) <= 1.96 * std[at])
    share = np.mean(np.reshape(inside, (-1, 2, 3)), axis=0)
    assert (share >= 0.90).all()
    assert (share <= 0.99).all()
