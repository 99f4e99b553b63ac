"""Stability of position-force feedback with a delay.

The hand holds the virtual mass with an arm of damping b_a. k_a is the stiffness of the arm and of
the centring spring of the virtual mass. The environment k x + b v is felt after the delay tau,
which is the round trip of the channel plus the lag of force channel and loop, and is multiplied by
the gain alpha:

    m s^2 + (d + b_a) s + k_a + alpha (k + b s) exp(-s tau) = 0                               (1)

For small s tau, exp(-s tau) is about 1 - s tau, and the damping in (1) is d + b_a + alpha b - alpha
k tau. The delay acts as a negative damping. The lag of a force channel changes the estimate of b in
the same way. So a condition for a positive damping is

    d + b_a + alpha b > alpha k tau.                                                           (2)

With b = 0 it is sufficient for the stability of (1): at a crossing s = j w, the imaginary part of
(1) is (d + b_a) w = alpha k sin(w tau) <= alpha k w tau.

The arm acts through the servo of the handle, its force channel and the loop, with a lag tau_h. To
first order in s tau_h, this subtracts k_arm tau_h from the damping of the arm, where k_arm is the
stiffness of the arm without the spring: b_a in (1) to (3) is the damping of the arm minus k_arm
tau_h. The spring is a part of the admittance, which has no lag.

(2) needs an arm that is known. The virtual mass is stable with any passive hand if its damping and
the delayed environment are passive together,

    Re{d + alpha k exp(-j w tau) / (j w)} = d - alpha k sin(w tau) / w >= 0    for all w,

which is d >= alpha k tau: condition (2) without b_a, `arm_stiffness` and `arm_damping` of 0.

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
    """Stiffness of the arm [N/m]."""
    arm_damping: float
    """Damping of the arm [N s/m]."""
    k: float
    """Stiffness of the environment [N/m]."""
    b: float = 0.0
    """Damping of the environment [N s/m]."""
    gain: float = 1.0
    """Ratio alpha of the displayed force to the contact force."""
    arm_lag: float = 0.0
    """Lag tau_h of the force of the arm [s]."""
    spring: float = 0.0
    """Stiffness of the centring spring of the virtual mass [N/m]."""

    @property
    def resistance(self) -> float:
        """Damping of virtual mass and arm, without that which the lag of the arm takes [N s/m]."""
        return self.damping + self.arm_damping - self.arm_stiffness * self.arm_lag

    @property
    def safe_delay(self) -> float:
        """Largest delay of condition (2) [s]; 0 if it is not satisfied with any delay.

        With b = 0 it is never above `largest_delay`.
        """
        return max(self.resistance + self.gain * self.b, 0.0) / (self.gain * self.k)

    @property
    def largest_delay(self) -> float:
        """Largest delay up to which (1) is stable for every smaller delay [s].

        It is infinite if (1) is stable with any delay, and 0 if it is unstable without delay.
        """
        resistance, k, b = self.resistance, self.gain * self.k, self.gain * self.b
        if resistance + b <= 0.0:
            return 0.0
        stiffness = self.arm_stiffness + self.spring
        half = 0.5 * (resistance**2 - 2.0 * self.mass * stiffness - b * b)
        constant = stiffness**2 - k * k
        discriminant = half * half - self.mass**2 * constant
        if discriminant < 0.0:
            return math.inf
        delays = []
        for sign in (1.0, -1.0):
            square = (-half + sign * math.sqrt(discriminant)) / self.mass**2
            if square > 0.0:
                w = math.sqrt(square)
                free = math.atan2(-resistance * w, self.mass * square - stiffness)
                phase = math.atan2(b * w, k) - free
                delays.append(phase % (2.0 * math.pi) / w)
        return min(delays, default=math.inf)
