"""Read the samples and settings of a recorded trial, to recompute its estimates."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from estimation import Preset
from estimation.arrays import Floats
from estimation.estimate_columns import estimators_in
from teleop.errors import InputError, invalid_parts
from teleop.evaluation.formats.units import LARGEST
from teleop.evaluation.reading.samples import Block, Samples
from teleop.evaluation.reading.signals import Signals
from teleop.evaluation.reading.thresholds import SHORTEST_PERIOD
from teleop.evaluation.settings import EstimateSettings
from teleop.recording.gaps import Gap
from teleop.recording.recording import Recording, missing_column
from teleop.recording.stream import RecordingStream

if TYPE_CHECKING:
    from pydantic import TypeAdapter

MEASURED = ("time", "paired_position", "paired_force", "paired_dt")
"""Columns of a recording that the estimators need: time, position, force, and time since the
previous sample."""
SECTION = 16.0
"""Duration of a section of a long recording [s]. The batch evaluation needs several cycles of the
palpation. Therefore, the duration of a section is constant, not its number of samples."""
SECTIONS = 5
"""Largest number of sections of a recording that are kept in memory."""
LAST = 1 << 15
"""Approximate largest number of ticks at the end of a recording whose columns are kept."""


class Sections:
    """Stores evenly spaced sections of a long recording, to limit the memory.

    The samples arrive in blocks. They are divided into sections of the duration `SECTION` [s], and
    at most `SECTIONS` sections are stored. If one more section must be stored, every second section
    is dropped. From then on, only half as many of the new sections are stored. The number of
    samples in a section is computed from the median sample period of the first block.
    """

    def __init__(self) -> None:
        self.count = 0
        """Number of all samples that were added, including those that were dropped."""
        self._size = 0
        self._every = 1
        self._kept: dict[int, list[Floats]] = {}

    def add(self, samples: Floats) -> None:
        """Add the next samples of the recording."""
        if not self._size and samples.shape[1]:
            period = float(np.median(samples[MEASURED.index("paired_dt")]))
            self._size = max(1, round(SECTION / period))
        while samples.shape[1]:
            number, inside = divmod(self.count, self._size)
            part = samples[:, : self._size - inside]
            samples = samples[:, self._size - inside :]
            self.count += part.shape[1]
            if number % self._every == 0:
                self._kept.setdefault(number, []).append(part.copy())
            if len(self._kept) > SECTIONS:
                self._every *= 2
                self._kept = {i: one for i, one in self._kept.items() if i % self._every == 0}

    def samples(self) -> Floats:
        """Return the samples of all stored sections in one array of shape (channels, n).

        The sections follow one another in the order of time.
        """
        parts = [part for section in self._kept.values() for part in section]
        return np.concatenate(parts, axis=1) if parts else np.empty((len(MEASURED), 0))

    @property
    def starts(self) -> Sequence[int]:
        """Indices in the array of `samples` at which a section begins after a gap in time.

        They are the indices of the first sample of each stored section except the first section. If
        no section was dropped, there are no gaps, and the list is empty.
        """
        size = self._size
        return [] if self._every == 1 else list(range(size, len(self._kept) * size, size))


class Last:
    """Stores the end of a recording that arrives in blocks: about the last `LAST` ticks."""

    def __init__(self) -> None:
        self._blocks: deque[dict[str, Floats]] = deque()
        self._count = 0

    def add(self, block: dict[str, Floats]) -> None:
        """Add the next ticks: arrays of shape (n,) by name, of the same columns in each block."""
        size = len(next(iter(block.values()), ()))
        self._blocks.append({name: column.copy() for name, column in block.items()})
        self._count += size
        while self._count - self._first_size >= LAST:
            self._count -= self._first_size
            self._blocks.popleft()

    @property
    def _first_size(self) -> int:
        return len(next(iter(self._blocks[0].values()), ()))

    def columns(self, names: Iterable[str]) -> dict[str, Floats]:
        """Return columns of the stored ticks, by name.

        To save memory, the returned columns are removed from this object. Each column can therefore
        be returned only once.
        """
        return {
            name: np.concatenate([np.empty(0), *(block.pop(name) for block in self._blocks)])
            for name in names
        }


NEEDED = ("time", "dt", "dropped", "paired_position", "paired_force", "paired_dt")
"""Columns that are needed to evaluate a recorded trial."""

NOTHING: Floats = np.empty(0)


class RecordedSamples(Samples):
    """The samples of a recorded trial for the evaluation, read from the file.

    The file is read when the object is made, and again by `blocks`. If the recording is long, the
    attribute `signals` contains only evenly spaced sections of it (see `Sections`). Their number
    and duration are limited. The required memory therefore does not increase with the duration of
    the recording, but it increases with the sampling rate. The attribute `recording` has the
    columns whose names `is_wanted` accepts.
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
        """The recording, with the columns that `is_wanted` selects. If the recording is long, only
        its last ticks are kept (see `Last`)."""
        t, x, f, dt = sections.samples()
        gaps = with_gaps(t, dt, ends_of(stream.gaps), sections.starts)
        super().__init__(Signals(t, x, f, dt, "slave_position", gaps))
        self.count = sections.count

    def blocks(self) -> Iterator[Block]:
        """Read the file again, and yield all samples in blocks, with their recorded estimates."""
        stream = RecordingStream(self._path)
        names = estimators_in(stream.units)
        columns = [f"{name}_{symbol}" for name in names for symbol in "bk"]
        ends = ends_of(self.recording.gaps)
        read = stream.blocks(lambda name: name in MEASURED or name in columns)
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
    """Return the n samples for the estimators in a block of ticks of the control loop.

    Ticks without a sample are omitted. The rows are `MEASURED`, and then the columns `further`,
    which are NaN if the estimators had failed during the trial.
    """
    part = ~np.isnan(block["paired_dt"])
    samples = np.stack([block[name][part] for name in (*MEASURED, *further)])
    for name, channel in zip(MEASURED, samples, strict=False):
        if not (np.abs(channel) < LARGEST).all():
            raise InputError(f"the recording's {name} is not finite in every sample")
    if not (samples[MEASURED.index("paired_dt")] >= SHORTEST_PERIOD).all():
        raise InputError(
            f"the recording's paired_dt is not {SHORTEST_PERIOD:g} s or more in every sample"
        )
    return samples


