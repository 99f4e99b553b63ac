"""What works without POSIX works, and the rest is refused in one line.

The modules and functions that Windows does not have are removed from Python, also in the processes
that a command starts. This is no test on Windows: paths, processes and pipes are those of POSIX.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from teleop.cli import main
from teleop.recording.recording import load

ABSENT = """
import os, signal, socket, sys

for name in ("fcntl", "grp", "pty", "pwd", "resource", "syslog", "termios", "tty"):
    sys.modules[name] = None
for module, names in {
    os: "fork forkpty getpgrp getpgid getuid killpg mkfifo nice sched_getaffinity "
        "sched_getscheduler sched_param sched_setaffinity sched_setscheduler set_blocking "
        "setsid tcgetpgrp",
    signal: "SIGALRM SIGCONT SIGHUP SIGQUIT SIGTSTP SIGTTIN SIGTTOU alarm setitimer",
    socket: "AF_UNIX AF_CAN SO_PEERCRED",
}.items():
    for name in names.split():
        if hasattr(module, name):
            delattr(module, name)
"""


@pytest.fixture
def windows(tmp_path, monkeypatch):
    """Returns a function that runs a command of teleop in an empty folder, without POSIX."""
    libraries = tmp_path / "absent"
    libraries.mkdir()
    (libraries / "sitecustomize.py").write_text(ABSENT)
    path = os.pathsep.join(filter(None, [str(libraries), os.environ.get("PYTHONPATH")]))
    folder = tmp_path / "here"
    folder.mkdir()

    def run(*arguments):
        return subprocess.run(
            [sys.executable, "-m", "teleop", *arguments],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": path},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )

    return run


@pytest.mark.real_time
def test_a_trial_is_run_and_recorded_in_real_time(windows, tmp_path):
    ran = windows("run", "--rate", "100", "--duration", "1", "--record", "trial.mcap", "--json")
    assert ran.returncode == 0, ran.stderr
    trial = json.loads(ran.stdout)
    assert trial["pairs"] > 0
    assert len(load(tmp_path / "here" / "trial.mcap")) >= trial["ticks"]


def test_a_recording_is_evaluated(windows, tmp_path):
    path = tmp_path / "here" / "trial.mcap"
    trial = ["--clock", "virtual", "--rate", "100", "--duration", "2", "--record", str(path)]
    assert main(["run", *trial]) == 0
    for command in (
        ("report", "trial.mcap"),
        ("export", "trial.mcap", "--out", "trial.mat"),
        ("estimate", "trial.mat"),  # in a process of its own
    ):
        done = windows(*command)
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        (("run", "--live"), "live page: not available on "),
        (("run", "--realtime", "require"), "not available on this system"),
        (("rig", "emulate", "serial-board.toml"), "a pseudo-terminal: not available on "),
    ],
)
def test_what_needs_posix_is_refused_in_one_line(windows, tmp_path, command, expected):
    shutil.copy(Path(__file__).parents[1] / "rigs" / "serial-board.toml", tmp_path / "here")
    ended = windows(*command)
    assert ended.returncode == 2, ended.stderr
    (line,) = ended.stderr.splitlines()
    assert expected in line
