"""Position-force feedback: the delayed contact force is subtracted from the force of the hand.

The law is m v' + d v = f_h - alpha f_e(t - T), with the force of the hand f_h, the contact force
f_e and the delay T. In steady contact, the hand feels the correct force. During motion, the delay
of the force acts as a damping of about -alpha k T, which is negative. k is the stiffness of the
environment. See `stability`.
"""

from __future__ import annotations

from teleop.control.feedback.energy_tank import TANK_MAX
from teleop.control.feedback.law import Master, Report


class PositionForceMaster(Master):
    """Master half of position-force feedback."""

    allowance = TANK_MAX
    """Energy [J] that the displayed environment may generate before the drives are stopped. It is
    larger than for a passive law, because this law is not passive."""

    def display(self, report: Report, dt: float) -> float:
        """Return alpha f_e [N], where f_e is the newest contact force that has arrived."""
        return self.gain * report.force
