"""Input and output of the supervisor at each tick."""

from __future__ import annotations

import math
from typing import NamedTuple

from drivers import CHANNELS, STANDSTILL, Command
from teleop.safety.channels import Trip, Watch
from teleop.safety.events import ACTIVE, STOPPING, Event, Mode, stops_at_once


class Request(NamedTuple):
    """What the person and the loop ask of the supervisor at a tick."""

    arm: bool = False
    """Go from ready to active."""
    stop: str = ""
    """Reason for an orderly stop; empty to go on."""
    halt: bool = False
    """Whether to stop without a ramp."""
    trips: tuple[Trip, ...] = ()
    """Faults found outside the supervisor: exceptions, the emergency-stop key."""
    skipped: int = 0
    """Whole periods that the loop left out before this tick."""
    elapsed: float = 0.0
    """Time since the tick before [s] by the loop's own clock."""


NO_REQUEST = Request()


class Supervision(NamedTuple):
    """State of the supervisor."""

    mode: Mode = Mode.DISCONNECTED
    since: float = math.nan
    """When the mode was entered [s]."""
    time: float = math.nan
    """Time of the tick before [s]."""
    applied: Command = STANDSTILL
    """The last command."""
    accelerated: float = 0.0
    """Change of the slave's velocity in the last command [m/s]."""
    position: float = math.nan
    """Last position of the slave [m]."""
    behind: float = 0.0
    """Departure of the slave from its command [m].

    The drive's compliance and gain error are deducted.
    """
    lost: float = 0.0
    """Share of periods that the loop has skipped in about the last second."""
    drift: float = 0.0
    """Time by which the measurements' clock fell behind the loop's in about the last second [s]."""
    watches: tuple[Watch, ...] = (Watch(),) * len(CHANNELS)
    """Memory of each channel's check."""
    causes: tuple[Trip, ...] = ()
    """The fault that tripped, then each other kind of fault since; empty unless in fault."""

    @property
    def at_once(self) -> bool:
        """Whether any of the causes stops without a ramp."""
        return any(stops_at_once(cause.fault) for cause in self.causes)


class Verdict(NamedTuple):
    """Decision of the supervisor at a tick."""

    state: Supervision
    command: Command
    """The command to apply."""
    limited: int = 0
    """Flags of the soft limits that reduced the command."""
    events: tuple[Event, ...] = ()
    arm: bool = False
    """Whether the drives may be enabled now; once they are, `activated` gives the verdict."""

    @property
    def enabled(self) -> bool:
        """Whether the drives are to be in operation."""
        mode = self.state.mode
        return mode is ACTIVE or mode is STOPPING or self.command != STANDSTILL
