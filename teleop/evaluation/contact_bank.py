"""Define a bank of estimators that hold their estimates constant while there is no contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation import Bank
from estimation.compiled import Floats, Samples
from estimation.estimator import Estimator
from teleop.evaluation.analysis import Analysis
from teleop.evaluation.masks import hysteresis
from teleop.evaluation.phases import level_width

FARTHEST = 1.0
"""The analysis of a long record contains only sections of the record. A time is between two
sections if it is farther than this [s], and than two sample periods of the analysis, from the next
sample of the analysis."""


class ContactBank(Bank):
    """A bank whose estimators hold their estimates while there is no contact.

    Parameters
    ----------
    bank
        Bank from which the estimators and the contact gate are taken.
    """

    def __init__(self, bank: Bank) -> None:
        super().__init__(bank, bank.gate)
        self.contact = np.zeros(0, dtype=np.bool_)
        """Whether there is contact at each of the samples that are processed next, shape (n,)."""

    def _open_samples(self, samples: Samples) -> NDArray[np.bool_]:
        return super()._open_samples(samples) & self.contact

    def _samples_of(
        self, e: Estimator, samples: Samples, plain: Samples, is_open: NDArray[np.bool_]
    ) -> Samples:
        chosen = super()._samples_of(e, samples, plain, is_open)
        return chosen._replace(open=chosen.open & self.contact)


def contact_at(analysis: Analysis, t: Floats, f: Floats) -> NDArray[np.bool_]:
    """Return whether there is contact at each time.

    The analysis of a long record contains only sections of the record. Between two sections, there
    is contact if the force is above its level out of contact. The times before the first analysed
    sample have the same contact state as this sample.

    Parameters
    ----------
    analysis
        Batch evaluation of the record.
    t
        Times [s], shape (n,).
    f
        Force at these times [N], shape (n,), as in the file (the datum is not subtracted).

    Returns
    -------
    Array of shape (n,); all False if the force does not follow the displacement.
    """
    record, phases = analysis.record, analysis.phases
    if record.band.coherence == 0.0:
        return np.zeros(len(t), dtype=np.bool_)
    nearest = np.clip(np.searchsorted(record.t, t), 0, len(record.t) - 1)
    contact = np.asarray(phases.contact[nearest])
    width = level_width(record)
    farthest = max(FARTHEST, 2.0 * record.period)
    away = (t > record.t[0]) & (np.abs(record.t[nearest] - t) > farthest)
    if away.any():
        level = phases.free_force
        above = np.ones(len(t), dtype=np.bool_)
        if level is not None:
            above = hysteresis(f - level, 0.5 * width, width)
        contact[away] = above[away]
    return contact
