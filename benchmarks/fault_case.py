"""Define a trial into which a fault is injected, with a clock that can skip periods."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

from page_in_process import InProcess
from page_process import PageProcess

from sim_backend.faults import FaultyRig
from teleop.control.clock import Tick, VirtualClock
from teleop.recording.black_box import BlackBox
from teleop.streams.columns import Layout
from teleop.recording.mcap_writer import McapFile
from teleop.recording.sinks import Outcome, Sink, event_record
from teleop.safety import Mode
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.assembly import make_controller, make_layout
from teleop.trial.loop import Loop
from teleop.trial.stop_switch import StopSwitch

AnyPage = InProcess | PageProcess
FLUSHED = 80
"""Number of ticks after which the file is flushed."""


class CampaignClock(VirtualClock):
    """Virtual clock that can skip periods. The live page also runs in periods that are skipped."""

    def __init__(self, rate: float) -> None:
        super().__init__(rate)
        self.losing = 0
        self.once = 0
        self.page: InProcess | None = None

    def wait(self) -> Tick:
        lost, self.once = self.losing + self.once, 0
        for _ in range(1 + lost):
            super().wait()
            if self.page:
                self.page.advance()
        return Tick(0.0, lost > 0, lost)


class FileSink(Sink):
    """Writes the recording in this process, flushed as often as in the recorder process."""

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
        """Imitate SIGKILL: write nothing more, not even buffered data."""
        self.alive = False
        rest = self.path.with_suffix(".killed.mcap")
        rest.write_bytes(self.path.read_bytes())
        self.path.unlink()
        self.path = rest

    def fill(self) -> None:
        """Imitate a full disk."""

        def refuse(data: bytes) -> int:
            self._file._disk.error = OSError(28, "No space left on device")
            raise self._file._disk.error

        self._file._disk.write = refuse

    def close(self) -> Outcome:
        self._file.close()
        return Outcome(self.path, len(self.pushed), 0, "")


class Case:
    """One trial into which a fault will be injected.

    Parameters
    ----------
    settings, rig, clock
        As for the trial.
    make_page
        Creates the live page in which the trial is armed, from the layout; None for no page.
    """

    def __init__(
        self,
        settings: TrialSettings,
        rig: FaultyRig,
        clock: Any,
        make_page: Callable[[Layout], AnyPage] | None = None,
    ) -> None:
        self.settings, self.rig, self.clock = settings, rig, clock
        self.sim = rig.rig
        self.limits = settings.limits
        self.bank = settings.estimation_preset.bank()
        self.layout = make_layout(settings, self.bank)
        self.box = BlackBox(self.layout, settings.loop_rate)
        self.switch = StopSwitch()
        self.sinks: list[Sink] = [self.box]
        self.random = random.Random(0)
        self.killed = False
        self.master_travel = 0.0
        """Commanded travel of the master since the injection [m]."""
        controller = make_controller(settings, rig, self.bank, clock)
        self.loop = Loop(controller, clock, self.layout, self.sinks, self.switch, settings.duration)
        self.page = make_page(self.layout) if make_page else None
        if self.page:
            self.sinks.append(self.page)
            self.switch.page = self.page.begin(settings, self.layout)

    def arm(self) -> None:
        """Run the loop until the drives are armed."""
        while self.controller.mode is not Mode.ACTIVE:
            if not self.loop.step():
                raise RuntimeError(f"not armed: {[*self.box._events]}")
            if self.page and self.controller.mode is Mode.READY:
                self.page.arm()

    @property
    def controller(self) -> Any:
        return self.loop.controller

    @property
    def speed(self) -> float:
        """Velocity command at the simulated slave drive [m/s]."""
        return self.sim._applied.slave_velocity

    @property
    def force(self) -> float:
        """True contact force [N]."""
        return self.sim.plant.slave.force

    @property
    def measured(self) -> Any:
        return self.controller._measurement
