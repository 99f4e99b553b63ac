"""Trials on emulated devices in virtual time and one process.

The emulator takes a step at each tick, so a trial of a second takes a fraction of it, and a
fault sets in at a chosen tick. The wire is real: pyserial and python-can talk to pseudo-terminals.
Tests of many trials replace the pseudo-terminals by lines in memory, since most of the time of a
tick is spent in the system's calls.
"""

from __future__ import annotations

import contextlib
import errno
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import pytest

from drivers import Measurement
from drivers.rig_file import RigFile, parse_rig_file, read_rig_file
from drivers.wired_rig import WiredRig
from sim_backend.wire.emulator import Emulator, PlannedFault, host_file
from sim_backend.wire.mechanism import NEVER
from teleop.rig.emulation import emulated_master
from teleop.safety.rig_limits import rig_limits
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.assembly import make_simulated_rig
from teleop.trial.result import Trial
from teleop.trial.run import run_trial

RIGS = Path(__file__).parents[3] / "rigs"


class SteppedRig(WiredRig):
    """A hardware rig, emulated synchronously with its clock."""

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
        self._temporary = tempfile.TemporaryDirectory(prefix="stepped-")
        folder = Path(self._temporary.name)
        self.emulator = Emulator(
            file,
            lambda now, enabled: make_simulated_rig(settings, now, NEVER, coupled=False),
            folder,
            faults,
            self.present,
        )
        prepare(self.emulator)
        host = folder / "host.toml"
        host.write_text(rewrite(host_file(self.emulator)))
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

    @contextlib.contextmanager
    def served(self) -> Iterator[None]:
        """Run the emulator in a thread, while the rig waits in real time."""
        done = threading.Event()

        def serve() -> None:
            while not done.wait(0.5e-3):
                self.emulator.step()

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()

    def open(self) -> None:
        self.emulator.__enter__()
        with self.served():
            super().open()

    def read(self) -> Measurement:
        self.emulator.step()
        return super().read()

    def close(self) -> None:
        try:
            with self.served():
                super().close()
        finally:
            self.emulator.__exit__(None, None, None)
            self._temporary.cleanup()


class Line:
    """A serial line in memory, with the methods of a pseudo-terminal for the device."""

    lines: ClassVar[dict[Path, Line]] = {}
    """Those that are plugged in, by their path."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.to_device = self.to_host = b""
        self.answer: Callable[[], object]
        """Lets the device answer while the host waits."""

    def open(self) -> None:
        self.plugged = True
        self.lines[self.path] = self

    def read(self) -> bytes:
        data, self.to_device = self.to_device, b""
        return data

    def write(self, data: bytes) -> None:
        self.to_host += data

    def close(self) -> None:
        self.plugged = False
        self.lines.pop(self.path, None)


class HostEnd:
    """The host's end of a line in memory, with the methods of an opened port."""

    def __init__(self, channel: str, baud: int) -> None:
        if Path(channel) not in Line.lines:
            raise OSError(errno.ENOENT, "no such line")
        self.line = Line.lines[Path(channel)]

    def read(self, timeout: float | None) -> bytes:
        line = self.plugged()
        if timeout and not line.to_host:
            line.answer()
        data, line.to_host = line.to_host, b""
        return data

    def write(self, data: bytes, timeout: float) -> int:
        return self.send(data)

    def send(self, data: bytes) -> int:
        self.plugged().to_device += data
        return len(data)

    def discard_input(self) -> None:
        self.plugged().to_host = b""

    def close(self) -> None: ...

    def plugged(self) -> Line:
        if not self.line.plugged:
            raise OSError(errno.EIO, "the line is unplugged")
        return self.line


class RigInMemory(SteppedRig):
    """The same on lines in memory: nothing waits in real time."""

    def nap(self, seconds: float) -> None:
        self._ahead += seconds
        self.emulator.step()

    @contextlib.contextmanager
    def served(self) -> Iterator[None]:
        yield

    def open(self) -> None:
        self.emulator.__enter__()
        for wire in self.emulator.wires.values():
            if isinstance(port := getattr(wire, "port", None), Line):
                port.answer = self.emulator.step
        WiredRig.open(self)


@dataclass(frozen=True)
class SteppedTrial:
    """A trial on an emulated rig in virtual time."""

    settings: TrialSettings
    file: RigFile
    faults: Sequence[PlannedFault] = ()
    prepare: Callable[[Emulator], None] = lambda emulator: None
    rewrite: Callable[[str], str] = str
    """Changes the rig file that the host reads."""
    kind: type[SteppedRig] = SteppedRig

    def make_rig(self, now: Callable[[], float]) -> SteppedRig:
        return self.kind(self.file, self.settings, now, self.faults, self.prepare, self.rewrite)

    def run(self) -> Trial:
        return run_trial(self.settings, rig_maker=self.make_rig, arm=True)


def stepped_trial(
    name: str,
    condition: str = "autonomous",
    *,
    faults: Sequence[PlannedFault] = (),
    prepare: Callable[[Emulator], None] = lambda emulator: None,
    rewrite: Callable[[str], str] = str,
    kind: type[SteppedRig] = SteppedRig,
    rate: float | None = None,
    edit: Callable[[str], str] = str,
    **settings: Any,
) -> SteppedTrial:
    """A trial on one of the example rigs, at the rate of its file if no other rate is given.

    `edit` changes the text of the rig file, for the emulated devices and for the host.
    """
    path = RIGS / f"{name}.toml"
    file = parse_rig_file(path, edit(path.read_text()))
    made = TrialSettings(
        condition=condition,
        clock="virtual",
        rate=rate or file.sections.rate_hz,
        custom_limits=rig_limits(file.sections),
        force_master=emulated_master(file),
        **settings,
    )
    return SteppedTrial(made, file, faults, prepare, rewrite, kind)


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    """Shorten the time that a trial records after a fault."""
    monkeypatch.setattr("teleop.trial.loop.AFTER", 0.2)


@pytest.fixture
def stepped() -> Callable[..., SteppedTrial]:
    """Returns a function that creates a trial on an emulated example rig."""
    pytest.importorskip("pty", reason="there are no pseudo-terminals on this system")
    return stepped_trial


@pytest.fixture
def in_memory(monkeypatch) -> Callable[..., SteppedTrial]:
    """Makes the same trial, with lines in memory in place of pseudo-terminals."""
    for module in ("serial_wire", "can_wires"):
        monkeypatch.setattr(f"sim_backend.wire.{module}.PseudoTerminal", Line)
    for module in ("serial_port", "slcan"):
        monkeypatch.setattr(f"drivers.transports.{module}.open_port", HostEnd)
    # the kernel's time stamps are in real time
    for module in ("datagram_port", "can_bus"):
        monkeypatch.setattr(f"drivers.transports.{module}.LATEST", -1.0)
    return partial(stepped_trial, kind=RigInMemory)
