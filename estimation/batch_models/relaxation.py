"""Compute the part of an elastic force that relaxes with a time constant.

For an elastic force y and a time constant tau, this part is the solution z of the differential
equation z' = y' - z / tau. `relaxing_part` computes z by a recursion, in blocks of samples: within
a block, the recursion is a product with a matrix. The function `scipy.signal.lfilter` gives the
same numbers, but importing `scipy.signal` takes longer than the evaluation of a short record.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from estimation.arrays import Floats

BLOCK = 64
"""Number of samples in a block."""
LAG = np.subtract.outer(np.arange(BLOCK), np.arange(BLOCK))
"""Number of samples by which the sample of a row is later than that of a column, in a block."""
START = 8
"""Number of samples from which the value at the start of a piece is computed.

A piece is a part of the record without gaps. The duration of these samples is about two standard
deviations of the smoothing kernel.
"""


def relaxing_part(pieces: Iterable[Floats], period: float, tau: float) -> Floats:
    """Return the relaxing part z of signals y, for example of elastic forces, shape (..., n).

    The relaxing part is the solution z of the differential equation z' = y' - z / tau. y is given
    in pieces of shape (..., n_i), the parts of the record without gaps. At the start of each piece,
    z is 0. n is the number of samples of all pieces together.

    Each piece contains the samples of y minus the value of y at its start. `period` and `tau` are
    in seconds.
    """
    decay = math.exp(-period / tau)
    gain = tau / period * (1.0 - decay)
    powers = decay ** np.arange(BLOCK + 1)
    response = np.where(LAG >= 0, powers[LAG], 0.0)
    parts = []
    for piece in pieces:
        n = piece.shape[-1]
        changes = np.zeros((*piece.shape[:-1], -(-n // BLOCK) * BLOCK))
        changes[..., :n] = np.diff(gain * piece, prepend=0.0)
        blocks = changes.reshape(*piece.shape[:-1], -1, BLOCK) @ response.T
        blocks[..., 1:, :] += (
            values_at_ends(blocks[..., -1], float(powers[-1]))[..., :-1, None] * powers[1:]
        )
        parts.append(blocks.reshape(changes.shape)[..., :n])
    return np.concatenate(parts, axis=-1)


def values_at_ends(own: Floats, decay: float) -> Floats:
    """Return z at the end of each block, shape (..., m), from its own part of z and those before.

    `decay` is the decay of z in a block.
    """
    if own.ndim > 1:
        return np.array([values_at_ends(row, decay) for row in own])
    last, ends = 0.0, []
    for value in own.tolist():
        last = value + decay * last
        ends.append(last)
    return np.array(ends)


def value_at_start(y: Floats) -> float:
    """Extrapolate y to the start of a piece by a line that is fitted to its first samples.

    `y` contains the samples of a piece, which is a part of the record without gaps. Each sample is
    the mean over one sample period, and its time is the middle of this period. So the piece starts
    half a sample period before the time of its first sample.
    """
    first = y[:START]
    return float(np.polyfit(np.arange(len(first)) + 0.5, first, 1)[1])
