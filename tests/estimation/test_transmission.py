"""Play of the transmission, and results that are corrected for a calibrated transmission."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.filters import Play
from estimation.stiffening import Interval
from estimation.transmission import RIGID, TransmissionCalibration


@pytest.mark.parametrize("ratio", [0.05, 0.3, 0.7])
def test_the_play_has_the_describing_function_of_a_backlash(ratio):
    """Gelb and Vander Velde, section 2.3: fundamental of the output for a sine of amplitude 1."""
    t = np.linspace(0.0, 2.0, 200_001)
    out = Play(ratio).run(np.sin(2.0 * np.pi * t))[100_000:-1]
    phase = 2.0 * np.pi * t[100_000:-1]
    in_phase, quadrature = 2.0 * np.mean(out * np.sin(phase)), 2.0 * np.mean(out * np.cos(phase))
    g = 1.0 - 2.0 * ratio
    expected = 0.5 + (math.asin(g) + g * math.sqrt(1.0 - g * g)) / math.pi
    assert in_phase == pytest.approx(expected, abs=1e-5)
    assert quadrature == pytest.approx(-4.0 * ratio * (1.0 - ratio) / math.pi, abs=1e-5)


values = st.lists(st.floats(-10.0, 10.0), min_size=2, max_size=30)


@given(values, st.floats(0.0, 5.0), st.integers(1, 29))
def test_the_play_stays_near_its_input_and_does_not_depend_on_blocks(inputs, half, cut):
    u = np.array(inputs)
    out = Play(half).run(u)
    assert (np.abs(u - out) <= half + 1e-12).all()
    moved = np.diff(out) != 0.0
    at_edge = np.abs(np.abs(u - out)[1:] - half) <= 1e-12 * (1.0 + np.abs(u[1:]))
    assert (at_edge | ~moved).all()
    play = Play(half)
    assert np.array_equal(np.concatenate([play.run(u[:cut]), play.run(u[cut:])]), out)


@given(st.floats(1.0, 1e5), st.floats(0.0, 1e-4))
def test_the_stiffness_at_the_tip_is_that_without_the_spring_in_series(k_tip, compliance):
    in_series = 1.0 / (1.0 / k_tip + compliance)
    found = TransmissionCalibration(compliance=compliance).at_tip(
        Interval(in_series, in_series, in_series)
    )
    assert found.value == pytest.approx(k_tip)


def test_errors_of_k_and_of_the_compliance_widen_the_stiffness_at_the_tip():
    """Against a sum of squares of finite differences."""
    k, half, c, c_half = 30e3, 200.0, 7e-6, 0.5e-6
    found = TransmissionCalibration(compliance=c, compliance_error=c_half).at_tip(
        Interval(k, k - half, k + half)
    )

    def tip(k, c):
        return 1.0 / (1.0 / k - c)

    by_k = (tip(k + 1.0, c) - tip(k - 1.0, c)) / 2.0 * half
    by_c = (tip(k, c + 1e-9) - tip(k, c - 1e-9)) / 2e-9 * c_half
    assert found.high - found.value == pytest.approx(math.hypot(by_k, by_c), rel=1e-4)


def test_no_stiffness_at_the_tip_if_the_compliance_explains_the_measured_one():
    soft = TransmissionCalibration(compliance=1e-4, compliance_error=2e-5)
    assert soft.at_tip(Interval(9e3, 8e3, 1e4)) is None
    assert soft.at_tip(Interval(2e4, 1.9e4, 2.1e4)) is None


def test_errors_of_lag_and_play_change_b_as_in_a_sine():
    k, amplitude, omega = 2000.0, 4e-3, 2.0 * np.pi
    v = amplitude * omega * np.cos(np.linspace(0.0, 2.0 * np.pi, 10_000, endpoint=False))
    per_speed = np.abs(v).mean() / (v**2).mean()
    play = TransmissionCalibration(lost_motion_error=5e-6).damping_error(k, per_speed, omega)
    assert play == pytest.approx(4.0 * k * 5e-6 / (np.pi * omega * amplitude), rel=1e-4)
    assert TransmissionCalibration(force_lag_error=1e-4).damping_error(k, per_speed, omega) == 0.2
    assert RIGID.damping_error(k, per_speed, omega) == 0.0


def test_errors_of_play_and_position_change_k_as_the_amplitude_behind_the_play():
    """Against a finite difference of k = (amplitude of the force) / (A - d)."""
    force, amplitude, d = 10.0, 5e-3, 120e-6
    k = force / (amplitude - d)
    by_d = (force / (amplitude - d - 1e-9) - k) / 1e-9
    known = TransmissionCalibration(lost_motion=d, lost_motion_error=3e-6)
    assert known.stiffness_error(k, amplitude, 6.0) == pytest.approx(3e-6 * by_d, rel=1e-4)
    both = known.stiffness_error(k, amplitude, 6.0, 1e-6)
    assert both == pytest.approx(math.hypot(3e-6, 1.96e-6) * by_d, rel=1e-3)
    assert known.stiffness_error(k, d, 6.0) == math.inf
    assert RIGID.stiffness_error(k, amplitude, 6.0, 1e-6) == 0.0


@pytest.mark.parametrize("value", [-1e-6, math.nan, math.inf])
def test_a_value_that_is_not_finite_or_negative_is_refused(value):
    with pytest.raises(ValueError, match="lost_motion"):
        TransmissionCalibration(lost_motion=value)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.01, 0.3))
def test_an_error_of_the_share_of_the_delay_changes_k_and_b_as_the_response(share, other, phase):
    """Against the complex stiffness that is fitted behind a channel with another share."""
    lag, k, omega = 5e-3, 2000.0, phase / 5e-3
    true = np.exp(-1j * phase * other) / (1.0 + 1j * phase * (1.0 - other))
    fitted = np.exp(-1j * phase * share) / (1.0 + 1j * phase * (1.0 - share))
    change = k * true / fitted - k
    known = TransmissionCalibration(lag, delay_share=share, delay_share_error=abs(other - share))
    # the error is about that of either sign of the difference
    assert known.stiffness_error(k, 1e-3, omega) >= 0.6 * abs(change.real) - 1e-9
    assert known.damping_error(k, 1.0, omega) >= 0.6 * abs(change.imag) / omega - 1e-9
    exact = TransmissionCalibration(lag, delay_share=other)
    assert exact.response(omega) == pytest.approx(true)
    assert exact.stiffness_error(k, 1e-3, omega) == 0.0


def test_a_share_above_one_is_refused():
    with pytest.raises(ValueError, match="delay_share must be at most 1"):
        TransmissionCalibration(1e-3, delay_share=1.1)


def test_the_error_of_a_value_has_the_correlation_of_lag_and_lost_motion():
    """The expected value is that of samples of both errors."""
    known = TransmissionCalibration(
        2e-3, 1e-4, force_lag_error=6e-6, lost_motion_error=2e-7, lag_lost_motion_correlation=-0.8
    )
    covariance = [[6e-6**2, -0.8 * 6e-6 * 2e-7], [-0.8 * 6e-6 * 2e-7, 2e-7**2]]
    errors = np.random.default_rng(0).multivariate_normal([0.0, 0.0], covariance, 100_000)
    by_lag, by_lost_motion = 3000.0, 1.2e5
    spread = float(np.std(errors @ [by_lag, by_lost_motion]))
    assert known.propagated(by_lag, by_lost_motion) == pytest.approx(spread, rel=0.02)


def test_a_correlation_beyond_one_is_refused():
    with pytest.raises(ValueError, match="lag_lost_motion_correlation"):
        TransmissionCalibration(lag_lost_motion_correlation=-1.1)
    with pytest.raises(ValueError, match="lag_lost_motion_correlation"):
        TransmissionCalibration(lag_lost_motion_correlation=1.1)
