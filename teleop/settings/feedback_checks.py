"""Check before a trial whether its force feedback may be used and is expected to be stable."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimation.arrays import Floats
from estimation.quantities import STIFFNESS
from sim_backend.plant import UNATTENDED
from teleop.control.channel import ChannelSettings
from teleop.control.feedback.law import STIFF_PRIOR
from teleop.control.feedback.stability import (
    DelayedLoop,
    LimitCycle,
    Responses,
    response_of_compensated_play,
    response_of_play,
)
from teleop.errors import InputError
from teleop.safety.soft_limits import APPROACH_TIME
from teleop.settings.trial_settings import TrialSettings
from teleop.vibration import detectable

LOOP_DELAY = 1.5
"""Delay of the control loop in periods. A sample is at most one period old. A command is held for
one period, which is a mean delay of half a period."""

RARE = 1e-3
"""Probability of a run of lost packets that is counted as a delay."""
ASSUMED_LOST_MOTION = 200e-6
"""Half width of the lost motion that is assumed if it is not known [m]."""
TREMOR = 50e-6
"""Amplitude of an oscillation of the hand that is hidden by tremor [m], about that of tremor at the
tool of a surgeon (S. P. N. Singh, C. N. Riviere, Proc. IEEE Northeast Bioeng. Conf., 2002)."""
COUPLED_LOOP_DELAY = 3.5
"""Delay of the control loop with a force-commanded master in periods, without its latency."""


def check_feedback(settings: TrialSettings, trip: float | None = None) -> str:
    """Check that the force feedback of a trial may be used, and return a warning or an empty text.

    `trip` is the round trip through the communication channel [s]; None for that of the settings.

    The warning names settings that are missing. Without these settings, it is not known whether the
    force feedback is stable.
    """
    law = settings.feedback.law
    trip = round_trip(settings) if trip is None else trip
    lost, most = settings.link_transmission.lost_motion, max(3e-4, 0.1 * settings.setup.depth)
    if law != "none" and lost > most:
        raise InputError(
            f"feedback {law}: a lost motion of {lost * 1e6:.0f} um, which the slave would cross at "
            f"each reversal: expected at most {most * 1e6:.0f} um"
        )
    if not settings.feedback.law_type.displays_measured_force:
        return ""
    warning = ""
    if unknown := unknown_values(settings):
        warning = (
            f"feedback {law}: whether it is stable is not known: expected {' and '.join(unknown)}"
        )
    if settings.rig and settings.feedback.stiffness is None:
        return warning
    loop = delayed_loop(settings)
    delay = trip + lag(settings)
    if delay >= loop.safe_delay:
        raise InputError(
            f"feedback {law}: unstable with k = {STIFFNESS.text(loop.k)} and a delay of "
            f"{delay * 1e3:.1f} ms, of which {trip * 1e3:.1f} ms are the round trip: expected a "
            f"delay below {loop.safe_delay * 1e3:.1f} ms, or feedback model-mediated"
        )
    if problem := oscillation(settings, loop, delay):
        raise InputError(f"feedback {law}: {problem}")
    return warning


def oscillation(settings: TrialSettings, loop: DelayedLoop, delay: float) -> str:
    """Return why the loop would oscillate because of lost motion; empty if it would not.

    An oscillation is permitted if the fingers do not detect it, or if tremor is larger.
    """
    lost, responses = lost_motion(settings)
    cycle = largest_cycle(loop, delay, responses)
    amplitude = cycle.amplitude / settings.coupling.scale
    if amplitude < max(detectable(cycle.frequency), TREMOR):
        return ""
    damping, step = loop.damping, 1.0
    while step > 0.1:
        trial = replace(loop, damping=damping + step)
        left = largest_cycle(trial, delay, responses).amplitude
        if left < TREMOR * settings.coupling.scale:
            step *= 0.5
        else:
            damping += step
            step *= 2.0
    source, remedy = "which the command of the slave compensates, ", ""
    if not settings.lost_motion_known:
        source = "which is assumed because it is not calibrated, "
        remedy = "a calibration (teleop lag), "
    return (
        f"with a delay of {delay * 1e3:.1f} ms and a lost motion of {lost * 1e6:.0f} um, {source}"
        f"the hand would oscillate by {amplitude * 1e6:.0f} um at "
        f"{cycle.frequency:.0f} Hz: expected {remedy}a virtual damping of at least "
        f"{damping + 0.1:.0f} N s/m, or feedback model-mediated"
    )


def largest_cycle(loop: DelayedLoop, delay: float, responses: Sequence[Responses]) -> LimitCycle:
    """Return the largest oscillation that the loop keeps; its amplitude is 0 if there is none."""
    found = (loop.limit_cycle(delay, played) for played in responses)
    return max((cycle for cycle in found if cycle), default=LimitCycle(0.0, 1.0))


def lost_motion(settings: TrialSettings) -> tuple[float, list[Responses]]:
    """Return the half width of the play of the slave [m], and possible responses of its tip.

    The true lost motion can be larger or smaller than the known one, by its error. If the lost
    motion is not known, it is assumed to be `ASSUMED_LOST_MOTION`, and is not compensated.
    """
    if not settings.lost_motion_known:
        return ASSUMED_LOST_MOTION, [response_of_play(ASSUMED_LOST_MOTION)]
    known = settings.link_transmission
    lost, error = known.lost_motion, known.lost_motion_error
    return lost, [response_of_compensated_play(lost, one) for one in (error, -min(error, lost))]


def unknown_values(settings: TrialSettings) -> list[str]:
    """Return a description of each missing setting that the check of the stability needs.

    The stability is that of the force-feedback law `position-force`. On the simulated rig, no such
    setting is missing.
    """
    if settings.rig is None:
        return []
    unknown = []
    if settings.feedback.stiffness is None:
        unknown.append("feedback.stiffness, the largest stiffness of the specimen")
    if not sensor_lag(settings):
        unknown.append("the lag of the contact force, force_lag or lag_ms in the rig file")
    slave = settings.rig.sections.drives.slave
    if slave is None:  # the master side of two stations: the slave side checks this
        return []
    # The velocity loop of a slave that accepts forces is computed here, and so is known.
    if "lag_ms" not in slave.model_fields_set and slave.moving_mass_kg is None:
        unknown.append("the lag of the slave's drive, lag_ms of drives.slave in the rig file")
    return unknown


def lag(settings: TrialSettings) -> float:
    """Return the delay from the contact force to the force that the hand feels [s].

    This delay is the sum of the lags of the contact force sensor and of the slave's drive, the
    delay of the control loop, the time in which the slave crosses its lost motion, and the time of
    lost packets. It does not include the delay of the communication channel.
    """
    coupling = settings.master_coupling
    periods = COUPLED_LOOP_DELAY + coupling.latency if coupling else LOOP_DELAY
    periods += 2.0 * lost_in_a_row(settings.channel)
    own = sensor_lag(settings) + slave_lag(settings) + periods / settings.loop_rate
    return own + crossing_time(settings)


def lost_in_a_row(channel: ChannelSettings | None) -> int:
    """Return the number of successive packets that are lost with a probability of `RARE`."""
    loss = channel.loss if channel else 0.0
    return math.ceil(math.log(RARE) / math.log(loss)) if loss else 0


def crossing_time(settings: TrialSettings) -> float:
    """Return the time in which the command of the slave crosses a known lost motion [s].

    The supervisor limits the speed of the slave towards the specimen (`APPROACH_TIME`).
    """
    if not settings.lost_motion_known:
        return 0.0
    travel = 2.0 * settings.link_transmission.lost_motion
    speed = settings.limits.soft_force / (expected_stiffness(settings) * APPROACH_TIME)
    return travel / speed


def slave_lag(settings: TrialSettings) -> float:
    """Return the lag with which the slave's drive follows its command [s]."""
    if settings.rig is None:
        return 1.0 / (2.0 * math.pi * settings.plant_parameters.slave_bandwidth)
    slave = settings.rig.sections.drives.slave
    return slave.lag_ms * 1e-3 if slave else 0.0


