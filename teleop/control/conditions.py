"""The control conditions: whose force drives the master."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import get_args

from drivers import Measurement
from teleop.control.injector import Injector
from teleop.names import ConditionName

CONDITIONS = get_args(ConditionName)


class Condition(ABC):
    """Where the force that moves the telemanipulator comes from."""

    over = False
    """Whether there is nothing left to do, which ends the trial before its time."""

    @abstractmethod
    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Force [N] on the admittance at time t [s] of the trial."""


class Teleoperation(Condition):
    """The operator's hand; `free` and `mimic` differ in what the operator is asked to do."""

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """The force that the master's sensor measures."""
        return measurement.master_force


class Autonomous(Condition):
    """The PE injector; nobody holds the handle."""

    def __init__(self, injector: Injector) -> None:
        self._injector = injector

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """The injected force."""
        return self._injector.force(t)
