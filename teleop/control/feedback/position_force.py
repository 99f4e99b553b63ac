"""Position-force feedback: the delayed contact force is subtracted from the force of the hand.

The law is m v' + d v = f_h - alpha f_e(t - T). m, d and v are mass, damping and velocity of the
virtual mass. f_h is the force of the hand, f_e the contact force, T the delay, and alpha the force
gain. If the slave is at rest in contact, the hand feels the correct force alpha f_e. During motion,
the delay acts as an additional damping of about -alpha k T, which is negative. k is the stiffness
of the environment. See `stability`.
"""

from __future__ import annotations

from teleop.control.feedback.energy_tank import TANK_MAX
from teleop.control.feedback.law import MasterHalf, Report


class PositionForceMaster(MasterHalf):
    """Master half of position-force feedback: the hand feels the delayed contact force."""

    allowance = TANK_MAX
    """Energy [J] that the displayed environment may generate before the drives are stopped. It is
    larger than for a passive law, because this law is not passive."""

    displays_measured_force = True

    def display(self, report: Report, dt: float) -> float:
        """Return the displayed force alpha f_e [N]; f_e is the newest that has arrived."""
        return self.gain * report.force
