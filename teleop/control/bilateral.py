"""Link between master and slave with a communication channel and a force-feedback law.

The law computes the force that the hand feels, and the desired velocity of the slave. It consists
of two halves, one at the master and one at the slave. The halves exchange data only through the
channel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from drivers import Command, Measurement, new_tuple
from teleop.control.admittance import Admittance
from teleop.control.channel import ChannelSettings, Direction
from teleop.control.coupling import Coupling
from teleop.control.feedback.law import MasterHalf, MasterMotion, Report, SlaveHalf
from teleop.control.feedback.oscillation import MOST_SHARE, SLOWEST, Oscillation
from teleop.control.feedback.port_energy import PortEnergy
from teleop.control.link import Link
from teleop.control.playout import Playout
from teleop.safety import Fault, Verdict
from teleop.safety.channels import DetectedFault


class LinkValues(NamedTuple):
    """Values that the link between master and slave records at one tick.

    `teleop.streams.columns.FEEDBACK_COLUMNS` states the meaning and the unit of each value.
    """

    displayed_force: float
    model_stiffness: float
    model_stiffening: float
    model_damping: float
    tank: float
    port_energy: float
    master_energy: float
    slave_energy: float
    report_age: float
    motion_age: float


NO_VALUES = LinkValues(*[math.nan] * len(LinkValues._fields))


class BilateralLink(Link):
    """Link between master and slave with a communication channel and a force-feedback law.

    The coupling is used here only to compute the initial position of the virtual mass. `closed`
    states whether the law displays a force to the hand: only then can the loop through the hand
    oscillate, which is observed.
    """

    def __init__(
        self,
        admittance: Admittance,
        coupling: Coupling,
        master: MasterHalf,
        slave: SlaveHalf,
        channel: ChannelSettings,
        seed: int = 0,
        closed: bool = True,
    ) -> None:
        self._admittance = admittance
        self._coupling = coupling
        self._master, self._slave = master, slave
        self._max_silence = channel.max_silence
        self.reports = Direction(channel, f"reports {seed}", Report())
        self.motions = Direction(channel, f"motions {seed}", MasterMotion(0.0))
        self._playout = Playout(channel.delay + channel.jitter)
        self._energy = PortEnergy(admittance)
        self._oscillation = Oscillation() if closed else None
        self.values = NO_VALUES
        # The controller calls both methods at each tick. The methods of the slave half are called
        # directly, because a method of this class that calls them would add 0.3 us.
        self.observe = slave.observe  # type: ignore[method-assign]
        self.stiffness = slave.stiffness  # type: ignore[method-assign]

    def align(self, measurement: Measurement) -> None:
        """Put the virtual mass at rest, and reset the force-feedback law and the channel.

        The virtual mass is put at the position that corresponds to that of the slave's tip. This
        method is called each time the drives are armed.
        """
        self._admittance.align(self._slave.tip(measurement) / self._coupling.scale)
        self._master.align()
        self._slave.align()
        self._energy.reset()
        if self._oscillation:
            self._oscillation.reset(self._admittance.position)
        now = measurement.time
        self.reports.reset(now, Report())
        still = MasterMotion(self._admittance.position)
        self.motions.reset(now, still)
        self._playout.reset(now, still)
        self._start = self._admittance.position
        self._started = self._force = self._dt = 0.0
        self.faults, self.values = (), NO_VALUES

    def step(self, force: float, measurement: Measurement, dt: float) -> Command:
        """Advance the link by one tick, and return the desired velocities of both drives [m/s]."""
        now = measurement.time
        reports, motions, admittance = self.reports, self.motions, self._admittance
        report = reports.exchange(now, self._slave.report(measurement, dt))
        master = self._master
        energy = self._energy.update(
            self._started, master.state.displayed, self._dt, master.reserve
        )
        start, share = admittance.position, 0.0
        if oscillation := self._oscillation:
            share = oscillation.update(self._force, start, self._dt)
        self._start = start
        newest = motions.exchange(now, master.step(force, report, dt))
        motion = self._playout.update(now, motions.sent, newest)
        slave = self._slave.velocity(motion, measurement, dt)
        displayed, model, tank = master.state
        self._started, self._force, self._dt = master.started, force, dt
        due = reports.due if reports.due < motions.due else motions.due
        silence = now - due
        if silence > self._max_silence or energy < -master.allowance or share > MOST_SHARE:
            self.faults = self._detected(now, silence, energy, share)
        k, k3, b, _ = model
        values = (
            displayed,
            k,
            k3,
            b,
            tank,
            energy,
            motion.energy,
            report.energy,
            now - reports.sent,
            now - self._playout.time,
        )
        self.values = new_tuple(LinkValues, values)
        return new_tuple(Command, (admittance.velocity, slave))

    def follow(self, verdict: Verdict, desired: Command, applied: Command, dt: float) -> None:
        """Move the virtual mass like the handle if the supervisor changed the master's velocity.

        If the supervisor changes only the velocity of the slave, the virtual mass is not changed.
        The hand feels this change only through the channel and the force-feedback law.
        """
        if verdict.command.master_velocity != desired.master_velocity:
            admittance, velocity = self._admittance, applied.master_velocity
            admittance.position, admittance.velocity = self._start + velocity * dt, velocity

    def _detected(
        self, now: float, silence: float, energy: float, share: float
    ) -> tuple[DetectedFault, ...]:
        """Return the faults of the link at this tick; an empty tuple if there is none.

        There are three possible faults: no packet has arrived for too long, the force feedback has
        given too much energy to the hand, or the loop sustains an oscillation of the hand.
        """
        faults = []
        if silence > (most := self._max_silence):
            source = f"silent for {silence * 1e3:.0f} ms, at most {most * 1e3:g} ms"
            faults.append(DetectedFault(Fault.CHANNEL_SILENT, source, silence, most, now - silence))
        if energy < -(allowed := self._master.allowance):
            source = (
                f"the displayed environment has given out {-energy * 1e3:.1f} mJ, at most "
                f"{allowed * 1e3:g} mJ"
            )
            faults.append(DetectedFault(Fault.PORT_ENERGY, source, energy, -allowed, now))
        if share > MOST_SHARE:
            source = (
                f"the loop sustains {share:.0%} of the motion of the hand, at more than "
                f"{SLOWEST:g} Hz, at most {MOST_SHARE:.0%}"
            )
            faults.append(DetectedFault(Fault.OSCILLATION, source, share, MOST_SHARE, now))
        return tuple(faults)
