"""Run one trial with force feedback in virtual time, and return its result as a row of a table."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from feedback_bodies import body as named_body
from feedback_bodies import is_left

from estimation.arrays import Floats
from sim_backend import Changing, OperatorModel, Setup, Transmission, operators
from sim_backend.bodies import LIFTED
from teleop.control.admittance import AdmittanceParameters
from teleop.control.channel import ChannelSettings
from teleop.control.feedback.settings import FeedbackSettings
from teleop.errors import InputError
from teleop.evaluation.teleoperation.rendering import hand
from teleop.evaluation.teleoperation.thresholds import FASTEST_HAND, LEAST_FORCE, SETTLING
from teleop.recording.recording import Recording
from teleop.safety.events import ACTIVE
from teleop.safety.tightened_limits import TightenedLimits
from teleop.settings.feedback_checks import check_feedback, delayed_loop, lag
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

AIM = 10.0
"""Force at which the operator reverses the motion [N]."""
SOFT, HARD = 20.0, 40.0
"""Soft limit and hard limit of the contact force [N]."""
DURATION = 10.0
"""Duration of a trial [s]."""
JITTER, LOSS = 20e-3, 0.05
ADAPTED = 2.0
"""Time after a change of the body from which the felt stiffness is compared [s]."""


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
    operator: str = "force",
    rate: float = 1000.0,
) -> TrialSettings:
    """Return the settings of a trial.

    `rigid` selects a transmission without lost motion, with the lag of the force stated. The
    operator `force` reverses the motion at the contact force `AIM`, and the operator `depth`, the
    default of a trial, at a depth.
    """
    settings = TrialSettings(cube=cube, clock="virtual", duration=duration, seed=seed, rate=rate)
    setup = settings.setup
    withdrawal = -0.2 if is_left(body) else 0.5
    stated = {"force_lag": setup.force_lag, "lost_motion": 0.0} if rigid else {}
    return replace(
        settings,
        **stated,
        custom_setup=Setup(
            named_body(body, setup.cube, seed),
            setup.force_lag,
            setup.depth,
            Transmission() if rigid else setup.transmission,
        ),
        estimators=("rls",),
        feedback=FeedbackSettings(law),
        channel=ChannelSettings(0.5 * round_trip, jitter, loss),
        admittance=AdmittanceParameters(damping=damping),
        operator_model=OperatorModel(arm, AIM, withdrawal)
        if operator == "force"
        else OperatorModel(arm),
        tightened_limits=TightenedLimits(soft_force=SOFT, hard_force=HARD),
    )


@contextlib.contextmanager
def tremor_amplitude(amplitude: float) -> Iterator[None]:
    """Within the block, the simulated hand has tremor of this amplitude [m]."""
    before, operators.TREMOR_AMPLITUDE = operators.TREMOR_AMPLITUDE, amplitude
    try:
        yield
    finally:
        operators.TREMOR_AMPLITUDE = before


def run_one(arguments: dict[str, Any]) -> dict[str, Any]:
    """Run a trial with these arguments of `settings_of`; return the arguments and the result.

    The additional argument `tremor` is the amplitude of the hand's tremor [m]; `permitted`, the
    longest round trip that the check permits [s], is only returned.
    """
    trial_arguments = dict(arguments)
    trial_arguments.pop("permitted", None)
    with tremor_amplitude(trial_arguments.pop("tremor", operators.TREMOR_AMPLITUDE)):
        settings = settings_of(**trial_arguments)
        trial = run_trial(settings)
    recording = trial.recording
    row = dict(arguments) | (trial.feedback() or {})
    limits = settings.limits
    force = float(np.max(np.abs(recording["contact_force"])))
    row["safe_round_trip"] = safe_round_trip(settings)
    row["largest_round_trip"] = largest_round_trip(settings)
    row["stable"] = bool(row["stable"])
    row |= against_the_law(recording, settings)
    row["fault"] = trial.fault["fault"] if trial.fault else ""
    row["stopped_s"] = trial.fault["time"] if trial.fault else math.nan
    row |= stopping(recording, settings, row["stopped_s"])
    row["force_of_soft_limit"] = force / limits.soft_force
    row["force_of_hard_limit"] = force / limits.hard_force
    row["converged_s"] = converged(recording)
    return row


def is_permitted(settings: TrialSettings) -> bool:
    """Return whether the check before a trial permits its force feedback."""
    try:
        check_feedback(settings)
    except InputError:
        return False
    return True


def safe_round_trip(settings: TrialSettings) -> float:
    """Return the longest round trip [s] that condition (2) of the stability check permits."""
    return delayed_loop(settings).safe_delay - lag(settings)


def largest_round_trip(settings: TrialSettings) -> float:
    """Return the longest round trip [s] that is stable by equation (1), with the body's damping.

    The check before a trial does not assume a damping of the body.
    """
    loop = replace(delayed_loop(settings), b=settings.setup.cube.slow.b)
    return loop.largest_delay - lag(settings)


def against_the_law(recording: Recording, settings: TrialSettings) -> dict[str, float]:
    """Return the errors of what the hand felt against the law of the simulated body.

    The simulated body is moved like the hand, without any fit. For a body that changes, the values
    are those from `ADAPTED` s after the change.
    """
    names = ("true_k_error", "true_force_error", "shaking_um")
    active = recording.where(recording["mode"] == ACTIVE)
    part, body = active["time"] > SETTLING, settings.setup.cube
    if isinstance(settings.setup.cube, Changing):
        changed = change_time(recording, settings)
        part = active["time"] > changed + ADAPTED
        body = settings.setup.cube.after
    if part.sum() < 1000:
        return dict.fromkeys(names, math.nan)
    admittance, scale = settings.admittance, settings.coupling.scale
    felt = hand(active, admittance.mass, admittance.damping, admittance.stiffness, scale)
    x = scale * felt.position
    v = np.gradient(x) / active["dt"]
    correct, state = np.empty(len(x)), body.initial
    for i, (depth, speed, dt) in enumerate(
        zip(x.tolist(), v.tolist(), active["dt"].tolist(), strict=True)
    ):
        law = body.law(state)
        correct[i] = settings.feedback.gain * law.force(depth, speed)
        state = body.advanced(state, law.surface(depth), dt)
    shown = active["displayed_force"]
    used = part & (np.abs(correct) > LEAST_FORCE)
    correct, shown, at_hand = correct[used], shown[used], felt.position[used]
    return {
        "true_k_error": float(shown @ at_hand / (correct @ at_hand) - 1.0),
        "true_force_error": float(np.linalg.norm(shown - correct) / np.linalg.norm(correct)),
        "shaking_um": shaking(felt.position[part], float(np.mean(active["dt"]))) * 1e6,
    }


def change_time(recording: Recording, settings: TrialSettings) -> float:
    """Return the time at which the simulated body changed [s]; infinite if it did not.

    The contacts are counted as by `sim_backend.Changing`, at the true position of the tip.
    """
    body = settings.setup.cube
    contacts, outside = 0, math.inf
    tips = settings.setup.tip(recording["slave_position"].tolist())
    for time, tip, dt in zip(
        recording["time"].tolist(), tips, recording["dt"].tolist(), strict=True
    ):
        if tip > 0.0:
            contacts += outside >= LIFTED
            outside = 0.0
        else:
            outside += dt
        if contacts >= body.contact:
            return float(time) + body.delay
    return math.inf


def shaking(position: Floats, dt: float) -> float:
    """Return the amplitude of the sine with the power of the motion above 4 Hz [m]."""
    spectrum = np.fft.rfft((position - position.mean()) * np.hanning(len(position)))
    spectrum[np.fft.rfftfreq(len(position), dt) <= FASTEST_HAND] = 0.0
    power = np.mean(np.fft.irfft(spectrum, len(position)) ** 2)
    return float(np.sqrt(2.0 * power / np.mean(np.hanning(len(position)) ** 2)))


def stopping(recording: Recording, settings: TrialSettings, time: float) -> dict[str, float]:
    """Return speed and position at a stop, advance after it, and the stopping distance.

    The stopping distance at the speed v is v dt + v / w + v^2 / 2a, with the period dt, the
    bandwidth w of the servo of the slave, and the greatest deceleration a. All are NaN without a
    stop.
    """
    if math.isnan(time):
        names = ("stop_speed", "stop_position", "advance", "stopping_distance")
        return dict.fromkeys(names, math.nan)
    x = recording["slave_position"]
    n = int(np.searchsorted(recording["time"], time - 1e-9))
    v = float(np.max(np.abs(recording["slave_velocity"][n - 2 : n + 1])))
    servo = 1.0 / (2.0 * math.pi * settings.plant_parameters.slave_bandwidth)
    return {
        "stop_speed": v,
        "stop_position": float(x[n]),
        "advance": float(np.max(x[n:]) - x[n]),
        "stopping_distance": v * (1.0 / settings.loop_rate + servo)
        + v * v / (2.0 * settings.limits.max_acceleration),
    }


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
