"""Observe during a trial whether the displayed environment generates energy.

The displayed environment is the environment that the hand feels, with the force f_d. The hand also
feels the virtual mass m and its damping d. The displayed dynamics consist of the displayed
environment, the virtual mass and its damping. With the velocity v of the virtual mass, the energy
that the hand gives to the displayed dynamics is

    E = integral of (f_d + d v) v dt + 1/2 m v^2

If the supervisor does not limit the velocity of the master, E is the integral of f_h v dt, where
f_h is the force of the hand. A limit acts like an additional force, and its work is also included
in E. The observer therefore also detects an oscillation that reaches the limits.

If the displayed dynamics are passive, the hand can only take back the stored energy, and E never
decreases by more than this energy. The damping d dissipates energy during motion. After some
seconds, E is therefore much larger than the stored energy. If the displayed environment then starts
to generate energy, it takes long until E is negative. Therefore E is limited at each tick to an
upper bound of the stored energy:

    E <- min(E + dE, 1/2 m max v^2 + max |f_d| max |x| + tank)

dE is the change of E during one tick, and x is the position of the virtual mass. Each maximum is
the largest value since the drives were armed. The term `tank` is the energy in the energy tank of
the force-feedback law (see `energy_tank`). It is part of the bound because a change of the model
may give this energy to the hand.

If the displayed dynamics are passive, the limited E is never smaller than the stored energy, and
therefore never negative. A negative E means that the displayed dynamics have generated energy.

E is computed only from the motion of the virtual mass and the displayed force. The observer
therefore detects energy from the displayed environment, for example from a delayed force. It does
not detect energy that is generated between the virtual mass and the hand, for example by the servo
of the handle or by the force sensor of the handle.

Source of the observer: J.-H. Ryu, D.-S. Kwon, B. Hannaford, "Stable teleoperation with time-domain
passivity control", IEEE Trans. Robotics and Automation 20(2), 2004.
"""

from __future__ import annotations

from teleop.control.admittance import Admittance


class PortEnergy:
    """Observes the energy that the hand gives to the virtual mass and to the displayed environment.

    The displayed environment is the environment that the hand feels. A negative energy means that
    the displayed environment has generated energy.

    Parameters
    ----------
    admittance
        Virtual mass, whose velocity is the desired velocity of the master.
    """

    def __init__(self, admittance: Admittance) -> None:
        self._admittance = admittance
        self._half_mass = 0.5 * admittance.parameters.mass
        self._damping = admittance.parameters.damping
        self.reset()

    def reset(self) -> None:
        """Set the energy to zero, and discard the largest values of velocity, force and position.

        The next motion starts at the present position of the virtual mass.
        """
        self.energy = 0.0
        """Energy from the hand, limited to an upper bound of the stored energy [J]."""
        self._position, self._velocity = self._admittance.position, self._admittance.velocity
        self._displayed = self._force = self._reach = self._square = 0.0

    def update(self, start: float, end: float, dt: float, tank: float = 0.0) -> float:
        """Add the energy of the last motion, and return the energy from the hand [J].

        The motion is that of the virtual mass since the last call of this method. The result is
        limited to an upper bound of the stored energy (see the module docstring).

        `start` and `end` are the displayed forces at the start and at the end of the motion [N].
        """
        x, v = self._admittance.position, self._admittance.velocity
        half_mass = self._half_mass
        last_x, last_v = self._position, self._velocity
        self._position, self._velocity = x, v
        square, reach, force = v * v, abs(x), abs(end)
        if square > self._square:
            self._square = square
        if reach > self._reach:
            self._reach = reach
        if force > self._force:
            self._force = force
        energy = self.energy + 0.5 * (start + end) * (x - last_x)
        energy += self._damping * (square + v * last_v + last_v * last_v) / 3.0 * dt
        energy += half_mass * (square - last_v * last_v)
        most = half_mass * self._square + self._force * self._reach + tank
        self.energy = energy if energy < most else most
        return self.energy
