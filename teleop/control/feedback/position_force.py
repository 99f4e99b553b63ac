"""Position-force feedback: the delayed contact force is subtracted from the force of the hand.

The law is m v' + d v = f_h - alpha f_e(t - T), with the force of the hand f_h, the contact force
f_e and the delay T. It is transparent in steady contact, but the delay of the force acts as a
negative damping of about -alpha k T, where k is the stiffness of the environment (`stability`).
"""

from __future__ import annotations

from teleop.control.feedback.energy_tank import TANK_MAX
from teleop.control.feedback.law import Master, Report


class PositionForceMaster(Master):
    """Master half of position-force feedback."""

    allowance = TANK_MAX
    """Energy that the handle may give to the hand before the drives are stopped [J]. It is not
    zero, because the law is not passive."""

    def display(self, report: Report, dt: float) -> float:
        """Return alpha f_e, with the newest contact force that has arrived [N]."""
        return self.gain * report.force
