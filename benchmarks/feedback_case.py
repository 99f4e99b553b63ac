"""Run one trial with force feedback in virtual time, and return its result as a row of a table."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from sim_backend import CUBES, Changing, Cube, OperatorModel, Relaxing, Setup, Transmission
from sim_backend.channel import ChannelSettings
from teleop.control.admittance import AdmittanceParameters
from teleop.control.feedback.settings import FeedbackSettings
from teleop.recording.recording import Recording
from teleop.safety.tightened_limits import TightenedLimits
from teleop.trial.feedback_checks import delayed_loop, lag
from teleop.trial.run import run_trial
from teleop.trial.settings import TrialSettings

AIM = 10.0
"""Force at which the operator reverses the motion [N]."""
SOFT, HARD = 20.0, 40.0
"""Soft limit and hard limit of the contact force [N]."""
DURATION = 10.0
"""Duration of a trial [s]."""
JITTER, LOSS = 20e-3, 0.05


def loose(cube: Cube) -> Cube:
    return replace(cube, glued=False)


def relaxing(cube: Cube) -> Relaxing:
    """Return a cube in which a quarter of k1 relaxes with a time constant of 0.5 s."""
    return Relaxing(replace(cube, k1=0.75 * cube.k1), k=0.25 * cube.k1, tau=0.5)


def next_contact(cube: Cube) -> Changing:
    """Return a cube that is replaced by the hard cube before the third contact."""
    return Changing(loose(cube), loose(CUBES["hard"]), contact=3)


def while_indented(cube: Cube) -> Changing:
    """Return a cube that is replaced by the hard cube while it is indented."""
    return Changing(cube, CUBES["hard"], contact=1, delay=4.0)


BODIES = {
    "glued": lambda cube: cube,
    "loose": loose,
    "relaxing": relaxing,
    "stiffer at the next contact": next_contact,
    "stiffer while indented": while_indented,
}


def settings_of(
    law: str,
    cube: str,
    round_trip: float,
    arm: float = 400.0,
    damping: float = 15.0,
    seed: int = 0,
    body: str = "glued",
    jitter: float = 0.0,
    loss: float = 0.0,
    rigid: bool = False,
    duration: float = DURATION,
) -> TrialSettings:
    """Return the settings of a trial; `rigid` selects a transmission without lost motion."""
    settings = TrialSettings(cube=cube, clock="virtual", duration=duration, seed=seed)
    setup = settings.setup
    withdrawal = -0.2 if body in ("loose", "stiffer at the next contact") else 0.5
    return replace(
        settings,
        custom_setup=Setup(
            BODIES[body](setup.cube),
            setup.force_lag,
            setup.depth,
            Transmission() if rigid else setup.transmission,
        ),
        estimators=("rls",),
        feedback=FeedbackSettings(law),
        channel=ChannelSettings(0.5 * round_trip, jitter, loss),
        admittance=AdmittanceParameters(damping=damping),
        operator_model=OperatorModel(arm, AIM, withdrawal),
        tightened_limits=TightenedLimits(soft_force=SOFT, hard_force=HARD),
    )


def run_one(arguments: dict[str, Any]) -> dict[str, Any]:
    """Run a trial with these arguments of `settings_of`; return the arguments and the result."""
    settings = settings_of(**arguments)
    trial = run_trial(settings)
    recording = trial.recording
    row = dict(arguments) | (trial.feedback() or {})
    limits = settings.limits
    force = float(np.max(np.abs(recording["contact_force"])))
    loop = delayed_loop(settings)
    row["safe_round_trip"] = loop.safe_delay - lag(settings)
    row["largest_round_trip"] = loop.largest_delay - lag(settings)
    row["stable"] = bool(row["stable"])
    row["fault"] = trial.fault["fault"] if trial.fault else ""
    row["stopped_s"] = trial.fault["time"] if trial.fault else math.nan
    row["force_of_soft_limit"] = force / limits.soft_force
    row["force_of_hard_limit"] = force / limits.hard_force
    row["converged_s"] = converged(recording)
    return row


def converged(recording: Recording) -> float:
    """Return the time after which the model at the master stays within 10 % of its last value [s].

    The compared value is the secant stiffness of the model at the deepest position. The result is
    NaN without a model.
    """
    k, k3 = recording["model_stiffness"], recording["model_stiffening"]
    if not np.isfinite(k[-100:]).all():
        return math.nan
    deepest = float(np.max(np.abs(recording["slave_position"])))
    secant = k + k3 * deepest**2
    off = np.flatnonzero(np.abs(secant / np.median(secant[-1000:]) - 1.0) > 0.1)
    return float(recording["time"][off[-1]]) if len(off) else 0.0
