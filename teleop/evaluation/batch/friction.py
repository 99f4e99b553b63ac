"""Compute the force of friction that builds up gradually over a path (Dahl's model).

After each reversal of the motion, the force changes exponentially with the path towards its largest
value, against the motion. The slip is the path after which 63 % of this change has taken place. A
short slip gives Coulomb friction.

References
----------
P. R. Dahl, "A solid friction model", Aerospace Corporation, report TOR-0158(3107-18)-1, 1968.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from estimation.arrays import Floats
from teleop.evaluation.batch.smoothed_record import SmoothedRecord


def friction_forces(record: SmoothedRecord, slips: Floats) -> Floats:
    """Return the friction of a record relative to its largest value, for m slips [m], (m, n).

    It is not smoothed. It follows from the smoothed position, because each reversal counts.
    """
    pieces = np.split(record.x, record.starts[1:])
    return np.concatenate([dahl(piece, slips) for piece in pieces], axis=1)


def dahl(x: Floats, slips: Floats) -> Floats:
    """Return the friction for one motion, which begins at zero, and for m slips, shape (m, n)."""
    side = np.sign(np.diff(x, prepend=x[0]))
    begins = [0, *(np.flatnonzero(np.diff(side)) + 1).tolist(), len(x)]
    z = np.zeros((len(slips), len(x)))
    last = np.zeros((len(slips), 1))
    for begin, end in pairwise(begins):
        path = np.abs(x[begin:end] - x[max(begin - 1, 0)])
        z[:, begin:end] = side[begin] + (last - side[begin]) * np.exp(-path / slips[:, None])
        if side[begin] == 0.0:  # at rest, the force keeps its value
            z[:, begin:end] = last
        last = z[:, end - 1 : end]
    return z
