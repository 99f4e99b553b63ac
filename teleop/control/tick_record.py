"""Everything about one tick, as it is recorded."""

from __future__ import annotations

from typing import NamedTuple

from drivers import Command, Measurement
from estimation import Estimate
from teleop.control.alignment import Pair
from teleop.control.clock import Tick
from teleop.safety import Event, Mode


class Timing(NamedTuple):
    """Where the time of a tick went."""

    read: float
    """Reading the rig [s]."""
    compute: float
    """Condition, admittance, supervisor and estimators [s]."""
    write: float
    """Commanding the drives [s]."""


class Record(NamedTuple):
    """Everything about one tick."""

    t: float
    """Time since the first tick that may be armed [s]; negative before it."""
    dt: float
    """Time since the tick before [s]."""
    measurement: Measurement
    drive_force: float
    """Force on the admittance [N]."""
    desired: Command
    """What the control condition wanted."""
    commanded: Command
    """What the supervisor made of it."""
    applied: Command
    """What the drives made of that."""
    pair: Pair
    """What the conditioning was given; NaN where position and force made no pair."""
    x: float
    """Displacement that the estimators were given [m]; NaN where they were given none."""
    v: float
    """Velocity that the estimators were given [m/s]."""
    f: float
    """Force that the estimators were given [N]."""
    further: tuple[float, ...]
    """The model's regressors besides v and x."""
    estimates: dict[str, Estimate]
    """NaN where the estimators were given nothing."""
    excitation: float
    mode: Mode
    limited: int
    """Flags of the soft limits that held the command back."""
    tick: Tick
    timing: Timing
    events: tuple[Event, ...]
