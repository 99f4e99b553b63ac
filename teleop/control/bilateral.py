"""Link between master and slave with a communication channel and a force-feedback law.

The master side and the slave side (`sides.py`) exchange data only through a simulated channel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from drivers import Command, Measurement, new_tuple
from teleop.control.channel import ChannelSettings, Direction
from teleop.control.feedback.law import MasterMotion, Report
from teleop.control.link import Link
from teleop.control.sides import MasterSide, SlaveSide, silence_fault
from teleop.safety import Verdict


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
    """Master side and slave side in one process, with a simulated channel between them.

    The delays and losses of the channel depend only on its settings and on `seed`.
    """

    def __init__(
        self, master: MasterSide, slave: SlaveSide, channel: ChannelSettings, seed: int = 0
    ) -> None:
        self._master, self._slave = master, slave
        self._max_silence = channel.max_silence
        self.reports = Direction(channel, f"reports {seed}", Report())
        self.motions = Direction(channel, f"motions {seed}", MasterMotion(0.0))
        self.values = NO_VALUES
        self.observe = self._slave.observe  # type: ignore[method-assign]
        self.stiffness = self._slave.stiffness  # type: ignore[method-assign]

    def align(self, measurement: Measurement) -> None:
        """Put the virtual mass at rest, and reset the force-feedback law and the channel.

        The virtual mass is put at the position that corresponds to that of the slave's tip. This
        method is called each time the drives are armed.
        """
        now = measurement.time
        still = self._master.align(self._slave.align(measurement))
        self.reports.reset(now, Report())
        self.motions.reset(now, still)
        self.faults, self.values = (), NO_VALUES

    def step(self, force: float, measurement: Measurement, dt: float) -> Command:
        """Advance the link by one tick, and return the desired velocities of both drives [m/s]."""
        now = measurement.time
        reports, motions, master, slave = self.reports, self.motions, self._master, self._slave
        report = reports.exchange(now, slave.report(measurement, dt))
        newest = motions.exchange(now, master.step(force, report, dt))
        velocity, motion = slave.step(motions.sent, newest, measurement, dt)
        due = reports.due if reports.due < motions.due else motions.due
        silence = now - due
        if silence > self._max_silence or master.has_fault:
            faults = master.faults(now)
            if silence > self._max_silence:
                faults.insert(0, silence_fault(now, silence, self._max_silence))
            self.faults = tuple(faults)
        values = (
            *master.values,
            motion.energy,
            report.energy,
            now - reports.sent,
            now - slave.playout.time,
        )
        self.values = new_tuple(LinkValues, values)
        return new_tuple(Command, (master.admittance.velocity, velocity))

    def follow(self, verdict: Verdict, desired: Command, applied: Command, dt: float) -> None:
        """Move the virtual mass like the handle if the supervisor changed the master's velocity."""
        self._master.follow(verdict, desired, applied, dt)
