"""Input and output of the supervisor at each tick."""

from __future__ import annotations

import math
from typing import NamedTuple

from drivers import CHANNELS, STANDSTILL, Command
from teleop.safety.channels import ChannelState, DetectedFault
from teleop.safety.events import ACTIVE, STOPPING, Event, Mode, stops_immediately


class Request(NamedTuple):
    """Input of the supervisor at a tick: requests of the person, and data from the loop."""

    arm: bool = False
    """Whether to arm the drives, which changes the mode from ready to active."""
    stop: str = ""
    """Reason for a stop with a ramp; empty to continue."""
    halt: bool = False
    """Whether to stop without a ramp."""
    faults: tuple[DetectedFault, ...] = ()
    """Faults detected outside the supervisor: exceptions, the emergency-stop key."""
    skipped: int = 0
    """Number of whole periods that the loop skipped before this tick."""
    elapsed: float = 0.0
    """Time since the previous tick by the loop's own clock [s]."""


NO_REQUEST = Request()
"""A tick without any request."""


class Supervision(NamedTuple):
    """State of the supervisor, which is passed from one tick to the next."""

    mode: Mode = Mode.DISCONNECTED
    """Mode after the tick."""
    since: float = math.nan
    """Time at which the mode was entered [s]."""
    time: float = math.nan
    """Time of the tick [s]."""
    applied: Command = STANDSTILL
    """Command of the tick."""
    velocity_change: float = 0.0
    """Magnitude of the change of the slave's commanded velocity at the tick [m/s]."""
    position: float = math.nan
    """Position of the slave [m]."""
    following_error: float = 0.0
    """Following error: commanded travel minus measured travel of the slave [m].

    The part that the drive's compliance and gain error explain is subtracted.
    """
    skipped_fraction: float = 0.0
    """Fraction of periods that the loop has skipped, averaged over about one second."""
    drift: float = 0.0
    """Delay of the rig's clock behind the loop's, over about the last second [s]."""
    channel_states: tuple[ChannelState, ...] = (ChannelState(),) * len(CHANNELS)
    """State of each channel's check, in the order of `CHANNELS`."""
    causes: tuple[DetectedFault, ...] = ()
    """The first fault, then each other kind of fault since; empty unless in fault mode."""

    @property
    def immediate(self) -> bool:
        """Whether any of the causes stops the drives without a ramp."""
        return any(stops_immediately(cause.fault) for cause in self.causes)


class Verdict(NamedTuple):
    """Decision of the supervisor at a tick."""

    state: Supervision
    """State of the supervisor after this tick."""
    command: Command
    """The command to apply."""
    limited: int = 0
    """Flags of the soft limits that reduced the command."""
    events: tuple[Event, ...] = ()
    """Changes of mode and faults of this tick."""
    arm: bool = False
    """Whether the drives may be enabled now; `activate` returns the verdict when they are."""

    @property
    def enabled(self) -> bool:
        """Whether the drives have to be enabled."""
        mode = self.state.mode
        return mode is ACTIVE or mode is STOPPING or self.command != STANDSTILL
