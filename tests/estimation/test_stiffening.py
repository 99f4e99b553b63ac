from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from estimation import MatchedFilter, least_squares
from estimation.filters import Lag
from estimation.stiffening import MatchedSignals, evenly_lagged, lagged

B, K, K3 = 20.0, 15_000.0, 4e9


def recording(lag, seconds=4.0, noise=0.0, frequency=2.0, b=B, k3=K3):
    """Return position and lagged force of a stiffening body, with the lag solved by solve_ivp."""
    t = np.arange(0.0, seconds, 1e-3)
    w = 2 * np.pi * frequency

    def body(s):
        x = 1e-3 - 0.8e-3 * np.cos(w * s) + 0.05e-3 * np.sin(3.3 * w * s)
        v = 0.8e-3 * w * np.sin(w * s) + 0.05e-3 * 3.3 * w * np.cos(3.3 * w * s)
        return x, b * v + K * x + k3 * x**3

    x, f = body(t)
    if lag:
        f = solve_ivp(
            lambda s, y: (body(s)[1] - y) / lag,
            (0.0, t[-1]),
            [f[0]],
            t_eval=t,
            rtol=1e-8,
            atol=1e-8,
            max_step=1e-2,
        ).y[0]
    return x, f + np.random.default_rng(0).normal(0.0, noise, len(t))


settled = slice(1000, None)


def test_a_lag_alone_biases_the_damping_to_b_minus_k_lag():
    x, f = recording(lag=5e-3, k3=0.0, frequency=0.5)
    fit = MatchedSignals(x, f, 1e-3, 20.0, settled).fit(0.0, stiffening=False)
    assert fit.b == pytest.approx(B - K * 5e-3, rel=0.02)


def test_matching_the_lag_recovers_the_damping_of_a_linear_body():
    x, f = recording(lag=5e-3, k3=0.0)
    fit = MatchedSignals(x, f, 1e-3, 20.0, settled).fit(5e-3, stiffening=False)
    assert fit.b == pytest.approx(B, rel=1e-3)
    assert fit.k == pytest.approx(K, rel=1e-4)


def test_stiffening_biases_the_damping_unless_it_is_a_regressor():
    t = np.arange(0.0, 4.0, 1e-3)
    x = 1e-3 - 0.8e-3 * np.cos(2 * np.pi * (t + 0.15 * np.sin(2 * np.pi * t)))
    f = B * np.gradient(x, t) + K * x + K3 * x**3
    signals = MatchedSignals(x, f, 1e-3, 20.0, slice(1000, 1370))
    assert abs(signals.fit(0.0, stiffening=False).b - B) > 2.0
    assert signals.fit(0.0).b == pytest.approx(B, rel=0.02)


@pytest.mark.parametrize("lag", [0.0, 5e-3, 15e-3])
def test_matched_and_stiffening_recovers_every_parameter(lag):
    fit = MatchedSignals(*recording(lag, noise=0.02), 1e-3, 20.0, settled).fit(lag)
    assert fit.b == pytest.approx(B, rel=0.03)
    assert fit.k == pytest.approx(K, rel=0.005)
    assert fit.k3 == pytest.approx(K3, rel=0.01)


def test_a_matched_filter_that_knows_the_lag_gives_the_same_damping_online():
    x, f = recording(lag=5e-3, k3=0.0)
    conditioned = MatchedFilter(20.0, force_lag=5e-3).run(x, f, 1e-3)
    online = least_squares(*conditioned.part(settled)[:3])
    assert online.b == pytest.approx(B, rel=1e-3)


def test_the_interval_of_lag_and_damping_widens_as_the_motion_slows():
    widths = {}
    for frequency, seconds in ((0.1, 10.0), (2.0, 10.0)):
        x, f = recording(6e-3, seconds, noise=0.02, frequency=frequency)
        signals = MatchedSignals(x, f, 1e-3, 20.0, settled)
        profile = signals.profile(np.linspace(3e-3, 9e-3, 25))
        interval = profile.b_interval()
        assert interval.low <= interval.value <= interval.high
        lag = profile.lag_interval()
        assert lag.low - 1e-9 <= 6e-3 <= lag.high + 1e-9
        widths[frequency] = interval.high - interval.low
    assert widths[0.1] > 5.0 * widths[2.0]


def test_a_lag_by_convolution_is_the_lag_sample_by_sample():
    signal = np.random.default_rng(0).normal(size=500)
    for lag in (0.2e-3, 5e-3, 80e-3):
        channel = Lag(lag)
        expected = [channel.update(float(u), 1e-3) for u in signal]
        np.testing.assert_allclose(evenly_lagged(signal, 1e-3, lag), expected, atol=1e-12)
        jittered = np.full(500, 1e-3)
        jittered[7] = 2e-3
        assert not np.allclose(lagged(signal, jittered, lag)[8:], expected[8:], atol=1e-9)


def test_a_negative_lag_is_refused():
    with pytest.raises(ValueError, match="lag must be >= 0"):
        MatchedFilter(20.0, force_lag=-1e-3)
