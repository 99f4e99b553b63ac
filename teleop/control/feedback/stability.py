"""Stability of position-force feedback with a delay.

The hand holds the virtual mass m, which has the damping d. b_a is the effective damping of the arm;
it includes the effect of the lag of the arm, as explained below. k_a is the stiffness of the arm
plus the stiffness of the centring spring. The environment has the force k x + b v. The hand feels
this force multiplied by the gain alpha, after the delay tau. tau is the sum of the round trip of
the channel, the lag of the force channel and the lag of the loop. The characteristic equation is

    m s^2 + (d + b_a) s + k_a + alpha (k + b s) exp(-s tau) = 0                               (1)

For small s tau, exp(-s tau) is about 1 - s tau. The damping in (1) is then
d + b_a + alpha b - alpha k tau: the delay acts as a negative damping. The lag of a force channel
changes the estimate of b in the same way. The condition for a positive damping is

    d + b_a + alpha b > alpha k tau.                                                           (2)

For b = 0, condition (2) is sufficient for the stability of (1). If (1) had a solution s = j w on
the imaginary axis, the imaginary part of (1) would give
(d + b_a) w = alpha k sin(w tau) <= alpha k w tau. This contradicts (2).

The force of the arm reaches the virtual mass with a lag tau_h. This lag is caused by the servo of
the handle, the force channel of the handle and the loop. k_arm is the stiffness of the arm without
the centring spring. To first order in s tau_h, the lag subtracts k_arm tau_h from the damping of
the arm. In (1) to (3), b_a is therefore the damping of the arm minus k_arm tau_h. The centring
spring is a part of the admittance, and its force has no lag.

Condition (2) is useful only if the arm is known. With b = 0, the virtual mass is stable with any
passive hand if its damping and the delayed environment together are passive:

    Re{d + alpha k exp(-j w tau) / (j w)} = d - alpha k sin(w tau) / w >= 0    for all w

This is equivalent to d >= alpha k tau, which is the limit of condition (2) for `arm_stiffness` = 0
and `arm_damping` = 0.

The exact largest delay follows from the solutions s = j w on the imaginary axis. The equation

    (k_a - m w^2)^2 + (d + b_a)^2 w^2 = alpha^2 (k^2 + b^2 w^2)                                (3)

is quadratic in w^2, and the phase of (1) at each solution gives tau. Without delay, (1) is stable
if d + b_a + alpha b > 0. With increasing delay, (1) becomes unstable at the smallest tau of all
solutions. If there is no solution, for example if k_a > alpha k and the damping is large, (1) is
stable with any delay.

Sources: W. S. Kim, B. Hannaford, A. K. Bejczy, "Force-reflection and shared compliant control in
operating telemanipulators with time delay", IEEE Trans. Robotics and Automation 8(2), 1992;
J. E. Marshall, H. Gorecki, A. Korytowski, K. Walton, "Time-Delay Systems: Stability and Performance
Criteria with Applications", 1992, for the solutions on the imaginary axis.
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
        """Sum d + b_a of the virtual damping and the effective damping of the arm [N s/m].

        The lag of the arm reduces its effective damping.
        """
        return self.damping + self.arm_damping - self.arm_stiffness * self.arm_lag

    @property
    def safe_delay(self) -> float:
        """Largest delay that satisfies condition (2) [s]; 0 if no delay satisfies it.

        If b = 0, the result is never larger than `largest_delay`.
        """
        return max(self.resistance + self.gain * self.b, 0.0) / (self.gain * self.k)

    @property
    def largest_delay(self) -> float:
        """Delay below which equation (1) is stable [s].

        The result is infinite if (1) is stable with any delay, and 0 if (1) is unstable without
        delay.
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
