"""Add a recording to a data set in the layout Motion-BIDS (Brain Imaging Data Structure).

The specification is at https://bids-specification.readthedocs.io, version 1.10, section Motion. The
subject is the specimen, the task the control condition, and the tracking system the rig. Each
column of the recording is a channel.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from operator import itemgetter
from pathlib import Path
from typing import Any

from teleop.errors import InputError
from teleop.files import make_folder, new_file, unreadable, write_text
from teleop.json_documents import dumps
from teleop.recording.stream import RecordingStream
from teleop.streams.message import FIELD

VERSION = "1.10.0"
"""Version of the specification."""
MISSING = "n/a"
TYPES = {"m": "POS", "m/s": "VEL"}
"""Type of a channel by its unit; other channels are miscellaneous."""
FRAME = "rig"
"""Name of the frame of reference: one axis, positive into the specimen."""
PARTICIPANT = {
    "participant_id": "The specimen",
    "specimen": "Name of the specimen",
    "species": "Species from which the specimen was taken",
    "material": "What the specimen consists of",
    "preparation": "How the specimen was prepared and kept",
}
"""Columns of the table of the specimens, with their meaning."""
EVENT = {
    "trial_type": "Mode of the safety supervisor after the event",
    "text": "Description of the event",
    "fault": "Kind of fault; n/a if there was none",
}
"""Columns of the table of the events, besides onset and duration, with their meaning."""


def add_to_dataset(file: Path, folder: Path) -> tuple[Path, RecordingStream]:
    """Add a recording to a data set, which is created if there is none.

    A recording of the same specimen and condition becomes a further run. Existing runs are never
    replaced.

    Parameters
    ----------
    file
        The recording.
    folder
        Folder of the data set.

    Returns
    -------
    tuple
        File with the samples, `..._motion.tsv`, and the recording.

    Raises
    ------
    InputError
        The recording is not complete, or a file of the data set cannot be read or written.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file: expected a folder")
    recording = RecordingStream(file)
    start = math.nan
    for block in recording.blocks({"time"}.__contains__):
        start = float(block["time"][0]) if math.isnan(start) else start
    if math.isnan(start):
        raise InputError(f"{file}: no tick: expected a recording with samples")
    session, settings = recording.session, recording.settings
    subject = f"sub-{label(session.get('specimen', ''))}"
    stem = free_stem(
        folder / subject / "motion",
        f"{subject}_task-{label(task_of(settings))}_tracksys-{label(session.get('rig', ''))}",
    )
    channels = [
        channel(name, unit, meaning)
        for name, unit, meaning in FIELD.findall(recording.contents.definition)
    ]
    motion = stem.with_name(f"{stem.name}_motion.tsv")
    make_folder(motion)
    describe_dataset(folder, session)
    with new_file(motion) as out:
        for block in RecordingStream(file).blocks():
            block["time"] = block["time"] - start
            lines = zip(*(column.tolist() for column in block.values()), strict=True)
            for line in lines:
                out.write(("\t".join(map(number, line)) + "\n").encode())
    write_json(stem, "motion", sidecar(recording, channels, start))
    write_table(stem.with_name(f"{stem.name}_channels.tsv"), channels)
    write_json(stem, "channels", channel_columns())
    if events := sorted(recording.events, key=itemgetter("time")):
        rows = [event_row(event, start) for event in events]
        write_table(stem.with_name(f"{stem.name}_events.tsv"), rows)
        write_json(stem, "events", {name: {"Description": text} for name, text in EVENT.items()})
    add_row(
        folder / "participants.tsv",
        {
            "participant_id": subject,
            "specimen": session.get("specimen", MISSING),
            "species": MISSING,
            "material": session.get("material", MISSING),
            "preparation": session.get("preparation", MISSING),
        },
    )
    began = (
        datetime.fromisoformat(session["created"]).astimezone(UTC) if "created" in session else None
    )
    add_row(
        folder / subject / f"{subject}_scans.tsv",
        {
            "filename": f"motion/{motion.name}",
            "acq_time": f"{began:%Y-%m-%dT%H:%M:%SZ}" if began else MISSING,
        },
    )
    return motion, recording


def label(text: str) -> str:
    """Return a label of a file name, which has letters and digits only."""
    return re.sub("[^A-Za-z0-9]", "", text) or "unknown"


def task_of(settings: Mapping[str, Any]) -> str:
    """Return the name of the task: the condition, or the protocol."""
    if settings.get("protocol"):
        return "protocol"
    custom = settings.get("custom_condition")
    return str(custom["name"] if custom else settings.get("condition", ""))


def free_stem(folder: Path, name: str) -> Path:
    """Return the path of the next run, without its suffix."""
    run = 1
    while (stem := folder / f"{name}_run-{run:02d}").with_name(f"{stem.name}_motion.tsv").exists():
        run += 1
    return stem


