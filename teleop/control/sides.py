"""The two sides of a telemanipulator, which exchange data only through a channel.

The master side moves the virtual mass, displays the force to the hand, and observes the energy and
the oscillation at the handle. The slave side moves the slave after the received motion, and reports
the contact force and the local model of the environment. The sides share no variable: in one
process, a simulated channel connects them (`bilateral.py`), and on two computers, a network
(`teleop.station`).
"""

from __future__ import annotations

from typing import NamedTuple

from drivers import Command, Measurement, new_tuple
from teleop.control.admittance import Admittance
from teleop.control.feedback.law import MasterHalf, MasterMotion, Report, SlaveHalf
from teleop.control.feedback.oscillation import MOST_SHARE, SLOWEST, Oscillation
from teleop.control.feedback.port_energy import PortEnergy
from teleop.control.playout import Playout
from teleop.safety import Fault, Verdict
from teleop.safety.channels import DetectedFault


class MasterValues(NamedTuple):
    """Values that the master side records at one tick."""

    displayed_force: float
    model_stiffness: float
    model_stiffening: float
    model_damping: float
    tank: float
    port_energy: float


class MasterSide:
    """Virtual mass, master half of the law, and the observers of energy and oscillation.

    `scale` is the ratio of slave motion to master motion. `closed` states whether the law displays
    a force to the hand: only then can the loop through the hand oscillate, which is observed.
    """

    def __init__(
        self, admittance: Admittance, scale: float, law: MasterHalf, closed: bool = True
    ) -> None:
        self.admittance = admittance
        self.law = law
        self._scale = scale
        self._energy = PortEnergy(admittance)
        self._oscillation = Oscillation() if closed else None
        self._stored = self._share = 0.0

    def align(self, tip: float) -> MasterMotion:
        """Put the virtual mass at rest where the tip of the slave is; return its motion.

        `tip` is the position of the tip [m].
        """
        admittance = self.admittance
        admittance.align(tip / self._scale)
        self.law.align()
        self._energy.reset()
        if self._oscillation:
            self._oscillation.reset(admittance.position)
        self._start = admittance.position
        self._started = self._force = self._dt = 0.0
        self._stored = self._share = 0.0
        return MasterMotion(admittance.position)

    def step(self, force: float, report: Report, dt: float) -> MasterMotion:
        """Move the virtual mass for one tick under the force of the hand [N]."""
        law, admittance = self.law, self.admittance
        self._stored = self._energy.update(
            self._started, law.state.displayed, self._dt, law.reserve
        )
        start, share = admittance.position, 0.0
        if oscillation := self._oscillation:
            share = oscillation.update(self._force, start, self._dt)
        self._start, self._share = start, share
        motion = law.step(force, report, dt)
        self._started, self._force, self._dt = law.started, force, dt
        return motion

    def fade(self, force: float, displayed: float, dt: float) -> MasterMotion:
        """Move the virtual mass for one tick against a force that replaces the environment [N].

        It is used after the connection to the slave was lost: no stiffness is displayed any more.
        """
        law, admittance = self.law, self.admittance
        self._start = admittance.position
        admittance.step(force - displayed, dt)
        law.state = law.state._replace(displayed=displayed)
        return MasterMotion(admittance.position, admittance.velocity)

    def follow(self, verdict: Verdict, desired: Command, applied: Command, dt: float) -> None:
        """Move the virtual mass like the handle if the supervisor changed the master's velocity.

        If the supervisor changes only the velocity of the slave, the virtual mass is not changed.
        The hand feels this change only through the channel and the force-feedback law.
        """
        if verdict.command.master_velocity != desired.master_velocity:
            admittance, velocity = self.admittance, applied.master_velocity
            admittance.position, admittance.velocity = self._start + velocity * dt, velocity

    @property
    def values(self) -> MasterValues:
        """Recorded values of the last tick."""
        displayed, (k, k3, b, _), tank = self.law.state
        return new_tuple(MasterValues, (displayed, k, k3, b, tank, self._stored))

    @property
    def has_fault(self) -> bool:
        """Whether `faults` finds a fault."""
        return self._stored < -self.law.allowance or self._share > MOST_SHARE

    def faults(self, now: float) -> list[DetectedFault]:
        """Return the faults at the handle in the tick at the time `now` [s].

        The force feedback has given too much energy to the hand, or the loop sustains an
        oscillation of the hand.
        """
        faults = []
        energy, share = self._stored, self._share
        if energy < -(allowed := self.law.allowance):
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
        return faults


class SlaveSide:
    """Slave half of the law, and the playout of the received motion.

    `scale` is the ratio of slave motion to master motion, and `longest` the largest expected delay
    of the channel [s].
    """

    def __init__(self, scale: float, law: SlaveHalf, longest: float) -> None:
        self.law = law
        self._scale = scale
        self.playout = Playout(longest)
        self.still = MasterMotion(0.0)
        """Motion of a master that rests where the slave was when the drives were armed."""
        # The controller calls both methods at each tick. The methods of the law are called
        # directly, because a method of this class that calls them would add 0.3 us.
        self.observe = law.observe
        self.stiffness = law.stiffness
        self.report = law.report

    def align(self, measurement: Measurement) -> float:
        """Wait for the motion of the master where the slave is; return the position of the tip.

        This method is called each time the drives are armed.
        """
        tip = self.law.tip(measurement)
        self.law.align()
        self.still = MasterMotion(tip / self._scale)
        self.playout.reset(measurement.time, self.still)
        return tip

    def step(
        self, sent: float, newest: MasterMotion, measurement: Measurement, dt: float
    ) -> tuple[float, MasterMotion]:
        """Return the desired velocity of the slave [m/s], and the motion that it follows.

        `newest` is the newest motion that has arrived. The master sent it at the time `sent` [s].
        """
        motion = self.playout.update(measurement.time, sent, newest)
        return self.law.velocity(motion, measurement, dt), motion


def silence_fault(now: float, silence: float, most: float) -> DetectedFault:
    """Return the fault that no packet has arrived for `silence`, more than `most` [s]."""
    source = f"silent for {silence * 1e3:.0f} ms, at most {most * 1e3:g} ms"
    return DetectedFault(Fault.CHANNEL_SILENT, source, silence, most, now - silence)
