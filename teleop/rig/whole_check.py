"""Check a whole rig: its channels, devices, control loop, buses, drives and watchdogs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from drivers.wired_rig import WiredRig
from teleop.control.clock import Clock
from teleop.rig.bus_load import overloaded
from teleop.rig.channel_check import ChannelReport, list_problems, listen, round_trips
from teleop.rig.drive_check import DrivesReport, check_drives
from teleop.rig.loop_check import check_loop, serial_ports
from teleop.trial.computer import latency_timers
from teleop.trial.loop_verdict import LoopVerdict
from teleop.trial.machine_check import loop_document


class RigCheck(NamedTuple):
    """Result of the check of an open rig. A part that was not checked is None."""

    channels: Sequence[ChannelReport]
    round_trips: Mapping[str, float]
    loop: LoopVerdict | None
    drives: DrivesReport | None
    rejected: Mapping[str, Mapping[str, int]]

    @property
    def problems(self) -> list[str]:
        """All problems of the rig, and of the computer with it."""
        drives = self.drives.drives if self.drives else []
        against = [] if self.loop is None or self.loop.possible else self.loop.reasons
        return [*list_problems(self.channels, drives), *against]


def check_rig(
    rig: WiredRig,
    clock: Clock,
    seconds: float,
    duration: float,
    move: bool,
    show: Callable[[list[ChannelReport]], None],
) -> RigCheck:
    """Check an open rig. If a channel has a problem, loop and drives are not checked.

    Parameters
    ----------
    rig
        The rig.
    clock
        Clock of the loop.
    seconds
        Time during which the channels are read [s].
    duration
        Time during which the loop is measured [s].
    move
        Whether the drives move.
    show
        Function that shows the channels while they are read.
    """
    channels = listen(rig, clock, seconds, show)
    trips = dict(round_trips(rig, clock))
    loop = drives = None
    if not list_problems(channels, []):
        loop = check_loop(rig, duration)
        drives = check_drives(rig, clock, move)
    rejected = {name: dict(counts) for name, counts in rig.rejected.items()}
    return RigCheck(channels, trips, loop, drives, rejected)


def check_document(rig: WiredRig, check: RigCheck, realtime: Mapping[str, str]) -> dict[str, Any]:
    """Return the result of a check as a JSON document. `realtime` are the results of its steps."""
    drives = check.drives.drives if check.drives else []
    loop: dict[str, Any] | None = None
    if check.loop:
        loads = check.drives.bus_load if check.drives else {}
        further = overloaded(loads, check.loop.timing.rate)
        timers = latency_timers(serial_ports(rig.file))
        loop = {**loop_document(check.loop, realtime, timers, further), "bus_load": loads}
    return {
        "rig": rig.file.sections.name,
        "channels": [channel._asdict() for channel in check.channels],
        "round_trip_s": check.round_trips,
        "drives": [drive._asdict() for drive in drives],
        "rejected": check.rejected,
        "problems": check.problems,
        "loop": loop,
    }
