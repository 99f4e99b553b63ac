"""Finding the tare: the force zero of a rig at rest, and where contact begins."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from drivers import Measurement, Rig
from estimation.compiled import Floats
from teleop.control.clock import Clock
from teleop.control.conditions import Condition
from teleop.control.tare import LARGEST_ZERO, Tare
from teleop.errors import InputError
from teleop.recording.recording import Recording

LISTENING = 0.5
"""Time over which the force zero is taken [s]."""
REST = 5e-5
"""Farthest that a slave at rest is seen to move meanwhile [m]."""
LIVELIEST = 0.5
"""Largest standard deviation of a force with nothing but noise [N]."""
TOUCH = 0.5
"""Force that tells contact at the least [N]; beyond it, ten times the noise."""


@dataclass(frozen=True)
class ForceZero:
    """What the force sensors read at no force, and where the slave was."""

    master: float
    """[N]"""
    contact: float
    """[N]"""
    noise: float
    """Standard deviation of a sample of the contact force [N]."""
    position: float
    """What the slave's encoder read [m]."""


def force_zero(rig: Rig, clock: Clock) -> ForceZero:
    """Listen to an opened rig whose drives are idle.

    Raises
    ------
    InputError
        The slave moves, or a force is too large or too lively to be a sensor's zero.
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


class Touch(Condition):
    """Goes forward at a constant speed until it feels something, and back again.

    Parameters
    ----------
    force
        Force on the admittance that gives the speed [N].
    threshold
        Contact force that tells contact [N].
    retreat
        How far to go back [m].
    """

    def __init__(self, force: float, threshold: float, retreat: float) -> None:
        self._force, self._threshold, self._retreat = force, threshold, retreat
        self._touched = math.nan

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Forward until contact, then back."""
        if math.isnan(self._touched):
            if measurement.contact_force < self._threshold:
                return self._force
            self._touched = measurement.slave_position
        self.over = measurement.slave_position < self._touched - self._retreat
        return 0.0 if self.over else -self._force


def touch_threshold(zero: ForceZero) -> float:
    """Contact force that tells contact [N]."""
    return max(TOUCH, 10.0 * zero.noise)


def contact_begins(recording: Recording) -> float:
    """Where contact begins in a recorded approach [m]: f = 0 before, rising linearly after.

    Raises
    ------
    InputError
        Nothing was touched.
    """
    deepest = int(np.argmax(recording["slave_position"])) if len(recording) else -1
    x, f = (recording[name][: deepest + 1] for name in ("slave_position", "contact_force"))
    if not len(f) or f.max() < 0.5 * TOUCH:
        raise InputError("tare: nothing was touched within the range: expected a contact")
    candidates = np.linspace(x.max() - 0.5 * np.ptp(x), x.max(), 400, endpoint=False)
    return float(candidates[int(np.argmin([misfit(x, f, start) for start in candidates]))])


def misfit(x: Floats, f: Floats, start: float) -> float:
    """Sum of squares that a spring from `start` on leaves of the force [N^2]."""
    pressed = np.maximum(x - start, 0.0)
    power = float(pressed @ pressed)
    k = float(pressed @ f) / power if power > 0.0 else 0.0
    return float(np.sum((f - k * pressed) ** 2))


def dated(zero: ForceZero, position: float, rig: str) -> Tare:
    """The tare of the rig of that name, with today's date."""
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    return Tare(zero.master, zero.contact, position, now, rig)
