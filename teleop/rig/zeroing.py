"""The force zero of a rig at rest, with idle drives and no load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers import Measurement, Rig
from teleop.control.clock import Clock
from teleop.control.tare import LARGEST_ZERO
from teleop.errors import InputError

LISTENING = 0.5
"""Time over which the force is averaged [s]."""
REST = 5e-5
"""Greatest apparent motion of a slave at rest in that time [m]."""
LIVELIEST = 0.5
"""Largest standard deviation of a force that is only noise [N]."""


@dataclass(frozen=True)
class ForceZero:
    """Readings of the sensors at no force."""

    master: float
    """Master force [N]."""
    contact: float
    """Contact force [N]."""
    noise: float
    """Standard deviation of a sample of the contact force [N]."""
    position: float
    """Reading of the slave's encoder [m]."""


def force_zero(rig: Rig, clock: Clock) -> ForceZero:
    """Measure the force zero of an opened rig whose drives are idle.

    Raises
    ------
    InputError
        The slave moves, or a force is too large or varies too much to be the zero of a sensor.
    """
    samples: list[Measurement] = []
    for _ in range(round(LISTENING * clock.rate)):
        clock.wait()
        samples.append(rig.read())
    position = np.array([m.slave_position for m in samples])
    if not np.ptp(position) <= REST:
        raise InputError(
            f"the slave moves, by {np.ptp(position) * 1e3:.3f} mm in "
            f"{LISTENING:g} s: expected it at rest"
        )
    forces = {
        "master": np.array([m.master_force for m in samples]),
        "contact": np.array([m.contact_force for m in samples]),
    }
    for name, force in forces.items():
        if not abs(force.mean()) <= LARGEST_ZERO:
            raise InputError(
                f"the {name} force sensor reads {force.mean():.2f} N: expected no "
                f"load, and a zero within {LARGEST_ZERO:g} N"
            )
        if not force.std() <= LIVELIEST:
            raise InputError(
                f"the {name} force varies by {force.std():.2f} N rms: expected "
                f"nothing but noise, {LIVELIEST:g} N at the most"
            )
    return ForceZero(
        float(forces["master"].mean()),
        float(forces["contact"].mean()),
        float(forces["contact"].std()),
        float(position.mean()),
    )
