"""Contact at the samples of the online estimators, from the phases of the batch evaluation."""

from __future__ import annotations

import numpy as np
import pytest

from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.contact_phases import follows
from teleop.evaluation.online.contact_bank import contact_at
from teleop.evaluation.reading.signals import Signals


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
