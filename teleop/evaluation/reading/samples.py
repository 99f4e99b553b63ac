"""Provide the samples of a record for the evaluation: in blocks, and as arrays in memory.

The online estimators process all samples, one block after another. The batch evaluation needs its
samples in memory. If the record is long, the arrays in memory contain only a part of the samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from estimation import Estimates
from estimation.arrays import Floats
from estimation.filters import Play
from teleop.evaluation.reading.signals import Signals

BLOCK = 1 << 14
"""Number of samples in a block of a record that is too long for a single block."""
LONGEST_SINGLE_BLOCK = 1 << 16
"""A record with at most this number of samples is processed in a single block."""


class Block(NamedTuple):
    """Successive samples of a record, and the estimates that were recorded after each sample."""

    signals: Signals
    """The samples: measured time, position and force."""
    recorded: Mapping[str, tuple[Floats, Floats]] = {}
    """Recorded b [N s/m] and k [N/m] after each sample, by the name of the estimator. It is empty
    if no estimates were recorded."""


class Samples:
    """The samples of a record for the evaluation, all of which are in memory."""

    def __init__(self, signals: Signals, recorded: Mapping[str, Estimates] | None = None) -> None:
        self.signals = signals
        """The samples for the batch evaluation: all samples, or sections with gaps between them."""
        self.count = len(signals.t)
        """Number of all samples of the record, even if `signals` contains only a part of them."""
        self._recorded = {name: (e.b, e.k) for name, e in (recorded or {}).items()}

    @property
    def is_whole(self) -> bool:
        """Whether the attribute `signals` contains all samples of the record."""
        return self.count == len(self.signals.t)

    @property
    def _block(self) -> int:
        """Largest number of samples in a block into which this record is divided."""
        return LONGEST_SINGLE_BLOCK if self.count <= LONGEST_SINGLE_BLOCK else BLOCK

    def blocks(self) -> Iterator[Block]:
        """Yield all samples of the record in blocks, in the order of time."""
        s, size = self.signals, self._block
        for start in range(0, self.count, size):
            part = slice(start, start + size)
            gaps = tuple(i - start for i in s.gaps if start <= i < start + size)
            recorded = {name: (b[part], k[part]) for name, (b, k) in self._recorded.items()}
            cut = s._replace(t=s.t[part], x=s.x[part], f=s.f[part], dt=s.dt[part], gaps=gaps)
            yield Block(cut, recorded)


class SamplesAtTip(Samples):
    """The samples of a record whose position is behind the lost motion of the transmission.

    The position is the output of the play operator: the position of the tip plus the stretch of the
    transmission. `lost_motion` is the half width of the play [m]. The state of the play at the
    first sample and after a gap is not known. It is known again after a motion of twice this half
    width.
    """

    def __init__(self, samples: Samples, lost_motion: float) -> None:
        signals = samples.signals
        played = Play(lost_motion).run(signals.x)
        super().__init__(signals._replace(x=played, measured_step=signals.step))
        self.count = samples.count
        self._samples, self._lost_motion = samples, lost_motion

    def blocks(self) -> Iterator[Block]:
        """Yield all samples of the record in blocks, in the order of time."""
        play = Play(self._lost_motion)
        for block in self._samples.blocks():
            yield block._replace(signals=block.signals._replace(x=play.run(block.signals.x)))


def is_replayed(column: str) -> bool:
    """Return whether a column of a recording is needed besides the samples of the estimators.

    From the selected columns, two things are computed: how well the slave follows the target, and
    the true values of b and k, which are known for the simulated rig only. The parameter `column`
    is the name of the column.
    """
    return column in ("time", "slave_position", "target")


def is_reported(column: str) -> bool:
    """Return whether a column of a recording may be shown in a report.

    Columns with recorded results of the estimators are not shown. The parameter `column` is the
    name of the column.
    """
    return not column.endswith(("_b", "_k", "_std", "_held", "_misfit"))
