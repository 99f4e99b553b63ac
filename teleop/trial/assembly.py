"""Create the parts of a trial, such as clock, rig and controller, from its settings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from drivers import Rig
from estimation import Estimator
from estimation.estimate_columns import Column
from sim_backend import (
    DEPTH,
    ForcePalpation,
    FreePalpation,
    MimickedSine,
    OneSidedRig,
    Operator,
    PointerOperator,
    SimulatedRig,
)
from teleop.control.admittance import Admittance
from teleop.control.bilateral import BilateralLink
from teleop.control.channel import ChannelSettings
from teleop.control.clock import Clock, RealClock, VirtualClock
from teleop.control.conditions import Condition, Followed
from teleop.control.controller import Controller
from teleop.control.feedback.law import LawInputs
from teleop.control.link import DirectLink, Link, LinkSettings
from teleop.control.sides import MasterSide, SlaveSide
from teleop.errors import InputError
from teleop.settings.custom_class import called, create
from teleop.settings.feedback_checks import expected_stiffness
from teleop.settings.trial_settings import TrialSettings
from teleop.station.links import MasterLink, SlaveLink
from teleop.station.station import Station
from teleop.streams.columns import FEEDBACK_COLUMNS, STATION_COLUMNS, Layout

LINK_GAIN = 20.0
"""Gain from the position error of the slave to the velocity of the slave [1/s].

