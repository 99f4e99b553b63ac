"""A rehearsal before a trial: warms every kernel, and checks that this machine holds the rate."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from drivers import Rig
from teleop.control.clock import Clock
from teleop.control.tare import NO_TARE
from teleop.errors import InputError
from teleop.recording.black_box import BlackBox
from teleop.recording.message import Layout
from teleop.recording.sinks import Memory
from teleop.safety.events import ACTIVE
from teleop.trial.loop import Session
from teleop.trial.settings import TrialSettings
from teleop.trial.stop_switch import StopSwitch

TICKS = 600
"""Ticks by which a rate is tried; the second half of the active ones counts."""
WIRE_TIME = 0.25
"""Time for which the devices of a rig are read before a trial [s]."""
SHARE = 0.9
"""Share of a period that a tick may take."""


def tick_cost(settings: TrialSettings) -> float:
    """Time [s] that nine of ten ticks keep to on this machine, rehearsed in virtual time.

    The rehearsal runs on the simulated rig, without the tare and the limits of the real one, and
    at 1 kHz at the most, so that it gets to the motion.

    Raises
    ------
    InputError
        The rehearsal was stopped for safety, so that its ticks are not those of a trial.
    Exception
        Whatever a tick raised.
    """
    rate = min(settings.rate, 1000.0)
    rehearsal = replace(
        settings,
        rig=None,
        tare=NO_TARE,
        custom_limits=None,
        clock="virtual",
        rate=rate,
        duration=2.0 * TICKS / rate,
    )
    clock, bank = rehearsal.make_clock(), rehearsal.make_bank()
    layout = Layout(bank)
    costs = []
    with rehearsal.make_simulated_rig(clock.now) as rig:
        box = BlackBox(layout, rehearsal.rate)
        session = Session(rehearsal, clock, rig, bank, layout, [Memory()], box, StopSwitch())
        for _ in range(TICKS):
            start = time.perf_counter()
            session.step()
            if session.controller.mode is ACTIVE:
                costs.append(time.perf_counter() - start)
    if session.error:
        raise session.error
    if box.fault:
        raise InputError(
            f"rehearsal on the simulated rig: stopped for safety: {box.fault['text']}: expected "
            "settings that the simulated rig can run"
        )
    return float(np.percentile(costs[len(costs) // 2 :], 90.0))


def check_rate(settings: TrialSettings) -> float:
    """Make sure that this machine can hold the rate, in the best of three rehearsals.

    Returns
    -------
    Time [s] that a tick takes, without the devices of a rig.

    Raises
    ------
    InputError
        It cannot.
    """
    cost = math.inf
    for _ in range(3):
        cost = min(cost, tick_cost(settings))
        if cost <= SHARE / settings.rate:
            return cost
    raise InputError(
        f"rate {settings.rate:g} Hz: a tick takes {cost * 1e6:.0f} us on this machine, "
        f"expected a rate of at most {SHARE / cost:.0f} Hz, or --clock virtual"
    )


def check_wire(rig: Rig, clock: Clock, cost: float) -> None:
    """Make sure that the devices of an opened rig leave time enough for the rest of a tick.

    The rig is read at the rate of the clock for a moment; nothing is sent to its drives. The
    write of a tick is taken to cost no more than the simulated rig in the rehearsal.

    Parameters
    ----------
    rig
        The rig, opened, its drives idle.
    clock
        The clock of the trial.
    cost
        Time that the rest of a tick takes [s], from `check_rate`.

    Raises
    ------
    InputError
        The rate cannot be held.
    RigError
        A device cannot be read.
    """
    wire = []
    for _ in range(math.ceil(WIRE_TIME * clock.rate)):
        clock.wait()
        start = time.perf_counter()
        rig.read()
        wire.append(time.perf_counter() - start)
    reading = float(np.percentile(wire, 90.0))
    if cost + reading > SHARE * clock.period:
        raise InputError(
            f"rate {clock.rate:g} Hz: a tick takes {(cost + reading) * 1e6:.0f} us on this "
            f"machine, of which {reading * 1e6:.0f} us to read the devices, expected a rate of at "
            f"most {SHARE / (cost + reading):.0f} Hz"
        )
