"""Recording of a trial: columns with their units, events, session and settings."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import Estimates, Regression
from estimation.compiled import Floats
from estimation.estimate_columns import estimates_in, estimators_in, misfit_in
from teleop.errors import InputError, MissingColumn
from teleop.recording.cdr import CDR
from teleop.recording.gaps import Gap, missing_ticks
from teleop.recording.mcap_reader import read_intact
from teleop.recording.mcap_writer import END
from teleop.recording.message import REGRESSOR

FIELD = re.compile(r"float64 (\w+)(?:\s*#\s*\[([^]]*)\]\s*(.*))?")
"""Pattern of a line in the definition of a tick's message: name, unit and meaning of a column."""


@dataclass(frozen=True)
class Recording:
    """Ticks, events and settings of a trial.

    Examples
    --------
    >>> recording = load(path)  # doctest: +SKIP
    >>> recording["contact_force"], recording.units["contact_force"]  # doctest: +SKIP
    """

    columns: dict[str, Floats]
    """Columns by name, each an array of shape (ticks,) in SI units."""
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
        """Return the column of a name, shape (ticks,).

        Raises
        ------
        MissingColumn
            There is no column of this name; the message lists the columns.
        """
        if name not in self.columns:
            raise MissingColumn(
                f"the recording has no column {name!r}: expected one of {', '.join(self.columns)}"
            )
        return self.columns[name]

    def __len__(self) -> int:
        return len(self["time"])

    @property
    def estimators(self) -> list[str]:
        """Names of the estimators."""
        return estimators_in(self.columns)

    @property
    def fault(self) -> dict[str, Any] | None:
        """Event of the first fault; None if there was no fault."""
        return next((event for event in self.events if event["fault"]), None)

    @property
    def estimated_channels(self) -> list[str]:
        """Names of the channels that an observer estimated. A sensor measured the others."""
        names = self.session.get("estimated_channels", "none")
        return [] if names == "none" else names.split(", ")

    def estimated(self) -> Recording:
        """Return a recording with only those ticks at which the estimators were updated."""
        return self.where(np.isfinite(self["x"]))

    def where(self, part: NDArray[np.bool_]) -> Recording:
        """Return a recording with only those ticks for which `part`, shape (ticks,), is True."""
        columns = self.columns
        if not part.all():
            columns = {name: column[part] for name, column in columns.items()}
        return replace(self, columns=columns)

    def estimates(self) -> dict[str, Estimates]:
        """Return the recorded estimates of each estimator, by its name."""
        return {name: estimates_in(self.columns, name) for name in self.estimators}

    def misfit(self, estimator: str) -> Floats:
        """Return the misfit of an estimator, shape (ticks,); NaN if it was not recorded."""
        return misfit_in(self.columns, estimator)

    def regression(self) -> Regression:
        """Return the samples of position, velocity and force that the estimators received."""
        further = [column for name, column in self.columns.items() if name.startswith(REGRESSOR)]
        x, v, f, dt = (self[name] for name in ("x", "v", "f", "paired_dt"))
        return Regression(x, v, f, dt, np.reshape(further, (len(further), len(self))).T)


def from_messages(
    definition: str,
    messages: bytes | bytearray,
    events: list[dict[str, Any]],
    metadata: dict[str, dict[str, str]],
) -> Recording:
    """Return a recording from the messages of its ticks.

    Parameters
    ----------
    definition
        Definition of the message in the message definition language of ROS 2.
    messages
        Messages of all ticks, one after another.
    events
        Events of the trial.
    metadata
        Named records of text about the session.
    """
    fields = FIELD.findall(definition)
    rows = np.frombuffer(messages, dtype=np.uint8).reshape(-1, len(CDR) + 8 * len(fields))
    values = np.ascontiguousarray(rows[:, len(CDR) :].T.reshape(len(fields), 8, -1).swapaxes(1, 2))
    table = values.view("<f8").reshape(len(fields), -1)
    columns = {name: table[i] for i, (name, _, _) in enumerate(fields)}
    return Recording(
        columns=columns,
        units={name: unit for name, unit, _ in fields},
        events=events,
        session=metadata.get("session", {}),
        settings=json.loads(metadata.get("settings", {}).get("json", "{}")),
        gaps=gaps_of(columns, metadata.get(END, {}).get("dropped", "")),
    )


def gaps_of(columns: dict[str, Floats], total_dropped: str) -> tuple[Gap, ...]:
    """Return the gaps of a recording: the parts in which ticks are missing.

    Parameters
    ----------
    columns
        Columns of the recording, each of shape (ticks,).
    total_dropped
        Number of all dropped ticks, as text from the file. Another text counts as 0.
    """
    if not {"time", "dt", "dropped"} <= columns.keys():
        return ()
    count = int(total_dropped) if re.fullmatch(r"[0-9]{1,15}", total_dropped) else 0
    return missing_ticks(columns["time"], columns["dt"], columns["dropped"], count)


def load(path: Path | str) -> Recording:
    """Read a recording from an MCAP file.

    Raises
    ------
    InputError
        The file cannot be read, is not a recording of `teleop run`, or is not complete. If it is
        not complete, the message states the command that recovers its intact part.
    """
    path = Path(path)
    contents = read_intact(path)
    recording = from_messages(
        contents.definition, contents.messages, contents.events, contents.metadata
    )
    if contents.damage:
        kept = (
            f"{recording['time'][-1]:.3f} s are intact" if len(recording) else "no tick is intact"
        )
        raise InputError(
            f"{path}: the recording is not complete ({contents.damage}): {kept}; "
            f"recover it with: teleop recover {path}"
        )
    return recording


def load_intact(path: Path) -> Recording | None:
    """Read the intact part of a recording from an MCAP file; return None if no part is intact."""
    try:
        contents = read_intact(path)
    except InputError:
        return None
    return from_messages(contents.definition, contents.messages, contents.events, contents.metadata)
