"""Control conditions, which compute the force that moves the master.

In the conditions `free` and `mimic`, this force is the force of the operator. In the condition
`autonomous`, the PE (persistent excitation) injector computes the force, so that the slave follows
a known signal.
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
    """Base class of control conditions, which compute the force that moves the master."""

    finished = False
    """Whether the condition has finished. The trial then ends, even before its full duration."""

    @abstractmethod
    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the force that moves the master, by acting on its virtual mass [N].

        Parameters
        ----------
        t
            Time since the drives were armed [s].
        measurement
            Measurement of this tick.
        """

    def target(self, t: float) -> float:
        """Return the position to which the operator should move the slave.

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
    """Control condition `free`: the force of the operator moves the master."""

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the measured force of the operator's hand on the handle [N]."""
        return measurement.master_force


class Mimicry(Teleoperation):
    """Control condition `mimic`: the operator follows a moving target with the slave."""

    def __init__(self, target: Target) -> None:
        self._target = target

    def target(self, t: float) -> float:
        """Return the target position of the slave [m], t [s] after the drives were armed."""
        return self._target.position(t)


class Autonomous(Condition):
    """Control condition `autonomous`: the slave follows a known signal, without an operator.

    The PE (persistent excitation) injector computes the force that moves the master in this way.
    """

    def __init__(self, injector: Injector) -> None:
        self._injector = injector

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the force [N] with which the slave follows the excitation signal.

        The force acts on the virtual mass of the master. The PE injector computes it from the time
        t [s] since the drives were armed.
        """
        return self._injector.force(t)
