"""Trials on emulated devices over real pseudo-terminals, in virtual time and one process.

The emulator takes a step at each tick, so a trial of a second takes a fraction of it, and a
fault sets in at a chosen tick. The wire is real: pyserial and python-can talk to pseudo-terminals.
"""

from __future__ import annotations

import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from drivers import Measurement
from drivers.rig_file import RigFile, read_rig_file
from drivers.wired_rig import WiredRig
from sim_backend.wire.emulator import Emulator, PlannedFault, host_file
from sim_backend.wire.mechanism import NEVER
from teleop.safety.rig_limits import rig_limits
from teleop.settings import TrialSettings

RIGS = Path(__file__).parents[3] / "rigs"


class SteppedRig(WiredRig):
    """A rig of devices, emulated in step with its clock."""

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
            lambda now: settings.make_simulated_rig(now, NEVER),
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
        """The clock's time, and what the opening took."""
        return self._clock() + self._ahead

    def nap(self, seconds: float) -> None:
        """Let time pass, here and outside."""
        self._ahead += seconds
        time.sleep(seconds)

    def open(self) -> None:
        """Open, while the emulator goes on in a thread: an adapter's opening waits in real time."""
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
class SteppedSettings(TrialSettings):
    """A trial on an emulated rig in virtual time."""

    file: RigFile = field(kw_only=True)
    faults: Sequence[PlannedFault] = ()
    prepare: Callable[[Emulator], None] = lambda emulator: None
    rewrite: Callable[[str], str] = str
    """What is wrong in the rig file that the host reads."""

    def make_rig(self, now: Callable[[], float]) -> SteppedRig:
        return SteppedRig(self.file, self, now, self.faults, self.prepare, self.rewrite)


def stepped_settings(name: str, condition: str = "autonomous", **settings: Any) -> SteppedSettings:
    """A trial on one of the example rigs."""
    file = read_rig_file(RIGS / f"{name}.toml")
    return SteppedSettings(
        condition=condition,
        clock="virtual",
        rate=file.sections.rate_hz,
        custom_limits=rig_limits(file.sections),
        file=file,
        **settings,
    )


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    """After a fault a trial holds still for a moment only."""
    monkeypatch.setattr("teleop.session.AFTER", 0.2)


@pytest.fixture
def stepped() -> Callable[..., SteppedSettings]:
    """Makes the settings of a trial on one of the example rigs, emulated."""
    pytest.importorskip("pty", reason="there are no pseudo-terminals on this system")
    return stepped_settings
