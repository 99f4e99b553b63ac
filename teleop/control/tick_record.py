"""Define the record of one tick: all quantities that are recorded."""

from __future__ import annotations

import math
from typing import NamedTuple

from drivers import Command, Measurement
from teleop.control.alignment import Pair
from teleop.control.clock import Tick
from teleop.safety import Event, Mode


class Timing(NamedTuple):
    """Times that the parts of one tick took."""

    read: float
    """Time that reading the rig took [s]."""
    compute: float
    """Time that condition, link and supervisor took [s]."""
    write: float
    """Time that sending the commands to the drives took [s]."""


class Record(NamedTuple):
    """All quantities that are recorded at one tick."""

    t: float
    """Time since the first tick at which the drives may be armed [s]; negative before this tick."""
    dt: float
    """Time since the previous tick [s]."""
    measurement: Measurement
    """Measurement of the rig, with the tare subtracted."""
    drive_force: float
    """Force on the virtual mass of the admittance [N]."""
    target: float
    """Target position of the slave, which the operator follows [m]; NaN if there is none."""
    desired: Command
    """Velocities that the condition and the coupling request, before the limits."""
    commanded: Command
    """Velocities that the supervisor commanded, after the limits."""
    applied: Command
    """Velocities that the drives applied."""
    pair: Pair
    """Slave position and contact force at the same time; NaN if there is no new pair."""
    mode: Mode
    """Mode of the supervisor."""
    limited: int
    """Sum of the flags of the soft limits that reduced the command."""
    tick: Tick
    """Timing of the tick by the loop's clock."""
    timing: Timing
    """Times that the parts of the tick took."""
    events: tuple[Event, ...]
    """Faults, and changes of the supervisor's mode, in this tick."""
    link: tuple[float, ...] = ()
    """Values of the communication channel and of the force feedback (see
    `teleop.control.bilateral`); empty if there is neither."""
    phase: float = math.nan
    """Number of the present step of a protocol, from 0; NaN in a condition without steps."""
    observed_hand_force: float = math.nan
    """Force of the hand that an observer estimates from the motion of the handle [N]; NaN if there
    is no observer. The controller does not use it."""
