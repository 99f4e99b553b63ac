"""What is intact of a recording that was cut off, as a complete recording."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from teleop.errors import InputError
from teleop.files import unwritable
from teleop.recording.gaps import Gap
from teleop.recording.mcap_reader import CUT, Contents, read_intact
from teleop.recording.mcap_writer import McapFile
from teleop.recording.message import CDR, TIME
from teleop.recording.recording import FIELD, from_messages

CHUNK = 1000
"""Ticks after which a chunk is written."""


@dataclass(frozen=True)
class Recovery:
    """What could be had of a recording."""

    ticks: int
    duration: float
    """Time of the last tick that is intact [s]."""
    damage: str
    """Why the recording is not complete; empty if it is."""
    gaps: tuple[Gap, ...]
    """Where ticks are missing that the recorder never got."""

    @property
    def lost(self) -> str:
        """What became of the rest."""
        if self.damage == CUT:
            return f"the rest was cut off ({self.damage})"
        return f"the rest could not be read ({self.damage})"


def recover_recording(file: Path, out: Path) -> Recovery:
    """Write what is intact of a recording to a new file; nothing if it is complete.

    Raises
    ------
    InputError
        The file cannot be read or is no recording of ours, nothing of it is intact, or the new
        file exists or cannot be written.
    """
    contents = read_intact(file)
    ticks = list(messages(contents))
    gaps = from_messages(contents.definition, contents.messages, [], contents.metadata).gaps
    if not ticks:
        raise InputError(f"{file}: no tick is intact: nothing can be recovered")
    recovery = Recovery(len(ticks), TIME.unpack_from(ticks[-1])[0], contents.damage, gaps)
    if contents.damage:
        write_contents(out, contents, ticks)
    return recovery


def messages(contents: Contents) -> Iterator[bytes]:
    """The message of each tick."""
    size = len(CDR) + 8 * len(FIELD.findall(contents.definition))
    for place in range(0, len(contents.messages), size):
        yield bytes(contents.messages[place : place + size])


def write_contents(out: Path, contents: Contents, ticks: list[bytes]) -> None:
    """Write a complete recording, every event before the first tick that is later."""
    try:
        file = McapFile(
            out,
            FIELD.findall(contents.definition),
            contents.definition,
            contents.metadata,
        )
    except FileExistsError as error:
        raise InputError(f"{out}: exists already: give another file with --out") from error
    except OSError as error:
        raise unwritable(out, error) from error
    file.begin(contents.start)
    events = contents.events[1:]  # the file begins with the first of itself
    for number, message in enumerate(ticks, start=1):
        t = TIME.unpack_from(message)[0]
        while events and events[0]["time"] < t:
            file.event(events.pop(0))
        file.tick(message, t)
        if number % CHUNK == 0:
            file.flush()
    for event in events:
        file.event(event)
    file.close()
    if file.error:
        out.unlink(missing_ok=True)
        raise unwritable(out, file.error) from file.error
