"""The control conditions: the operator's force or the PE injector's drives the master."""

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
    """Source of the force that moves the telemanipulator."""

    finished = False
    """Whether the condition has finished; the trial then ends before its full duration."""

    @abstractmethod
    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the force on the admittance [N].

        Parameters
        ----------
        t
            Time since the drives were armed [s].
        measurement
            Measurement of this tick.
        """

    def target(self, t: float) -> float:
        """Return the position of the slave [m] that the operator follows; NaN for none.

        Parameters
        ----------
        t
            Time since the drives were armed [s].
        """
        return math.nan


class Teleoperation(Condition):
    """The operator's force."""

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the measured force on the handle [N]."""
        return measurement.master_force


class Mimicry(Teleoperation):
    """The operator's force; the operator follows a target."""

    def __init__(self, target: Target) -> None:
        self._target = target

    def target(self, t: float) -> float:
        """Return the position of the target [m]."""
        return self._target.position(t)


class Autonomous(Condition):
    """The force of the PE injector; the operator does not hold the handle."""

    def __init__(self, injector: Injector) -> None:
        self._injector = injector

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the injected force [N]."""
        return self._injector.force(t)
