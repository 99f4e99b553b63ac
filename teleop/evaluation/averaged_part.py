"""Define the part of a record over which the estimates are averaged."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats


class AveragedPart(NamedTuple):
    """The part of a record over which the estimates are averaged.

    The batch evaluation uses only this part. The online estimators process all samples of the
    record, but their averages and their final estimates are reported for this part only.
    """

    start: float = -math.inf
    """Time of the start of the part [s]."""
    end: float = math.inf
    """Time of the end of the part [s]."""
    left_out: str = ""
    """Description of the samples outside the part; empty if it is the whole record."""

    def after(self, time: float) -> AveragedPart:
        """Return the part of the record that starts and ends later than this part by `time` [s]."""
        return self._replace(start=self.start + time, end=self.end + time)

    def contains(self, t: Floats) -> NDArray[np.bool_]:
        """Return whether each of the times `t` [s], shape (n,), is in this part."""
        return (t >= self.start) & (t < self.end)

    def indices(self, t: Floats) -> slice:
        """Return the range of indices of the samples that are in this part, as a slice.

        Parameters
        ----------
        t
            Times of the samples [s], increasing, shape (n,).
        """
        start, end = np.searchsorted(t, (self.start, self.end))
        return slice(int(start), int(end))


WHOLE = AveragedPart()
"""The whole record."""
