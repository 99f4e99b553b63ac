"""What a trial recorded: columns by name with their units, events, and the session's settings."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from estimation import Estimates, Regression
from estimation.compiled import Floats
from estimation.estimator import Series
from teleop.errors import InputError, MissingColumn
from teleop.recording.gaps import Gap, missing_ticks
from teleop.recording.mcap_reader import read_intact
from teleop.recording.mcap_writer import END
from teleop.recording.message import CDR

REGRESSOR = "regressor_"
"""How the names of columns of further regressors begin."""
FIELD = re.compile(r"float64 (\w+)(?:\s*#\s*\[([^]]*)\]\s*(.*))?")
"""A line of a tick's definition: name, unit, meaning."""


@dataclass(frozen=True)
class Recording:
    """A trial's ticks, events and settings.

    Examples
    --------
    >>> recording = load(path)  # doctest: +SKIP
    >>> recording["contact_force"], recording.units["contact_force"]  # doctest: +SKIP
    """

    columns: dict[str, Floats]
    """Every column by name, arrays of shape (ticks,) in SI units."""
    units: dict[str, str]
    """Unit of each column; - for none."""
    events: list[dict[str, Any]] = field(default_factory=list)
    """Changes of the safety mode, and faults."""
    session: dict[str, str] = field(default_factory=dict)
    """Software, machine, date."""
    settings: dict[str, Any] = field(default_factory=dict)
    """Settings of the trial."""
    gaps: tuple[Gap, ...] = ()
    """Where ticks are missing from the whole recording, because the recorder was too slow."""

    def __getitem__(self, name: str) -> Floats:
        """A column.

        Raises
        ------
        MissingColumn
            There is none of this name; names those that there are.
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
        return [name[:-2] for name in self.columns if name.endswith("_b")]

    @property
    def estimated_channels(self) -> list[str]:
        """The channels that an observer estimated: no sensor measured them."""
        told = self.session.get("estimated_channels", "none")
        return [] if told == "none" else told.split(", ")

    def estimated(self) -> Recording:
        """The ticks alone at which the estimators were given a sample."""
        part = np.isfinite(self["x"])
        columns = self.columns
        if not part.all():
            columns = {name: column[part] for name, column in columns.items()}
        return replace(self, columns=columns)

    def estimates(self) -> dict[str, Estimates]:
        """Each estimator's estimates."""
        nothing = np.full(len(self), np.nan)
        return {
            name: Estimates(
                self[f"{name}_b"],
                self[f"{name}_k"],
                self.columns.get(f"{name}_b_std", nothing),
                self.columns.get(f"{name}_k_std", nothing),
                self.columns.get(f"{name}_held", nothing) == 1.0,
                self._further(name),
            )
            for name in self.estimators
        }

    def _further(self, estimator: str) -> dict[str, Series]:
        """Its parameters besides b and k."""
        start = f"{estimator}_"
        names = [name.removeprefix(start) for name in self.columns if name.startswith(start)]
        told = [name.removesuffix("_std") for name in names if name.endswith("_std")]
        return {
            name: Series(self[start + name], self[f"{start}{name}_std"])
            for name in told
            if name not in ("b", "k") and "_" not in name
        }

    def regression(self) -> Regression:
        """What the estimators were given."""
        further = [column for name, column in self.columns.items() if name.startswith(REGRESSOR)]
        x, v, f, dt = (self[name] for name in ("x", "v", "f", "paired_dt"))
        return Regression(x, v, f, dt, np.reshape(further, (len(further), len(self))).T)


def from_messages(
    definition: str,
    messages: bytes | bytearray,
    events: list[dict[str, Any]],
    metadata: dict[str, dict[str, str]],
) -> Recording:
    """A recording from the messages of its ticks, one after the other."""
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


def gaps_of(columns: dict[str, Floats], in_all: str) -> tuple[Gap, ...]:
    """Where ticks are missing, of which `in_all` were dropped."""
    if not {"time", "dt", "dropped"} <= columns.keys():
        return ()
    count = int(in_all) if re.fullmatch(r"[0-9]{1,15}", in_all) else 0
    return missing_ticks(columns["time"], columns["dt"], columns["dropped"], count)


def load(path: Path | str) -> Recording:
    """Read a recording.

    Raises
    ------
    InputError
        The file cannot be read, is no recording of ours, or is not complete; the latter tells
        how to recover it.
    """
    path = Path(path)
    contents = read_intact(path)
    recording = from_messages(
        contents.definition, contents.messages, contents.events, contents.metadata
    )
    if contents.damage:
        kept = f"{recording['time'][-1]:.3f} s are intact" if len(recording) else "nothing is left"
        raise InputError(
            f"{path}: the recording is not complete ({contents.damage}): {kept}; "
            f"rescue them with: teleop recover {path}"
        )
    return recording


def salvage(path: Path) -> Recording | None:
    """What is intact of a recording; None for nothing."""
    try:
        contents = read_intact(path)
    except InputError:
        return None
    return from_messages(contents.definition, contents.messages, contents.events, contents.metadata)
