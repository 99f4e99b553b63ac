"""Measure the control loop on this computer while it reads the devices of a rig."""

from __future__ import annotations

from drivers.rig_file import RigFile
from drivers.rig_sections import SerialSettings
from drivers.wired_rig import WiredRig
from teleop.safety.rig_limits import rig_limits
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.loop_verdict import LoopVerdict, verdict_of
from teleop.trial.rehearsal import rehearse


def check_loop(rig: WiredRig, seconds: float) -> LoopVerdict:
    """Measure the loop at the rate of an open rig for some time [s]; the drives stay idle.

    In each tick, the devices are read in addition to the work of a tick on the simulated rig.
    Nothing is sent to the drives: the time to send a command is assumed to be at most the computing
    time of the simulated rig.
    """
    sections = rig.file.sections
    settings = TrialSettings(condition="autonomous", rate=sections.rate_hz)
    timing = rehearse(settings, seconds, rig.read)
    return verdict_of(timing, rig_limits(sections), watchdog_times(rig.file))


def watchdog_times(rig: RigFile) -> dict[str, float]:
    """Return the watchdog time of each drive that has one [s], by its device and its name."""
    found = {}
    for name, drive in rig.sections.drives.items():
        milliseconds = getattr(rig.devices[drive.device], "watchdog_ms", None)
        if milliseconds is not None:
            found[f"{drive.device} ({name})"] = milliseconds * 1e-3
    return found


def serial_ports(rig: RigFile) -> list[str]:
    """Return the serial ports of a rig, including those of slcan adapters."""
    return [
        bus.port if isinstance(bus, SerialSettings) else bus.address
        for bus in rig.sections.buses.values()
        if isinstance(bus, SerialSettings) or getattr(bus, "interface", "") == "slcan"
    ]
