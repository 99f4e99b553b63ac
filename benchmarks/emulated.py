"""Emulate an example rig in another process."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

RIGS = Path(__file__).parents[1] / "rigs"


@contextmanager
def emulated(name: str, condition: str = "autonomous") -> Iterator[Path]:
    """Emulate an example rig in another process; yield the rig file for runs on this rig."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run.toml"
        process = subprocess.Popen(
            [sys.executable, "-m", "teleop", "rig", "emulate", RIGS / f"{name}.toml",
             "--condition", condition, "--out", out],
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
