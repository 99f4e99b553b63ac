"""Measure the contact datum, which is the slave position at which contact with the body begins.

In a short trial, the slave moves forward slowly until contact (the approach), and then backward.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np

from drivers import Measurement
from drivers.rig_file import RigFile
from estimation.arrays import Floats
from sim_backend import CUBES, Sensors, SimulatedRig
from teleop.control.conditions import Condition
from teleop.control.tare import Tare
from teleop.errors import InputError, SafetyStop
from teleop.names import CubeName
from teleop.recording.recording import Recording
from teleop.rig.zeroing import ForceZero
from teleop.safety import Limits
from teleop.safety.rig_limits import rig_limits
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.arming import motion_text
from teleop.trial.run import run_trial
from teleop.trial.stop_switch import StopSwitch

SPEED = 1e-3
"""Speed of the slave in the approach (the motion until contact) [m/s]."""
REACH = 4e-3
"""Largest travel of the slave in the approach [m]."""
SOFT_FORCE = 5.0
"""Soft limit of the contact force during the approach [N]; smaller if the rig has a smaller one."""
AWAY = 2e-3
"""Distance between the simulated slave and the cube at the start [m]."""
TOUCH = 0.5
"""Smallest contact force that is treated as contact [N].

If ten times the standard deviation of the noise is larger than this force, ten times the standard
deviation is used instead.
"""


class Touch(Condition):
    """Control condition: the slave moves forward at constant speed until contact, then back."""

    def __init__(self, force: float, threshold: float, retreat: float) -> None:
        self._force, self._threshold, self._retreat = force, threshold, retreat
        self._touched = math.nan

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the force that moves the slave forward until contact, and then backward [N].

        The force acts on the virtual mass of the master (the handle), whose motion the slave
        follows. The force is zero after the backward motion.
        """
        if math.isnan(self._touched):
            if measurement.contact_force < self._threshold:
                return self._force
            self._touched = measurement.slave_position
        self.finished = measurement.slave_position < self._touched - self._retreat
        return 0.0 if self.finished else -self._force


def touch(
    zero: ForceZero,
    rig: RigFile | None,
    cube: CubeName,
    sensors: Sensors,
    seed: int,
    record: Path | None = None,
) -> float:
    """Move the slave forward until contact; return the encoder reading at which contact begins [m].

    `rig`: None for the simulated rig. `record`: None for no recording.
    """
    settings = TrialSettings(
        condition="autonomous",
        specimen="tare",
        rig=rig,
        cube=cube,
        duration=REACH / SPEED,
        clock="real" if rig else "virtual",
        seed=seed,
        sensors=sensors,
        tare=Tare(zero.master, zero.contact, zero.position),
    )
    limits = touch_limits(settings.raw_limits)
    settings = replace(settings, custom_limits=limits, depth=REACH)
    threshold = max(TOUCH, 10.0 * zero.contact_noise)
    with StopSwitch(key=rig is not None) as switch:
        trial = run_trial(
            settings,
            record,
            switch=switch,
            arm=rig is not None,
            condition=Touch(settings.admittance.damping * SPEED, threshold, 0.5 * AWAY),
            rig_maker=None if rig else lambda now: rig_away_from_cube(cube, now, sensors, seed),
        )
    if trial.fault:
        raise SafetyStop(f"tare: {trial.stop_text}")
    if trial.interrupted:
        raise KeyboardInterrupt
    return zero.position + contact_position(trial.recording.estimated())


def arming_text(rig: RigFile) -> str:
    """Return a text for the person who arms the drives: how the slave will move until contact."""
    limits = touch_limits(rig_limits(rig.sections))
    return motion_text(
        rig.sections.name,
        f"tare, the slave moves forward at {SPEED * 1e3:g} mm/s until contact, by at most "
        f"{REACH * 1e3:g} mm, then back, force limit {limits.soft_force:g} N, stop at "
        f"{limits.hard_force:g} N",
    )


def touch_limits(limits: Limits) -> Limits:
    """Return the safety limits for the motion in which the slave moves forward until contact.

    The soft force limit is `SOFT_FORCE`, and the hard force limit is twice as large. If a force
    limit of the rig is smaller, the limit of the rig is used. The position limits of the rig are
    not used, because they are relative to the contact datum (slave position at which contact
    begins), which is not yet known. The new position limits are relative to the start position.
    """
    return replace(
        limits,
        soft_position=(-AWAY, REACH),
        hard_position=(-2.0 * AWAY, REACH + AWAY),
        soft_force=min(SOFT_FORCE, limits.soft_force),
        hard_force=min(2.0 * SOFT_FORCE, limits.hard_force),
    )


def rig_away_from_cube(
    cube: CubeName, now: Callable[[], float], sensors: Sensors, seed: int
) -> SimulatedRig:
    """Return a simulated rig without operator, whose slave does not touch the cube at the start."""
    body = replace(CUBES[cube], glued=False)
    return SimulatedRig(body, now, sensors=sensors, seed=seed, start=-AWAY)


def contact_position(recording: Recording) -> float:
    """Return the slave position [m] at which contact begins in a recording.

    In the recording, the slave moves forward until contact. The position is estimated by a
    least-squares fit. The fitted force is zero before contact. After the beginning of contact, it
    is proportional to the displacement.
    """
    deepest = int(np.argmax(recording["slave_position"])) if len(recording) else -1
    x, f = (recording[name][: deepest + 1] for name in ("slave_position", "contact_force"))
    if not len(f) or f.max() < 0.5 * TOUCH:
        raise InputError("tare: no contact within the range: expected a contact")
    candidates = np.linspace(x.max() - 0.5 * np.ptp(x), x.max(), 400, endpoint=False)
    return float(
        candidates[int(np.argmin([squared_residuals(x, f, start) for start in candidates]))]
    )


def squared_residuals(x: Floats, f: Floats, start: float) -> float:
    """Return the sum of the squared residuals of the force, if contact begins at `start` [N^2].

    The model of the force is k max(x - start, 0). The stiffness k is fitted by least squares.
    """
    pressed = np.maximum(x - start, 0.0)
    power = float(pressed @ pressed)
    k = float(pressed @ f) / power if power > 0.0 else 0.0
    return float(np.sum((f - k * pressed) ** 2))


def dated_tare(zero: ForceZero, position: float, rig: str) -> Tare:
    """Return the tare (zero offsets of the sensors) of a rig, with the present date and time."""
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    return Tare(zero.master, zero.contact, position, now, rig)
