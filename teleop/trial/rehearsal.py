"""Check before a trial that this machine can run the control loop at its rate.

The duration of a tick is measured in a rehearsal, a short run of the trial on the simulated rig.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from drivers import Rig
from teleop.control.channel import ChannelSettings
from teleop.control.clock import Clock
from teleop.control.tare import NO_TARE
from teleop.errors import InputError
from teleop.recording.recording import reported_fault
from teleop.safety.events import ACTIVE
from teleop.safety.tightened_limits import NOT_TIGHTENED
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.stream import Stream
from teleop.trial.assembly import make_clock, make_controller, make_layout, make_simulated_rig
from teleop.trial.loop import Loop
from teleop.trial.readers import Readers
from teleop.trial.stop_switch import StopSwitch

TICKS = 600
"""Number of ticks of a rehearsal. Of the ticks with armed drives, the second half is evaluated."""
WIRE_TIME = 0.25
"""Time for which the devices of a rig are read in the check before a trial [s]."""
SHARE = 0.9
"""Largest fraction of a period of the loop that a tick may take."""


class TooSlowError(InputError):
    """The machine, with the programs that run now, cannot run the loop at its rate."""


def tick_cost(settings: TrialSettings) -> float:
    """Measure how long a tick takes on this machine.

    The time of the communication with devices is not included. The measurement is a rehearsal: a
    run of `TICKS` ticks with the settings of the trial, on the simulated rig and in virtual time.
    The tare and the limits of the hardware rig are not used. The delay of the communication channel
    is set to zero, and the gain of the force feedback is limited, because feedback that is stable
    on the specimen may be unstable on the simulated cube. A high rate of the loop is reduced, so
    that the motion begins within `TICKS` ticks.
    """
    rate = min(settings.loop_rate, 1000.0)
    rehearsal = replace(
        settings,
        rig=None,
        custom_rig=None,
        custom_condition=None,
        custom_signal=None,
        custom_link=None,
        protocol=None,
        tare=NO_TARE,
        custom_limits=None,
        tightened_limits=NOT_TIGHTENED,
        feedback=replace(settings.feedback, gain=min(settings.feedback.gain, 1.0)),
        channel=ChannelSettings() if settings.channel or settings.station else None,
        station=None,
        clock="virtual",
        rate=rate,
        duration=2.0 * TICKS / rate,
    )
    clock, bank = make_clock(rehearsal), rehearsal.estimation_preset.bank()
    stream = Stream(make_layout(rehearsal, bank), TICKS)
    costs = []
    with make_simulated_rig(rehearsal, clock.now) as rig:
        controller = make_controller(rehearsal, rig, clock)
        loop = Loop(controller, clock, stream, Readers(), StopSwitch(), rehearsal.duration)
        for _ in range(TICKS):
            start = time.perf_counter()
            loop.step()
            if controller.mode is ACTIVE:
                costs.append(time.perf_counter() - start)
    if loop.error:
        raise loop.error
    if fault := reported_fault(stream.events):
        raise InputError(
            f"rehearsal on the simulated rig: stopped for safety: {fault['text']}: expected "
            "settings that the simulated rig can run"
        )
    return float(np.percentile(costs[len(costs) // 2 :], 90.0))


def check_rate(settings: TrialSettings) -> float:
    """Check that this machine can run the control loop at its rate.

    The duration of a tick is measured in a rehearsal, a short run of the trial on the simulated
    rig. The communication with devices is not included. If a tick takes too long, the rehearsal is
    repeated a few times.
    """
    cost = math.inf
    for _ in range(3):
        cost = min(cost, tick_cost(settings))
        if cost <= SHARE / settings.loop_rate:
            return cost
    other = "" if settings.needs_arming else ", or --clock virtual"
    raise TooSlowError(f"{too_slow(settings.loop_rate, cost)}{other}")


def check_wire(rig: Rig, clock: Clock, cost: float) -> None:
    """Check that reading the devices of a rig leaves enough time for the rest of a tick.

    The devices are read at the rate of the clock, for the time `WIRE_TIME`. Nothing is sent to the
    drives, so that the time of sending a command is not measured. It is assumed to be at most the
    computing time of the simulated rig, which is included in `cost`.
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
        raise TooSlowError(too_slow(clock.rate, cost + reading, part))


def too_slow(rate: float, cost: float, part: str = "") -> str:
    """Return an error message: a tick takes longer than `SHARE` of the period."""
    return (
        f"rate {rate:g} Hz: a tick takes {cost * 1e6:.0f} us{part} on this machine with the "
        f"programs that run now, more than {SHARE:.0%} of the period of {1e6 / rate:.0f} us: "
        f"expected a rate of at most {SHARE / cost:.0f} Hz, or fewer programs at the same time"
    )
