"""Control conditions, which compute the force that moves the master.

The force is either that of the operator or that of the PE (persistent excitation) injector. The PE
injector computes the force so that the slave follows a known signal.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import get_args

from drivers import Measurement
from teleop.control.injector import Injector
from teleop.control.target import Target
from teleop.names import ConditionName

CONDITIONS = get_args(ConditionName)


class Condition(ABC):
    """Base class of control conditions. A condition computes the force that moves the master."""

    finished = False
    """Whether the condition has finished. The trial then ends, even before its full duration."""

    @abstractmethod
    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the force that acts on the virtual mass of the admittance [N].

        Parameters
        ----------
        t
            Time since the drives were armed [s].
        measurement
            Measurement of this tick.
        """

    def target(self, t: float) -> float:
        """Return the target that the operator follows with the slave.

        Parameters
        ----------
        t
            Time since the drives were armed [s].

        Returns
        -------
        position
            Target position of the slave [m]; NaN if the condition has no target.
        """
        return math.nan


class Teleoperation(Condition):
    """Control condition in which the force of the operator moves the master."""

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the measured force on the handle [N]."""
        return measurement.master_force


class Mimicry(Teleoperation):
    """Control condition: the operator moves the master so that the slave follows a target."""

    def __init__(self, target: Target) -> None:
        self._target = target

    def target(self, t: float) -> float:
        """Return the position of the target [m]."""
        return self._target.position(t)


class Autonomous(Condition):
    """Control condition in which the PE injector moves the master, without an operator."""

    def __init__(self, injector: Injector) -> None:
        self._injector = injector

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the force of the PE injector on the virtual mass of the admittance [N]."""
        return self._injector.force(t)
