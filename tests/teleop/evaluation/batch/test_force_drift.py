"""A force that drifts out of contact is corrected, and is no relaxation and no softening."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.force_drift import find_drift
from teleop.evaluation.batch.smoothed_record import smoothed_signals
from teleop.evaluation.reading.signals import Signals, periods

K, B = 800.0, 6.0
T = np.arange(0.0, 16.0, 4e-3)
LINEAR = T / 16.0
WARM_UP = -np.expm1(-T / 5.0) / -np.expm1(-16.0 / 5.0)


def presses(lowest=-1e-3, top=3e-3):
    """Return the position of eight presses; `lowest` and `top` are one value, or one for each."""
    middle, half = 0.5 * (np.asarray(top) + lowest), 0.5 * (np.asarray(top) - lowest)
    return middle - half * np.cos(np.pi * T)


def force(x):
    d = np.maximum(x, 0.0)
    return np.where(x > 0.0, np.maximum(K * d + B * np.gradient(x, T), 0.0), 0.0)


def evaluated(x, f, noise=0.01, seed=7):
    f = f + np.random.default_rng(seed).normal(0.0, noise, len(T))
    return analyse(Signals(T, x, f, periods(T), "position"))


def slow_noise(seed, size):
    pole = np.exp(-4e-3 / 0.1)
    white = np.random.default_rng(seed).normal(size=len(T) + 500)
    return size * np.sqrt(1.0 - pole**2) * lfilter([1.0], [1.0, -pole], white)[500:]


@pytest.mark.parametrize("share", [0.03, -0.06, 0.15, -0.15])
@pytest.mark.parametrize("form", [LINEAR, WARM_UP], ids=["linear", "warm-up"])
def test_a_drift_is_named_and_does_not_change_the_result(form, share):
    x = presses()
    f = force(x)
    drift = share * np.ptp(f)
    found = evaluated(x, f + drift * form)
    assert found.drift is not None
    assert found.drift.change == pytest.approx(abs(drift), abs=0.01)
    (remark,) = [r for r in found.result.reasons if "lag of the force" not in r]
    assert remark.startswith("the force drifts: out of contact it changes by")
    assert found.result.k == pytest.approx(K, rel=3e-3)
    assert found.result.b_low < B < found.result.b_high
    assert found.result.b == pytest.approx(B, rel=0.05)


@pytest.mark.parametrize("seed", range(6))
def test_slow_noise_of_the_force_is_no_drift(seed):
    x = presses()
    found = evaluated(x, force(x) + slow_noise(seed, 0.02))
    assert found.drift is None


@pytest.mark.parametrize("step", [0.02, 0.05])
def test_a_body_that_softens_has_no_drift(step):
    x = presses()
    softening = 1.0 - step * np.floor(T / 2.0)
    assert evaluated(x, softening * force(x)).drift is None


def test_the_resolution_of_a_digital_force_is_that_before_the_correction():
    x, step = presses(), 0.02
    f = np.round((force(x) + 0.3 * LINEAR) / step) * step
    signals = Signals(T, x, f, periods(T), "position")
    drift = find_drift(smoothed_signals(signals))
    assert drift is not None
    assert drift.removed(signals).force_step == pytest.approx(step)
    assert analyse(signals).result.k == pytest.approx(K, rel=5e-3)


def test_troughs_in_contact_are_not_taken_for_a_drift():
    lift = np.interp(T, [0.0, 16.0], [-1e-3, 0.8e-3])  # the later presses do not leave contact
    x = presses(lift)
    assert evaluated(x, force(x)).drift is None


def test_estimates_of_a_drifting_ramp_and_return_use_both_ends():
    x = np.interp(T, [0.0, 2.0, 7.0, 9.0, 14.0, 16.0], [-1e-3, -1e-3, 3e-3, 3e-3, -1e-3, -1e-3])
    f = force(x)
    found = evaluated(x, f + 0.1 * np.ptp(f) * LINEAR)
    assert found.drift is not None
    assert found.result.k == pytest.approx(K, rel=0.01)
