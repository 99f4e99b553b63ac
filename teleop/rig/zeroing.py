"""Measure the zero offsets of the force sensors of a rig at rest and without load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers import Measurement, Rig
from teleop.control.clock import Clock
from teleop.control.tare import LARGEST_ZERO
from teleop.errors import InputError

LISTENING = 0.5
"""Time over which the forces are averaged [s]."""
REST = 5e-5
"""Largest variation of the measured position during `LISTENING` for a slave at rest [m]."""
MAX_NOISE = 0.5
"""Largest standard deviation of the noise of a force sensor without load [N]."""


@dataclass(frozen=True)
class ForceZero:
    """Readings of the sensors of a rig at rest and without load."""

    master: float
    """Mean of the measured master force [N]."""
    contact: float
    """Mean of the measured contact force [N]."""
    noise: float
    """Standard deviation of the measured contact force [N]."""
    position: float
    """Mean of the readings of the slave's encoder [m]."""


def force_zero(rig: Rig, clock: Clock) -> ForceZero:
    """Measure the zero offsets of the force sensors.

    Parameters
    ----------
    rig
        The rig, which has been opened. The drives are disabled.
    clock
        Clock of the loop; the rig is read once per tick.

    Raises
    ------
    InputError
        The slave moves, or the mean or the variation of a force is too large for a sensor without
        load.
    """
    samples: list[Measurement] = []
    for _ in range(round(LISTENING * clock.rate)):
        clock.wait()
        samples.append(rig.read())
    position = np.array([m.slave_position for m in samples])
    if not np.ptp(position) <= REST:
        raise InputError(
            f"the slave moves by {np.ptp(position) * 1e3:.3f} mm in "
            f"{LISTENING:g} s: expected it to be at rest"
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
        if not force.std() <= MAX_NOISE:
            raise InputError(
                f"the {name} force varies by {force.std():.2f} N rms: expected "
                f"noise of at most {MAX_NOISE:g} N"
            )
    return ForceZero(
        float(forces["master"].mean()),
        float(forces["contact"].mean()),
        float(forces["contact"].std()),
        float(position.mean()),
    )
