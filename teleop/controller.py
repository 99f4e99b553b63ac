"""One tick of the control loop, in the order in which data flows."""

from __future__ import annotations

import math
from typing import NamedTuple

from drivers import Command, Measurement, Rig
from estimation import Bank, Conditioner, Estimate, Excitation
from teleop.admittance import Admittance, Coupling
from teleop.conditions import Condition
from teleop.errors import SafetyStop


class Record(NamedTuple):
    """Everything about one tick."""

    t: float
    """Time since the first tick [s]."""
    dt: float
    """Time since the tick before [s]."""
    measurement: Measurement
    drive_force: float
    """Force on the admittance [N]."""
    desired: Command
    applied: Command
    x: float
    """Displacement that the estimators were given [m]."""
    v: float
    """Velocity that the estimators were given [m/s]."""
    f: float
    """Force that the estimators were given [N]."""
    estimates: dict[str, Estimate]
    excitation: float


NEEDED = ("master_force", "slave_position", "contact_force")
"""Channels without which there is no loop."""


def check(measurement: Measurement) -> None:
    """Raise SafetyStop unless every needed channel is a finite number."""
    for channel in NEEDED:
        value = getattr(measurement, channel)
        if not math.isfinite(value):
            raise SafetyStop(
                f"{channel.replace('_', ' ')} is {value} at {measurement.time:.3f} s, expected a "
                "number: the rig was stopped"
            )


class Controller:
    """Maps force to velocity and feeds the estimators, tick by tick.

    Parameters
    ----------
    rig
        The telemanipulator.
    condition
        Whose force drives the master.
    admittance, coupling
        From that force to the velocities of master and slave.
    conditioner
        From slave position and contact force to regressors.
    bank
        The estimators.
    excitation
        The excitation measure.
    period
        Nominal time between ticks [s]; the first tick's dt.
    """

    def __init__(
        self,
        rig: Rig,
        condition: Condition,
        admittance: Admittance,
        coupling: Coupling,
        conditioner: Conditioner,
        bank: Bank,
        excitation: Excitation,
        period: float,
    ) -> None:
        self._rig = rig
        self._condition = condition
        self._admittance = admittance
        self._coupling = coupling
        self._conditioner = conditioner
        self._bank = bank
        self._excitation = excitation
        self._period = period
        self._start: float | None = None
        self._last = 0.0

    def tick(self) -> Record:
        """Read, map, write, estimate.

        Raises
        ------
        SafetyStop
            A channel that the loop needs is not a number; nothing was commanded.
        """
        measurement = self._rig.read()
        check(measurement)
        if self._start is None:
            self._start = measurement.time
            self._last = measurement.time - self._period
        t = measurement.time - self._start
        dt = measurement.time - self._last
        self._last = measurement.time

        drive_force = self._condition.drive_force(t, measurement)
        self._admittance.step(drive_force, dt)
        desired = self._coupling.command(self._admittance, measurement.slave_position)
        applied = self._rig.write(desired)

        x, v, f = self._conditioner.update(
            measurement.slave_position, measurement.contact_force, dt
        )
        estimates = self._bank.update(x, v, f, dt)
        excitation = self._excitation.update(x, v, dt)
        return Record(
            t, dt, measurement, drive_force, desired, applied, x, v, f, estimates, excitation
        )
