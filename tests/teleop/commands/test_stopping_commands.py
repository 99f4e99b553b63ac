"""Commands that are ended by a signal while they hang, or before any motion."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
from pathlib import Path

import pytest

from teleop.cli import main
from teleop.recording import new_recording
from teleop.safety import Request
from teleop.studies.json_lines import locked
from teleop.studies.series.journal import Journal

from ...forked_command import start_command

ROOT = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The folder of the recordings."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


RUN = ("run", "--no-record", "--specimen", "a", "--depth", "3mm", "--yes", "--rig")


@contextlib.contextmanager
def started(*arguments):
    """Start a command, which is killed if it still runs at the end of the block."""
    command = start_command(*arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    with command:
        try:
            yield command
        finally:
            command.kill()


@pytest.mark.parametrize("arguments", [("rig", "check"), RUN])
def test_ctrl_c_while_a_silent_rig_opens_ends_with_130(tmp_path, undemanding_rig, arguments):
    """The low rate of the rig is not refused on a busy machine."""
    pytest.importorskip("pty", reason="needs a pseudo-terminal")
    import pty
    import tty

    leader, follower = pty.openpty()
    tty.setraw(follower)
    rig = undemanding_rig("serial-board", tmp_path / "silent.toml")
    rig.write_text(rig.read_text().replace("/dev/ttyACM0", os.ttyname(follower)))
    with started(*arguments, rig) as process:
        while not select.select([leader], [], [], 0.1)[0]:  # a request that nothing answers
            assert process.poll() is None, process.communicate()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate()
    assert (process.returncode, out, err) == (130, "", "")
    os.close(leader)
    os.close(follower)


@pytest.mark.real_time
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")
def test_a_run_that_is_stopped_before_arming_reports_that_it_is_not_drawn(monkeypatch, capsys):
    def request(self, arm, skipped, end=""):
        self.count = 1
        return Request(arm=False, stop="Ctrl-C")

    monkeypatch.setattr("teleop.trial.stop_switch.StopSwitch.request", request)
    arguments = ["run", "--clock", "virtual", "--no-record", "--plot", "a.png"]
    assert main(arguments) == 130
    assert "a.png: not drawn: there are no estimates" in capsys.readouterr().err
    assert not Path("a.png").exists()


def test_recordings_that_are_started_in_the_same_second_get_different_names(monkeypatch):
    class Now(new_recording.datetime):
        @classmethod
        def now(cls):
            return cls(2026, 1, 2, 3, 4, 5)

    monkeypatch.setattr(new_recording, "datetime", Now)
    paths = [new_recording.new_recording("free", "soft") for _ in range(3)]
    assert [str(path) for path in paths] == [
        f"recordings/2026-01-02/030405-free-soft{suffix}.mcap" for suffix in ("", "-2", "-3")
    ]
    assert all(path.exists() for path in paths)


def test_runs_that_are_started_at_the_same_time_are_all_recorded(tmp_path):
    arguments = ("run", "--clock", "virtual", "--duration", "0.1", "--json")
    with started(*arguments) as first, started(*arguments) as second:
        for process in (first, second):
            _, err = process.communicate()
            assert (process.returncode, err) == (0, "")
    assert len(list(tmp_path.glob("recordings/*/*-free-soft*.mcap"))) == 2


def test_a_refused_run_leaves_no_empty_recording(tmp_path):
    assert main(["run", "--rate", "90000"]) == 2
    assert [path for path in tmp_path.rglob("*.mcap") if not path.stat().st_size] == []


PLAN = """
name = "one"
factors = { cube = ["soft"] }
[settings]
rate_hz = 100
duration_s = 30
estimators = ["rls"]
"""
BOARD = str(ROOT / "rigs" / "serial-board.toml")
PROMPTS = {
    "question": (("series", "plan.toml", "--ask", "--out", "asked"), b"q quits."),
    "trial": (("series", "plan.toml", "--ask", "--out", "run"), b"active"),
    "trial without --ask": (("series", "plan.toml", "--out", "alone"), b"active"),
    "run": (("run", "--rig", BOARD, "--specimen", "a", "--depth", "3mm"), b"other answer ends."),
    "check": (("rig", "check", BOARD, "--move"), b"other answer ends."),
    "tare": (("rig", "tare", "--rig", BOARD, "--contact", "touch"), b"other answer ends."),
}
"""Commands, and the text after which the terminal is closed."""


@pytest.mark.real_time
def test_a_closed_terminal_ends_a_command_wherever_it_waits(tmp_path, monkeypatch):
    pytest.importorskip("pty", reason="needs a pseudo-terminal")
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)  # the rest of the output is not written
    (tmp_path / "plan.toml").write_text(PLAN)
    running = {}
    for name, (arguments, _) in PROMPTS.items():
        terminal, follower = os.openpty()
        running[name] = start_command(*arguments, terminal=follower), terminal
        os.close(follower)
    for name, (_, terminal) in running.items():
        text = b""
        while PROMPTS[name][1] not in text:
            text += os.read(terminal, 4096)
            if name == "trial" and b"q quits." in text:
                os.write(terminal, b"\n")
                text = b""
    for _, terminal in running.values():
        os.close(terminal)
    codes = {name: command.wait() for name, (command, _) in running.items()}
    assert {*codes.values()} == {130}, codes
    for folder in ("asked", "run", "alone"):
        with locked(tmp_path / folder):
            entries = [entry["entry"] for entry in Journal(tmp_path / folder).entries]
        assert entries == ["plan"] + ["started", "spoilt"] * (folder != "asked")
