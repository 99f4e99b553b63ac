"""Run one tick of the control loop, from the measurement to the commands of the drives."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from drivers import STANDSTILL, Ages, Command, Measurement, NotStoppedError, Rig, new_tuple
from drivers.rig import LONGEST_STOP
from teleop.control.alignment import Alignment, Pair
from teleop.control.clock import Tick
from teleop.control.conditions import Condition
from teleop.control.hand_observer import HandObserver
from teleop.control.link import Link
from teleop.control.rig_values import command_of, measurement_of
from teleop.control.tare import NO_TARE, Tare
from teleop.control.tick_record import Record, Timing
from teleop.failures import failure
from teleop.safety import (
    Event,
    Fault,
    Limits,
    Mode,
    Request,
    Supervision,
    Verdict,
    activate,
    supervise,
)
from teleop.safety import rearm as rearmed
from teleop.safety.channels import DetectedFault
from teleop.safety.events import ACTIVE, EXCITATION, STOPPING
from teleop.safety.state import NO_REQUEST

NO_PAIR = Pair(math.nan, math.nan, math.nan)


class Controller:
    """Runs the ticks of the control loop.

    In each tick, the controller reads the rig, computes the desired velocities, lets the supervisor
    limit them, commands the drives, and returns a `Record`. The loop (`teleop.trial.loop`) writes
    it to the stream (`teleop.streams.stream`), from which all other parts read it. Stiffness and
    damping of the specimen are estimated by such a reader, not here.

    An exception within a tick becomes a fault for the supervisor, which stops the drives. The first
    exception is stored in `error`. The method `tick` raises an exception only in two cases: the
    exception is a KeyboardInterrupt, or it occurs while the first measurement is read.

    `period` is the nominal time between ticks [s], and the time step of the first tick. `stopwatch`
    returns a time [s], to measure the durations of parts of a tick. `observer` estimates the force
    of the hand for the recording.
    """

    def __init__(
        self,
        rig: Rig,
        condition: Condition,
        link: Link,
        period: float,
        limits: Limits,
        tare: Tare = NO_TARE,
        stopwatch: Callable[[], float] = time.perf_counter,
        observer: HandObserver | None = None,
    ) -> None:
        self._rig = rig
        self._condition = condition
        self._link = link
        self._period = period
        self._limits = limits
        self._tare = tare
        self._stopwatch = stopwatch
        self._observer = observer
        self._alignment = Alignment()
        self._supervision = Supervision()
        self._measurement: Measurement | None = None
        self._start = math.nan
        self._lateness = 0.0
        self._energised = False
        """True from `Rig.enable` until the drives confirm that they are disabled."""
        self._idled = math.nan
        """Time of the first unconfirmed call of `Rig.idle` [s]; NaN if there is none."""
        self._silent = False
        """Whether no command is sent until the drives confirm that they are disabled."""
        self._phase = math.nan
        self._faults: list[DetectedFault] = []
        self._note = ""
        """Latest note of the condition that became an event."""
        self.finished = False
        """Whether the control condition has finished, so that the trial ends."""
        self.error: Exception | None = None
        """The first exception within a tick since the start or `rearm`; None if there was none."""

    @property
    def mode(self) -> Mode:
        """Present mode of the safety supervisor, for example ready, active or fault."""
        return self._supervision.mode

    @property
    def ending(self) -> str:
        """Reason why the condition has finished early; empty if there is none."""
        return self._condition.ending

    @property
    def stops(self) -> bool:
        """True until the drives have confirmed a stop, and the slave is at rest since then."""
        return self._energised or self._supervision.halting is not None

    def rearm(self) -> None:
        """Clear the faults, so that the drives can be armed again. The drives remain disabled.

        Before the drives are armed again, the supervisor repeats all its checks.
        """
        supervision = rearmed(self._supervision)
        self._rig.rearm()
        self._supervision = supervision
        self._faults.clear()
        self.error = None

    def tick(self, tick: Tick, request: Request = NO_REQUEST) -> Record:
        """Run one tick: read the rig, limit the velocities, and command the drives."""
        started = self._stopwatch()
        measurement, dt = self._read()
        self._link.sense(measurement, dt)
        read = self._stopwatch()
        t = measurement.time - self._start

        drive_force, target, desired = 0.0, math.nan, STANDSTILL
        self._phase = math.nan
        if self._supervision.mode is ACTIVE and 0.0 <= dt <= self._limits.max_gap:
            try:
                active = measurement.time - self._supervision.since
                drive_force = float(self._condition.drive_force(active, measurement))
                target = float(self._condition.target(active))
                desired = self._link.step(drive_force, measurement, dt)
                self._faults += self._link.faults
                self._phase = float(self._condition.phase)
                self.finished = bool(self._condition.finished)
            except BaseException as error:
                self._fail(Fault.CONTROL_FAILURE, error, measurement.time)
        request = self._complete(request, tick, measurement)
        verdict = supervise(self._supervision, measurement, desired, request, self._limits)
        if verdict.arm and self._enable(measurement.time):
            verdict = activate(verdict)
            self._link.align(measurement)
        self._supervision = verdict.state
        mode = verdict.state.mode

        mapped = self._stopwatch()
        applied = self._apply(verdict, measurement.time)
        written = self._stopwatch()
        self._link.follow(verdict, desired, applied, dt)

        pair = NO_PAIR
        if mode is ACTIVE or mode is STOPPING:
            try:
                if found := self._alignment.update(measurement, dt):
                    self._link.observe(found)
                    pair = found
            except BaseException as error:
                self._fail(Fault.CONTROL_FAILURE, error, measurement.time)
        events = verdict.events
        if mode is ACTIVE and self._condition.note != self._note:
            self._note = self._condition.note
            events += (Event(measurement.time, mode, self._note, source=EXCITATION),)
        if events:
            start = self._start
            events = tuple(e._replace(time=e.time - start, since=e.since - start) for e in events)
        compute = mapped - read + self._stopwatch() - written
        timing = new_tuple(Timing, (read - started, compute, written - mapped))
        values = (
            t,
            dt,
            measurement,
            drive_force,
            target,
            desired,
            verdict.command,
            applied,
            pair,
            mode,
            verdict.limited,
            tick,
            timing,
            events,
            self._link.values,
            self._phase,
            self._observer.update(measurement) if self._observer else math.nan,
        )
        return new_tuple(Record, values)

    def _read(self) -> tuple[Measurement, float]:
        """Read the sensors; return the measurement, and the time since the last measurement [s].

        The zero offsets (tare) are subtracted from the measurement. If reading fails, the error
        becomes a fault, and the last measurement is returned with a time and ages one period later.
        If even the first reading fails, the exception is raised.
        """
        last = self._measurement
        try:
            measurement = measurement_of(self._rig.read())
            if self._tare is not NO_TARE:
                measurement = self._tare.apply(measurement)
        except BaseException as error:
            if last is None:
                raise
            age = Ages._make(age + self._period for age in last.age)
            measurement = last._replace(time=last.time + self._period, age=age)
            self._fail(Fault.RIG_FAILURE, error, measurement.time)
        self._measurement = measurement
        if last is None:
            self._start = measurement.time + self._limits.preflight + self._period
            return measurement, self._period
        return measurement, measurement.time - last.time

    def _complete(self, request: Request, tick: Tick, measurement: Measurement) -> Request:
        """Return the input of the supervisor: the request of a person, and data of the loop.

        The data are the faults that were detected, the number of skipped periods, the time since
        the previous tick, and the expected stiffness of the environment (the slope of the contact
        force over the position of the slave).
        """
        elapsed = (1 + tick.skipped) * self._period + tick.lateness - self._lateness
        self._lateness = tick.lateness
        trips = (*request.faults, *self._faults)
        self._faults.clear()
        stiffness = self._link.stiffness(measurement.slave_position)
        values = (*request[:3], trips, tick.skipped, elapsed, stiffness)
        return new_tuple(Request, values)

    def _enable(self, now: float) -> bool:
        """Enable the drives, and return whether all drives are ready for commands.

        If an exception occurs, it becomes a fault at the time `now` [s], and False is returned.
        """
        self._energised, self._silent = True, False
        try:
            return bool(self._rig.enable())
        except BaseException as error:
            self._fail(Fault.RIG_FAILURE, error, now)
            return False

    def _apply(self, verdict: Verdict, now: float) -> Command:
        """Send the command to the drives, and disable the drives if the supervisor requires it.

        The drives are disabled by `Rig.idle`. It is called again at each tick until it returns
        True, that is, until the drives have confirmed that they are disabled. Until then, no
        command is sent after a first command of zero velocity, so that the watchdogs (timers in the
        drives) stop the drives.

        The argument `verdict` is the output of the supervisor, and `now` is the time of this tick
        [s]. The velocities that the drives applied are returned [m/s].
        """
        applied = STANDSTILL
        operating = (verdict.enabled or verdict.arm) and not self._faults
        if not self._silent:
            try:
                applied = command_of(self._rig.write(verdict.command))
            except BaseException as error:
                self._fail(Fault.RIG_FAILURE, error, now)
                operating = False
        if self._energised and not operating:
            self._silent = verdict.command == STANDSTILL
            try:
                if self._rig.idle() is True:
                    self._energised = self._silent = False
                    self._idled = math.nan
                elif math.isnan(self._idled):
                    self._idled = now
                elif now - self._idled > LONGEST_STOP:
                    raise NotStoppedError(
                        f"the drives have not confirmed within {LONGEST_STOP:g} s that they are "
                        "disabled: if the slave moves, use the hardware emergency stop"
                    )
                applied = STANDSTILL
            except NotStoppedError as error:
                self._fail(Fault.NOT_STOPPED, error, now)
            except BaseException as error:
                error.add_note("the drives could not be disabled")
                self._fail(Fault.RIG_FAILURE, error, now)
        return applied

    def _fail(self, fault: Fault, error: BaseException, now: float) -> None:
        """Convert an exception at the time `now` [s] to a fault, which the supervisor receives.

        The first exception is also stored in the attribute `error`. A KeyboardInterrupt is not
        converted, but raised.
        """
        if isinstance(error, KeyboardInterrupt):
            raise error
        text, exception = failure(error)
        if self.error is None:
            self.error = exception
        self._faults.append(DetectedFault(fault, text, math.nan, math.nan, now))
