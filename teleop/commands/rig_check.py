"""`teleop rig check`: what a rig's devices send, and whether their watchdogs work."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def check(
    file: Path,
    /,
    *,
    seconds: float = 3.0,
    move: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Connect to a rig, show every channel live, and let the watchdogs of its drives run out.

    The drives are enabled at standstill for that, if every channel is well; nothing moves without
    --move. The safety supervisor watches them, and Enter is an emergency stop. Exits with 2 if
    anything is wrong, and with 3 after a stop for safety.

    Example: `teleop rig check rigs/serial-board.toml`

    Parameters
    ----------
    file
        Rig file, TOML.
    seconds
        How long to listen [s].
    move
        Move both drives too, forth and back in strokes of 0.05 to 0.4 mm at 1 mm/s at most, and
        compare the commanded travel with what the encoders and the velocity channel show. The
        first that differs ends the check. The slave must be free to move.
    json
        Print one JSON document instead of a table.
    """
    import sys

    from drivers.wired_rig import WiredRig
    from teleop.control.clock import RealClock
    from teleop.errors import InputError, SafetyStop
    from teleop.output import rig_tables as rig_console
    from teleop.output import tables as console
    from teleop.recording.black_box import moment
    from teleop.rig.channel_check import listen, problems, round_trips
    from teleop.rig.drive_check import check_drives
    from teleop.rig.loading import load_rig_file
    from teleop.trial.realtime import realtime
    from teleop.trial.rehearsal import tick_cost
    from teleop.trial.settings import TrialSettings

    if not 0.1 <= seconds <= 3600.0:
        raise InputError(f"seconds {seconds:g}: expected 0.1 to 3600")
    rig_file = load_rig_file(file)
    tick_cost(TrialSettings(condition="autonomous"))  # the first ticks of a process are slow
    clock = RealClock(rig_file.sections.rate_hz)
    with realtime("try") as real_time, WiredRig(rig_file, clock.now) as rig:
        real_time.start()
        with rig_console.live_channels(sys.stderr) as show:
            channels = listen(rig, clock, seconds, show)
        trips = dict(round_trips(rig, clock))
        found = None if problems(channels, []) else check_drives(rig, clock, move)
        rejected = {name: dict(counts) for name, counts in rig.rejected.items()}
    drives = found.drives if found else []
    wrong = problems(channels, drives)
    if json:
        console.print_json(
            {
                "rig": rig_file.sections.name,
                "channels": [channel._asdict() for channel in channels],
                "round_trip_s": trips,
                "drives": [drive._asdict() for drive in drives],
                "rejected": rejected,
                "problems": wrong,
            }
        )
    else:
        rig_console.print_check(rig_file.sections.name, channels, trips, drives, rejected)
    if found and found.fault:
        raise SafetyStop(f"{file}: stopped {moment(found.fault)}: {found.fault['text']}")
    if found and found.interrupted:
        return 130
    if wrong:
        raise InputError(f"{file}: {'; '.join(wrong)}")
    return 0
