"""Contact at the samples of the online estimators, from the phases of the batch evaluation."""

from __future__ import annotations

import numpy as np
import pytest

from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.contact_phases import find_phases, follows
from teleop.evaluation.batch.smoothed_record import smoothed_signals
from teleop.evaluation.online.contact_bank import contact_at
from teleop.evaluation.reading.signals import Signals, periods


@pytest.mark.parametrize("period", [1e-3, 0.5])
def test_the_contact_of_a_record_without_gaps_is_that_of_its_phases(period):
    """The slower motion is evaluated on a grid of 12 s, longer than the distance to a section."""
    rng = np.random.default_rng(0)
    t = period * np.arange(30_000)
    x = 2e-3 * (1.0 - np.cos(10.0 * np.pi * t / t[-1]))
    f = 2000.0 * np.maximum(x - 1.5e-3, 0.0) + 0.05 * rng.standard_normal(len(t))
    signals = Signals(t, x, f, np.full(len(t), period), "position")
    analysis = analyse(signals)
    record, contact = analysis.record, analysis.phases.contact
    expected = contact[np.clip(np.searchsorted(record.t, t), 0, len(record.t) - 1)]
    assert 0.4 < expected.mean() < 0.8
    np.testing.assert_array_equal(contact_at(analysis, t, f), expected)


def test_the_trough_of_a_damped_force_is_contact_and_a_force_without_slope_is_not():
    """Before a reversal, the damping force increases while the elastic force decreases."""
    t = np.linspace(-0.3, 0.3, 61)
    x, v = 2e-3 * (1.0 - np.cos(2.0 * np.pi * t)), 4e-3 * np.pi * np.sin(2.0 * np.pi * t)
    noise = np.random.default_rng(0).normal(0.0, 0.01, len(t))
    assert follows(x, v, 300.0 * x + 40.0 * v + noise, 500.0)
    assert not follows(x, v, 300.0 * np.maximum(x - 3e-3, 0.0) + noise, 500.0)
    assert not follows(x, v, 20.0 * x + 40.0 * v + noise, 500.0)


def light_presses(t):
    """Return the depth of presses of which only the last 6 % of the travel are in contact."""
    return 5e-3 * (0.5 - 0.5 * np.cos(2.0 * np.pi * 1.2 * t)) - 4.7e-3


def test_samples_near_a_jump_of_the_force_at_the_beginning_of_contact_are_not_used():
    t = np.arange(0.0, 12.0, 1e-3)
    d = light_presses(t)
    f = np.where(d > 0.0, np.maximum(900.0 * d + 20.0 * np.gradient(d, t), 0.0), 0.0)
    f = f + np.random.default_rng(1).normal(0.0, 2e-4, len(t))
    found = analyse(Signals(t, d, f, periods(t), "position"))
    begins = t[1:][(d[1:] > 0.0) & (d[:-1] <= 0.0)]
    record = found.record
    used = record.t[found.phases.usable]
    distance = np.abs(used[:, None] - begins).min()
    assert distance > 3.0 * record.width
    assert found.local is not None
    assert found.local.best.rms < 1.5 * record.f_noise_smoothed
    assert found.local.b == pytest.approx(20.0, rel=0.01)


def test_free_motion_beside_a_strongly_damped_body_is_found():
    t = np.arange(0.0, 12.0, 5e-3)
    d = 4e-3 * (0.5 - 0.5 * np.cos(2.0 * np.pi * 0.5 * t)) - 0.5e-3
    f = 800.0 * np.maximum(d, 0.0) * (1.0 + 40.0 * np.gradient(d, t))
    f = np.maximum(f, 0.0) + np.random.default_rng(1).normal(0.0, 0.015, len(t))
    phases = find_phases(smoothed_signals(Signals(t, d, f, periods(t), "position")))
    assert phases.free_force == pytest.approx(0.0, abs=0.01)
    assert phases.contact_point is not None
    assert phases.contact_point.low < 0.0 < phases.contact_point.high
