"""The page howto-notebook.md works on an emulated rig, from the first block to the last."""

from __future__ import annotations

import contextlib
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from teleop.rig_session import RunningTrial

from .forked_command import start_command

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals"),
]
PAGE = Path(__file__).parents[1] / "docs" / "howto-notebook.md"
BLOCKS = re.findall(r"```(?:python|\{run-python\})\n(.*?)```", PAGE.read_text("utf-8"), re.S)


@contextlib.contextmanager
def emulated(rig, out):
    """Emulate the devices of a rig file in another process."""
    command = ("rig", "emulate", rig, "--json", "--condition", "autonomous", "--out", out)
    process = start_command(*command, stdout=subprocess.PIPE)
    try:
        for line in process.stdout:
            if line.rstrip() == "}":
                break
        yield
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=10)


def test_the_blocks_of_the_page_run_in_a_notebook(tmp_path, monkeypatch, undemanding_rig):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("builtins.input", lambda text: "arm")
    rig = undemanding_rig("serial-board", tmp_path / "board.toml")
    notebook = {"__name__": "a_notebook"}
    with emulated(rig, tmp_path / "my-rig.toml"):
        for block in BLOCKS:
            code = block.replace("4.0", "1.0").replace("duration=30.0", "duration=5.0")
            code = code.replace('record="liver.mcap",', 'record="liver.mcap", duration=1.0,')
            for _ in range(3):  # the machine may be taken away from a loop in real time
                exec(compile(code, str(PAGE), "exec"), notebook)
                fault = getattr(notebook["trial"], "fault", None)
                if not fault:
                    break
                (tmp_path / "liver.mcap").unlink(missing_ok=True)
            while isinstance(trial := notebook["trial"], RunningTrial) and trial.is_running:
                if len(trial.samples(0.1)["time"]):
                    break
                time.sleep(0.1)
    assert (tmp_path / "liver.mcap").exists()
    finished = notebook["finished"]
    assert finished.summary["interrupted"]
    assert finished.recording.settings["specimen"] == "liver"
