"""The control conditions: which force moves the master, that of the operator or of the PE injector.

The PE injector (persistent excitation) computes the force for a known signal.
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
    """Control condition: computes the force that moves the telemanipulator."""

    finished = False
    """Whether the condition has finished. If it has, the trial ends before its full duration."""

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
    """Control condition in which the operator moves the master and follows a target."""

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
        """Return the injected force [N]."""
        return self._injector.force(t)