It is used with a communication channel or force feedback if this gain is 0 in the settings.
"""
MOST_JITTER = 0.05
"""Longest time for which the slave station keeps a motion that arrived early, to play it out
evenly [s]. It is added to the shortest delay of the network."""
RigMaker = Callable[[Callable[[], float]], Rig]
"""Function that creates a rig. Its argument is a function that returns the time [s]."""


def make_clock(settings: TrialSettings) -> Clock:
    """Return a new clock of the control loop, in real or virtual time as the settings state."""
    return (
        RealClock(settings.loop_rate)
        if settings.clock == "real"
        else VirtualClock(settings.loop_rate)
    )


def make_rig(
    settings: TrialSettings, now: Callable[[], float], pointer: PointerOperator | None = None
) -> Rig:
    """Return a new hardware rig, or a new simulated rig if the settings have no rig file.

    `pointer`: None for the simulated operator of the control condition.
    """
    if settings.custom_rig:
        maker: RigMaker = create("rig", settings.custom_rig)
        return maker(now)
    if settings.rig is None:
        return make_simulated_rig(settings, now, pointer=pointer)
    from drivers.wired_rig import WiredRig  # imports python-can

    return WiredRig(settings.rig, now, settings.loop_rate)


def make_simulated_rig(
    settings: TrialSettings,
    now: Callable[[], float],
    watchdog: float = 0.1,
    mimic: type[MimickedSine] = MimickedSine,
    pointer: PointerOperator | None = None,
    coupled: bool = True,
) -> SimulatedRig:
    """Return a new simulated rig, with a simulated operator if the control condition needs one.

    `pointer`: None for the simulated operator of the control condition. `coupled`: False
    if an emulated drive commands the force of a force-commanded master.
    """
    has_hand = settings.has_master
    rig = (OneSidedRig if settings.station else SimulatedRig)(
        settings.setup.cube,
        now,
        operator=(pointer or make_operator(settings, mimic)) if has_hand else None,
        parameters=settings.plant_parameters,
        sensors=settings.sensors,
        watchdog=watchdog,
        seed=settings.seed,
        arm=settings.operator_model.arm,
        master=settings.force_master,
        coupled=coupled,
        slave_drive=settings.force_slave or "velocity",
        period=1.0 / settings.loop_rate,
    )
    if isinstance(rig, OneSidedRig):
        rig.side = "slave" if settings.has_slave else "master"
    return rig


def make_operator(
    settings: TrialSettings, mimic: type[MimickedSine] = MimickedSine
) -> Operator | None:
    """Return a new simulated operator; None if no hand moves the master."""
    depth = handle_depth(settings)
    seed, model = settings.seed, settings.operator_model
    if not settings.by_hand:
        return None
    if target := settings.performed_as.target_for(settings.intended_motion):
        return mimic(depth, seed, target.frequency, target.count_in)
    if model.aim_force:
        return ForcePalpation(depth, seed, model.aim_force, model.arm_stiffness, model.withdrawal)
    return FreePalpation(depth, seed, model.withdrawal)


def handle_depth(settings: TrialSettings) -> float:
    """Return how deep the simulated hand moves the handle for the depth of palpation [m].

    With force feedback, the hand must also stretch the virtual coupling of a force-commanded
    master, until it feels the contact force at this depth or the greatest force of the motor.
    """
    depth, master = settings.setup.depth / settings.coupling.scale, settings.force_master
    if not master or settings.feedback.law == "none":
        return depth
    felt = settings.feedback.gain * settings.setup.force(settings.setup.depth)
    return depth + min(felt, 0.5 * master.max_force) / master.stiffness


def make_condition(settings: TrialSettings) -> Condition:
    """Return a new object for the condition that the settings state, prepared for the trial."""
    if not settings.has_master:
        return Followed()
    custom = settings.custom_condition
    condition: Condition = create("condition", custom) if custom else settings.performed_as
    return prepared(condition, settings)


def prepared(condition: Condition, settings: TrialSettings) -> Condition:
    """Prepare a condition for a trial; InputError if a part of the trial is not installed."""
    if settings.custom_signal:
        create("signal", settings.custom_signal)
    what = f"condition {settings.condition_name}"
    if callable(condition.finished):
        raise InputError(f"{what}: finished is a method: expected an attribute or a property")
    if condition.moved_by not in DEPTH:
        expected = " or ".join(DEPTH)
        raise InputError(f"{what}: moved_by {condition.moved_by!r}: expected {expected}")
    called(what, condition.prepare, motion=settings.intended_motion)
    return condition


def make_link(settings: TrialSettings) -> Link:
    """Return a new link, which computes the desired velocities of master and slave.

    With a communication channel or force feedback, the slave follows both the velocity and the
    position of the master. If the slave followed only the velocity, a lost packet of the channel
    would cause a permanent position error of the slave.
    """
    if settings.custom_link:
        link: Link = create("link", settings.custom_link)
        given = LinkSettings(settings.admittance, settings.coupling, 1.0 / settings.loop_rate)
        called(f"link {settings.custom_link.name}", link.prepare, settings=given)
        return link
    if not settings.has_link:
        return DirectLink(Admittance(settings.admittance), settings.coupling)
    channel = settings.channel or ChannelSettings()
    sides = make_sides(settings, channel.delay + channel.jitter)
    return BilateralLink(*sides, channel, settings.seed)


def make_sides(settings: TrialSettings, longest: float) -> tuple[MasterSide, SlaveSide]:
    """Return the master side and the slave side of a trial with a channel or force feedback.

    `longest` is the largest expected delay of the channel [s].
    """
    admittance, coupling = Admittance(settings.admittance), settings.coupling
    if coupling.position_gain == 0.0:
        coupling = replace(coupling, position_gain=LINK_GAIN)
    feedback = settings.feedback
    inputs = LawInputs(
        admittance,
        coupling,
        feedback.gain,
        settings.link_transmission,
        settings.lost_motion_known,
        settings.is_glued,
        expected_stiffness(settings),
    )
    master, slave = feedback.law_type.halves(inputs)
    closed = feedback.law != "none"
    return (
        MasterSide(admittance, coupling.scale, master, closed),
        SlaveSide(coupling.scale, slave, longest),
    )


def make_station_link(settings: TrialSettings, station: Station) -> Link:
    """Return the link of a station: the side of this computer, and the other one by network."""
    given = settings.station
    assert given
    master, slave = make_sides(settings, MOST_JITTER)
    if given.side == "slave":
        return SlaveLink(station, slave, given.max_silence, given.retreat)
    return MasterLink(station, master, given.max_silence, settings.master_coupling is not None)


def make_layout(
    settings: TrialSettings,
    bank: Mapping[str, Estimator],
    pointer: PointerOperator | None = None,
) -> Layout:
    """Return the columns of a trial, which the loop and the estimation write."""
    link: tuple[Column, ...] = FEEDBACK_COLUMNS if settings.has_link else ()
    if settings.station:
        link = (*link, *STATION_COLUMNS)
    return Layout(bank, link, pointer, settings.hand_observer is not None)


def make_controller(
    settings: TrialSettings,
    rig: Rig,
    clock: Clock,
    condition: Condition | None = None,
    station: Station | None = None,
) -> Controller:
    """Return a new controller, with the zero offsets and the safety limits of the settings.

    `condition`: None to create it from the settings. `station`: the session with the other
    station; None if this computer has both sides.
    """
    return Controller(
        rig,
        condition or make_condition(settings),
        make_station_link(settings, station) if station else make_link(settings),
        1.0 / settings.loop_rate,
        settings.limits,
        settings.tare,
        clock.stopwatch,
        settings.hand_observer,
    )
