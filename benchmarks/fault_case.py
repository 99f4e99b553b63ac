"""A trial in which a fault is to set in: its clock can lose time, its recorder can die."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

from sim_backend.faults import FaultyRig
from teleop.control.clock import Tick, VirtualClock
from teleop.recording.black_box import BlackBox
from teleop.recording.mcap_writer import McapFile
from teleop.recording.message import Layout
from teleop.recording.sinks import Outcome, Sink, event_record
from teleop.trial.loop import Session
from teleop.trial.settings import TrialSettings
from teleop.trial.stop_switch import StopSwitch

FLUSHED = 80
"""Ticks after which the file is flushed."""


class CampaignClock(VirtualClock):
    """Virtual time that can be lost."""

    def __init__(self, rate: float) -> None:
        super().__init__(rate)
        self.losing = 0
        self.once = 0

    def wait(self) -> Tick:
        lost, self.once = self.losing + self.once, 0
        self._tick += lost
        super().wait()
        return Tick(0.0, lost > 0, lost)


class FileSink(Sink):
    """The recorder's file without its process: flushed as often, killed without being closed."""

    def __init__(self, path: Path, layout: Layout, columns: Any) -> None:
        self.path = path
        self._file = McapFile(path, columns, layout.definition, {})
        self._file.begin(10**18)
        self.pushed: list[bytes] = []
        self.alive = True

    def push(self, message: bytes) -> None:
        self.pushed.append(message)
        if self.alive:
            self._file.tick(message, 1e-3 * len(self.pushed))
            if len(self.pushed) % FLUSHED == 0:
                self._file.flush()

    def event(self, event: Any) -> None:
        if self.alive:
            self._file.event(event_record(event))

    def kill(self) -> None:
        """As SIGKILL: nothing more reaches the file, not even what was taken in."""
        self.alive = False
        rest = self.path.with_suffix(".killed.mcap")
        rest.write_bytes(self.path.read_bytes())
        self.path.unlink()
        self.path = rest

    def fill(self) -> None:
        """As a disk that is full."""

        def refuse(data: bytes) -> int:
            self._file._disk.error = OSError(28, "No space left on device")
            raise self._file._disk.error

        self._file._disk.write = refuse

    def close(self) -> Outcome:
        self._file.close()
        return Outcome(self.path, len(self.pushed), 0, "")


class Case:
    """One trial with a fault to come."""

    def __init__(self, settings: TrialSettings, rig: FaultyRig, clock: Any) -> None:
        self.settings, self.rig, self.clock = settings, rig, clock
        self.sim = rig.rig
        self.limits = settings.limits
        self.bank = settings.make_bank()
        self.layout = Layout(self.bank)
        self.box = BlackBox(self.layout, settings.rate)
        self.switch = StopSwitch()
        self.sinks: list[Sink] = []
        self.random = random.Random(0)
        self.killed = False
        self.session = Session(
            settings, clock, rig, self.bank, self.layout, self.sinks, self.box, self.switch
        )

    @property
    def controller(self) -> Any:
        return self.session.controller

    @property
    def speed(self) -> float:
        """What the slave's drive is told, truly [m/s]."""
        return self.sim._applied.slave_velocity

    @property
    def force(self) -> float:
        """The true contact force [N]."""
        return self.sim.plant.slave.force

    @property
    def measured(self) -> Any:
        return self.controller._measurement
