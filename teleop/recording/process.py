"""The recorder process: drains the control process's pipe into an MCAP file.

    python -m teleop.recording.process

Standard input carries a head, the session as JSON, and then frames: when the trial begins, and a
tick or an event each.
Standard output says when recording has begun, and at the end what became of it. Standard error
shows the progress line where the session asks for one. It ends when the pipe ends: when the
control process closes it, exits, or is killed; so what was pushed is kept in every case.
"""

from __future__ import annotations

import json
import os
import struct
import sys
import time
from pathlib import Path
from typing import Any

from teleop.errors import reason
from teleop.live.terminal import Terminal
from teleop.recording.mcap_writer import McapFile
from teleop.recording.message import CDR, TIME

FRAME = struct.Struct("<cH")
"""Head of a frame: its kind and the length of what follows."""
TICK, EVENT, BEGIN, END = b"T", b"E", b"B", b"N"
HEAD = struct.Struct("<I")
"""Length of the session's JSON."""
NUMBER = struct.Struct("<q")
"""Wall-clock time of the trial's beginning [ns], or number of dropped ticks at its end."""
CHECK = 1.0
"""Time between two checks that the file is still in its place [s]."""
NAP = 0.02
"""The pipe is left alone for this long [s]: a sleeping reader costs the writer no wake-up."""
FLUSH = 0.05
"""Longest time for which a tick stays out of the file [s]."""
REDRAW = 0.1
"""Time between two drawings of the progress line [s]."""
BULK = 1 << 16
PAIR = struct.Struct("<2d")
SHOWN = 4
"""Most estimators on the progress line."""
STDERR = 2


class Progress:
    """The progress line: time and the present estimates, drawn over and over.

    Parameters
    ----------
    session
        Whether to show it, how long the trial lasts, and where the estimates stand.
    """

    def __init__(self, session: dict[str, Any]) -> None:
        self._shown = session["show"]
        self._duration = session["duration"]
        self._hint = f"[{session['hint']}]  " if session.get("hint") else ""
        self._names = session["estimators"]
        columns = [name for name, _, _ in session["columns"]]
        self._places = [len(CDR) + 8 * columns.index(f"{name}_b") for name in self._names]
        self._due = 0.0
        self._terminal = Terminal(STDERR)
        if self._shown and session.get("instructions"):
            self.tell(f"teleop: {session['instructions']}")

    def show(self, message: bytes, t: float) -> None:
        """Draw the line if it is due."""
        now = time.monotonic()
        if not self._shown or now < self._due or t < 0.0:
            return
        self._due = now + REDRAW
        told = []
        for name, place in zip(self._names, self._places, strict=True):
            b, k = PAIR.unpack_from(message, place)
            told.append(f"  {name} {k:6.0f} {b:+5.0f}")
        estimates = "".join(told[:SHOWN])
        progress = f"{self._hint}{t:4.1f} of {self._duration:g} s"
        self._draw(f"{progress}  k [N/m], b [N s/m]:{estimates}")

    def tell(self, text: str) -> None:
        """Write a line that stays."""
        self._terminal.write(("\r\x1b[K" if self._shown else "") + text + "\n")

    def close(self) -> None:
        """Clear the line, unless the terminal is stopped."""
        if self._shown:
            self._terminal.draw("\r\x1b[K")
        self._terminal.close()

    def _draw(self, text: str) -> None:
        try:
            width = os.get_terminal_size(STDERR).columns or 80
        except OSError:
            self._shown = False
            return
        self._terminal.draw("\r" + text[: width - 1] + "\x1b[K")


def say(**status: Any) -> None:
    """Tell the control process, if it is still there."""
    try:
        print(json.dumps(status), flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def read_session() -> dict[str, Any]:
    """The session, from the head of the pipe."""
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


class Drain:
    """Takes frames apart and hands them to the file."""

    def __init__(self, file: McapFile | None, progress: Progress) -> None:
        self.file = file
        self.progress = progress
        self.ticks = 0
        self._rest = b""

    def take(self, data: bytes) -> None:
        """Take in what the pipe had."""
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
                if self.file:
                    self.file.tick(frame, t)
                self.progress.show(frame, t)
            elif self.file and kind == EVENT:
                self.file.event(json.loads(frame))
            elif self.file and kind == BEGIN:
                self.file.begin(*NUMBER.unpack(frame))
            elif self.file and kind == END:
                self.file.end(*NUMBER.unpack(frame))
        self._rest = data[place:]


def main() -> None:
    """Record until the pipe ends."""
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
            say(problem=reason(refusal))
            return
    say(problem="")
    progress = Progress(session)
    drain = Drain(file, progress)
    watch = Watch(session["path"], file, progress) if file else None
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
            drain.take(data)
        if watch:
            watch.look()
        if not data or len(data) < BULK:
            time.sleep(NAP)
    status = finish(file, drain.ticks) if file else {"problem": ""}
    progress.close()
    say(**status)


class Watch:
    """Flushes the file in time, and reports at once what keeps it from holding the ticks."""

    def __init__(self, path: str, file: McapFile, progress: Progress) -> None:
        self._path = path
        self._file = file
        self._progress = progress
        self._flushed = self._checked = time.monotonic()
        self._told = False

    def look(self) -> None:
        """Flush and check, where that is due."""
        now, file = time.monotonic(), self._file
        if now - self._flushed >= FLUSH:
            self._flushed = now
            file.flush()
        problem = file.failure
        if now - self._checked >= CHECK:
            self._checked = now
            problem = problem or file.missing
        if problem and not self._told:
            self._told = True
            self._progress.tell(f"teleop: {self._path}: {problem}: the run continues")


def finish(file: McapFile, ticks: int) -> dict[str, Any]:
    """Complete the file, or remove it if it holds no tick; returns its state."""
    missing = file.missing
    file.close()
    if not (ticks or missing):
        file.remove()
    return {"problem": file.failure or missing, "at_path": not missing}


if __name__ == "__main__":
    main()
