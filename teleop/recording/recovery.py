"""Write the intact (undamaged) part of an incomplete recording to a new, complete recording."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from teleop.errors import InputError
from teleop.files import unwritable
from teleop.recording.gaps import Gap
from teleop.recording.mcap_reader import CUT, Contents, read_ticks
from teleop.recording.mcap_writer import McapFile
from teleop.recording.stream import RecordingStream
from teleop.streams.message import FIELD, TIME

CHUNK = 1000
"""Number of ticks per chunk of the new MCAP file."""


@dataclass(frozen=True)
class Recovery:
    """Result of the recovery of a recording whose file may be damaged."""

    ticks: int
    """Number of intact ticks."""
    duration: float
    """Time of the last intact tick [s]."""
    damage: str
    """Reason why the recording is not complete; empty if the recording is complete."""
    gaps: tuple[Gap, ...]
    """Parts of the recording with ticks that the recorder did not receive."""

    @property
    def loss(self) -> str:
        """Text that states why a part of the damaged recording cannot be recovered."""
        if self.damage == CUT:
            return f"the rest was cut off ({self.damage})"
        return f"the rest could not be read ({self.damage})"


def recover_recording(file: Path, out: Path) -> Recovery:
    """Write the intact part of an incomplete recording to a new file; none if it is complete."""
    stream = RecordingStream(file)
    stream.read_through()
    if not stream.ticks:
        raise InputError(f"{file}: no tick is intact: nothing can be recovered")
    contents = stream.contents
    if contents.damage:
        write_contents(out, contents, messages(file))
    return Recovery(stream.ticks, stream.last_time, contents.damage, stream.gaps)


def messages(file: Path) -> Iterator[bytes]:
    """Yield the recorded bytes of each intact tick."""
    for rows in read_ticks(file, Contents()):
        for row in rows:
            yield row.tobytes()


def write_contents(out: Path, contents: Contents, ticks: Iterable[bytes]) -> None:
    """Write a complete recording, with ticks and events in the order of their times.

    Each message of a tick is written before the next is requested, so that they need not be in
    memory together.
    """
    try:
        file = McapFile(
            out,
            FIELD.findall(contents.definition),
            contents.definition,
            contents.metadata,
        )
    except FileExistsError as error:
        raise InputError(f"{out}: exists already: choose another file with --out") from error
    except OSError as error:
        raise unwritable(out, error) from error
    file.begin(contents.start)
    events = contents.events[1:]  # McapFile.begin wrote the first event
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