def sensor_lag(settings: TrialSettings) -> float:
    """Return the lag of the signal of the contact force sensor [s].

    On a hardware rig, this lag is the sum of `force_lag` in the settings and the lag of the contact
    force in the rig file.
    """
    if settings.rig is None:
        return settings.plant_parameters.contact_force_lag
    contact = settings.rig.sections.channels.contact_force
    return (settings.force_lag or 0.0) + (contact.lag_ms * 1e-3 if contact else 0.0)


def arm_lag(settings: TrialSettings) -> float:
    """Return the largest lag with which the force of the arm acts on the virtual mass [s].

    The virtual mass is the mass that the operator of the simulated rig feels at the handle. The lag
    is the sum of the lags of the servo of the handle, the force sensor of the handle and the
    control loop. It includes one period for the age of a sample. On the simulated rig, this age is
    0, so that the true lag is about one period shorter.
    """
    plant = settings.plant_parameters
    servo = 1.0 / (2.0 * math.pi * plant.handle_bandwidth)
    return servo + plant.master_force_lag + LOOP_DELAY / settings.loop_rate


def arm_damping(settings: TrialSettings, frequency: Floats) -> Floats:
    """Return the effective damping of the simulated operator's arm [N s/m], shape (n,).

    The arm has the damping b and the stiffness k. Its force acts on the virtual mass of the master
    with the lag tau, which `arm_lag` returns. The impedance of the arm is therefore
    (b + k / (j w)) exp(-j w tau). The effective damping is the real part of this impedance.
    """
    arm, delay = settings.operator_model.arm, arm_lag(settings)
    phase = 2.0 * np.pi * frequency * delay
    elastic = arm.stiffness * delay * np.sinc(phase / np.pi)
    return arm.damping * np.cos(phase) - elastic


