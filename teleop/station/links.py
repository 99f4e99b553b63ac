"""Links of the two stations: one side of the telemanipulator, and the other side over a network."""

from __future__ import annotations

import math

from drivers import Command, Measurement, new_tuple
from teleop.control.feedback.law import MasterMotion, Report
from teleop.control.link import Link
from teleop.control.sides import MasterSide, MasterValues, SlaveSide, silence_fault
from teleop.safety import Verdict
from teleop.safety.channels import DetectedFault
from teleop.safety.events import ACTIVE
from teleop.station.datagram import motion_values, report_values, to_motion, to_report
from teleop.station.station import Station

FADING = 0.1
"""Time in which the displayed force of a force-commanded master fades after a silence [s]."""
HELD = 5e-3
"""Time without a new motion of the master after which the slave holds its position [s]. The slave
can be behind the master, because of its limits. Otherwise it would move on to where the master was.
"""
RETREAT_SPEED = 20e-3
"""Speed with which the slave retreats from the specimen after a silence [m/s]."""
PATIENCE = 1.0
"""Time in addition to the expected one after which a retreat ends in any case [s]."""
NO_MASTER = MasterValues(*[math.nan] * len(MasterValues._fields))


class StationLink(Link):
    """Base class of the links of both stations.

    The values that are recorded are those of `LinkValues`, NaN for the other side, and of
    `ConnectionValues`.

    `max_silence` is the longest permitted time without a datagram of the other station [s].
    """

    def __init__(self, station: Station, max_silence: float) -> None:
        self.station = station
        self._max_silence = max_silence
        self._measurement: Measurement | None = None
        self._dt = 0.0
        self._left = False

    def sense(self, measurement: Measurement, dt: float) -> None:
        """Store the measurement of a tick."""
        self._measurement, self._dt = measurement, dt

    @property
    def _now(self) -> float:
        """Time of the measurement of this tick [s]."""
        return self._measurement.time if self._measurement else math.nan

    def _silence(self) -> float:
        """Return for how long nothing has arrived from the other station [s].

        A silence that was too long lasts until the drives are armed again.
        """
        silence = self.station.peer.now() - self.station.peer.heard
        self._left |= silence > self._max_silence
        return silence

    def _silent(self, now: float, silence: float) -> DetectedFault:
        """Return the fault of a silence."""
        return silence_fault(now, max(silence, self._max_silence), self._max_silence)


class MasterLink(StationLink):
    """Master side, with the slave side at the other station.

    `fades`: whether the displayed force fades after a silence, and the drives are stopped then.
    Otherwise, they are stopped at once. It is for a force-commanded master, whose handle would
    jump towards the hand if its force ended suddenly.
    """

    def __init__(
        self, station: Station, side: MasterSide, max_silence: float, fades: bool = False
    ) -> None:
        super().__init__(station, max_silence)
        self._side = side
        self._fades = fades
        self._report = Report()
        self._motion = MasterMotion(0.0)
        self._shown = 0.0
        """Displayed force when the silence became too long [N]."""
        self._lost = math.nan
        """Time at which the silence became too long [s]."""

    def align(self, measurement: Measurement) -> None:
        """Put the virtual mass at rest where the tip of the slave is."""
        self._motion = self._side.align(self._newest().tip)
        self._left, self._lost = False, math.nan
        self.faults = ()

    def _newest(self) -> Report:
        """Return the newest report of the slave."""
        if newest := self.station.peer.newest:
            self._report = to_report(newest.values, self._report.model)
            self.station.echo = newest.sent
        return self._report

    def step(self, force: float, measurement: Measurement, dt: float) -> Command:
        """Move the virtual mass, and return the desired velocity of the master [m/s]."""
        side, now = self._side, measurement.time
        silence = self._silence()
        if self._left:
            self._motion = self._without_slave(force, now, silence, dt)
        else:
            self.faults = tuple(side.faults(now)) if side.has_fault else ()
            self._motion = side.step(force, self._newest(), dt)
        return new_tuple(Command, (side.admittance.velocity, 0.0))

    def _without_slave(self, force: float, now: float, silence: float, dt: float) -> MasterMotion:
        """Return the motion after a silence: the displayed force fades, and then the drives stop.

        The virtual mass and its damping stay.
        """
        if self._lost != self._lost:
            self._lost, self._shown = now, self._side.law.state.displayed
        left = 1.0 - (now - self._lost) / FADING
        if not self._fades or left <= 0.0:
            self.faults = (self._silent(now, silence),)
        return self._side.fade(force, max(left, 0.0) * self._shown, dt)

    def follow(self, verdict: Verdict, desired: Command, applied: Command, dt: float) -> None:
        """Move the virtual mass like the handle, and send its motion to the slave."""
        self._side.follow(verdict, desired, applied, dt)
        if verdict.state.mode is not ACTIVE:
            self._newest()
        station, report = self.station, self._report
        station.send(verdict, motion_values(self._motion))
        age = station.peer.age(station.echo).high
        self.values = (
            *self._side.values,
            math.nan,
            report.energy,
            age,
            math.nan,
            *station.values(self._now),
        )


