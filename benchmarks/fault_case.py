"""Define a trial into which a fault is injected, with a clock that can skip periods."""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from page_in_process import InProcess
from page_process import PageProcess

from sim_backend.faults import FaultyRig
from teleop.control.clock import Tick, VirtualClock
from teleop.control.tick_record import Record
from teleop.recording.recorder import Recorder
from teleop.safety import Mode
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.stream import Stream
from teleop.trial.assembly import make_controller, make_layout
from teleop.trial.loop import Loop
from teleop.trial.readers import ReadersInLoop
from teleop.trial.stop_switch import StopSwitch

AnyPage = InProcess | PageProcess
STORED = 10_000
"""Number of ticks in the stream."""
BLOCK = 10
"""Number of ticks after which the readers read. The estimators are then not compiled."""
FLUSHED = 80
"""Number of ticks after which the file is flushed."""
BEFORE = 200
"""Number of ticks before the injection that are recorded."""


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


class CampaignReaders(ReadersInLoop):
    """Readers in the process of the loop, whose recorder can fail as one in another process.

    Attributes
    ----------
    path
        File of the recording.
    first
        Number of the first tick that is recorded.
    """

    def begin_recording(self, path: Path) -> None:
        """Record the last `BEFORE` ticks, and the ticks from now on."""
        reader = self._stream.reader()
        reader.position = max(self._stream.newest - BEFORE, 0)
        self.path, self.first = path, reader.position + 1
        session = {"path": str(path), "metadata": {}, "overwrite": False, "show": False}
        session |= {"duration": 0.0, "hint": "", "instructions": "", "cue": None}
        self._recorder = Recorder(session, reader, partial(self._receive, "recorder"))
        self._recorder.begin(10**18)
        self._advance()
        self._recorder._file.flush()  # type: ignore[union-attr]

    def after_tick(self, record: Record) -> None:
        """Read the new ticks every `BLOCK` ticks, and flush the file every `FLUSHED` ticks."""
        self._time, self._mode = record.t, record.mode
        if self._stream.newest % BLOCK:
            return
        self._advance()
        if self._recorder and self._stream.newest % FLUSHED == 0:
            self._recorder._file.flush()  # type: ignore[union-attr]

    def _advance(self) -> None:
        self._estimation.advance()
        if self._recorder:
            self._recorder.advance()

    def kill(self) -> None:
        """Imitate SIGKILL of the recorder: write nothing more, not even buffered data."""
        self._recorder = None
        rest = self.path.with_suffix(".killed.mcap")
        rest.write_bytes(self.path.read_bytes())
        self.path.unlink()
        self.path = rest
        self.end_reason = "the recorder was killed"

    def fill(self) -> None:
        """Imitate a full disk."""
        assert self._recorder
        disk = self._recorder._file._disk  # type: ignore[union-attr]

        def refuse(data: bytes) -> int:
            disk.error = OSError(28, "No space left on device")
            raise disk.error

        disk.write = refuse


class Case:
    """One trial into which a fault will be injected.

    Parameters
    ----------
    settings, rig, clock
        As for the trial.
    make_stream
        Creates the stream of the trial, from the layout and a number of ticks.
    page
        The live page in which the trial is armed; None for no page.
    """

    def __init__(
        self,
        settings: TrialSettings,
        rig: FaultyRig,
        clock: Any,
        make_stream: Callable[..., Stream],
        page: AnyPage | None = None,
    ) -> None:
        self.settings, self.rig, self.clock = settings, rig, clock
        self.sim = rig.rig
        self.limits = settings.limits
        self.bank = settings.estimation_preset.bank()
        self.stream = make_stream(make_layout(settings, self.bank), STORED)
        self.readers = CampaignReaders(self.stream, settings, self.bank)
        self.switch = StopSwitch()
        self.random = random.Random(0)
        self.killed = False
        self.master_travel = 0.0
        """Commanded travel of the master since the injection [m]."""
        controller = make_controller(settings, rig, clock)
        self.loop = Loop(
            controller, clock, self.stream, self.readers, self.switch, settings.duration
        )
        self.page = page
        if page:
            self.switch.page = page.begin(settings, self.stream)

    def arm(self) -> None:
        """Run the loop until the drives are armed."""
        while self.controller.mode is not Mode.ACTIVE:
            if not self.loop.step():
                raise RuntimeError(f"not armed: {self.stream.events}")
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
