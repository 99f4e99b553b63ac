"""The paper's series on emulated devices, with keys typed in a terminal, and killed."""

from __future__ import annotations

import csv
import json
import os
import random
import re
import select
import signal
import subprocess
import threading
import time
from collections import Counter

import pytest

from drivers.rig_file import read_rig_file
from sim_backend.wire.emulator import host_file
from teleop.cli import main
from teleop.recording.recording_file import recorded_ticks
from teleop.rig.emulation import make_emulator
from teleop.settings.trial_settings import TrialSettings
from teleop.studies.series.journal import Journal

from ...busy_machine import REPEATS, busy_cause
from ...forked_command import run_command, start_command

pytest.importorskip("pty", reason="there are no pseudo-terminals on this system")
pytestmark = pytest.mark.real_time

SHORT = """
name = "short"
order = "listed"
prompt = "Place the {cube} cube. Condition {condition}."
[factors]
condition = ["autonomous", "free"]
cube = ["soft", "medium"]
[settings]
rate_hz = 125
duration_s = 0.8
estimators = ["rls"]
"""


class Series:
    """`teleop series` in a new terminal."""

    def __init__(self, folder, *arguments):
        self.terminal, follower = os.openpty()
        self.command = start_command("series", *arguments, terminal=follower, cwd=folder)
        os.close(follower)
        self.text = ""

    def wait_until(self, pattern):
        """Return the text up to a pattern; None if the command ends before it."""
        while not (found := re.search(pattern, self.text, re.DOTALL)):
            if not select.select([self.terminal], [], [], 60.0)[0]:
                self.command.kill()
                pytest.fail(f"nothing is printed after: {self.text}")
            try:
                data = os.read(self.terminal, 4096)
            except OSError:
                data = b""
            if not data:
                return None
            self.text += data.decode(errors="replace")
        text, self.text = self.text[: found.end()], self.text[found.end() :]
        return text

    def type(self, line):
        os.write(self.terminal, line.encode() + b"\n")

    def end(self):
        self.wait_until("no further text")
        os.close(self.terminal)
        return self.command.wait()


