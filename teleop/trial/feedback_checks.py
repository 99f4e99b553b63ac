"""Check the force feedback before a trial begins."""

from __future__ import annotations

import math

import numpy as np

from estimation.compiled import Floats
from sim_backend.channel import ChannelSettings
from sim_backend.plant import UNATTENDED
from teleop.control.feedback.law import STIFF_PRIOR
from teleop.control.feedback.stability import DelayedLoop
from teleop.errors import InputError
from teleop.trial.settings import TrialSettings

LOOP_DELAY = 1.5
"""Delay of the loop in periods: a command is computed from the last sample, and then held."""
PASSIVITY_OFFERED = {"soft": (0.05, 0.5)}
"""Shortest and longest round trip [s] for which passivity control is permitted, by cube.

All trials of the benchmark on the cube with a round trip in this range were stable. They were made
with 20 seeds, with arms of 150, 400 and 1500 N/m, and with operators who reverse at a force or at a
depth (`benchmarks/results/feedback-passivity.csv`).
"""


def check_feedback(settings: TrialSettings) -> str:
    """Check that the feedback may be used, and return a warning or an empty text.

    The warning states that settings are missing, so that it is not known whether the feedback is
    stable.

    Raises
    ------
    InputError
        The law is `position-force` and is expected to be unstable, or it is `passivity` and is not
        permitted for the cube and the round trip of the trial.
    """
    law, trip = settings.feedback.law, round_trip(settings)
    if law == "passivity":
        check_offered(settings, trip)
    if law != "position-force":
        return ""
    warning = ""
    if unknown := unknown_values(settings):
        warning = (
            "feedback position-force: whether it is stable is not known: expected "
            f"{' and '.join(unknown)}"
        )
    if settings.rig and settings.feedback.stiffness is None:
        return warning
    loop = delayed_loop(settings)
    delay = trip + lag(settings)
    if delay < loop.safe_delay:
        return warning
    raise InputError(
        f"feedback position-force: unstable with k = {loop.k:.0f} N/m and a delay of "
        f"{delay * 1e3:.1f} ms, of which {trip * 1e3:.1f} ms are the round trip: expected a delay "
        f"below {loop.safe_delay * 1e3:.1f} ms, or feedback model-mediated"
    )


def unknown_values(settings: TrialSettings) -> list[str]:
    """Return the settings that are missing for the check of the law position-force.

    Only a trial on a hardware rig can have missing settings.
    """
    if settings.rig is None:
        return []
    unknown = []
    if settings.feedback.stiffness is None:
        unknown.append("feedback.stiffness, the largest stiffness of the specimen")
    if not sensor_lag(settings):
        unknown.append("the lag of the contact force, force_lag or lag_ms in the rig file")
    return unknown


def lag(settings: TrialSettings) -> float:
    """Return the delay of the contact force at the master, without the delay of the channel [s]."""
    return sensor_lag(settings) + LOOP_DELAY / settings.rate


def sensor_lag(settings: TrialSettings) -> float:
    """Return the lag of the force channel that measures the contact force [s].

    On a hardware rig, it is the sum of the lags in the settings and in the rig file.
    """
    if settings.rig is None:
        return settings.plant_parameters.contact_force_lag
    return settings.force_lag + settings.rig.sections.channels.contact_force.lag_ms * 1e-3


def arm_lag(settings: TrialSettings) -> float:
    """Return the largest lag with which the arm acts on the virtual mass of the simulated rig [s].

    It contains a period for the age of a sample. On the simulated rig, the samples of a tick have
    the age 0, so that the true lag is about one period shorter.
    """
    plant = settings.plant_parameters
    servo = 1.0 / (2.0 * math.pi * plant.handle_bandwidth)
    return servo + plant.master_force_lag + LOOP_DELAY / settings.rate


def arm_damping(settings: TrialSettings, frequency: Floats) -> Floats:
    """Return the effective damping of the simulated operator's arm [N s/m], shape (n,).

    The arm has the damping b and the stiffness k, and acts on the virtual mass with the lag tau.
    Its impedance is (b + k / (j w)) exp(-j w tau). The effective damping is the real part of this
    impedance. `frequency` contains the frequencies w / (2 pi) [Hz], shape (n,).
    """
    arm, delay = settings.operator_model.arm, arm_lag(settings)
    phase = 2.0 * np.pi * frequency * delay
    elastic = arm.stiffness * delay * np.sinc(phase / np.pi)
    return arm.damping * np.cos(phase) - elastic


def round_trip(settings: TrialSettings) -> float:
    """Return the longest delay of a round trip through the channel [s]."""
    channel = settings.channel or ChannelSettings()
    return 2.0 * (channel.delay + channel.jitter)


def delayed_loop(settings: TrialSettings) -> DelayedLoop:
    """Return the loop of hand, virtual mass and delayed environment, to check its stability.

    The stiffness of the environment is the result of `expected_stiffness` times the motion scale.
    On a hardware rig, the impedance of the person's arm is not known. The returned loop then has no
    arm, and condition (2) of `teleop.control.feedback.stability` ensures stability for any passive
    hand.
    """
    admittance, feedback = settings.admittance, settings.feedback
    arm = UNATTENDED if settings.rig else settings.operator_model.arm
    return DelayedLoop(
        admittance.mass,
        admittance.damping,
        arm.stiffness,
        arm.damping,
        settings.coupling.scale * expected_stiffness(settings),
        gain=feedback.gain,
        arm_lag=arm_lag(settings),
        spring=admittance.stiffness,
    )


def expected_stiffness(settings: TrialSettings) -> float:
    """Return the largest expected slope of the contact force [N/m].

    This is the stiffness that the settings state. If they state none, it is the stiffness of the
    simulated body or, on a hardware rig, `STIFF_PRIOR`.
    """
    if settings.feedback.stiffness is not None:
        return settings.feedback.stiffness
    return STIFF_PRIOR if settings.rig else present_stiffness(settings)


def present_stiffness(settings: TrialSettings) -> float:
    """Return the slope of the simulated contact force at the deepest position [N/m]."""
    from scipy.optimize import brentq  # its import takes as long as that of the rest of a run

    setup, aim = settings.setup, settings.operator_model.aim_force
    deepest = setup.depth
    if aim and setup.force(deepest) > aim:
        deepest = brentq(lambda x: setup.force(x) - aim, 0.0, deepest)
    step = 1e-3 * deepest
    return (setup.force(deepest) - setup.force(deepest - step)) / step


def check_offered(settings: TrialSettings, trip: float) -> None:
    """Raise an error unless `PASSIVITY_OFFERED` permits passivity control for this trial.

    Raises
    ------
    InputError
        The law passivity is not permitted for the cube and the round trip.
    """
    shortest, longest = PASSIVITY_OFFERED.get("" if settings.rig else settings.cube, (1.0, 0.0))
    if shortest <= trip <= longest:
        return
    offered = " or ".join(
        f"the {cube} cube of the simulated rig with a round trip of {low * 1e3:g} to "
        f"{high * 1e3:g} ms"
        for cube, (low, high) in PASSIVITY_OFFERED.items()
    )
    raise InputError(
        f"feedback passivity: not stable in all tests with a round trip of {trip * 1e3:g} ms on "
        f"the {settings.palpated}: expected {offered}, or feedback model-mediated"
    )
