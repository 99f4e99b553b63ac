import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.checks import LARGEST
from estimation.methods.batch_window import BatchWindow
from estimation.model import WITH_DATUM


def fitted(phi, f):
    return np.linalg.lstsq(phi, f, rcond=None)[0]


@settings(max_examples=20, deadline=None)
@given(st.integers(3, 40), st.integers(3, 150), st.integers(0, 99))
def test_is_least_squares_over_the_latest_samples(samples, n, seed):
    rng = np.random.default_rng(seed)
    x, v, f = rng.normal(size=(3, n))
    estimator = BatchWindow(samples * 1e-3, 1e-3)
    estimator.run(x, v, f, 1e-3)
    expected = fitted(np.column_stack((v, x))[-samples:], f[-samples:])
    np.testing.assert_allclose(estimator.state.theta, expected, rtol=1e-6, atol=1e-6)


def test_interval_is_the_standard_one(palpation):
    import statsmodels.api as sm

    x, v, f, dt = palpation(seconds=0.4, noise=0.02)
    ones = np.ones((len(x), 1))
    estimator = BatchWindow(0.1, 1e-3, WITH_DATUM)
    estimator.run(x, v, f, dt, ones)
    oracle = sm.OLS(f[-100:], np.column_stack((v, x, ones))[-100:]).fit()
    values, deviations = zip(*estimator.values.values(), strict=True)
    np.testing.assert_allclose(values, oracle.params, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(deviations, oracle.bse, rtol=1e-6)


def test_interval_covers_the_truth(palpation):
    hits = []
    for seed in range(60):
        estimator = BatchWindow(0.2, 1e-3)
        estimator.run(*palpation(seconds=0.4, noise=0.02, seed=seed))
        got = estimator.estimate
        hits += [abs(got.b - 20.0) < 1.96 * got.b_std, abs(got.k - 2100.0) < 1.96 * got.k_std]
    assert 0.88 < np.mean(hits) <= 1.0


def test_correlated_noise_widens_the_interval(palpation):
    signals = palpation(seconds=0.4, noise=0.02)
    white, correlated = BatchWindow(0.1, 1e-3), BatchWindow(0.1, 1e-3, correlation=9.0)
    white.run(*signals)
    correlated.run(*signals)
    assert correlated.estimate.k_std == pytest.approx(3.0 * white.estimate.k_std)


@pytest.mark.usefixtures("interpreted")
def test_sums_do_not_drift(palpation):
    x, v, f, dt = palpation(seconds=10.0, noise=0.02)
    estimator = BatchWindow(0.05, 1e-3)
    estimator.run(1e3 * x, 1e3 * v, 1e3 * f, dt)
    estimator.run(1e-3 * x[:110], 1e-3 * v[:110], f[:110], dt[:110])
    expected = fitted(np.column_stack((v, x))[60:110] * 1e-3, f[60:110])
    np.testing.assert_allclose(estimator.state.theta, expected, rtol=1e-9)


def test_recovers_from_an_outlier_beyond_double_precision(palpation):
    x, v, f, dt = palpation(seconds=0.3)
    x[100] = v[100] = f[100] = 9e29
    estimates = BatchWindow(0.05, 1e-3).run(x, v, f, dt)
    assert np.all(np.isfinite(estimates.k))
    assert estimates.k[-1] == pytest.approx(2100.0, rel=1e-6)


def test_holds_while_the_window_does_not_determine_the_parameters(palpation):
    x, v, f, dt = palpation(seconds=0.2)
    estimator = BatchWindow(0.05, 1e-3)
    estimates = estimator.run(x, v, f, dt)
    assert estimates.held[:2].all()
    assert estimates.k_std[0] == LARGEST
    assert not estimates.held[5:].any()
    still = estimator.run(np.full(100, x[-1]), np.zeros(100), np.full(100, 2100.0 * x[-1]), 1e-3)
    assert still.held[-1]
    assert still.k[-1] == pytest.approx(2100.0, rel=1e-6)


def test_a_gap_as_long_as_the_window_empties_it(palpation):
    x, v, f, dt = palpation(seconds=0.2)
    dt[120] = 0.06
    f[:120] *= 2.0
    estimates = BatchWindow(0.05, 1e-3).run(x, v, f, dt)
    assert estimates.held[120:122].all()
    assert estimates.k[124] == pytest.approx(2100.0, rel=1e-6)
    np.testing.assert_allclose(estimates.k[180:], 2100.0, rtol=1e-6)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"window": 2e-3}, "more than 2 samples"),
        ({"window": 1e6}, "at most 1000000"),
        ({"sample_period": 0.0}, "positive"),
        ({"correlation": 0.5}, "correlation"),
    ],
)
def test_refuses_settings_out_of_range(settings, message):
    with pytest.raises(ValueError, match=message):
        BatchWindow(**{"window": 0.1, "sample_period": 1e-3, **settings})