class Emulated:
    """`teleop rig emulate`, in which a person types what is palpated."""

    def __init__(self, folder):
        self.process = start_command(
            *("rig", "emulate", "board.toml"),
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        self.limit = threading.Timer(120.0, self.process.kill)
        self.limit.start()
        self.wait_until("run against it")

    def wait_until(self, text):
        for line in self.process.stdout:
            if text in line:
                return
        self.process.communicate()
        self.limit.cancel()
        pytest.fail("the emulator ended")

    def place(self, condition, cube):
        self.process.stdin.write(f"{condition} {cube}\n")
        self.process.stdin.flush()
        self.wait_until(f"{condition}, {cube} cube")


@pytest.fixture
def board(tmp_path, undemanding_rig):
    return undemanding_rig("serial-board", tmp_path / "board.toml")


@pytest.fixture
def emulator(tmp_path, board):
    (tmp_path / "plan.toml").write_text(SHORT)
    made = Emulated(tmp_path)
    yield made
    made.process.send_signal(signal.SIGTERM)
    made.process.communicate(timeout=20)
    made.limit.cancel()


def test_a_series_on_devices_is_run_with_keys_and_ends_in_table_and_figures(
    emulator, tmp_path, capsys
):
    keys = {(2, 1): "r", (2, 2): "s", (4, 1): "q"}  # by trial and number of the prompt
    prompts, armed, codes = Counter(), Counter(), []
    for _ in range(2):
        series = Series(tmp_path, "plan.toml", "--rig", "run.toml", "--out", "study")
        while prompt := series.wait_until(r"q quits\.|Enter for no note\."):
            if prompt.endswith("note."):  # is not asked if the machine was too busy for the trial
                series.type("a note")
                continue
            number, cube, condition = re.search(
                r"trial (\d) of 4: Place the (\w+) cube\. Condition (\w+)", prompt
            ).groups()
            emulator.place(condition, cube)
            trial = int(number)
            prompts[trial] += 1
            key = keys.get((trial, prompts[trial]), "")
            series.type(key)
            if not key:
                armed[trial, re.search(r"board: \w+, \w+, 0.8 s, depth [\d.]+ mm", prompt)[0]] += 1
        codes.append(series.end())
    assert codes == [0, 0]
    assert armed.keys() == {
        (1, "board: autonomous, soft, 0.8 s, depth 10.3 mm"),
        (3, "board: free, soft, 0.8 s, depth 15.5 mm"),
        (4, "board: free, medium, 0.8 s, depth 6.5 mm"),
    }
    assert armed[1, "board: autonomous, soft, 0.8 s, depth 10.3 mm"] >= 2
    with (tmp_path / "study" / "trials.csv").open(newline="") as file:
        rows = [*csv.DictReader(file)]
    assert [row["cube"] for row in rows] == ["soft", "soft", "medium"]
    assert all(row["note"] == "a note" for row in rows)
    assert {row["seed"] for row in rows} == {""}, "the seed of an emulator is not known here"
    for row in rows:
        kept = recorded_ticks(tmp_path / "study" / "recordings" / row["file"])
        assert kept.settings["specimen"] == row["cube"]
    study = tmp_path / "study"
    written = ["--out", str(study / "table.tex"), "--plot", str(study / "figure.pdf")]
    assert main(["compare", str(study), *written, "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["recordings"]) == 3
    assert r"\toprule" in (tmp_path / "study" / "table.tex").read_text()
    assert (tmp_path / "study" / "figure.pdf").stat().st_size


@pytest.fixture
def served(tmp_path, board):
    """An emulator in a thread of this process; its rig file is run.toml."""
    rig = read_rig_file(board)
    emulator = make_emulator(rig, TrialSettings(condition="autonomous"), tmp_path)
    (tmp_path / "run.toml").write_text(host_file(emulator))
    stop = threading.Event()
    with emulator:
        thread = threading.Thread(target=emulator.serve, args=(stop.is_set,))
        thread.start()
        yield emulator
        stop.set()
        thread.join()


def test_a_killed_series_stops_the_devices_and_is_resumed_with_nothing_lost(served, tmp_path):
    plan = SHORT.replace(', "free"', "").replace("0.8", "1.2")
    (tmp_path / "plan.toml").write_text(plan)
    command = ("series", "plan.toml", "--rig", "run.toml", "--yes", "--out", "study")
    chance, kept = random.Random(2), {}
    for _ in range(2):
        series = start_command(
            *command, cwd=tmp_path, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE
        )
        while not served.mechanism.driven and series.poll() is None:
            select.select((), (), (), 0.01)
        time.sleep(chance.uniform(0.0, 0.9))
        series.kill()
        _, error = series.communicate()
        is_killed = series.returncode == -signal.SIGKILL
        assert is_killed or busy_cause(error, on_devices=True), error
        time.sleep(0.5)
        assert not served.mechanism.driven
        assert abs(served.mechanism.measurement.slave_velocity) < 1e-6
        assert all(path.read_bytes() == content for path, content in kept.items())
        recordings = (tmp_path / "study" / "recordings").glob("*.mcap")
        kept = {path: path.read_bytes() for path in recordings}
    for _ in range(1 + REPEATS):
        done = run_command(*command, cwd=tmp_path)
        if not busy_cause(done.stderr, on_devices=True):
            break
    assert done.returncode == 0, done.stderr
    assert all(path.read_bytes() == content for path, content in kept.items())
    journal = Journal(tmp_path / "study")
    assert [result["trial"] for result in journal.results()] == [1, 2]
    started = [entry["file"] for entry in journal.entries if entry["entry"] == "started"]
    for path in kept:
        assert path.name in started
        assert recorded_ticks(path) is not None
