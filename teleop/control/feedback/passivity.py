"""Position-force feedback with a time-domain passivity observer and controller.

The power at each port of the channel, integrated by its sign, gives the energy that has entered the
channel and the energy that has left it. Each side sends the energy that has entered at its port.
The energy that has left at a port must not exceed the received value of the energy that has entered
at the other port:

    E_out at the master(t) <= E_in at the slave(t - T),    E_out at the slave <= E_in at the master

If this condition is violated, the passivity controller dissipates the difference: at the master by
a damping force proportional to the velocity, at the slave by a velocity proportional to the contact
force.

The energies are those of the outer ports, at the hand and at the environment: they contain what the
controllers dissipate. Ryu et al. observe the port of the network and add the energy of the
controller separately. Both are valid.

The damping at the master is limited to `MOST_DAMPING`. At a speed below |f| / MOST_DAMPING, which
is 5 mm/s with a force f of 10 N, it cannot dissipate the power |f v| that leaves the port. The law
then exceeds its balance by some 10 mJ. A limit of 1e5 N s/m makes this smaller, but not all trials
with it were stable. The felt stiffness is too low mainly because the slave yields, so that the
positions of master and slave drift apart, as is known of this method.

Source: J.-H. Ryu, J. Artigas, C. Preusche, "A passive bilateral control scheme for a teleoperator
with time-varying communication delay", Mechatronics 20(7), 2010.
"""

from __future__ import annotations

import math

from drivers import Measurement
from teleop.control.admittance import Admittance, Environment
from teleop.control.coupling import Coupling
from teleop.control.feedback.energy_tank import TANK_MAX
from teleop.control.feedback.law import (
    STIFF_PRIOR,
    Master,
    MasterState,
    Motion,
    Report,
    Slave,
)

MOST_DAMPING = 2000.0
"""Greatest damping of the passivity controller at the master [N s/m]. This damping is part of the
admittance. The discretisation of the admittance is exact, so that large damping does not make the
loop unstable."""
MOST_ADMITTANCE = 5e-3
"""Greatest ratio of velocity to force of the passivity controller at the slave [m/(s N)]. This is
enough to stop the slave in every case."""
LEAST_SPEED = 1e-5
"""Speed below which the passivity controller at the master does not act [m/s]."""
LEAST_FORCE = 0.05
"""Contact force below which the passivity controller at the slave does not act [N]."""


class PassivityMaster(Master):
    """Master half: observes the energy at the hand's port, and adds damping if it is too large."""

    allowance = TANK_MAX
    """The damping at the master is limited, so the law may generate some energy [J]."""

    def __init__(self, admittance: Admittance, scale: float = 1.0, gain: float = 1.0) -> None:
        super().__init__(admittance, scale, gain)
        self.align()

    def align(self) -> None:
        """Set all energies to zero; called each time the drives are armed."""
        super().align()
        self._in = self._out = 0.0

    def step(self, force: float, report: Report, dt: float) -> Motion:
        """Advance the virtual mass under the forces of hand and environment, with damping."""
        admittance = self.admittance
        displayed, v, d = self.gain * report.force, admittance.velocity, 0.0
        excess = self._out - min(displayed * v, 0.0) * dt - self.gain / self.scale * report.energy
        if excess > 0.0 and abs(v) > LEAST_SPEED:
            d = min(excess / (v * v * dt), MOST_DAMPING)
        before = admittance.position
        end = admittance.step_against(force - displayed, Environment(0.0, 0.0, d), dt)
        work = displayed * (admittance.position - before)
        work += d * (v * v + v * end + end * end) / 3.0 * dt
        if work > 0.0:
            self._in += work
        else:
            self._out -= work
        self.started = displayed + d * v
        self.state = MasterState(displayed + d * end)
        return Motion(admittance.position, admittance.velocity, self._in)


class PassivitySlave(Slave):
    """Slave half: observes the energy at the environment's port, and reduces the velocity.

    Parameters
    ----------
    coupling
        Maps the motion of the master to that of the slave.
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
        """Return the contact force, and the energy that the environment has given so far."""
        work = measurement.contact_force * self._velocity * dt
        if work > 0.0:
            self._out += work
        else:
            self._in -= work
        return Report(measurement.contact_force, energy=self._in)

    def velocity(self, motion: Motion, measurement: Measurement, dt: float) -> float:
        """Return the desired velocity [m/s], reduced so that no energy is generated."""
        wanted, f = super().velocity(motion, measurement, dt), measurement.contact_force
        excess = self._out + max(f * wanted, 0.0) * dt - self._share * motion.energy
        if excess > 0.0 and abs(f) > LEAST_FORCE:
            most = max(abs(wanted), MOST_ADMITTANCE * abs(f))
            wanted -= math.copysign(min(excess / (abs(f) * dt), most), f)
        self._velocity = wanted
        return wanted
