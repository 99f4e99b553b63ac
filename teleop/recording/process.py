"""The recorder process, which receives data from the control process and writes an MCAP file.

    python -m teleop.recording.process

Standard input is a pipe: the length of a JSON document (`HEAD`), the document, which describes the
session, and then frames. A frame has a kind, a length (`FRAME`) and a content. When the file is
open, and again at the end, a status (one line of JSON) is written to standard output. When the
control process closes the pipe, exits or is killed, all ticks that were written to the pipe are
recorded.
"""

from __future__ import annotations

import json
import math
import os
import struct
import sys
import time
from pathlib import Path
from typing import Any

from teleop.errors import reason
from teleop.live.progress import Cue, Progress, Shown, Status
from teleop.recording.mcap_writer import McapFile
from teleop.recording.message import TIME, packer
from teleop.safety.events import Mode, is_note

HEAD = struct.Struct("<I")
"""Layout of the first bytes on the pipe: length of the JSON document [bytes]."""
FRAME = struct.Struct("<cH")
"""Layout of the start of a frame: kind of the frame, and length of the frame's content [bytes]."""
TICK, EVENT, BEGIN, END = b"T", b"E", b"B", b"N"
"""Kinds of frame: a tick, an event, the beginning of the trial, and the end of the trial."""
NUMBER = struct.Struct("<q")
"""Layout of the content of a frame BEGIN or END: one integer.

In a frame BEGIN, the integer is the wall-clock time of the beginning of the trial [ns]. In a frame
END, it is the number of dropped ticks.
"""


def number_frame(kind: bytes, number: int) -> bytes:
    """Return a frame BEGIN (wall-clock time of t = 0 [ns]) or END (dropped ticks)."""
    return FRAME.pack(kind, NUMBER.size) + NUMBER.pack(number)


CHECK = 1.0
"""Time between two checks whether the file is still at its path [s]."""
NAP = 0.02
"""Time between two reads of the pipe [s].

The recorder sleeps for this time instead of waiting for data. Otherwise, each write of the control
process to the pipe would have to wake the recorder, which would delay the control process.
"""
FLUSH = 0.25
"""Time between two flushes of the file [s].

Each flush ends a chunk (block of records) of the file. For each chunk, 200 bytes stay in memory
until the end of the trial. A shorter time would need more memory and would have no advantage: if
the recorder is killed, the recording is not complete in any case.
"""
BULK = 1 << 16
"""Largest number of bytes that are read from the pipe at a time."""