def channel(name: str, unit: str, meaning: str) -> dict[str, str]:
    """Return the row of a column of the recording in the table of the channels."""
    kind = "LATENCY" if name == "time" else TYPES.get(unit, "MISC")
    moving = kind in TYPES.values()
    point = next((part for part in ("master", "slave") if part in name), "slave")
    if name == "time":
        meaning = "time since the first sample"
    return {
        "name": name,
        "component": "x" if moving else MISSING,
        "type": kind,
        "tracked_point": point if moving else MISSING,
        "units": MISSING if unit == "-" else unit,
        "reference_frame": FRAME if moving else MISSING,
        "description": meaning,
    }


def channel_columns() -> dict[str, Any]:
    """Return the description of the columns of the table of the channels."""
    axis = {
        "SpatialAxes": "___",
        "RotationRule": MISSING,
        "RotationOrder": MISSING,
        "Description": "One axis, positive into the specimen; 0 is the contact datum",
    }
    return {
        "reference_frame": {
            "Description": "Frame of reference of the motion",
            "Levels": {FRAME: axis},
        }
    }


def sidecar(
    recording: RecordingStream, channels: Sequence[Mapping[str, str]], start: float
) -> dict[str, Any]:
    """Return the metadata of a recording that was read, with all its settings."""
    session, settings = recording.session, recording.settings
    kinds = [one["type"] for one in channels]
    length = recording.last_time - start
    points = {one["tracked_point"] for one in channels} - {MISSING}
    known = {
        "InstitutionName": session.get("institution"),
        "SoftwareVersions": session.get("software"),
        "SamplingFrequencyEffective": (recording.ticks - 1) / length if length > 0.0 else None,
    }
    return {
        "TaskName": task_of(settings) or "unknown",
        "TaskDescription": "palpation with a 1-DOF telemanipulator, see teleop.settings",
        "SamplingFrequency": settings.get("loop_rate_hz") or 1000.0,
        "TrackingSystemName": session.get("rig", "unknown"),
        "RecordingDuration": length,
        "MissingValues": MISSING,
        "MotionChannelCount": len(channels),
        "TrackedPointsCount": len(points),
        **{f"{kind}ChannelCount": kinds.count(kind) for kind in sorted(set(kinds))},
        **{name: value for name, value in known.items() if value is not None},
        "teleop": {"session": dict(session), "settings": dict(settings)},
    }


def describe_dataset(folder: Path, session: Mapping[str, str]) -> None:
    """Write the files that describe a data set, unless they exist."""
    documents: dict[str, dict[str, Any]] = {
        "dataset_description.json": {
            "Name": session.get("title") or folder.resolve().name,
            "BIDSVersion": VERSION,
            "DatasetType": "raw",
            **({"License": session["licence"]} if "licence" in session else {}),
            **({"Authors": session["authors"].split("; ")} if "authors" in session else {}),
            **({"ReferencesAndLinks": [session["reference"]]} if "reference" in session else {}),
            "GeneratedBy": [
                {
                    "Name": "teleop",
                    "Version": session.get("software", "").removeprefix("teleop "),
                    "Description": "teleop export --bids",
                }
            ],
        },
        "participants.json": {name: {"Description": text} for name, text in PARTICIPANT.items()},
    }
    for name, document in documents.items():
        if not (folder / name).exists():
            write_text(folder / name, dumps(document, indent=2) + "\n")
    if not (folder / "README").exists():
        write_text(folder / "README", README)


README = """\
Palpation of specimens with a 1-DOF telemanipulator.

Each recording is a run: its samples are in ..._motion.tsv, the meaning and the SI unit of each
column in ..._channels.tsv, and the settings of the trial in ..._motion.json (teleop.settings).
The subject is the specimen, the task is the control condition, and the tracking system is the rig.
"""


def event_row(event: Mapping[str, Any], start: float) -> dict[str, str]:
    """Return the row of an event of the recording."""
    return {
        "onset": number(float(event["time"]) - start),
        "duration": "0",
        "trial_type": str(event["mode"]),
        "text": " ".join(str(event["text"]).split()) or MISSING,
        "fault": str(event.get("fault") or MISSING),
    }


def number(value: float) -> str:
    """Return a number with all digits, or n/a if it is not finite."""
    return repr(value) if math.isfinite(value) else MISSING


def write_json(stem: Path, suffix: str, document: Mapping[str, Any]) -> None:
    """Write a new JSON file of a run."""
    path = stem.with_name(f"{stem.name}_{suffix}.json")
    write_text(path, dumps(dict(document), indent=2) + "\n")


def write_table(path: Path, rows: Sequence[Mapping[str, str]], overwrite: bool = False) -> None:
    """Write a table whose columns are separated by tabs."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), delimiter="\t", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(path, text.getvalue(), overwrite)


def add_row(path: Path, row: Mapping[str, str]) -> None:
    """Add a row to a table, unless it has a row with the same first value."""
    rows: list[Mapping[str, str]] = []
    key = next(iter(row))
    if path.exists():
        try:
            with path.open(encoding="utf-8", newline="") as file:
                rows = list(csv.DictReader(file, delimiter="\t"))
        except (OSError, UnicodeDecodeError) as error:
            raise unreadable(path, OSError(str(error))) from error
        if rows and set(rows[0]) != set(row):
            raise InputError(f"{path}: expected the columns {', '.join(row)}")
    if row[key] not in [one[key] for one in rows]:
        write_table(path, [*rows, row], overwrite=True)
