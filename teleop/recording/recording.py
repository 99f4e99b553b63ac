"""Read the recording of a trial, which contains columns with units, events and settings."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from estimation import Estimates, Regression
from estimation.arrays import Floats
from estimation.estimate_columns import estimates_in, estimators_in, misfit_in
from teleop.errors import MissingColumn
from teleop.recording.gaps import Gap, missing_ticks
from teleop.recording.mcap_checks import check_memory
from teleop.recording.stream import OF_GAPS, RecordingStream
from teleop.safety import Fault
from teleop.streams.columns import REGRESSOR, Schema
from telepalpation import needs

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, repr=False)
class Recording:
    """Ticks, events and settings of a recorded trial, in memory.

    The recorded values form columns, with one value per tick.

    Examples
    --------
    >>> recording = load(path)  # doctest: +SKIP
    >>> recording["contact_force"], recording.units["contact_force"]  # doctest: +SKIP
    """

    columns: dict[str, Floats]
    """Columns by name. Each column is an array of shape (ticks,), in SI units."""
    units: dict[str, str]
    """Unit of each column, by its name; `-` for a column without a unit."""
    events: list[dict[str, Any]] = field(default_factory=list)
    """Changes of the mode of the safety supervisor, and faults."""
    session: dict[str, str] = field(default_factory=dict)
    """Texts about the session by name, for example software, machine and date."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the trial."""
    gaps: tuple[Gap, ...] = ()
    """Parts of the recording in which ticks are missing, because the recorder was too slow."""

    def __getitem__(self, name: str) -> Floats:
        """Return the column with a given name, shape (ticks,).

        Raises
        ------
        MissingColumn
            There is no column with this name. The error message lists all columns.
        """
        if name not in self.columns:
            raise missing_column(name, self.columns)
        return self.columns[name]

    def __contains__(self, name: object) -> bool:
        """Return whether there is a column with a given name."""
        return name in self.columns

    def __len__(self) -> int:
        return len(self["time"])

    @property
    def estimators(self) -> list[str]:
        """Names of the estimators whose estimates were recorded."""
        return estimators_in(self.columns)

    @property
    def fault(self) -> dict[str, Any] | None:
        """Event of the reported fault (see `reported_fault`); None if there was no fault.

        A fault is a problem for which the safety supervisor stops the drives.
        """
        return reported_fault(self.events)

    @property
    def estimated_channels(self) -> list[str]:
        """Names of the channels that have no sensor, for example `contact_force`.

        An observer estimated the values of these channels.
        """
        names = self.session.get("estimated_channels", "none")
        return [] if names == "none" else names.split(", ")

    def blocks(self, is_wanted: Callable[[str], bool] = bool) -> Iterator[Recording]:
        """Yield this whole recording once: `RecordingFile` has the same method."""
        yield self

    def evenly_spaced(self) -> Recording:
        """Return this whole recording. `RecordingFile` returns a selection, to save memory."""
        return self

    def load(self) -> Recording:
        """Return this recording: `RecordingFile` has the same method."""
        return self

    def estimated(self) -> Recording:
        """Return a recording that contains only the ticks at which the estimators were updated."""
        return self.where(np.isfinite(self["x"]))

    def where(self, part: NDArray[np.bool_]) -> Recording:
        """Return a recording of the ticks for which `part`, Boolean of shape (ticks,), is True."""
        columns = self.columns
        if not part.all():
            columns = {name: column[part] for name, column in columns.items()}
        return replace(self, columns=columns)

    def estimates(self) -> dict[str, Estimates]:
        """Return the recorded estimates of all estimators, by the name of the estimator."""
        return {name: estimates_in(self.columns, name) for name in self.estimators}

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the columns as a pandas table with one row per tick. The index is the time [s].

        Raises
        ------
        ImportError
            pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise ImportError(needs("a data frame", "pandas", "notebook")) from error

        columns = {name: values for name, values in self.columns.items() if name != "time"}
        return pandas.DataFrame(columns, index=pandas.Index(self["time"], name="time"))

    def __repr__(self) -> str:
        """Return one line with the number of ticks, the estimators, the rig and the date."""
        about = [f"{len(self)} ticks", f"estimators {', '.join(self.estimators) or 'none'}"]
        about += [self.session[name] for name in ("rig", "created") if name in self.session]
        return f"Recording({'; '.join(about)})"

    def misfit(self, estimator: str) -> Floats:
        """Return the misfit of an estimator, shape (ticks,); NaN if it was not recorded.

        The misfit is the systematic part of the force error, divided by the force.
        """
        return misfit_in(self.columns, estimator)

    def regression(self) -> Regression:
        """Return the samples of displacement, velocity and force that the estimators received.

        If the model of the specimen has more regressors, the samples of these are also returned.
        """
        further = [column for name, column in self.columns.items() if name.startswith(REGRESSOR)]
        x, v, f, dt = (self[name] for name in ("x", "v", "f", "paired_dt"))
        return Regression(x, v, f, dt, np.reshape(further, (len(further), len(self))).T)


