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
    """Connect to a rig, show every channel live, and prove the drives' watchdogs by silence.

    The drives are enabled at standstill for the proof; nothing moves without --move. Exits with
    2 if anything is wrong.

    Example: `teleop rig check rigs/serial-board.toml`

    Parameters
    ----------
    file
        Rig file, TOML.
    seconds
        How long to listen [s].
    move
        Move both drives too, forth and back by 1 mm at 2 mm/s.
    json
        Print one JSON document instead of a table.
    """
    import sys

    from drivers.wired_rig import WiredRig
    from teleop import console, rig_console
    from teleop.clock import RealClock
    from teleop.errors import InputError
    from teleop.realtime import realtime
    from teleop.rig_check import listen, problems, round_trips, watchdogs
    from teleop.rig_file import load_rig_file

    if not 0.1 <= seconds <= 3600.0:
        raise InputError(f"seconds {seconds:g}: expected 0.1 to 3600")
    rig_file = load_rig_file(file)
    clock = RealClock(rig_file.sections.rate_hz)
    with realtime("try") as real_time, WiredRig(rig_file, clock.now) as rig:
        real_time.start()
        with rig_console.live_channels(sys.stderr) as show:
            channels = listen(rig, clock, seconds, show)
        trips = dict(round_trips(rig, clock))
        drives = watchdogs(rig, clock, move)
        rejected = {name: dict(counts) for name, counts in rig.rejected.items()}
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
    if wrong:
        raise InputError(f"{file}: {'; '.join(wrong)}")
    return 0
