"""Write one file with everything that the developers need to know about a rig with real devices."""

from __future__ import annotations

import io
import time
import zipfile
from collections import deque
from pathlib import Path
from typing import Any

from drivers import NotStoppedError, RigError
from drivers.ports import available_ports
from drivers.rig_file import RigFile
from drivers.wired_rig import WiredRig
from teleop.control.clock import Clock
from teleop.errors import InputError
from teleop.files import new_file
from teleop.json_documents import dumps
from teleop.rig.channel_check import listen
from teleop.rig.whole_check import check_document, check_rig
from teleop.trial.computer import this_computer
from teleop.trial.metadata import libraries, versions
from teleop.trial.realtime import realtime

ENDING = ".zip"
LIBRARIES = ("pyserial", "python-can", "canopen", "cantools", "websockets", "pydantic")
"""Packages that the drivers use."""
LOGGED = 50_000
"""Largest number of logged transmissions; later ones are left out."""
LOGGED_TIME = 0.5
"""Time during which the samples of the devices are logged, after their set-up [s]."""


class WireLog:
    """The first transmissions on the buses of a rig, as text."""

    def __init__(self) -> None:
        self._start = time.monotonic()
        self._lines: deque[str] = deque()

    def attach(self, rig: WiredRig) -> None:
        """Log the transmissions of all buses from now on. The rig is not open yet."""
        for name, bus in rig.buses.items():
            bus.log = lambda way, text, name=name: self._add(name, way, text)

    def detach(self, rig: WiredRig) -> None:
        """Log no more transmissions."""
        for bus in rig.buses.values():
            bus.log = None

    def _add(self, bus: str, way: str, text: str) -> None:
        if len(self._lines) < LOGGED:
            self._lines.append(f"{time.monotonic() - self._start:.6f} {bus} {way} {text}")

    @property
    def text(self) -> str:
        """One line for each transmission: time [s], bus, < received or > sent, and its bytes."""
        return "".join(f"{line}\n" for line in self._lines)


def report_rig(file: RigFile, clock: Clock, seconds: float, duration: float) -> dict[str, Any]:
    """Check a rig at standstill, and return everything that is known about it.

    If the rig cannot be opened, or its check fails, the key `error` states why. The key `wire` is
    the text of the `WireLog`.

    Parameters
    ----------
    file
        The rig file.
    clock
        Clock of the loop.
    seconds
        Time during which the channels are read [s].
    duration
        Time during which the loop is measured [s].
    """
    report: dict[str, Any] = {
        "software": versions() | {"drivers": libraries(LIBRARIES)},
        "computer": this_computer()._asdict(),
        "ports": [port._asdict() for port in available_ports()],
        "devices": {},
        "check": None,
        "error": "",
    }
    log = WireLog()
    rig = WiredRig(file, clock.now)
    log.attach(rig)
    try:
        with realtime("try") as applied, rig:
            report["devices"] = {name: dict(one.about()) for name, one in rig.devices.items()}
            listen(rig, clock, LOGGED_TIME, lambda channels: None)
            log.detach(rig)
            applied.start()
            check = check_rig(rig, clock, seconds, duration, False, lambda channels: None)
            report["check"] = check_document(rig, check, applied.report)
            if check.drives and check.drives.fault:
                report["error"] = f"stopped for safety: {check.drives.fault['text']}"
    except (RigError, NotStoppedError, InputError) as error:
        report["error"] = str(error)
    report["wire"] = log.text
    return report


def write_report(path: Path, file: RigFile, report: dict[str, Any], overwrite: bool) -> None:
    """Write a report to a ZIP archive: `report.json`, `rig.toml` and `wire.txt`."""
    rest = {name: part for name, part in report.items() if name != "wire"}
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("report.json", dumps(rest, indent=2) + "\n")
        archive.writestr("rig.toml", file.text)
        archive.writestr("wire.txt", report["wire"])
    with new_file(path, overwrite) as out:
        out.write(content.getvalue())
