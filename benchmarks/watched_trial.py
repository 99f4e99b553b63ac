"""Run a trial in real time in another process, and read its stream in this one.

The process of the trial must pass an `Announcement` to `run_trial` as a viewer.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from teleop.safety.events import is_note
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.shared_file import SharedFile
from teleop.streams.stream import READERS, Stream, StreamReader

MODULES = {
    b"teleop.recording.recorder": "recorder",
    b"teleop.streams.estimation": "estimation",
    b"teleop.live.process": "live page",
    b"teleop.live.foxglove_process": "foxglove",
    b"teleop.trial.precision": "evaluation",
}
"""Name of each reader by the module of its process."""
TICK = 1.0 / os.sysconf("SC_CLK_TCK")


class Announcement:
    """Writes the description of the stream to standard output, followed by `more`."""

    def __init__(self, **more: Any) -> None:
        self._more = more

    def begin(self, settings: TrialSettings, stream: Stream) -> None:
        print(json.dumps({"stream": stream.document, **self._more}), flush=True)

    def end_trial(self) -> None: ...


class WatchedTrial:
    """A trial in another process, whose stream this process reads.

    Attributes
    ----------
    stream
        Reader of the stream. It does not wait for estimates.
    begun
        The line that the process wrote before the first tick.
    readers
        Process id of each reader, by its name.
    events
        Events that were read so far.
    """

    def __init__(self, *command: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self.process.stdout
        line = self.process.stdout.readline()
        if not line:
            raise ConnectionError(self.process.communicate()[1].strip())
        self.begun = json.loads(line)
        document = self.begun["stream"]
        self.stream = StreamReader.open(document, "python")
        self.stream.patience = 0.0
        self._files = [Path(path) for path in document["files"].values()]
        missed = SharedFile.open(Path(document["files"]["missed"]))
        self._missed = memoryview(missed.buffer).cast("Q")
        self.readers = readers_of(self.process.pid)
        self.events: list[dict[str, Any]] = []

    def read(self) -> None:
        """Read the new events."""
        while batch := self.stream.read():
            self.events += [event for _, event in batch.events]

    @property
    def armed(self) -> float | None:
        """Time at which the drives were armed [s]; None before."""
        for event in self.events:
            if event["mode"] == "active" and not is_note(event["fault"], event["source"]):
                return float(event["time"])
        return None

    def wait_until_armed(self) -> None:
        """Wait until the drives are armed; ConnectionError if the trial ends before."""
        while self.armed is None:
            if self.process.poll() is not None:
                raise ConnectionError(self.process.communicate()[1].strip() or str(self.events))
            self.read()
            time.sleep(0.01)

    def wait(self) -> dict[str, Any]:
        """Wait for the end of the process, and return the last line that it wrote; else {}."""
        out, _ = self.process.communicate()
        self.read()
        lines = out.splitlines()
        return dict(json.loads(lines[-1])) if lines else {}

    @property
    def missed(self) -> dict[str, int]:
        """Number of ticks that each reader in another process has missed."""
        return dict(zip(READERS, self._missed, strict=False))

    def columns(self) -> dict[str, np.ndarray]:
        """Return all columns of all ticks in the ring."""
        return self.stream.columns(1, self.stream.ticks.newest + 1)

    def clean_up(self) -> int:
        """Remove the shared memory that is left, and return how many files this was."""
        left = [path for path in self._files if path.exists()]
        for path in left:
            path.unlink(missing_ok=True)
        return len(left)


def readers_of(pid: int) -> dict[str, int]:
    """Return the process ids of the readers that a process has started, by their names."""
    found = {}
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        with contextlib.suppress(OSError):
            command = Path(f"/proc/{child}/cmdline").read_bytes()
            found |= {name: int(child) for part, name in MODULES.items() if part in command}
    return found


def processor_time(pid: int) -> float:
    """Return the processor time that a process has used so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) * TICK
