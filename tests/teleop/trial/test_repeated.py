"""A recorded trial of a pointer is repeated with exactly the same numbers."""

from __future__ import annotations

import math
import mmap
import time
from dataclasses import replace

import numpy as np
import pytest

from teleop.control.clock import Tick, VirtualClock
from teleop.errors import InputError
from teleop.live.cells import ARM, END, PROCESS, SIZE, STOP, CellReader, CellWriter
from teleop.recording.recording import load
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.page_requests import PagePointer, PageRequests
from teleop.trial.repeated import repeated
from teleop.trial.run import run_trial

DURATIONS = ("read_time", "compute_time", "write_time")


class Hand:
    """A link to a page in this process: at chosen ticks it arms, moves the pointer, and stops."""

    pid = None

    def __init__(self, last_request):
        from sim_backend import PointerOperator

        buffer = mmap.mmap(-1, SIZE)
        self.cells, self.reader = CellWriter(buffer), CellReader(buffer)
        self.operator = PointerOperator(PagePointer(self.reader))
        self.last_request = last_request
        self.ticks = 0

    def make_operator(self):
        return self.operator

    def begin(self, settings, stream):
        write = stream.write

        def written(record):
            write(record)
            self.act()

        stream.write = written
        return PageRequests(self.reader, by_page=True)

    def act(self):
        self.ticks += 1
        self.cells.count(PROCESS)
        self.cells.confirm(time.monotonic())
        if self.ticks == 150:
            self.cells.count(ARM)
        if self.ticks % 17 == 0:
            t = 1e-3 * self.ticks
            self.cells.point(0.006 * (1.0 - math.cos(6.0 * t)), not 700 < self.ticks < 800)
        if self.ticks == 1200 and self.last_request is not None:
            self.cells.count(self.last_request)

    def end_trial(self):
        """Do nothing."""


class LateClock(VirtualClock):
    """A clock of a busy machine: ticks are late, and some periods are skipped."""

    def __init__(self, rate):
        super().__init__(rate)
        self.random = np.random.default_rng(0)

    def wait(self):
        skipped = int(self.random.random() < 0.01) * int(self.random.integers(1, 4))
        lateness = float(self.random.exponential(1e-4))
        self._tick += 1 + skipped
        self._now = self._tick / self.rate + lateness
        return Tick(lateness, skipped > 0, skipped, float(self.random.uniform(1e-4, 5e-4)))


@pytest.mark.parametrize(
    ("clock", "last"),
    [(VirtualClock, None), (LateClock, END), (LateClock, STOP)],
    ids=["on time, whole", "late, end", "late, stop"],
)
def test_the_repeated_trial_is_identical_to_the_bit(tmp_path, monkeypatch, clock, last):
    settings = TrialSettings(operator="pointer", clock="virtual", duration=1.5, cube="medium")
    monkeypatch.setattr("teleop.trial.run.make_clock", lambda settings: clock(settings.loop_rate))
    path = tmp_path / "trial.mcap"
    run_trial(settings, path, live=Hand(last))
    recording = load(path)
    assert recording["pointer_grip"].max() == 1.0
    assert recording["contact_force"].max() > 2.0
    again = repeated(recording)
    assert set(again.columns) == set(recording.columns)
    for name, column in recording.columns.items():
        if name not in DURATIONS:
            assert np.array_equal(again[name], column, equal_nan=True), name
    assert again.events == recording.events[1:]  # the first is that of the recorder


def test_a_recording_without_a_pointer_is_refused():
    recording = run_trial(TrialSettings(clock="virtual", duration=0.2)).recording
    with pytest.raises(InputError, match="no pointer"):
        repeated(recording)
    assert "pointer_depth" not in recording.columns


def test_a_recording_with_missing_ticks_is_refused(tmp_path):
    settings = TrialSettings(operator="pointer", clock="virtual", duration=0.3)
    recording = run_trial(settings, live=Hand(None)).recording
    with pytest.raises(InputError, match="missing"):
        repeated(replace(recording, gaps=(object(),)))
