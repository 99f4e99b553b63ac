"""Check, by a rehearsal before a trial, that this machine can run the loop at its rate."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from drivers import Rig
from sim_backend.channel import ChannelSettings
from teleop.control.clock import Clock
from teleop.control.tare import NO_TARE
from teleop.errors import InputError
from teleop.recording.black_box import BlackBox
from teleop.recording.sinks import Memory
from teleop.safety.events import ACTIVE
from teleop.safety.tightened_limits import NOT_TIGHTENED
from teleop.trial.assembly import make_clock, make_controller, make_layout, make_simulated_rig
from teleop.trial.loop import Loop
from teleop.trial.settings import TrialSettings
from teleop.trial.stop_switch import StopSwitch

TICKS = 600
"""Number of ticks of a rehearsal; the second half of its active ticks is evaluated."""
WIRE_TIME = 0.25
"""Time for which the devices of a rig are read in the check before a trial [s]."""
SHARE = 0.9
"""Largest fraction of a period of the loop that a tick may take."""


def tick_cost(settings: TrialSettings) -> float:
    """Measure how long a tick takes on this machine, without the communication with devices.

    The measurement is a rehearsal of the trial on the simulated rig in virtual time, without the
    tare and the limits of the hardware rig. In the rehearsal, the channel has no delay and the gain
    of the force feedback is at most 1, because feedback that is stable on the specimen may be
    unstable on the simulated cube. The simulated rate is at most 1 kHz, so that the motion begins
    within `TICKS` ticks.

    Returns
    -------
    cost
        90th percentile of the measured durations [s].

    Raises
    ------
    InputError
        A fault stopped the rehearsal.
    Exception
        An exception that a tick raised.
    """
    rate = min(settings.rate, 1000.0)
    rehearsal = replace(
        settings,
        rig=None,
        tare=NO_TARE,
        custom_limits=None,
        tightened_limits=NOT_TIGHTENED,
        feedback=replace(settings.feedback, gain=min(settings.feedback.gain, 1.0)),
        channel=settings.channel and ChannelSettings(),
        clock="virtual",
        rate=rate,
        duration=2.0 * TICKS / rate,
    )
    clock, bank = make_clock(rehearsal), rehearsal.estimation_preset.bank()
    layout = make_layout(rehearsal, bank)
    box = BlackBox(layout, rate)
    costs = []
    with make_simulated_rig(rehearsal, clock.now) as rig:
        controller = make_controller(rehearsal, rig, bank, clock)
        loop = Loop(controller, clock, layout, [Memory(), box], StopSwitch(), rehearsal.duration)
        for _ in range(TICKS):
            start = time.perf_counter()
            loop.step()
            if controller.mode is ACTIVE:
                costs.append(time.perf_counter() - start)
    if loop.error:
        raise loop.error
    if box.fault:
        raise InputError(
            f"rehearsal on the simulated rig: stopped for safety: {box.fault['text']}: expected "
            "settings that the simulated rig can run"
        )
    return float(np.percentile(costs[len(costs) // 2 :], 90.0))


def check_rate(settings: TrialSettings) -> float:
    """Check that this machine can run the loop at the rate, without communication with devices.

    If a rehearsal is too slow, it is repeated, up to three rehearsals in total.

    Returns
    -------
    Duration of a tick in the fastest rehearsal, without communication with devices [s].

    Raises
    ------
    InputError
        A tick takes longer than `SHARE` of the period.
    """
    cost = math.inf
    for _ in range(3):
        cost = min(cost, tick_cost(settings))
        if cost <= SHARE / settings.rate:
            return cost
    other = "" if settings.rig else ", or --clock virtual"
    raise InputError(f"{too_slow(settings.rate, cost)}{other}")


def check_wire(rig: Rig, clock: Clock, cost: float) -> None:
    """Check that reading the devices of a rig leaves enough time for the rest of a tick.

    The rig is read at the rate of the clock for `WIRE_TIME`. Nothing is sent to its drives. The
    time that sending a command takes is not measured. It is assumed to be at most the time that the
    simulated rig takes in the rehearsal.

    Parameters
    ----------
    rig
        The rig, which has been opened. Its drives are disabled.
    clock
        The clock of the trial.
    cost
        Duration of the rest of a tick [s], from `check_rate`.

    Raises
    ------
    InputError
        A tick takes longer than `SHARE` of the period.
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
        part = f" ({reading * 1e6:.0f} us of it to read the devices)"
        raise InputError(too_slow(clock.rate, cost + reading, part))


def too_slow(rate: float, cost: float, part: str = "") -> str:
    """Return a message that a tick takes longer than `SHARE` of the period.

    Parameters
    ----------
    rate
        Rate of the loop [Hz].
    cost
        Duration of a tick [s].
    part
        Text that states how much of this duration the devices take; empty without devices.
    """
    return (
        f"rate {rate:g} Hz: a tick takes {cost * 1e6:.0f} us{part} on this machine with the "
        f"programs that run now, more than {SHARE:.0%} of the period of {1e6 / rate:.0f} us: "
        f"expected a rate of at most {SHARE / cost:.0f} Hz, or fewer programs at the same time"
    )
