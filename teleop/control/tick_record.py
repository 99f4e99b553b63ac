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
    """Measurement of the rig, tared."""
    drive_force: float
    """Force on the admittance [N]."""
    target: float
    """Position of the slave that the operator follows [m]; NaN if there is none."""
    desired: Command
    """Command of the control condition."""
    commanded: Command
    """Command after the supervisor."""
    applied: Command
    """Command that the drives applied."""
    pair: Pair
    """Input of the conditioning; NaN if there is no new pair of position and force."""
    x: float
    """Displacement passed to the estimators [m]; NaN if none."""
    v: float
    """Velocity passed to the estimators [m/s]; NaN if none."""
    f: float
    """Force passed to the estimators [N]; NaN if none."""
    further: tuple[float, ...]
    """Regressors of the model other than v and x."""
    estimates: dict[str, Estimate]
    """Estimates by the name of the estimator; NaN if the estimators were not updated."""
    excitation: float
    """Excitation measure; 0 for no excitation, 1 for a sine of 1 Hz about zero."""
    contact: float
    """1 while the gate of the bank detects contact, else 0; NaN without a gate or estimates."""
    misfit: tuple[float, ...]
    """Misfit of each estimator (`estimation.misfit`); NaN if it is not known yet."""
    mode: Mode
    """Mode of the supervisor."""
    limited: int
    """Flags of the soft limits that reduced the command."""
    tick: Tick
    """Timing of the tick by the loop's clock."""
    timing: Timing
    """Durations of the parts of the tick."""
    events: tuple[Event, ...]
    """Changes of mode and faults."""
