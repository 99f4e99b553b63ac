"""The control conditions: the operator's force or the PE injector's drives the master."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import get_args

from drivers import Measurement
from teleop.control.injector import Injector
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


class Teleoperation(Condition):
    """The operator's force; `free` and `mimic` differ in the operator's task only."""

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the measured force on the handle [N]."""
        return measurement.master_force


class Autonomous(Condition):
    """The force of the PE injector; the operator does not hold the handle."""

    def __init__(self, injector: Injector) -> None:
        self._injector = injector

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the injected force [N]."""
        return self._injector.force(t)
