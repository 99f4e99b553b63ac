from __future__ import annotations

import numpy as np
import pytest

from teleop.control.admittance import Admittance, AdmittanceParameters
from teleop.control.excitation_signals import Chirp, Multisine, RampHold, Sine
from teleop.control.injector import Injector

SIGNALS = {
    "sine": Sine(1.0),
    "multisine": Multisine([0.5, 1.0, 1.5, 2.0, 2.5]),
    "chirp": Chirp(0.5, 4.0),
    "ramp-hold": RampHold(0.4, 1.0, 0.6),
}
t = np.arange(0.0, 10.0, 2e-3)
STEP = 1e-4
"""Step of the numerical derivatives [s]."""


@pytest.fixture(params=SIGNALS)
def signal(request):
    return SIGNALS[request.param]


def injector(signal, **parameters):
    values = {"depth": 6e-3, "admittance": AdmittanceParameters(), "scale": 1.0, "duration": 10.0}
    return Injector(signal, **(values | parameters))


def derivatives(motion):
    """Return the first two derivatives at the times t, from differences."""
    before, after = (np.array([motion(s + d) for s in t[1:]]) for d in (-STEP, STEP))
    return ((after - before) / (2.0 * STEP))[:, :2].T


def test_a_signal_is_within_one_and_its_derivatives_are_right(signal):
    value, rate, acceleration = np.array([signal.at(s) for s in t]).T
    assert np.abs(value).max() <= 1.0 + 1e-12
    first, second = derivatives(signal.at)
    np.testing.assert_allclose(first, rate[1:], atol=1e-3)
    np.testing.assert_allclose(second, acceleration[1:], atol=0.05)


def test_motion_is_smooth_and_its_derivatives_are_right(signal):
    motion = injector(signal).motion
    _, velocity, acceleration = np.array([motion(s) for s in t]).T
    first, second = derivatives(motion)
    np.testing.assert_allclose(first, velocity[1:], atol=1e-5)
    np.testing.assert_allclose(second, acceleration[1:], atol=1e-3)


def test_motion_ramps_in_from_rest_and_out_to_rest_and_keeps_contact(signal):
    pe = injector(signal, touch=0.1)
    motion = np.array([pe.motion(s) for s in t])
    assert pe.motion(0.0) == (0.0, 0.0, 0.0)
    np.testing.assert_allclose(pe.motion(10.0), 0.0, atol=1e-12)
    assert motion[:, 0].min() >= 0.0
    middle = motion[(t > 0.5) & (t < 9.5), 0]
    assert middle.min() >= 0.6e-3 - 1e-12
    assert middle.max() <= 6e-3 + 1e-12


def test_the_force_moves_the_admittance_along_the_motion(signal):
    parameters = AdmittanceParameters(0.5, 15.0, 40.0)
    pe = injector(signal, admittance=parameters)
    admittance = Admittance(parameters)
    for n in range(10_000):
        assert abs(admittance.position - pe.motion(n * 1e-3).value) <= 0.05e-3
        admittance.step(pe.force((n + 0.5) * 1e-3), 1e-3)


def test_the_slave_reaches_the_depth_for_every_scale():
    pe = injector(SIGNALS["sine"], scale=0.25)
    assert max(pe.motion(s).value for s in t) * 0.25 == pytest.approx(6e-3, rel=0.01)


def test_a_short_trial_has_short_ramps():
    pe = injector(SIGNALS["sine"], duration=0.2)
    assert pe.motion(0.2).value == pytest.approx(0.0, abs=1e-12)
    assert pe.motion(0.1).value > 0.0


@pytest.mark.parametrize(
    "make",
    [
        lambda: Sine(0.0),
        lambda: Multisine([]),
        lambda: Multisine([1.0, float("nan")]),
        lambda: Chirp(2.0, 1.0),
        lambda: Chirp(1.0, 2.0, sweep=0.0),
        lambda: RampHold(hold=0.0),
        lambda: injector(SIGNALS["sine"], depth=0.0),
        lambda: injector(SIGNALS["sine"], duration=0.0),
        lambda: injector(SIGNALS["sine"], touch=1.0),
    ],
)
def test_a_parameter_out_of_range_is_refused(make):
    with pytest.raises(ValueError, match=r"must be|needs"):
        make()
