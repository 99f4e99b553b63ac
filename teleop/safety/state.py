"""Define input, output and state of the safety supervisor at a tick of the control loop."""

from __future__ import annotations

import math
from typing import NamedTuple

from drivers import CHANNELS, STANDSTILL, Command
from teleop.safety.channels import ChannelState, DetectedFault
from teleop.safety.events import ACTIVE, STOPPING, Event, Mode, stops_immediately


class Request(NamedTuple):
    """Input of the supervisor at a tick: requests of a person, and data from the loop."""

    arm: bool = False
    """Whether to arm the drives. Arming changes the mode from ready to active."""
    stop: str = ""
    """Reason for a stop with a ramp; empty if no stop is requested."""
    halt: bool = False
    """Whether a stop without a ramp is requested."""
    faults: tuple[DetectedFault, ...] = ()
    """Faults detected outside the supervisor, for example exceptions and the emergency-stop key."""
    skipped: int = 0
    """Number of whole periods that the loop skipped before this tick."""
    elapsed: float = 0.0
    """Time since the previous tick on the clock of the loop [s]."""
    stiffness: float | None = None
    """Expected stiffness of the palpated body at the position of the slave [N/m].

    If a stiffness is given, the soft limits reduce the velocities of master and slave separately.
    If the value is None, they reduce both velocities by the same factor.
    """


NO_REQUEST = Request()
"""Input of the supervisor at a tick without a request."""


class Halting(NamedTuple):
    """Motion of the slave since its drives were disabled, until it has come to rest."""

    since: float
    """Time of the stop, or the latest time at which the specimen pushed the slave [s]."""
    start: float
    """Position of the slave at the time `since` [m]."""
    moved: float
    """Latest time at which the slave was seen to move [s]."""
    position: float
    """Position of the slave at the time `moved` [m]."""
    pushing: float = math.inf
    """Smallest contact force with which the specimen has pushed the slave since the stop [N]."""


class Supervision(NamedTuple):
    """State of the safety supervisor after a tick, which is its input at the next tick."""

    mode: Mode = Mode.DISCONNECTED
    """Mode after the tick."""
    since: float = math.nan
    """Time at which the present mode was entered [s].

    While the drives are not armed, each tick at which the rig is not at rest sets this value to the
    time of the tick. The mode can become ready only if the rig is at rest long enough.
    """
    time: float = math.nan
    """Time of the tick [s]."""
    applied: Command = STANDSTILL
    """Command that was applied at the tick."""
    velocity_change: float = 0.0
    """Magnitude of the change of the slave's commanded velocity at the tick [m/s]."""
    position: float = math.nan
    """Measured position of the slave [m]."""
    following_error: float = 0.0
    """Following error: commanded travel minus measured travel of the slave [m].

    It does not include the difference that the compliance of the drive and an allowed gain error
    can cause; see `update_following_error`.
    """
    followed: float = 0.0
    """Velocity with which the slave follows its commands, after the lag of its drive [m/s]."""
    skipped_fraction: float = 0.0
    """Fraction of its periods that the loop skipped; see `update_skipped_fraction`."""
    drift: float = 0.0
    """Time by which the clock of the rig fell behind the clock of the loop [s]; see
    `update_clock_drift`."""
    channel_states: tuple[ChannelState, ...] = (ChannelState(),) * len(CHANNELS)
    """State of the check of each channel, in the order of `CHANNELS`."""
    halting: Halting | None = None
    """Motion of the slave after a stop; None before a stop, and after the slave came to rest."""
    causes: tuple[DetectedFault, ...] = ()
    """The first fault of each kind, in the order of detection; empty unless the mode is fault."""

    @property
    def enabled(self) -> bool:
        """Whether the drives remain enabled after the tick, if they were enabled.

        They remain enabled in the modes active and stopping, and while the command is not zero.
        """
        return self.mode is ACTIVE or self.mode is STOPPING or self.applied != STANDSTILL

    @property
    def immediate(self) -> bool:
        """Whether a fault in the attribute `causes` requires that the drives stop immediately.

        If not, the velocity first decreases to zero on a ramp.
        """
        return any(stops_immediately(cause.fault) for cause in self.causes)


class Verdict(NamedTuple):
    """Output of the safety supervisor at a tick: its new state, the command, and the events."""

    state: Supervision
    """State of the supervisor after this tick."""
    command: Command
    """The command to send to the drives."""
    limited: int = 0
    """Sum of the flags of the soft limits that reduced the command."""
    events: tuple[Event, ...] = ()
    """Changes of mode and faults of this tick."""
    arm: bool = False
    """Whether the drives may be enabled now. Call `activate` when all drives are in operation."""

    @property
    def enabled(self) -> bool:
        """Whether the drives must remain enabled. If False, the controller disables them."""
        return self.state.enabled