def missing_column(name: str, columns: Iterable[str]) -> MissingColumn:
    """Return an error for a recording without a column `name`. Its message lists `columns`."""
    return MissingColumn(
        f"the recording has no column {name!r}: expected one of {', '.join(columns)}"
    )


def from_columns(
    schema: Schema,
    columns: dict[str, Floats],
    events: list[dict[str, Any]],
    metadata: Mapping[str, Mapping[str, str]],
) -> Recording:
    """Return a recording from the columns of a stream, and its other data."""
    return Recording(
        columns=columns,
        units={column.name: column.unit for column in schema.columns},
        events=events,
        session=dict(metadata.get("session", {})),
        settings=json.loads(metadata.get("settings", {}).get("json", "{}")),
        gaps=gaps_of(columns),
    )


def reported_fault(events: Sequence[dict[str, Any]]) -> dict[str, Any] | None:
    """Return the event of the fault that a trial reports; None if there was no fault.

    This is the first fault, because later faults can be its effects. There is one exception: if the
    slave moved after the stop, this is reported.
    """
    faults = [event for event in events if event["fault"]]
    worst = (event for event in faults if event["fault"] == Fault.MOVES_AFTER_STOP)
    return next(worst, faults[0] if faults else None)


def stated_settings(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return recorded settings whose condition is that of the trial.

    It is the class of the user, or the protocol, if there was one.
    """
    custom, protocol = settings.get("custom_condition"), settings.get("protocol")
    if custom or protocol:
        return {**settings, "condition": custom["name"] if custom else "protocol"}
    return dict(settings)


def gaps_of(columns: dict[str, Floats], total_dropped: int = 0) -> tuple[Gap, ...]:
    """Return the gaps of a recording; none if a column of `OF_GAPS` is missing."""
    if not columns.keys() >= set(OF_GAPS):
        return ()
    t, dt, dropped = (columns[name] for name in OF_GAPS)
    return missing_ticks(t, dt, dropped, total_dropped)


def load(path: Path | str, is_wanted: Callable[[str], bool] = bool) -> Recording:
    """Read a recording from an MCAP file.

    Parameters
    ----------
    path
        The file.
    is_wanted
        Function that takes the name of a column and returns whether to read this column. By
        default, all columns are read.

    Raises
    ------
    InputError
        The file cannot be read, is not a recording of `teleop run`, or is not complete, or the
        columns are too large for the memory of this machine. If the recording is not complete, the
        message states the command that recovers the intact part.
    """
    stream = RecordingStream(Path(path))
    return stored(stream, stream.blocks(is_wanted))


def load_intact(path: Path) -> Recording:
    """Read the intact part of a recording into memory."""
    stream = RecordingStream(path)
    return stored(stream, stream.intact_blocks())


def stored(stream: RecordingStream, blocks: Iterable[dict[str, Floats]]) -> Recording:
    """Join the blocks of a stream of which none was read, and return one recording in memory."""
    parts: dict[str, list[Floats]] = {}
    size = 0
    for block in blocks:
        for name, column in block.items():
            parts.setdefault(name, []).append(column.copy())
            size += column.nbytes
        check_memory(stream.path, size)
    if not parts:
        parts = {name: [np.empty(0)] for name in stream.units}
    columns = {name: np.concatenate(parts.pop(name)) for name in list(parts)}
    return Recording(
        columns=columns,
        units={name: unit for name, unit in stream.units.items() if name in columns},
        events=stream.events,
        session=stream.session,
        settings=stream.settings,
        gaps=stream.gaps,
    )
