"""Measure before a trial whether this computer can run the control loop at its rate.

The measurement is a rehearsal: the loop of the trial runs in real time on the simulated rig. A
trial measures for `BEFORE_A_TRIAL`, `teleop machine check` for a minute. Both use the same code and
the same verdict, see `teleop.trial.loop_verdict`.
"""

from __future__ import annotations

import math
import time
from array import array
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from drivers import Rig
from teleop.control.channel import ChannelSettings
from teleop.control.clock import Clock, RealClock, Tick
from teleop.control.tare import NO_TARE
from teleop.errors import InputError
from teleop.names import RealtimeName
from teleop.recording.recording import reported_fault
from teleop.safety.events import ACTIVE, FAULT, Fault
from teleop.safety.tightened_limits import NOT_TIGHTENED
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.stream import STORED, Stream
from teleop.trial.assembly import make_controller, make_layout, make_simulated_rig
from teleop.trial.loop import Loop
from teleop.trial.loop_verdict import SHARE, LoopTiming, LoopVerdict, too_slow, verdict_of
from teleop.trial.other_programs import ProcessorUse
from teleop.trial.readers import Readers
from teleop.trial.realtime import realtime
from teleop.trial.stop_switch import StopSwitch

BEFORE_A_TRIAL = 0.1
"""Time for which the loop is measured before each trial in real time [s]."""
ATTEMPTS = 3
"""Number of measurements before a trial is refused, because a short disturbance may be chance."""
WARM_UP = 0.1
"""Time before the measurement, in which the drives are armed and the caches are filled [s]."""
WIRE_TIME = 0.25
"""Time for which the devices of a rig are read in the check before a trial [s]."""
OWN_FAULTS = (Fault.OVERRUN, Fault.DRIVE_ERROR)
"""Faults of a rehearsal that a pause of the loop causes; the simulated drives have a watchdog."""


class TooSlowError(InputError):
    """The machine, with the programs that run now, cannot run the loop at its rate."""


class LoggingClock(RealClock):
    """A clock in real time that stores the timing of each tick, and its processor time."""

    def __init__(self, rate: float) -> None:
        super().__init__(rate)
        self.log = array("d")
        """Values of each `Tick`, one after another."""
        self.work = array("d")
        """Processor time of the tick before each tick [s]."""
        self._begun = time.thread_time()

    def wait(self) -> Tick:
        """Wait until the deadline of the next tick; store and return the timing of this tick."""
        self.work.append(time.thread_time() - self._begun)
        tick = super().wait()
        self.log.extend(tick)
        self._begun = time.thread_time()
        return tick


def rehearsal_settings(settings: TrialSettings, duration: float) -> TrialSettings:
    """Return the settings of a trial on the simulated rig whose ticks take as long.

    The tare and the limits of the hardware rig are not used. The delay of the communication channel
    is set to zero, and the gain of the force feedback is limited, because feedback that is stable
    on the specimen may be unstable on the simulated cube.
    """
    return replace(
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
        clock="real",
        rate=settings.loop_rate,
        duration=duration,
        until=None,
    )


def rehearse(
    settings: TrialSettings, seconds: float, read: Callable[[], object] | None = None
) -> LoopTiming:
    """Run the loop of a trial on the simulated rig in real time, and return its timing.

    The caller applies the real-time settings. The first ticks, for `WARM_UP`, are not evaluated.

    Parameters
    ----------
    settings
        Settings of the trial.
    seconds
        Duration of the measurement [s].
    read
        Function that is called once in each tick in addition, to read the devices of a rig.

    Raises
    ------
    InputError
        The safety supervisor stopped the rehearsal for a reason other than the timing of the loop.
    """
    rehearsal = rehearsal_settings(settings, 2.0 * (WARM_UP + seconds))
    rate, bank = rehearsal.loop_rate, rehearsal.estimation_preset.bank()
    clock = LoggingClock(rate)
    stored = min(2.0 * (WARM_UP + seconds), STORED)
    stream = Stream(make_layout(rehearsal, bank), round(stored * rate))
    reading = array("d")
    first = 0
    with make_simulated_rig(rehearsal, clock.now) as rig:
        controller = make_controller(rehearsal, rig, clock)
        loop = Loop(controller, clock, stream, Readers(), StopSwitch(), rehearsal.duration)
        use, begun = ProcessorUse(), clock.now()
        while loop.step() and controller.mode is not FAULT:
            if read:
                start = time.perf_counter()
                read()
                reading.append(time.perf_counter() - start)
            elapsed = clock.now() - begun
            if first and elapsed >= seconds:
                break
            if not first and elapsed >= WARM_UP and controller.mode is ACTIVE:
                use, begun, first = ProcessorUse(), clock.now(), loop.ticks
        others = use.others()
    if loop.error:
        raise loop.error
    lateness, _, skipped, busy = np.array(clock.log).reshape(-1, len(Tick._fields)).T
    timing = LoopTiming.of_ticks(
        rate,
        lateness[first:],
        skipped[first:],
        busy[first:],
        np.array(reading[first:]),
        others,
        np.array(clock.work[first:]),
    )
    if fault := reported_fault(stream.events):
        if fault["fault"] not in OWN_FAULTS:
            raise InputError(
                f"rehearsal on the simulated rig: stopped for safety: {fault['text']}: expected "
                "settings that the simulated rig can run"
            )
        return timing._replace(fault=fault["text"])
    return timing


def check_rate(settings: TrialSettings, real: RealtimeName = "off") -> LoopVerdict:
    """Check before a trial that this machine can run the control loop at its rate.

    The loop is measured for `BEFORE_A_TRIAL`, up to `ATTEMPTS` times while a tick does not fit into
    its period. The communication with devices is not included. A pause or missed periods do not
    refuse a trial, because so short a measurement cannot tell how frequent they are: the supervisor
    watches them during the trial.

    Parameters
    ----------
    settings
        Settings of the trial.
    real
        Real-time settings of the trial, which are also applied for the measurement.

    Raises
    ------
    TooSlowError
        A tick did not fit into its period each time.
    InputError
        A required real-time setting was refused, or the settings cannot be rehearsed.
    """
    with realtime(real) as applied:
        applied.start()
        for _ in range(ATTEMPTS):
            verdict = verdict_of(rehearse(settings, BEFORE_A_TRIAL), settings.limits)
            if verdict.fits:
                return verdict
    other = "" if settings.needs_arming else ", or --clock virtual"
    raise TooSlowError(f"{too_slow(settings.loop_rate, verdict.cost)}{other}")


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
