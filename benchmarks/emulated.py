"""Emulate an example rig in another process."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

RIGS = Path(__file__).parents[1] / "rigs"


@contextmanager
def emulated(
    name: str | Path, condition: str = "autonomous", rate: int = 0, extra: Sequence[str] = ()
) -> Iterator[Path]:
    """Emulate an example rig in another process; yield the rig file for runs on this rig.

    `name` is the name of an example, or the path of a rig file. `extra` are further options.

    `rate` is the rate of the loop and of the samples [Hz]. If it is 0, they are those of the rig
    file. The baud rate of a serial port is then high enough for 4 kHz.
    """
    with tempfile.TemporaryDirectory() as folder:
        rig = name if isinstance(name, Path) else RIGS / f"{name}.toml"
        out = Path(folder) / "run.toml"
        if rate:
            text = re.sub(r"rate_hz = \d+", f"rate_hz = {rate}", rig.read_text())
            text = re.sub(r"baud_bps = \d+", "baud_bps = 3000000", text)
            rig = Path(folder) / rig.name
            rig.write_text(text)
        process = subprocess.Popen(
            [sys.executable, "-m", "teleop", "rig", "emulate", rig, "--condition", condition,
             "--out", out, *extra],
            stdout=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            while not out.exists() or not out.stat().st_size:
                assert process.poll() is None, "the emulator ended"
                time.sleep(0.05)
            yield out
        finally:
            process.terminate()
            process.wait()
