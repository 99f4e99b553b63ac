"""Stability of position-force feedback with a delay.

The arm of the operator, with stiffness k_a and damping b_a, holds the virtual mass m with damping
d. The force of the environment, k x + b v, is multiplied by the gain alpha and acts at the master
after the delay tau. This delay is the round trip of the channel plus the lag of force channel and
loop. The characteristic equation is

    m s^2 + (d + b_a) s + k_a + alpha (k + b s) exp(-s tau) = 0                               (1)

For small s tau, exp(-s tau) is about 1 - s tau, and the damping in (1) is d + b_a + alpha b - alpha
k tau. The delay acts as a negative damping. The lag of a force channel changes the estimate of b in
the same way. So a condition for a positive damping is

    d + b_a + alpha b > alpha k tau.                                                           (2)

If (2) holds, the displayed environment also takes energy from the hand in every slow motion. This
is necessary because the reaction of the hand is not known. Therefore (2) is the condition for
enabling the law. With b = 0, condition (2) is sufficient for the stability of (1): at a crossing of
the imaginary axis, s = j w, the imaginary part of (1) is (d + b_a) w = alpha k sin(w tau) <= alpha
k w tau.

The exact largest delay follows from the crossings of the imaginary axis, s = j w. The equation

    (k_a - m w^2)^2 + (d + b_a)^2 w^2 = alpha^2 (k^2 + b^2 w^2)                                (3)

is quadratic in w^2, and the phase of (1) at each solution gives tau. Without delay, all
coefficients of (1) are positive and (1) is stable. With increasing delay, (1) becomes unstable at
the smallest tau of all crossings. If there is no crossing, for example if k_a > alpha k and the
damping is large, (1) is stable with any delay.

Sources: W. S. Kim, B. Hannaford, A. K. Bejczy, "Force-reflection and shared compliant control in
operating telemanipulators with time delay", IEEE Trans. Robotics and Automation 8(2), 1992;
J. E. Marshall, H. Gorecki, A. Korytowski, K. Walton, "Time-Delay Systems: Stability and Performance
Criteria with Applications", 1992, for the crossings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class DelayedLoop:
    """Parameters of equation (1), the loop of position-force feedback."""

    mass: float
    """Virtual mass m [kg]."""
    damping: float
    """Virtual damping d [N s/m]."""
    arm_stiffness: float
    """Stiffness k_a of the arm [N/m]."""
    arm_damping: float
    """Damping b_a of the arm [N s/m]."""
    k: float
    """Stiffness of the environment [N/m]."""
    b: float = 0.0
    """Damping of the environment [N s/m]."""
    gain: float = 1.0
    """Ratio alpha of the displayed force to the contact force."""

    @property
    def safe_delay(self) -> float:
        """Largest delay that condition (2) permits [s]; if b = 0, at most `largest_delay`."""
        resistance = self.damping + self.arm_damping + self.gain * self.b
        return resistance / (self.gain * self.k)

    @property
    def largest_delay(self) -> float:
        """Largest delay at which (1) is stable [s]; infinite if it is stable with any delay."""
        resistance, k, b = self.damping + self.arm_damping, self.gain * self.k, self.gain * self.b
        half = 0.5 * (resistance**2 - 2.0 * self.mass * self.arm_stiffness - b * b)
        constant = self.arm_stiffness**2 - k * k
        discriminant = half * half - self.mass**2 * constant
        if discriminant < 0.0:
            return math.inf
        delays = []
        for sign in (1.0, -1.0):
            square = (-half + sign * math.sqrt(discriminant)) / self.mass**2
            if square > 0.0:
                w = math.sqrt(square)
                free = math.atan2(-resistance * w, self.mass * square - self.arm_stiffness)
                phase = math.atan2(b * w, k) - free
                delays.append(phase % (2.0 * math.pi) / w)
        return min(delays, default=math.inf)
