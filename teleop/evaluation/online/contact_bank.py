"""Define a bank of estimators that hold their estimates constant while there is no contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation import Bank
from estimation.arrays import Floats
from estimation.compiled import Samples
from estimation.estimator import Estimator
from teleop.evaluation.batch.analysis import Analysis
from teleop.evaluation.batch.contact_phases import level_width
from teleop.evaluation.batch.masks import hysteresis
from teleop.evaluation.online.thresholds import FARTHEST_ANALYSED


class ContactBank(Bank):
    """A bank of estimators that keep their estimates constant while there is no contact.

    The contact is known from the batch evaluation of the record. The attribute `contact` must be
    set before each block of samples. It applies to all estimators. In addition, the contact gate of
    `bank` applies: a detector of contact and motion that uses the present and past samples only.
    """

    def __init__(self, bank: Bank) -> None:
        super().__init__(bank, bank.gate)
        self.contact = np.zeros(0, dtype=np.bool_)
        """Whether there is contact at each of the next n samples, shape (n,)."""

    def _open_samples(self, samples: Samples) -> NDArray[np.bool_]:
        return super()._open_samples(samples) & self.contact

    def _samples_of(
        self, e: Estimator, samples: Samples, plain: Samples, is_open: NDArray[np.bool_]
    ) -> Samples:
        chosen = super()._samples_of(e, samples, plain, is_open)
        return chosen._replace(open=chosen.open & self.contact)


def contact_at(analysis: Analysis, t: Floats, f: Floats) -> NDArray[np.bool_]:
    """Return whether there is contact at each of the given times.

    The batch evaluation finds the contact in the analysed samples. For a long record, these samples
    are only sections of the record. Between two sections, there is contact if the force is above
    the force out of contact. Before the first analysed sample, the result is the same as at this
    sample.
    """
    record, phases = analysis.record, analysis.phases
    if record.band.coherence == 0.0:
        return np.zeros(len(t), dtype=np.bool_)
    nearest = np.clip(np.searchsorted(record.t, t), 0, len(record.t) - 1)
    contact = np.asarray(phases.contact[nearest])
    width = level_width(record)
    farthest = max(FARTHEST_ANALYSED, 2.0 * record.period)
    away = (t > record.t[0]) & (np.abs(record.t[nearest] - t) > farthest)
    if away.any():
        level = phases.free_force
        above = np.ones(len(t), dtype=np.bool_)
        if level is not None:
            drift = analysis.drift.at(t) if analysis.drift else 0.0
            above = hysteresis(f - drift - level, 0.5 * width, width)
        contact[away] = above[away]
    return contact
