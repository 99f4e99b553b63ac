"""Trials on emulated devices over real pseudo-terminals, in virtual time and one process.

The emulator takes a step at each tick, so a trial of a second takes a fraction of it, and a
fault sets in at a chosen tick. The wire is real: pyserial and python-can talk to pseudo-terminals.
"""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from drivers import Measurement
from drivers.rig_file import RigFile, read_rig_file
from drivers.wired_rig import WiredRig
from sim_backend.wire.bench import NEVER
from sim_backend.wire.emulator import Emulator, PlannedFault, host_file
from teleop.safety.rig_limits import rig_limits
from teleop.trial.assembly import make_simulated_rig
from teleop.trial.result import Trial
from teleop.trial.run import run_trial
from teleop.trial.settings import TrialSettings

RIGS = Path(__file__).parents[3] / "rigs"


class SteppedRig(WiredRig):
    """A rig of devices, emulated synchronously with its clock."""

    def __init__(
        self,
        file: RigFile,
        settings: TrialSettings,
        now: Callable[[], float],
        faults: Sequence[PlannedFault],
        prepare: Callable[[Emulator], None],
        rewrite: Callable[[str], str],
    ) -> None:
        self._ahead = 0.0
        self._clock = now
        self._folder = Path(tempfile.mkdtemp(prefix="stepped-"))
        self.emulator = Emulator(
            file,
            lambda now: make_simulated_rig(settings, now, NEVER),
            self._folder,
            faults,
            self.present,
        )
        prepare(self.emulator)
        host = self._folder / "host.toml"
        host.write_text(rewrite(host_file(file, self._folder)))
        super().__init__(read_rig_file(host), self.present)
        for bus in self.buses.values():
            bus.nap = self.nap

    def present(self) -> float:
        """Return the time of the clock plus the duration of opening [s]."""
        return self._clock() + self._ahead

    def nap(self, seconds: float) -> None:
        """Advance the time of the rig and of the emulator."""
        self._ahead += seconds
        time.sleep(seconds)

    def open(self) -> None:
        """Open while the emulator runs in a thread: opening an adapter waits in real time."""
        self.emulator.__enter__()
        opened = threading.Event()

        def serve() -> None:
            while not opened.wait(0.5e-3):
                self.emulator.step()

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            super().open()
        finally:
            opened.set()
            thread.join()

    def read(self) -> Measurement:
        self.emulator.step()
        return super().read()

    def close(self) -> None:
        super().close()
        self.emulator.__exit__(None, None, None)


@dataclass(frozen=True)
class SteppedTrial:
    """A trial on an emulated rig in virtual time."""

    settings: TrialSettings
    file: RigFile
    faults: Sequence[PlannedFault] = ()
    prepare: Callable[[Emulator], None] = lambda emulator: None
    rewrite: Callable[[str], str] = str
    """Changes the rig file that the host reads."""

    def make_rig(self, now: Callable[[], float]) -> SteppedRig:
        return SteppedRig(self.file, self.settings, now, self.faults, self.prepare, self.rewrite)

    def run(self) -> Trial:
        return run_trial(self.settings, rig_maker=self.make_rig)


def stepped_trial(
    name: str,
    condition: str = "autonomous",
    *,
    faults: Sequence[PlannedFault] = (),
    prepare: Callable[[Emulator], None] = lambda emulator: None,
    rewrite: Callable[[str], str] = str,
    **settings: Any,
) -> SteppedTrial:
    """A trial on one of the example rigs."""
    file = read_rig_file(RIGS / f"{name}.toml")
    made = TrialSettings(
        condition=condition,
        clock="virtual",
        rate=file.sections.rate_hz,
        custom_limits=rig_limits(file.sections),
        **settings,
    )
    return SteppedTrial(made, file, faults, prepare, rewrite)


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    """Shorten the time that a trial records after a fault."""
    monkeypatch.setattr("teleop.trial.loop.AFTER", 0.2)


@pytest.fixture
def stepped() -> Callable[..., SteppedTrial]:
    """Returns a function that creates a trial on an emulated example rig."""
    pytest.importorskip("pty", reason="there are no pseudo-terminals on this system")
    return stepped_trial
