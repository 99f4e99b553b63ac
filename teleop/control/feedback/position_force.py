"""Position-force feedback: the delayed contact force is subtracted from the force of the hand.

m v' + d v = f_h - alpha f_e(t - T). The law is transparent in steady contact, but the delay of the
force acts as a negative damping of about -alpha k T (`stability`).
"""

from __future__ import annotations

from teleop.control.feedback.energy_tank import TANK_MAX
from teleop.control.feedback.law import Master, Report


class PositionForceMaster(Master):
    """Master half of position-force feedback."""

    allowance = TANK_MAX
    """The law is not passive: it may generate some energy before it counts as unstable [J]."""

    def display(self, report: Report, dt: float) -> float:
        """Return alpha f_e, with the newest contact force that has arrived [N]."""
        return self.gain * report.force
