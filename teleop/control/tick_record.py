"""Define the record of one tick, which contains all quantities that are recorded."""

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
    """Time that reading the rig took [s]."""
    compute: float
    """Time that condition, admittance, supervisor and estimators took [s]."""
    write: float
    """Time that sending the commands to the drives took [s]."""


class Record(NamedTuple):
    """All quantities of one tick."""

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
    x: float
    """Displacement passed to the estimators [m]; NaN if they were not updated."""
    v: float
    """Velocity passed to the estimators [m/s]; NaN if they were not updated."""
    f: float
    """Force passed to the estimators [N]; NaN if they were not updated."""
    further: tuple[float, ...]
    """Values of the model's regressors other than v and x, for example x^3."""
    estimates: dict[str, Estimate]
    """Estimates by the name of the estimator; NaN if the estimators were not updated."""
    excitation: float
    """Excitation measure; 0 for no excitation, 1 for a sine of 1 Hz about the position x = 0."""
    contact: float
    """1 while the contact gate of the estimators detects contact, else 0; NaN if there is no
    contact gate or no estimate."""
    misfit: tuple[float, ...]
    """Misfit of each estimator, see `estimation.misfit`; NaN before the first value."""
    mode: Mode
    """Mode of the supervisor."""
    limited: int
    """Bit flags of the soft limits that reduced the command."""
    tick: Tick
    """Timing of the tick by the loop's clock."""
    timing: Timing
    """Durations of the parts of the tick."""
    events: tuple[Event, ...]
    """Faults, and changes of the supervisor's mode, in this tick."""
    link: tuple[float, ...] = ()
    """Values of the channel and of the force feedback (`teleop.control.bilateral`)."""
