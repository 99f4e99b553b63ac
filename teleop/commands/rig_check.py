"""`teleop rig check`: check the channels, round-trip times, drives and watchdogs of a rig."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

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
    from teleop.rig.bus_load import overloaded
    from teleop.rig.channel_check import list_problems, listen, round_trips
    from teleop.rig.drive_check import arming_text, check_drives
    from teleop.rig.loop_check import check_loop, serial_ports
    from teleop.safety.events import time_text
    from teleop.settings.rig_loading import load_rig_file
    from teleop.trial.arming import is_armed
    from teleop.trial.computer import latency_timers
    from teleop.trial.machine_check import loop_document
    from teleop.trial.realtime import realtime

    check_duration("seconds", seconds)
    check_duration("duration", duration)
    rig_file = load_rig_file(file)
    if move and not is_armed(rig_file, arming_text(rig_file), yes):
        return 130
    clock = RealClock(rig_file.sections.rate_hz)
    checked, loop, unstopped = None, None, ""
    try:
        with realtime("try") as real_time, WiredRig(rig_file, clock.now) as rig:
            real_time.start()
            with live_channels(sys.stderr) as show:
                channels = listen(
                    rig,
                    clock,
                    seconds,
                    lambda reports: show([channel._asdict() for channel in reports]),
                )
            round_trip = dict(round_trips(rig, clock))
            if not list_problems(channels, []):
                loop = check_loop(rig, duration)
                checked = check_drives(rig, clock, move)
            rejected = {name: dict(counts) for name, counts in rig.rejected.items()}
    except NotStoppedError as error:
        if not checked:
            raise
        unstopped = str(error)
    drives = checked.drives if checked else []
    problems = list_problems(channels, drives)
    if loop and not loop.possible:
        problems += loop.reasons
    check: dict[str, Any] = {
        "rig": rig_file.sections.name,
        "channels": [channel._asdict() for channel in channels],
        "round_trip_s": round_trip,
        "drives": [drive._asdict() for drive in drives],
        "rejected": rejected,
        "problems": problems,
        "loop": None,
    }
    if loop:
        loads = checked.bus_load if checked else {}
        further = overloaded(loads, loop.timing.rate)
        timers = latency_timers(serial_ports(rig_file))
        check["loop"] = {
            **loop_document(loop, real_time.report, timers, further),
            "bus_load": loads,
        }
    if json:
        print_json(check)
    else:
        print_check(check)
        if check["loop"]:
            print_machine_check(check["loop"])
    if checked and checked.fault:
        text = f"stopped {time_text(checked.fault['time'])}: {checked.fault['text']}"
        raise SafetyStop(f"{file}: {'; '.join(filter(None, (text, unstopped)))}")
    if unstopped:
        raise SafetyStop(f"{file}: {unstopped}")
    if checked and checked.interrupted:
        return 130
    if problems:
        raise InputError(f"{file}: {'; '.join(problems)}")
    return 0
