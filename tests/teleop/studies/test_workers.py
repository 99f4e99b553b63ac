"""Worker processes end with the block, after an exception in it, and with their parent."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from teleop.studies.workers import workers

pytestmark = pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs /proc")
PARENT = """
import signal, sys, time

signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in the background of a shell
signal.signal(signal.SIGHUP, signal.SIG_DFL)

from teleop.cli import app, main
from teleop.studies.workers import workers

@app.command
def wait():
    with workers() as pool:
        for _ in range(8):
            pool.submit(time.sleep, 600)
        print(*pool._processes, flush=True)
        while True:  # a signal while a future is asked would leave the lock of the future closed
            time.sleep(0.05)

raise SystemExit(main(["wait"]))
"""


def is_alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP", "SIGKILL"])
@pytest.mark.parametrize("whole_group", [False, True], ids=["alone", "whole group"])
def test_workers_end_when_their_command_is_ended(name, whole_group):
    with subprocess.Popen(
        [sys.executable, "-c", PARENT],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    ) as process:
        pids = process.stdout.readline().split()
        assert pids
        assert all(map(is_alive, pids))
        (os.killpg if whole_group else os.kill)(process.pid, getattr(signal, name))
        process.wait()
    while any(map(is_alive, pids)):
        time.sleep(0.05)


def test_running_tasks_are_killed_when_the_block_raises():
    def interrupted():
        with workers() as pool:
            pool.submit(time.sleep, 600)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()


def test_the_results_are_those_of_the_function():
    with workers() as pool:
        assert list(pool.map(abs, [-1, 2, -3])) == [1, 2, 3]
