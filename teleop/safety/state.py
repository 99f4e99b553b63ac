"""What goes into the supervisor and comes out of it at each tick."""

from __future__ import annotations

import math
from typing import NamedTuple

from drivers import CHANNELS, STANDSTILL, Command
from teleop.safety.channels import Trip, Watch
from teleop.safety.events import Event, Mode


class Request(NamedTuple):
    """What the person and the loop want of the supervisor at a tick."""

    arm: bool = False
    """Go from ready to active."""
    stop: str = ""
    """Why to come to a stop in good order; empty to go on."""
    halt: bool = False
    """Whether to stop without a ramp."""
    trip: Trip | None = None
    """A fault that the loop found: an exception, the emergency-stop key."""
    skipped: int = 0
    """Whole periods that the loop left out before this tick."""


NO_REQUEST = Request()


class Supervision(NamedTuple):
    """The supervisor's state."""

    mode: Mode = Mode.DISCONNECTED
    since: float = math.nan
    """When the mode was entered [s]."""
    time: float = math.nan
    """Of the tick before [s]."""
    applied: Command = STANDSTILL
    """The last command."""
    accelerated: float = 0.0
    """By how much it changed the slave's velocity [m/s]."""
    position: float = math.nan
    """The last position of the slave [m]."""
    behind: float = 0.0
    """How far the slave is behind its command and its drive's compliance [m].

    What the drive's gain error explains is forgiven.
    """
    lost: float = 0.0
    """Share of periods that the loop has skipped lately."""
    watches: tuple[Watch, ...] = (Watch(),) * len(CHANNELS)
    """What is remembered of each channel."""
    tripped: Trip | None = None
    """What tripped; None unless the mode is fault."""


class Verdict(NamedTuple):
    """What the supervisor decides at a tick."""

    state: Supervision
    command: Command
    """What to apply."""
    enabled: bool
    """Whether the drives are to be in operation."""
    limited: int
    """Flags of the soft limits that held the command back."""
    events: tuple[Event, ...]