def ends_of(gaps: Iterable[Gap]) -> list[float]:
    """Return the end of each gap: the time of the first recorded tick after the gap [s].

    In a gap, ticks of the control loop are missing in the recording. A gap at the end of the
    recording has no end, and is omitted.
    """
    return [gap.end for gap in gaps if gap.end is not None]


def with_gaps(
    t: Floats,
    dt: Floats,
    ends: Sequence[float],
    starts: Sequence[int] = (),
    before: Floats = NOTHING,
) -> tuple[int, ...]:
    """Return the index of the first sample after each gap, and correct `dt` at this sample.

    In a gap, samples are missing. The first sample after a gap has a recorded `dt` that is too
    short: it is the time since the last missing sample. It is replaced by the time since the last
    sample before the gap. The array `dt` is changed in place.

    A gap ends at a time in `ends` [s], or at an index in `starts`. `before` is the time of the last
    sample before these n samples [s], shape (1,), or empty.
    """
    found = {int(i) for i in np.searchsorted(t, ends) if i < len(t)} | set(starts)
    for i in found:
        if i or len(before):
            dt[i] = t[i] - (t[i - 1] if i else before[0])
    return tuple(sorted(found))


def joined(blocks: Iterable[Floats], size: int) -> Iterator[Floats]:
    """Join arrays of successive samples, and divide them again into arrays of `size` samples.

    The last yielded array may contain fewer samples.
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


def recorded_signals(recording: Recording) -> Signals:
    """Return the measured samples of a recorded trial, as they were before the filters.

    In a gap of the recording, samples are missing. The first sample after a gap has a recorded
    period `paired_dt` that is too short: it is the time since the last missing sample. It is
    replaced by the time since the last sample before the gap.
    """
    t, x, f, dt = measured(recording.columns)
    return Signals(t, x, f, dt, "slave_position", with_gaps(t, dt, ends_of(recording.gaps)))


def recorded_settings(recording: Recording) -> EstimateSettings:
    """Return the settings that the estimators had in a recorded trial.

    With these settings, `teleop.evaluation.evaluate.evaluate` computes exactly the estimates that
    were recorded in the trial.
    """
    from pydantic import ValidationError

    settings = recording.settings
    try:
        made: EstimateSettings = validator(EstimateSettings).validate_python(
            {
                "datum": "file",
                "preset": validator(Preset).validate_python(settings["preset"]),
                "conditioning": settings["conditioning"],
                "bandwidth": settings["bandwidth_hz"],
                # Earlier versions corrected the online estimates for the stated lag only, and
                # others for every lag as one of first order: they recorded no `delay_share`.
                "online": settings.get("online_transmission")
                or {"force_lag": settings["force_lag_s"]},
                "whole": True,
                "resolution": settings["encoder_resolution_m"],
                "cube": settings.get("cube") or EstimateSettings.cube,
            }
        )
        return made
    except KeyError as error:
        raise InputError(f"the recording lacks the setting {error} of the estimators") from error
    except ValidationError as error:
        raise InputError(
            "the recording has invalid settings of the estimators: " + invalid_parts(error)
        ) from error


@cache
def validator(kind: type) -> TypeAdapter[Any]:
    """Return the object of the library pydantic that checks values of the class `kind`.

    It is made in the first call for each class, and is used again in later calls.
    """
    from pydantic import TypeAdapter

    return TypeAdapter(kind)
