"""Contact at the samples of the online estimators, from the phases of the batch evaluation."""

from __future__ import annotations

import numpy as np
import pytest

from teleop.evaluation.batch.analysis import analyse
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
