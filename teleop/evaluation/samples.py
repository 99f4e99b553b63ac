"""The samples that are evaluated: all of them in blocks, and a part that fits into memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from estimation import Estimates
from estimation.compiled import Floats
from estimation.estimate_columns import estimators_in
from teleop.errors import InputError
from teleop.evaluation.kept_parts import MEASURED, Last, Sections
from teleop.evaluation.signals import Signals
from teleop.evaluation.units import LARGEST
from teleop.recording.gaps import Gap
from teleop.recording.recording import Recording, missing_column
from teleop.recording.stream import RecordingStream

BLOCK = 1 << 14
"""Number of samples in a block of a long record."""
WHOLE = 1 << 16
"""Largest number of samples of a record that is processed in a single block."""
NEEDED = ("time", "dt", "dropped", "x", "paired_position", "paired_force", "paired_dt")
"""Columns that are needed to evaluate a recorded trial."""

NOTHING: Floats = np.empty(0)


class Block(NamedTuple):
    """Successive samples, and their recorded estimates."""

    signals: Signals
    recorded: Mapping[str, tuple[Floats, Floats]] = {}
    """Recorded b and k of each estimator after each sample; empty if they are not known."""


class Samples:
    """Samples in memory.

    Parameters
    ----------
    signals
        The samples.
    recorded
        Recorded estimates after each sample; empty if they are not known.
    """

    def __init__(self, signals: Signals, recorded: Mapping[str, Estimates] | None = None) -> None:
        self.signals = signals
        """The samples for the batch evaluation: all samples, or sections with gaps between them."""
        self.count = len(signals.t)
        """Number of all samples."""
        self._recorded = {name: (e.b, e.k) for name, e in (recorded or {}).items()}

    @property
    def is_whole(self) -> bool:
        """Whether `signals` contains all samples."""
        return self.count == len(self.signals.t)

    @property
    def _block(self) -> int:
        """Largest number of samples in a block of this record."""
        return WHOLE if self.count <= WHOLE else BLOCK

    def blocks(self) -> Iterator[Block]:
        """Yield all samples in blocks."""
        s, size = self.signals, self._block
        for start in range(0, self.count, size):
            part = slice(start, start + size)
            gaps = tuple(i - start for i in s.gaps if start <= i < start + size)
            recorded = {name: (b[part], k[part]) for name, (b, k) in self._recorded.items()}
            cut = s._replace(t=s.t[part], x=s.x[part], f=s.f[part], dt=s.dt[part], gaps=gaps)
            yield Block(cut, recorded)


class RecordedSamples(Samples):
    """Samples of a recorded trial, which are read from the file twice.

    The file is read when the object is made, and again by `blocks`. If the recording is long,
    `signals` contains only evenly spaced sections (see `Sections`). Therefore, the required memory
    does not depend on the duration; it increases with the sampling rate.

    Parameters
    ----------
    path
        The recording.
    is_wanted
        Function that takes the name of a column, and returns whether the attribute `recording`
        contains this column.

    Raises
    ------
    InputError
        The recording cannot be read, is not complete or lacks a column, a sample is not finite, or
        a period is not positive.
    """

    def __init__(self, path: Path, is_wanted: Callable[[str], bool]) -> None:
        self._path = path
        stream = RecordingStream(path)
        missing = [name for name in NEEDED if name not in stream.units]
        if missing:
            for _ in stream.blocks():  # damage of the file is reported first
                pass
            raise missing_column(missing[0], stream.units)
        last = Last()
        sections = Sections()
        read = stream.blocks(lambda name: name in NEEDED or is_wanted(name))
        for block in read:
            last.add({name: column for name, column in block.items() if is_wanted(name)})
            sections.add(measured(block))
        names = [name for name in stream.units if is_wanted(name)]
        self.recording = Recording(
            columns=last.columns(names),
            units={name: stream.units[name] for name in names},
            events=stream.events,
            session=stream.session,
            settings=stream.settings,
            gaps=stream.gaps,
        )
        """The recording with the wanted columns. Of a long one, only the end is kept (`Last`)."""
        t, x, f, dt = sections.samples()
        gaps = with_gaps(t, dt, ends_of(stream.gaps), sections.starts)
        super().__init__(Signals(t, x, f, dt, "slave_position", gaps))
        self.count = sections.count

    def blocks(self) -> Iterator[Block]:
        """Yield all samples in blocks, with their recorded estimates."""
        stream = RecordingStream(self._path)
        names = estimators_in(stream.units)
        columns = [f"{name}_{symbol}" for name in names for symbol in "bk"]
        ends = ends_of(self.recording.gaps)
        read = stream.blocks(lambda name: name in (*MEASURED, "x") or name in columns)
        before = NOTHING
        for rows in joined((measured(block, columns) for block in read), self._block):
            t, x, f, dt, *estimates = rows
            inside = [end for end in ends if end <= t[-1] and not (len(before) and end <= before)]
            gaps = with_gaps(t, dt, inside, (), before)
            pairs = zip(estimates[::2], estimates[1::2], strict=True)
            recorded = dict(zip(names, pairs, strict=True))
            yield Block(Signals(t, x, f, dt, "slave_position", gaps), recorded)
            before = t[-1:]


def measured(block: Mapping[str, Floats], further: Sequence[str] = ()) -> Floats:
    """Return the samples that the estimators received in a block of ticks.

    Parameters
    ----------
    block
        Columns of the ticks. Ticks at which the estimators were not updated are omitted.
    further
        Names of columns that are returned besides `MEASURED`.

    Returns
    -------
    Array of shape (channels, n). Its rows are the columns `MEASURED` and `further`.

    Raises
    ------
    InputError
        A sample is not finite, or a period is not positive.
    """
    part = np.isfinite(block["x"])
    samples = np.stack([block[name][part] for name in (*MEASURED, *further)])
    for name, channel in zip(MEASURED, samples, strict=False):
        if not (np.abs(channel) < LARGEST).all():
            raise InputError(f"the recording's {name} is not finite in every sample")
    if not (samples[MEASURED.index("paired_dt")] > 0.0).all():
        raise InputError("the recording's paired_dt is not positive in every sample")
    return samples


def ends_of(gaps: Iterable[Gap]) -> list[float]:
    """Return the time of the first tick after each gap [s]."""
    return [gap.end for gap in gaps if gap.end is not None]


def with_gaps(
    t: Floats,
    dt: Floats,
    ends: Sequence[float],
    starts: Sequence[int] = (),
    before: Floats = NOTHING,
) -> tuple[int, ...]:
    """Return the index of the first sample after each gap, and correct `dt` at this sample.

    At the first sample after a gap, the recorded `dt` is the time since a sample in the gap. The
    arrays do not contain that sample. This value of `dt` is replaced by the time since the last
    sample before the gap. The array `dt` is changed in place.

    Parameters
    ----------
    t
        Time of each sample [s], shape (n,).
    dt
        Time since the previous sample [s], shape (n,).
    ends
        Time of the first tick after each gap [s].
    starts
        Further indices of samples that follow a gap.
    before
        Time of the sample before the first of the n samples [s], shape (1,). If there is no such
        sample, the array is empty.
    """
    found = {int(i) for i in np.searchsorted(t, ends) if i < len(t)} | set(starts)
    for i in found:
        if i or len(before):
            dt[i] = t[i] - (t[i - 1] if i else before[0])
    return tuple(sorted(found))


def joined(blocks: Iterable[Floats], size: int) -> Iterator[Floats]:
    """Join arrays of samples, and yield arrays of `size` samples, shape (channels, size).

    The last array may contain fewer samples.
    """
    parts: list[Floats] = []
    count = 0
    for block in blocks:
        parts.append(block)
        count += block.shape[1]
        while count >= size:
            whole = np.concatenate(parts, axis=1)
            parts = [whole[:, size:].copy()]
            count -= size
            yield whole[:, :size]
    if count:
        yield np.concatenate(parts, axis=1)
