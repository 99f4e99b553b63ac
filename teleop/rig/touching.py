"""Measure the contact datum in a trial in which the slave moves forward until contact."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np

from drivers import Measurement
from drivers.rig_file import RigFile
from estimation.compiled import Floats
from sim_backend import CUBES, Sensors, SimulatedRig
from teleop.control.conditions import Condition
from teleop.control.tare import Tare
from teleop.errors import InputError, SafetyStop
from teleop.names import CubeName
from teleop.recording.recording import Recording
from teleop.rig.zeroing import ForceZero
from teleop.safety import Limits
from teleop.safety.events import time_text
from teleop.safety.rig_limits import rig_limits
from teleop.trial.arming import motion_text
from teleop.trial.run import run_trial
from teleop.trial.settings import TrialSettings
from teleop.trial.stop_switch import StopSwitch

SPEED = 1e-3
"""Speed of the approach [m/s]."""
REACH = 4e-3
"""Largest travel of the approach [m]."""
SOFT_FORCE = 5.0
"""Largest soft limit of the contact force during the approach [N]."""
AWAY = 2e-3
"""Distance between the simulated slave and the cube at the start [m]."""
TOUCH = 0.5
"""Smallest contact force that is treated as contact [N].

If ten times the standard deviation of the noise is larger than this force, ten times the standard
deviation is used instead.
"""


class Touch(Condition):
    """Control condition: the slave moves forward at a constant speed until contact, then backward.

    Parameters
    ----------
    force
        Force on the admittance that causes the wanted speed [N].
    threshold
        Contact force above which the slave is treated as in contact [N].
    retreat
        Distance by which the slave moves backward after contact [m].
    """

    def __init__(self, force: float, threshold: float, retreat: float) -> None:
        self._force, self._threshold, self._retreat = force, threshold, retreat
        self._touched = math.nan

    def drive_force(self, t: float, measurement: Measurement) -> float:
        """Return the force on the admittance [N]: forward until contact, then backward."""
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
    """Move the slave until contact, and return the encoder reading at which contact begins [m].

    Parameters
    ----------
    zero
        Readings of the sensors without load.
    rig
        Rig file of the rig. None for the simulated rig, whose slave starts away from the cube.
    cube
        Name of the cube on the simulated rig.
    sensors
        Imperfections of the simulated sensors.
    seed
        Seed of the simulated noise.
    record
        MCAP file for the recording of the trial; None for no file.

    Raises
    ------
    InputError
        There was no contact within `REACH`.
    SafetyStop
        The safety supervisor stopped the trial.
    KeyboardInterrupt
        A person stopped the trial.
    """
    settings = TrialSettings(
        condition="autonomous",
        rig=rig,
        cube=cube,
        duration=REACH / SPEED,
        clock="real" if rig else "virtual",
        rate=rig.sections.rate_hz if rig else 1000.0,
        seed=seed,
        sensors=sensors,
        tare=Tare(zero.master, zero.contact, zero.position),
    )
    settings = replace(settings, custom_limits=touch_limits(settings.raw_limits))
    threshold = max(TOUCH, 10.0 * zero.contact_noise)
    with StopSwitch(key=rig is not None) as switch:
        trial = run_trial(
            settings,
            record,
            switch=switch,
            condition=Touch(settings.admittance.damping * SPEED, threshold, 0.5 * AWAY),
            rig_maker=None if rig else lambda now: rig_away_from_cube(cube, now, sensors, seed),
        )
    if trial.fault:
        text = trial.fault["text"]
        raise SafetyStop(f"tare: stopped {time_text(trial.fault['time'])}: {text}")
    if trial.interrupted:
        raise KeyboardInterrupt
    return zero.position + contact_position(trial.recording.estimated())


def arming_text(rig: RigFile) -> str:
    """Return a text that describes the approach, for the person who arms the drives."""
    limits = touch_limits(rig_limits(rig.sections))
    return motion_text(
        rig.sections.name,
        f"tare, the slave moves forward at {SPEED * 1e3:g} mm/s until contact, by at most "
        f"{REACH * 1e3:g} mm, then back, force limit {limits.soft_force:g} N, stop at "
        f"{limits.hard_force:g} N",
    )


def touch_limits(limits: Limits) -> Limits:
    """Return the limits for the approach. The force limits are at most those of the rig.

    The position limits replace those of the rig. They are relative to the start position, because
    the datum is not yet known.
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
    """Return the simulated rig with a free handle and the slave away from the cube."""
    body = replace(CUBES[cube], glued=False)
    return SimulatedRig(body, now, sensors=sensors, seed=seed, start=-AWAY)


def contact_position(recording: Recording) -> float:
    """Return the position at which contact begins in the recording of an approach [m].

    The position is estimated by a least-squares fit. The fitted force is zero before contact, and
    proportional to the displacement after the beginning of contact.

    Raises
    ------
    InputError
        There was no contact during the approach.
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
    """Fit the stiffness of a spring that begins at `start`.

    The function returns the sum of the squared residuals of the force [N^2].

    Parameters
    ----------
    x, f
        Position [m] and contact force [N], each of shape (n,).
    start
        Position at which contact begins [m].
    """
    pressed = np.maximum(x - start, 0.0)
    power = float(pressed @ pressed)
    k = float(pressed @ f) / power if power > 0.0 else 0.0
    return float(np.sum((f - k * pressed) ** 2))


def dated_tare(zero: ForceZero, position: float, rig: str) -> Tare:
    """Return the tare of a rig, with the present date and time.

    Parameters
    ----------
    zero
        Readings of the force sensors without load.
    position
        Contact datum, a reading of the slave's encoder [m].
    rig
        Name of the rig.
    """
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    return Tare(zero.master, zero.contact, position, now, rig)
