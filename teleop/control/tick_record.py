"""All quantities of one tick, as they are recorded."""

from __future__ import annotations

from typing import NamedTuple

from drivers import Command, Measurement
from estimation import Estimate
from teleop.control.alignment import Pair
from teleop.control.clock import Tick
from teleop.safety import Event, Mode


class Timing(NamedTuple):
    """Durations of the parts of a tick."""

    read: float
    """Time to read the rig [s]."""
    compute: float
    """Time of condition, admittance, supervisor and estimators [s]."""
    write: float
    """Time to command the drives [s]."""


class Record(NamedTuple):
    """All quantities of one tick."""

    t: float
    """Time since the first tick at which the drives may be armed [s]; negative before it."""
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
    """Position and force at the same time; NaN if there is no new pair."""
    x: float
    """Displacement passed to the estimators [m]; NaN if none."""
    v: float
    """Velocity passed to the estimators [m/s]; NaN if none."""
    f: float
    """Force passed to the estimators [N]; NaN if none."""
    further: tuple[float, ...]
    """Values of the regressors of the model other than v and x, such as x^3."""
    estimates: dict[str, Estimate]
    """Estimates by the name of the estimator; NaN if the estimators were not updated."""
    excitation: float
    """Excitation measure; 0 for no excitation, 1 for a sine of 1 Hz about the position x = 0."""
    contact: float
    """1 while the gate of the bank detects contact, else 0; NaN without a gate or estimates."""
    misfit: tuple[float, ...]
    """Misfit of each estimator (`estimation.misfit`); NaN if it is not known yet."""
    mode: Mode
    """Mode of the supervisor."""
    limited: int
    """Bit flags of the soft limits that reduced the command."""
    tick: Tick
    """Timing of the tick by the loop's clock."""
    timing: Timing
    """Durations of the parts of the tick."""
    events: tuple[Event, ...]
    """Changes of the supervisor's mode, and faults, in this tick."""
    link: tuple[float, ...] = ()
    """Values of the channel and of the force feedback (`teleop.control.bilateral`)."""
