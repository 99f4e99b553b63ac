"""A short run of the fault campaign, benchmarks/faults.py, and the ways to stop a run."""

from __future__ import annotations

import importlib.util
import itertools
import json
import os
import re
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from teleop.recording.recording import load

from ...busy_machine import REPEATS, busy_cause
from ...forked_command import start_command

ROOT = Path(__file__).parents[3]
termios = pytest.importorskip("termios", reason="needs a POSIX terminal")
pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs fork and a pseudo-terminal")


def load_campaign():
    """The script, whose own folder Python would look in for its parts."""
    sys.path.insert(0, str(ROOT / "benchmarks"))
    spec = importlib.util.spec_from_file_location("campaign", ROOT / "benchmarks" / "faults.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["campaign"] = module
    spec.loader.exec_module(module)
    return module


campaign = load_campaign()
CODE = """
import json, sys
sys.path.insert(0, {folder!r})
import faults
special = [name for name, kind in faults.KINDS.items() if kind.linked or kind.paged]
others = [name for name in faults.KINDS if name not in special]
rows = []
for condition, trials in {trials!r}.items():
    for i, (law, cube, page) in enumerate(trials):
        names = special + others[i :: len(trials)]
        rows += faults.virtual(condition, cube, names, 1, seed=1270, law=law, page=page)
print(json.dumps(rows))
"""
TRIALS = {
    "free": [
        ("none", "soft", False),
        ("model-mediated", "medium", True),
        ("position-force", "soft", False),
    ],
    "mimic": [("none", "hard", False), ("position-force", "soft", False)],
    "autonomous": [("none", "medium", False)],
}
"""Laws of force feedback of each condition, the cubes, and whether a live page is attached."""


def test_every_kind_of_fault_ends_as_docs_safety_states_under_every_condition():
    """Run in another process, because the campaign forks, which fails with pytest's threads.

    The kinds of fault of a condition are divided among its trials. Those of the link are injected
    in each trial that has a link, and those of the live page in each trial that has one. With this
    seed, the random times are early, between 0.6 s and 2 s, so that the trials are short.
    """
    code = CODE.format(folder=str(ROOT / "benchmarks"), trials=TRIALS)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)
    assert [row for row in rows if row["problems"]] == []
    kinds = campaign.KINDS.items()
    special = {name: 1 if kind.paged else 3 for name, kind in kinds if kind.linked or kind.paged}
    injected = [(row["kind"], row["condition"]) for row in rows if row["kind"] not in special]
    others = campaign.KINDS.keys() - special.keys()
    assert sorted(injected) == sorted(itertools.product(others, TRIALS))
    assert Counter(row["kind"] for row in rows if row["kind"] in special) == special


def test_a_cube_with_an_inclusion_behind_a_spring_is_compressed_as_its_force_requires():
    cube, compliance = sys.modules["fault_kinds"].Inclusion(2000.0, 1e6, 3.0), 1e-5
    object.__setattr__(cube, "inside", 5e-3)
    object.__setattr__(cube, "stiffness_inside", 20e3)
    for x in (-1e-3, 1e-3, 5e-3, 6e-3, 20e-3):
        y = cube.compressed(x, compliance)
        assert y + compliance * cube.force(y, 0.0) == pytest.approx(x, abs=1e-12)


@pytest.mark.parametrize(
    "kind",
    ["contact_force NaN", "slave_position stale", "runaway plant", "rig unplugged", "Ctrl-C twice"],
)
@pytest.mark.real_time
def test_a_fault_in_real_time_stops_the_slave_and_is_named(kind):
    for _ in range(3):  # the loop stops first if the machine is busy for 80 ms
        row = campaign.real("autonomous", "soft", kind, seed=1)
        if row["fault"] not in ("loop overrun", "drive error"):
            break
    named = [problem for problem in row["problems"] if not problem.startswith("stopped after")]
    assert named == []


SLOW = ("--rate", "100")
"""A low rate of a loop in real time, so that a busy machine can run it."""
MOVING = rb"0\.[5-9] of 60 s"


class Run:
    """A run in a new terminal with keyboard input."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.terminal, follower = os.openpty()
        self.command = start_command("run", *SLOW, *arguments, terminal=follower, cwd=folder)
        os.close(follower)
        self.text = b""

    def moves(self) -> bool:
        """Wait until the slave moves; False if the command ends before."""
        while not re.search(MOVING, self.text):
            if not self.read():
                return False
        assert not self.is_cooked()
        return True

    def read(self) -> bytes:
        try:
            chunk = os.read(self.terminal, 4096)
        except OSError:
            chunk = b""
        self.text += chunk
        return chunk

    def is_cooked(self) -> bool:
        """Return whether the terminal passes whole lines and echoes."""
        wanted = termios.ICANON | termios.ECHO
        return termios.tcgetattr(self.terminal)[3] & wanted == wanted

    def type(self, text: bytes) -> None:
        os.write(self.terminal, text)

    def end(self) -> int:
        """The exit code; the terminal must have its modes again."""
        while self.read():
            pass
        assert self.is_cooked()
        os.close(self.terminal)
        return self.command.wait()


def moving_run(folder: Path, *arguments: str) -> Run:
    """A run whose slave moves. It is started again if the machine was too busy for it."""
    for _ in range(1 + REPEATS):
        run = Run(folder, *arguments, "--overwrite", "--duration", "60", "--record", "a.mcap")
        if run.moves():
            return run
        run.end()
        text = run.text.decode()
        assert busy_cause(text), text
    raise AssertionError(text)


@pytest.mark.real_time
def test_the_enter_key_is_an_emergency_stop(tmp_path):
    run = moving_run(tmp_path, "--condition", "autonomous")
    run.type(b"\n")
    assert run.end() == 3, run.text
    assert b"emergency stop: key" in run.text
    recording = load(tmp_path / "a.mcap")
    fault = next(event for event in recording.events if event["fault"])
    after = recording["time"] >= fault["time"]
    assert fault["fault"] == "emergency stop"
    assert not recording["commanded_slave_velocity"][after].any()


@pytest.mark.real_time
def test_ctrl_c_ramps_down_and_keeps_the_recording(tmp_path):
    run = moving_run(tmp_path, "--condition", "autonomous")
    run.type(b"\x03")
    assert run.end() == 130, run.text
    assert b"INTERRUPTED" in run.text
    recording = load(tmp_path / "a.mcap")
    assert [event["text"] for event in recording.events][-2:] == ["Ctrl-C", "at standstill"]
    assert recording["commanded_slave_velocity"][-1] == 0.0


@pytest.mark.real_time
def test_a_closed_terminal_ends_the_run_with_a_ramp(tmp_path):
    run = moving_run(tmp_path)
    run.command.send_signal(signal.SIGHUP)
    assert run.end() == 130, run.text
    assert load(tmp_path / "a.mcap").events[-1]["text"] == "at standstill"
