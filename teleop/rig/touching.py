"""The trial that feels for contact, under the supervisor like any other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from drivers import Rig
from drivers.rig_file import RigFile
from sim_backend import CUBES, Sensors, SimulatedRig
from teleop.control.conditions import Condition
from teleop.control.tare import Tare
from teleop.errors import SafetyStop
from teleop.recording.black_box import moment
from teleop.rig.zeroing import ForceZero, Touch, contact_begins, touch_threshold
from teleop.safety import Limits
from teleop.trial.run import run_trial
from teleop.trial.settings import TrialSettings

SPEED = 1e-3
"""Of the approach [m/s]."""
REACH = 4e-3
"""How far contact is looked for [m]."""
SOFT_FORCE = 5.0
"""Contact force at which the approach ends in any case [N]."""
AWAY = 2e-3
"""How far before the cube the simulated slave stands [m]."""


@dataclass(frozen=True)
class TouchSettings(TrialSettings):
    """A trial that goes forward until it touches; a simulated cube lets go again."""

    zero: ForceZero = field(kw_only=True)

    @property
    def raw_limits(self) -> Limits:
        """Tight on force; positions count from the start, since the datum is not known yet."""
        limits = super().raw_limits
        return replace(
            limits,
            soft_position=(-AWAY, REACH),
            hard_position=(-2.0 * AWAY, REACH + AWAY),
            soft_force=min(SOFT_FORCE, limits.soft_force),
            hard_force=min(2.0 * SOFT_FORCE, limits.hard_force),
        )

    def make_rig(self, now: Callable[[], float]) -> Rig:
        """The rig; the simulated one with the slave off the cube."""
        if self.rig:
            return super().make_rig(now)
        return off_the_cube(self.cube, now, self.sensors, self.seed)

    def make_condition(self) -> Condition:
        """Forward until contact."""
        return Touch(self.admittance.damping * SPEED, touch_threshold(self.zero), 0.5 * AWAY)


def off_the_cube(cube: str, now: Callable[[], float], sensors: Sensors, seed: int) -> SimulatedRig:
    """The simulated rig with nobody at the handle and the slave off the cube."""
    body = replace(CUBES[cube], glued=False)
    return SimulatedRig(body, now, sensors=sensors, seed=seed, start=-AWAY)


def touch(settings: TouchSettings, record: Path | None) -> float:
    """What the slave's encoder reads where contact begins [m].

    Parameters
    ----------
    settings
        The trial; its tare holds the force zeros and the position at the start.
    record
        MCAP file to record to.

    Raises
    ------
    InputError
        Nothing was touched.
    SafetyStop
        The trial was stopped for safety.
    KeyboardInterrupt
        A person stopped it.
    """
    trial = run_trial(settings, record)
    if trial.fault:
        raise SafetyStop(f"tare: stopped {moment(trial.fault)}: {trial.fault['text']}")
    if trial.interrupted:
        raise KeyboardInterrupt
    return settings.tare.slave_position + contact_begins(trial.recording.estimated())


def touch_settings(
    rig: RigFile | None, cube: str, zero: ForceZero, sensors: Sensors, seed: int
) -> TouchSettings:
    """The trial that feels for contact, on a rig of devices or for this cube."""
    return TouchSettings(
        condition="autonomous",
        rig=rig,
        cube=cube,
        duration=REACH / SPEED,
        clock="real" if rig else "virtual",
        rate=rig.sections.rate_hz if rig else 1000.0,
        seed=seed,
        sensors=sensors,
        tare=Tare(zero.master, zero.contact, zero.position),
        zero=zero,
    )
