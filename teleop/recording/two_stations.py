"""Merge the recordings of two stations into one, on the clock of the slave.

The estimates of k and b need position and contact force of the slave, which one clock stamps. The
offset between the clocks of the stations shifts only what comes from the master. Its error is at
most half of the width of its interval, which the merged recording contains at each tick.
"""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from estimation.arrays import Floats
from estimation.estimate_columns import Column
from teleop.errors import InputError
from teleop.recording.black_box import write_black_box
from teleop.recording.recording import Recording
from teleop.recording.recording_file import RecordingFile
from teleop.safety import Mode
from teleop.streams.columns import COLUMNS, FEEDBACK_COLUMNS, STATION_COLUMNS

OF_MASTER = (
    "master_force",
    "master_position",
    "master_force_age",
    "master_position_age",
    "drive_force",
    "target",
    "desired_master_velocity",
    "commanded_master_velocity",
    "applied_master_velocity",
    "displayed_force",
    "model_stiffness",
    "model_stiffening",
    "model_damping",
    "tank",
    "port_energy",
    "slave_energy",
    "report_age",
)
"""Columns that the master records, and the slave does not."""
SETTINGS_OF_MASTER = ("condition", "signal", "count_in_s", "operator_model", "force_master")
"""Settings that concern the master only."""
COUNTS = ("lost", "overtaken", "rejected")
OF_CONNECTION = (
    "round_trip",
    "offset_low",
    "offset_high",
    *(f"{name}_datagrams" for name in COUNTS),
)
"""Columns that `connection_summary` needs."""
NOTE = "master station"
"""Source of the events of the master in a merged recording."""


def side_of(recording: Recording) -> str:
    """Return the side of the station that made a recording; empty if it was no station."""
    station = recording.settings.get("station") or {}
    return str(station.get("side", ""))


def merge(one: Recording, two: Recording) -> Recording:
    """Return one recording with the ticks of the slave and the columns of the master.

    Parameters
    ----------
    one, two
        The recordings of both stations of a session, in any order.

    Raises
    ------
    InputError
        They are not the recordings of a master and a slave of the same session.
    """
    recordings = {side_of(recording): recording for recording in (one, two)}
    if recordings.keys() != {"master", "slave"}:
        found = ", ".join(side_of(recording) or "no station" for recording in (one, two))
        raise InputError(
            f"recordings of {found}: expected those of a master station and a slave station"
        )
    master, slave = recordings["master"], recordings["slave"]
    sessions = [recording.settings["station"]["session"] for recording in (master, slave)]
    if sessions[0] != sessions[1]:
        raise InputError(
            f"recordings of the sessions {sessions[0]} and {sessions[1]}: expected the same session"
        )
    low, high = common_interval(master, slave)
    clock = slave["station_clock"] - 0.5 * (low + high)
    columns = dict(slave.columns)
    times = master["station_clock"]
    known = np.isfinite(times)
    for name in OF_MASTER:
        if name in master and name in columns:
            columns[name] = interpolated(clock, times[known], master[name][known])
    columns["offset_low"], columns["offset_high"] = low, high
    if not np.isfinite(clock).any():
        raise InputError("the offset of the clocks was never measured: expected a longer session")
    first = int(np.flatnonzero(np.isfinite(clock))[0])
    shift = slave["time"][first] - clock[first] + times[known][0] - master["time"][known][0]
    events = [
        {**event, "time": event["time"] + shift, "fault": None, "source": NOTE}
        | {"text": f"{NOTE}: {event['text']}"}
        for event in master.events
    ]
    settings: dict[str, Any] = dict(slave.settings)
    settings |= {name: master.settings.get(name) for name in SETTINGS_OF_MASTER}
    settings["station"] = {**slave.settings["station"], "side": "both"}
    session = dict(slave.session)
    session |= {
        name: master.session[name] for name in ("hand_force", "operator") if name in master.session
    }
    both = sorted([*slave.events, *events], key=lambda event: event["time"] or 0.0)
    return replace(slave, columns=columns, events=both, settings=settings, session=session)


def common_interval(master: Recording, slave: Recording) -> tuple[Floats, Floats]:
    """Return the interval of the slave's clock minus the master's at each tick of the slave [s].

    It is that of the slave, made narrower by that of the master at about the same time.
    """
    low, high = finite(slave["offset_low"]), finite(slave["offset_high"])
    clock = slave["station_clock"] - 0.5 * (low + high)
    ends = []
    for name in ("offset_high", "offset_low"):
        values, times = -finite(master[name]), master["station_clock"]
        ends.append(interpolated(clock, times, values))
    low = np.fmax(low, ends[0])
    high = np.fmin(high, ends[1])
    unknown = ~np.isfinite(low + high)
    return np.where(unknown, np.nan, low), np.where(unknown, np.nan, high)


def interpolated(at: Floats, times: Floats, values: Floats) -> Floats:
    """Return values at other times, linear between two finite ones; NaN outside and beside NaN."""
    result: Floats = np.interp(at, times, finite(values), left=np.nan, right=np.nan)
    return result


def finite(values: Floats) -> Floats:
    """Return values with NaN in place of infinity."""
    return np.where(np.isfinite(values), values, np.nan)


def write_merged(path: Path, merged: Recording) -> None:
    """Write a merged recording to a file."""
    known = {one.name: one.meaning for one in (*COLUMNS, *FEEDBACK_COLUMNS, *STATION_COLUMNS)}
    columns = tuple(
        Column(name, unit, known.get(name, "as in the recording of the slave station"))
        for name, unit in merged.units.items()
    )
    metadata = {"session": merged.session, "settings": {"json": json.dumps(merged.settings)}}
    created = datetime.fromisoformat(merged.session["created"])
    write_black_box(path, columns, merged, metadata, round(created.timestamp() * 1e9))


def connection_summary(recording: Recording | RecordingFile) -> dict[str, Any]:
    """Return what a station has measured of its connection while the drives were armed.

    The result is empty if they were not. All times are in s.
    """
    columns = {name: [np.empty(0)] for name in OF_CONNECTION}
    for block in recording.blocks(lambda name: name in ("mode", *OF_CONNECTION)):
        active = block["mode"] == Mode.ACTIVE
        for name, parts in columns.items():
            parts.append(block[name][active])
    trip, low, high, *counts = (np.concatenate(parts) for parts in columns.values())
    known = np.isfinite(trip + low + high)
    if not known.any():
        return {}
    return {
        "round_trip_s": float(np.median(trip[known])),
        "round_trip_largest_s": float(np.max(trip[known])),
        "offset_low_s": float(low[known][-1]),
        "offset_high_s": float(high[known][-1]),
        **{name: int(one[-1]) for name, one in zip(COUNTS, counts, strict=True)},
    }
