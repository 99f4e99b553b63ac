"""Measure how much other programs use the processors of this computer (Linux only)."""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path
from typing import NamedTuple

PROC = Path("/proc")
IDLE, IOWAIT, STEAL = 3, 4, 7
"""Columns of `/proc/stat` for the time in which a processor did nothing, and in which the host of a
virtual machine used it."""
NAMED = 3
"""Largest number of programs that are named."""
LEAST = 0.05
"""Smallest use of a processor of a program that is named, as a fraction."""


class OtherPrograms(NamedTuple):
    """Use of the processors by other programs, in processors: 1.0 is one processor all the time."""

    processors: int
    """Number of processors of the computer."""
    used: float
    """Use by all other programs; NaN if it is not known."""
    stolen: float
    """Use by the host of a virtual machine while this computer wanted to run; NaN if not known."""
    names: tuple[tuple[str, int, float], ...]
    """Name, process and use of the programs that used most."""


NOT_KNOWN = OtherPrograms(os.cpu_count() or 1, float("nan"), float("nan"), ())


class ProcessorUse:
    """The processor times of the computer at its creation; `others` compares them with now."""

    def __init__(self) -> None:
        self._time = time.monotonic()
        self._own = own_time()
        self._busy, self._stolen = system_times()
        self._processes = process_times()

    def others(self) -> OtherPrograms:
        """Return what other programs have used since the object was created."""
        elapsed = time.monotonic() - self._time
        busy, stolen = system_times()
        tick = ticks_per_second()
        if not tick or elapsed <= 0.0:
            return NOT_KNOWN
        used = (busy - self._busy) / tick - (own_time() - self._own)
        programs = sorted(
            (
                (name, process, (spent - self._processes.get(process, ("", 0.0))[1]) / elapsed)
                for process, (name, spent) in process_times().items()
                if process != os.getpid()
            ),
            key=lambda one: -one[2],
        )
        return OtherPrograms(
            NOT_KNOWN.processors,
            max(0.0, used / elapsed),
            (stolen - self._stolen) / tick / elapsed,
            tuple(one for one in programs[:NAMED] if one[2] >= LEAST),
        )


def ticks_per_second() -> float:
    """Return the unit of the times in `/proc` [1/s]; 0 if this system has no such files."""
    return os.sysconf("SC_CLK_TCK") if (PROC / "stat").exists() else 0.0


def own_time() -> float:
    """Return the processor time of this process [s]."""
    return time.process_time()


def system_times() -> tuple[float, float]:
    """Return the times in which all processors were busy, and in which the host used them."""
    try:
        values = [int(text) for text in (PROC / "stat").read_text().split("\n", 1)[0].split()[1:9]]
        return sum(values) - values[IDLE] - values[IOWAIT] - values[STEAL], values[STEAL]
    except (OSError, ValueError, IndexError):
        return 0.0, 0.0


def process_times() -> dict[int, tuple[str, float]]:
    """Return name and processor time [s] of each process that this user can see."""
    found, tick = {}, ticks_per_second()
    for folder in PROC.glob("[0-9]*") if tick else ():
        with contextlib.suppress(OSError, ValueError, IndexError):
            name, rest = (folder / "stat").read_text().split("(", 1)[1].rsplit(")", 1)
            values = rest.split()
            found[int(folder.name)] = name, (int(values[11]) + int(values[12])) / tick
    return found
