"""Create the clock, the rig, the condition and the controller of a trial from its settings."""

from __future__ import annotations

from collections.abc import Callable

from drivers import Rig
from drivers.wired_rig import WiredRig
from estimation import Bank, Excitation
from sim_backend import FreePalpation, MimickedSine, Operator, PointerOperator, SimulatedRig
from teleop.control.admittance import Admittance
from teleop.control.clock import Clock, RealClock, VirtualClock
from teleop.control.conditions import Autonomous, Condition, Mimicry, Teleoperation
from teleop.control.controller import Controller
from teleop.control.injector import Injector
from teleop.trial.settings import TrialSettings

RigMaker = Callable[[Callable[[], float]], Rig]
"""Function that creates a rig. Its argument is a function that returns the time [s]."""


def make_clock(settings: TrialSettings) -> Clock:
    """Return a new clock, real or virtual."""
    return RealClock(settings.rate) if settings.clock == "real" else VirtualClock(settings.rate)


def make_rig(
    settings: TrialSettings, now: Callable[[], float], pointer: PointerOperator | None = None
) -> Rig:
    """Return a new rig of devices, or a new simulated rig if the settings have no rig file.

    Parameters
    ----------
    settings
        Settings of the trial.
    now
        Returns the time of the clock [s].
    pointer
        Operator of the simulated rig; None for that of the condition.
    """
    if settings.rig:
        return WiredRig(settings.rig, now)
    return make_simulated_rig(settings, now, pointer=pointer)


def make_simulated_rig(
    settings: TrialSettings,
    now: Callable[[], float],
    watchdog: float = 0.1,
    pointer: PointerOperator | None = None,
) -> SimulatedRig:
    """Return a new simulated rig, with a simulated operator if the condition needs one.

    Parameters
    ----------
    settings
        Settings of the trial.
    now
        Returns the time of the clock [s].
    watchdog
        Timeout of the drives' watchdogs [s].
    pointer
        Operator that replaces the simulated one.
    """
    setup = settings.setup
    depth = setup.depth / settings.coupling.scale
    operator: Operator | PointerOperator | None = pointer
    if not pointer and settings.condition == "free":
        operator = FreePalpation(depth, settings.seed)
    elif not pointer and settings.condition == "mimic":
        target = settings.target
        operator = MimickedSine(depth, settings.seed, target.frequency, target.count_in)
    return SimulatedRig(
        setup.cube,
        now,
        operator=operator,
        parameters=settings.plant_parameters,
        sensors=settings.sensors,
        watchdog=watchdog,
        seed=settings.seed,
    )


def make_condition(settings: TrialSettings) -> Condition:
    """Return a new control condition, with its target or its PE injector."""
    if settings.condition == "free":
        return Teleoperation()
    if settings.condition == "mimic":
        return Mimicry(settings.target)
    return Autonomous(
        Injector(
            settings.excitation,
            settings.setup.depth,
            settings.admittance,
            settings.coupling.scale,
            settings.duration,
        )
    )


def make_controller(
    settings: TrialSettings, rig: Rig, bank: Bank, clock: Clock, condition: Condition | None = None
) -> Controller:
    """Return a new controller.

    Parameters
    ----------
    settings
        Settings of the trial.
    rig
        The rig that the controller reads and commands.
    bank
        The estimators.
    clock
        The clock of the loop.
    condition
        Control condition; None for that of the settings.
    """
    return Controller(
        rig,
        condition or make_condition(settings),
        Admittance(settings.admittance),
        settings.coupling,
        settings.make_conditioner(),
        bank,
        Excitation(),
        1.0 / settings.rate,
        settings.limits,
        settings.tare,
        clock.stopwatch,
    )