class SlaveLink(StationLink):
    """Slave side, with the master side at the other station.

    The slave follows the motion of a master whose mode is active, and no other. `retreat` is the
    distance by which it moves out of the specimen after a silence [m]; 0 to stop where it is.
    """

    def __init__(
        self, station: Station, side: SlaveSide, max_silence: float, retreat: float = 0.0
    ) -> None:
        super().__init__(station, max_silence)
        self._side = side
        self._retreat = retreat
        self._motion = MasterMotion(0.0)
        self._sent = 0.0
        self._number = -1
        self._goal = self._end = math.nan
        self._advanced = 0.0
        """Latest time at which there was a motion of the master to follow [s]."""
        self._played = math.nan
        self.observe = side.observe  # type: ignore[method-assign]
        self.stiffness = side.stiffness  # type: ignore[method-assign]

    def align(self, measurement: Measurement) -> None:
        """Hold the position until the master moves."""
        side, station = self._side, self.station
        station.peer.settle()
        side.align(measurement)
        self._motion, self._sent = side.still, side.playout.time
        self._left, self._goal = False, math.nan
        self.faults = ()

    def step(self, force: float, measurement: Measurement, dt: float) -> Command:
        """Return the desired velocity of the slave, with which it follows the master [m/s]."""
        station, side = self.station, self._side
        peer = station.peer
        newest, transit = peer.newest, peer.transit
        silence = self._silence()
        if newest and newest.mode is ACTIVE:
            if newest.sequence != self._number:
                self._number = newest.sequence
                self._motion, self._sent = to_motion(newest.values), newest.sent + transit
            before = side.playout.time
            velocity, motion = side.step(self._sent, self._motion, measurement, dt)
            if side.playout.time > before:
                self._advanced = measurement.time
            elif measurement.time - self._advanced > HELD:
                velocity = 0.0
            station.echo = side.playout.time - transit
            station.lag = self._sent - side.playout.time
        else:  # also after the master has stopped
            velocity, motion = 0.0, self._motion
        self._played = motion.energy
        if self._left:
            return self._without_master(measurement, silence)
        return new_tuple(Command, (0.0, velocity))

    def _without_master(self, measurement: Measurement, silence: float) -> Command:
        """Return the command after a silence: retreat if this is wanted, and then stop."""
        now, x = measurement.time, measurement.slave_position
        if self._goal != self._goal:
            self._goal = x - self._retreat
            self._end = now + self._retreat / RETREAT_SPEED + PATIENCE
        if self._retreat and x > self._goal and now < self._end:
            return new_tuple(Command, (0.0, -RETREAT_SPEED))
        self.faults = (self._silent(now, silence),)
        return new_tuple(Command, (0.0, 0.0))

    def follow(self, verdict: Verdict, desired: Command, applied: Command, dt: float) -> None:
        """Send the contact force and the model of the specimen to the master."""
        station, measurement = self.station, self._measurement
        assert measurement
        if verdict.state.mode is not ACTIVE and (newest := station.peer.newest):
            station.echo, station.lag = newest.sent, 0.0
        station.send(verdict, report_values(self._side.report(measurement, self._dt)))
        age = station.peer.age(station.echo).high
        connection = station.values(self._now)
        self.values = (*NO_MASTER, self._played, math.nan, math.nan, age, *connection)
