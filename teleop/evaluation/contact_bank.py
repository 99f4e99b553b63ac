"""Define a bank of estimators that hold their estimates constant while there is no contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation import Bank
from estimation.compiled import Floats, Samples
from estimation.estimator import Estimator
from teleop.evaluation.analysis import Analysis


class ContactBank(Bank):
    """A bank for one record. Its estimators hold their estimates constant without contact.

    Parameters
    ----------
    bank
        Bank from which the estimators and the contact gate are taken.
    contact
        Whether there is contact at each sample of the record, shape (n,).
    """

    def __init__(self, bank: Bank, contact: NDArray[np.bool_]) -> None:
        super().__init__(bank, bank.gate)
        self.contact = contact

    def _open_samples(self, samples: Samples) -> NDArray[np.bool_]:
        return super()._open_samples(samples) & self.contact

    def _samples_of(
        self, e: Estimator, samples: Samples, plain: Samples, is_open: NDArray[np.bool_]
    ) -> Samples:
        chosen = super()._samples_of(e, samples, plain, is_open)
        return chosen._replace(open=chosen.open & self.contact)


def contact_at(analysis: Analysis, t: Floats) -> NDArray[np.bool_]:
    """Return whether there is contact at each time.

    Parameters
    ----------
    analysis
        Batch evaluation of the record.
    t
        Times [s], shape (n,).

    Returns
    -------
    Array of shape (n,); all False if the force does not follow the displacement.
    """
    record, phases = analysis.record, analysis.phases
    if record.band.coherence == 0.0:
        return np.zeros(len(t), dtype=np.bool_)
    nearest = np.clip(np.searchsorted(record.t, t), 0, len(record.t) - 1)
    return np.asarray(phases.contact[nearest])