def send(**status: Any) -> None:
    """Send the status of the recording to the control process, unless that has ended.

    `problem` is a text, or empty. At the end, `at_path` states whether the file is still at its
    path.
    """
    try:
        print(json.dumps(status), flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def read_session() -> dict[str, Any]:
    """Return the description of the session. Raise an EOFError if the pipe was closed before."""
    pipe = sys.stdin.fileno()

    def exactly(count: int) -> bytes:
        got = b""
        while len(got) < count:
            part = os.read(pipe, count - len(got))
            if not part:
                raise EOFError
            got += part
        return got

    session: dict[str, Any] = json.loads(exactly(HEAD.unpack(exactly(HEAD.size))[0]))
    return session


class FrameReader:
    """Divides the data of the pipe into frames, for the recording file and the progress line."""

    def __init__(self, session: dict[str, Any], file: McapFile | None, progress: Progress) -> None:
        self.ticks = 0
        self._file = file
        self._progress = progress
        self._estimators = session["estimators"]
        self._names = [name for name, _, _ in session["columns"]]
        self._message = packer(self._names)
        self._last = b""
        self._rest = b""
        self._level = session["level"]
        """Half width of the 95 % interval, in standard deviations."""
        self._estimates: list[Shown] = []

    def process(self, data: bytes) -> None:
        """Process the next bytes. An incomplete frame at their end waits for the next call."""
        data = self._rest + data
        place, end = 0, len(data)
        while end - place >= FRAME.size:
            kind, length = FRAME.unpack_from(data, place)
            if end - place < FRAME.size + length:
                break
            place += FRAME.size
            frame = data[place : place + length]
            place += length
            if kind == TICK:
                self.ticks += 1
                t = TIME.unpack_from(frame)[0]
                if self._file:
                    self._file.tick(frame, t)
                self._last = frame
                self._progress.show(t, self._status)
            elif kind == EVENT:
                event = json.loads(frame)
                if is_note(event["fault"], event["source"]):
                    self._progress.note = event["text"]
                if self._file:
                    self._file.event(event)
            elif self._file and kind == BEGIN:
                self._file.begin(*NUMBER.unpack(frame))
            elif self._file and kind == END:
                self._file.end(*NUMBER.unpack(frame))
        self._rest = data[place:]

    def _status(self) -> Status:
        _, *values = self._message.unpack(self._last)
        tick = dict(zip(self._names, values, strict=True))
        mode = Mode(int(tick["mode"]))
        estimates = [
            Shown(
                name,
                tick[f"{name}_k"],
                self._level * tick[f"{name}_k_std"],
                tick[f"{name}_b"],
                self._level * tick[f"{name}_b_std"],
                tick[f"{name}_misfit"],
            )
            for name in self._estimators
        ]
        without_sample = all(math.isnan(one.k) for one in estimates)
        if not (without_sample and mode is Mode.ACTIVE):
            self._estimates = estimates
        return Status(
            mode.name.lower(),
            tick["target"],
            tick["slave_position"],
            None if tick["contact"] == 0.0 else self._estimates,
        )


def main() -> None:
    """Run the recorder process: record until the control process closes the pipe."""
    try:
        session = read_session()
    except EOFError:
        return
    file = None
    if session["path"]:
        try:
            file = McapFile(
                Path(session["path"]),
                session["columns"],
                session["definition"],
                session["metadata"],
                session["overwrite"],
            )
        except OSError as refusal:
            send(problem=reason(refusal))
            return
    send(problem="")
    progress = Progress(
        session["show"],
        session["duration"],
        session["hint"],
        session["instructions"],
        session["largest_misfit"],
        Cue(*session["cue"]) if session["cue"] else None,
    )
    frames = FrameReader(session, file, progress)
    monitor = FileMonitor(session["path"], file, progress) if file else None
    pipe = sys.stdin.fileno()
    if hasattr(os, "set_blocking"):
        os.set_blocking(pipe, False)
    while True:
        try:
            data = os.read(pipe, BULK)
        except BlockingIOError:
            data = None
        if data == b"":
            break
        if data:
            frames.process(data)
        if monitor:
            monitor.update()
        if not data or len(data) < BULK:
            time.sleep(NAP)
    status = finish(file, frames.ticks) if file else {"problem": ""}
    progress.close()
    send(**status)


class FileMonitor:
    """Flushes the file once per `FLUSH`, and reports the first problem of the recording.

    A problem is a write error or, checked once per `CHECK`, a file that is no longer at its path.
    """

    def __init__(self, path: str, file: McapFile, progress: Progress) -> None:
        self._path = path
        self._file = file
        self._progress = progress
        self._flushed = self._checked = time.monotonic()
        self._reported = False

    def update(self) -> None:
        """Flush and check the file if it is time to do so. Call this method often."""
        now, file = time.monotonic(), self._file
        if now - self._flushed >= FLUSH:
            self._flushed = now
            file.flush()
        problem = file.failure
        if now - self._checked >= CHECK:
            self._checked = now
            problem = problem or file.missing
        if problem and not self._reported:
            self._reported = True
            self._progress.report(f"teleop: {self._path}: {problem}: the run continues")


def finish(file: McapFile, ticks: int) -> dict[str, Any]:
    """Close the file (remove it if it has no tick), and return the final status (see `send`)."""
    missing = file.missing
    file.close()
    if not (ticks or missing):
        file.remove()
    return {"problem": file.failure or missing, "at_path": not missing}


if __name__ == "__main__":
    main()