def round_trip(settings: TrialSettings) -> float:
    """Return the longest delay of a round trip through the communication channel [s].

    A round trip is the way from the master to the slave and back.
    """
    channel = settings.channel or ChannelSettings()
    return 2.0 * (channel.delay + channel.jitter)


def delayed_loop(settings: TrialSettings) -> DelayedLoop:
    """Return the loop of arm, virtual mass and delayed contact force, to check its stability.

    The contact force is that of a spring. Its stiffness is the result of `expected_stiffness` times
    the motion scale (slave motion divided by master motion). On a hardware rig, the impedance of
    the person's arm is not known. The returned loop then has no arm. If the delay is below
    `safe_delay` of this loop, the feedback is stable with any passive hand.
    """
    admittance, feedback = settings.admittance, settings.feedback
    # The arm acts on a force-commanded master through the virtual coupling, so that its damping
    # does not reach the virtual mass.
    known = settings.rig is None and settings.master_coupling is None
    arm = settings.operator_model.arm if known else UNATTENDED
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
    """Return the largest stiffness that is expected in contact with the specimen [N/m].

    This is the stiffness in the settings of the force feedback. If the settings state no stiffness,
    the result is the stiffness of the simulated body. On a hardware rig, the result is then
    `STIFF_PRIOR`, the stiffness that is assumed for an unknown specimen.
    """
    if settings.feedback.stiffness is not None:
        return settings.feedback.stiffness
    return STIFF_PRIOR if settings.rig else present_stiffness(settings)


def present_stiffness(settings: TrialSettings) -> float:
    """Return the stiffness of the simulated body at the deepest position of a trial [N/m].

    The stiffness is the derivative of the static contact force with respect to the position. The
    deepest position is the depth in the settings. If the operator reverses the motion at a certain
    force, the deepest position is at most the position with this contact force.
    """
    from scipy.optimize import brentq  # its import takes as long as that of the rest of a run

    setup, aim = settings.setup, settings.operator_model.aim_force
    deepest = setup.depth
    if aim and setup.force(deepest) > aim:
        deepest = brentq(lambda x: setup.force(x) - aim, 0.0, deepest)
    step = 1e-3 * deepest
    return (setup.force(deepest) - setup.force(deepest - step)) / step
