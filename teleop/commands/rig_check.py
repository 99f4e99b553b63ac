"""`teleop rig check`: check the channels, round-trip times, drives and watchdogs of a rig."""

from __future__ import annotations

import sys
from pathlib import Path

from teleop.commands.machine import check_duration
from teleop.commands.options import Json
from teleop.commands.quantities import Seconds


def check(
    file: Path,
    /,
    *,
    seconds: Seconds = 3.0,
    duration: Seconds = 60.0,
    move: bool = False,
    yes: bool = False,
    json: Json = False,
) -> int:
    """Connect to a rig, show every channel live, and test the watchdogs of its drives.

    A channel is a measured quantity. A watchdog stops a drive that receives no commands. If all
    channels work, the control loop is measured on this computer while it reads the devices, as with
    teleop machine check. Then the drives are enabled at standstill to test the watchdogs, and the
    load of the buses is measured. Nothing moves without --move. The safety supervisor is active,
    and Enter is an emergency stop. The exit code is 2 if there is a problem, and 3 after a safety
    stop.

    Example: `teleop rig check rigs/serial-board.toml`

    Parameters
    ----------
    file
        Rig file (TOML).
    seconds
        Time during which the channels are read [s].
    duration
        Time during which the loop is measured [s].
    move
        Also move both drives forward and back, by 0.05 to 0.4 mm at up to 1 mm/s, and compare
        the commanded travel with the travel that the encoders and the velocity channel measure.
        The first large difference ends the check. The slave must be free to move. A person has to
        arm the drives first.
    yes
        Arm the drives for --move without asking, for scripts.
    """
    from drivers import NotStoppedError
    from drivers.wired_rig import WiredRig
    from teleop.control.clock import RealClock
    from teleop.errors import InputError, SafetyStop
    from teleop.output.console import print_json
    from teleop.output.machine_tables import print_machine_check
    from teleop.output.rig_tables import live_channels, print_check
    from teleop.rig.drive_check import arming_text
    from teleop.rig.whole_check import check_document, check_rig
    from teleop.safety.events import time_text
    from teleop.settings.rig_loading import load_rig_file
    from teleop.trial.arming import is_armed
    from teleop.trial.realtime import realtime

    check_duration("seconds", seconds)
    check_duration("duration", duration)
    rig_file = load_rig_file(file)
    if move and not is_armed(rig_file, arming_text(rig_file), yes):
        return 130
    clock = RealClock(rig_file.sections.rate_hz)
    checked, unstopped = None, ""
    try:
        with realtime("try") as real_time, WiredRig(rig_file, clock.now) as rig:
            real_time.start()
            with live_channels(sys.stderr) as show:
                checked = check_rig(
                    rig,
                    clock,
                    seconds,
                    duration,
                    move,
                    lambda reports: show([channel._asdict() for channel in reports]),
                )
    except NotStoppedError as error:
        if not checked:
            raise
        unstopped = str(error)
    check = check_document(rig, checked, real_time.report)
    if json:
        print_json(check)
    else:
        print_check(check)
        if check["loop"]:
            print_machine_check(check["loop"])
    drives = checked.drives
    if drives and drives.fault:
        text = f"stopped {time_text(drives.fault['time'])}: {drives.fault['text']}"
        raise SafetyStop(f"{file}: {'; '.join(filter(None, (text, unstopped)))}")
    if unstopped:
        raise SafetyStop(f"{file}: {unstopped}")
    if drives and drives.interrupted:
        return 130
    if checked.problems:
        raise InputError(f"{file}: {'; '.join(checked.problems)}")
    return 0
