"""Position-force feedback with a time-domain passivity observer and controller.

The hand feels the delayed contact force. The communication channel between master and slave has one
port at the master and one port at the slave. The delay of the channel can generate energy. A
passivity observer measures this energy, and passivity controllers dissipate it.

At each port, E_in is the energy that has entered the channel since the drives were armed: the
integral of the power into the channel. E_out is the energy that has left the channel: the integral
of the power out of the channel. Each side sends its E_in to the other side. T is the delay of the
channel. The channel generates no energy if two conditions are true:

    E_out at the master (t) <= E_in at the slave (t - T)
    E_out at the slave (t) <= E_in at the master (t - T)

In these conditions, the energies at the slave are multiplied by the force gain divided by the
motion scale. If a condition is violated, a passivity controller dissipates the excess energy, which
is the left side minus the right side of the condition. The controller at the master adds a damping
force, which is proportional to the velocity. The controller at the slave adds a velocity, which is
proportional to the contact force.

In this file, the ports are at the hand and at the environment. Therefore E_in and E_out contain the
energy that the passivity controllers dissipate. In the paper of Ryu et al., the ports are at the
communication network, and the energy of the controllers is added separately. Both methods are
valid.

The damping that the controller adds at the master is limited to `MOST_DAMPING`. With the displayed
force f and the velocity v of the master, the power |f v| leaves the port. If |v| is below
|f| / MOST_DAMPING, the damping cannot dissipate this power. E_out is then too large, by up to about
30 mJ in simulated trials. With a limit of 1e5 N s/m, this error was smaller, but some simulated
trials were unstable.

With this law, the hand feels a stiffness that is too low. The main cause is the passivity
controller at the slave. It reduces the velocity of the slave, so that the difference between the
positions of master and slave increases. This is a known property of the method.

Source: J.-H. Ryu, J. Artigas, C. Preusche, "A passive bilateral control scheme for a teleoperator
with time-varying communication delay", Mechatronics 20(7), 2010.
"""

from __future__ import annotations

import math

from drivers import Measurement, new_tuple
from teleop.control.admittance import Admittance, Environment
from teleop.control.coupling import Coupling
from teleop.control.feedback.energy_tank import TANK_MAX
from teleop.control.feedback.law import (
    NO_BODY,
    PRIOR,
    STIFF_PRIOR,
    Master,
    MasterState,
    Motion,
    Report,
    Slave,
)

MOST_DAMPING = 2000.0
"""Largest damping that the passivity controller adds at the master [N s/m]. The admittance contains
this damping. It stays stable with a large damping, because its discretisation is exact."""
MOST_ADMITTANCE = 5e-3
"""Largest ratio of added velocity to contact force of the passivity controller at the slave
[m/(s N)]. The controller may always stop the slave, even if the ratio is then larger."""
LEAST_SPEED = 1e-5
"""Speed below which the passivity controller at the master does not act [m/s]."""
LEAST_FORCE = 0.05
"""Contact force below which the passivity controller at the slave does not act [N]."""


class PassivityMaster(Master):
    """Master half of the law `passivity`, with the passivity controller at the master.

    If more energy leaves the communication channel at the hand than has entered the channel at the
    slave, the controller adds damping to the virtual mass.
    """

    allowance = TANK_MAX
    """Energy [J] that the displayed environment may generate before the drives are stopped. It is
    larger than for a passive law, because the damping of the controller is limited."""

    def __init__(self, admittance: Admittance, scale: float = 1.0, gain: float = 1.0) -> None:
        super().__init__(admittance, scale, gain)
        self.align()

    def align(self) -> None:
        """Set all energies to zero. This is done each time the drives are armed."""
        super().align()
        self._in = self._out = 0.0

    def step(self, force: float, report: Report, dt: float) -> Motion:
        """Move the virtual mass, with the damping of the passivity controller.

        Parameters
        ----------
        force
            Force of the hand [N].
        report
            Newest packet that has arrived from the slave half.
        dt
            Duration for which the force acts: the time since the previous tick [s].

        Returns
        -------
        motion
            Packet for the slave half, with the motion of the virtual mass and the energy from the
            hand.
        """
        admittance = self.admittance
        displayed, v, d = self.gain * report.force, admittance.velocity, 0.0
        excess = self._out - min(displayed * v, 0.0) * dt - self.gain / self.scale * report.energy
        if excess > 0.0 and abs(v) > LEAST_SPEED:
            d = min(excess / (v * v * dt), MOST_DAMPING)
        before = admittance.position
        body = new_tuple(Environment, (0.0, 0.0, d, True))
        end = admittance.step_against(force - displayed, body, dt)
        work = displayed * (admittance.position - before)
        work += d * (v * v + v * end + end * end) / 3.0 * dt
        if work > 0.0:
            self._in += work
        else:
            self._out -= work
        self.started = displayed + d * v
        self.state = new_tuple(MasterState, (displayed + d * end, NO_BODY, math.nan))
        return new_tuple(Motion, (admittance.position, admittance.velocity, self._in))


class PassivitySlave(Slave):
    """Slave half of the law `passivity`, with the passivity controller at the slave.

    If the slave would give more energy to the environment than the hand has given to the
    communication channel, the controller reduces the velocity of the slave.

    Parameters
    ----------
    coupling
        Computes the desired velocity of the slave from the motion of the virtual mass.
    stiffness
        Expected slope of the contact force over the position of the slave [N/m].
    gain
        Ratio alpha of the displayed force to the contact force.
    """

    def __init__(
        self, coupling: Coupling, stiffness: float = STIFF_PRIOR, gain: float = 1.0
    ) -> None:
        super().__init__(coupling, stiffness)
        self._share = coupling.scale / gain if gain else 0.0
        self.align()

    def align(self) -> None:
        """Set all energies to zero. This is done each time the drives are armed."""
        self._in = self._out = self._velocity = 0.0

    def report(self, measurement: Measurement, dt: float) -> Report:
        """Return the packet for the master half: contact force and energy from the environment.

        The energy is the energy that the environment has given to the slave since the drives were
        armed.

        Parameters
        ----------
        measurement
            Measurement of this tick.
        dt
            Time since the previous tick [s].
        """
        work = measurement.contact_force * self._velocity * dt
        if work > 0.0:
            self._out += work
        else:
            self._in -= work
        return new_tuple(Report, (measurement.contact_force, PRIOR, self._in))

    def velocity(self, motion: Motion, measurement: Measurement, dt: float) -> float:
        """Return the desired velocity of the slave [m/s], so that the channel generates no energy.

        Parameters
        ----------
        motion
            Newest packet that has arrived from the master half.
        measurement
            Measurement of this tick.
        dt
            Time since the previous tick [s].
        """
        wanted, f = super().velocity(motion, measurement, dt), measurement.contact_force
        excess = self._out + max(f * wanted, 0.0) * dt - self._share * motion.energy
        if excess > 0.0 and abs(f) > LEAST_FORCE:
            most = max(abs(wanted), MOST_ADMITTANCE * abs(f))
            wanted -= math.copysign(min(excess / (abs(f) * dt), most), f)
        self._velocity = wanted
        return wanted
