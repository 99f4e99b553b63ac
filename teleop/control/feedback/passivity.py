"""Position-force feedback with a time-domain passivity observer and controller.

The channel has a port at the master and a port at the slave. The power into the channel and the
power out of the channel are integrated separately at each port. E_in is the energy that has entered
the channel at a port. E_out is the energy that has left the channel at the same port. Each side
sends its E_in to the other side. T is the delay of the channel. The channel generates no energy if
two conditions are true:

    E_out at the master (t) <= E_in at the slave (t - T)
    E_out at the slave (t) <= E_in at the master (t - T)

In these conditions, the energies at the slave are multiplied by the force gain divided by the
motion scale. If a condition is violated, a passivity controller dissipates the difference between
the two sides of the condition. The controller at the master adds a damping force, which is
proportional to the velocity. The controller at the slave adds a velocity, which is proportional to
the contact force.

In this file, the ports are at the hand and at the environment. Therefore E_in and E_out contain the
energy that the passivity controllers dissipate. In the paper of Ryu et al., the ports are at the
communication network, and the energy of the controllers is added separately. Both methods are
valid.

The damping at the master is limited to `MOST_DAMPING`. At a speed below |f| / MOST_DAMPING, which
is 5 mm/s for a force f of 10 N, the damping cannot dissipate the power |f v| that leaves the port.
E_out is then too large, by up to about 30 mJ in simulated trials. With a limit of 1e5 N s/m, this
error was smaller, but some simulated trials were unstable.

The hand feels a stiffness that is too low. The main cause is the passivity controller at the slave.
It reduces the velocity of the slave, so that the difference between the positions of master and
slave increases. This is a known property of the method.

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
"""Largest damping of the passivity controller at the master [N s/m]. This damping is part of the
admittance. The discretisation of the admittance is exact, so that it stays stable with large
damping."""
MOST_ADMITTANCE = 5e-3
"""Largest ratio of velocity to force of the passivity controller at the slave [m/(s N)]. The
controller may always use the velocity that stops the slave, even if this ratio is then larger."""
LEAST_SPEED = 1e-5
"""Speed below which the passivity controller at the master does not act [m/s]."""
LEAST_FORCE = 0.05
"""Contact force below which the passivity controller at the slave does not act [N]."""


class PassivityMaster(Master):
    """Master half: adds damping if too much energy leaves the channel at the hand's port."""

    allowance = TANK_MAX
    """Energy [J] that the displayed environment may generate before the drives are stopped. It is
    larger than for a passive law, because the damping at the master is limited."""

    def __init__(self, admittance: Admittance, scale: float = 1.0, gain: float = 1.0) -> None:
        super().__init__(admittance, scale, gain)
        self.align()

    def align(self) -> None:
        """Set all energies to zero; called each time the drives are armed."""
        super().align()
        self._in = self._out = 0.0

    def step(self, force: float, report: Report, dt: float) -> Motion:
        """Advance the virtual mass by dt [s], with the damping of the passivity controller."""
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
    """Slave half: reduces the velocity if the slave would give too much energy to the environment.

    Parameters
    ----------
    coupling
        Maps the motion of the master to the motion of the slave.
    stiffness
        Expected slope of the contact force [N/m].
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
        """Set all energies to zero; called each time the drives are armed."""
        self._in = self._out = self._velocity = 0.0

    def report(self, measurement: Measurement, dt: float) -> Report:
        """Return the packet: contact force, and energy from the environment since arming."""
        work = measurement.contact_force * self._velocity * dt
        if work > 0.0:
            self._out += work
        else:
            self._in -= work
        return new_tuple(Report, (measurement.contact_force, PRIOR, self._in))

    def velocity(self, motion: Motion, measurement: Measurement, dt: float) -> float:
        """Return the desired velocity [m/s], reduced so that the channel generates no energy."""
        wanted, f = super().velocity(motion, measurement, dt), measurement.contact_force
        excess = self._out + max(f * wanted, 0.0) * dt - self._share * motion.energy
        if excess > 0.0 and abs(f) > LEAST_FORCE:
            most = max(abs(wanted), MOST_ADMITTANCE * abs(f))
            wanted -= math.copysign(min(excess / (abs(f) * dt), most), f)
        self._velocity = wanted
        return wanted
