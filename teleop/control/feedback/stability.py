"""Stability of position-force feedback with a delay.

The hand holds a virtual mass m, which has the damping d. The stiffness k_a is the stiffness of the
arm plus the stiffness of the centring spring, which pulls the virtual mass to a centre. b_a is the
effective damping of the arm. It includes the effect of the lag of the arm, as explained below. The
environment has the force k x + b v. Here x and v are position and velocity of the virtual mass, so
that k and b contain the motion scale. The hand feels this force multiplied by the gain alpha, after
the delay tau. tau is the sum of the round trip of the communication channel, the lag of the contact
force sensor and the lag of the control loop. The characteristic equation is

    m s^2 + (d + b_a) s + k_a + alpha (k + b s) exp(-s tau) = 0                               (1)

For small s tau, exp(-s tau) is about 1 - s tau. The coefficient of s in (1), which is the damping,
is then d + b_a + alpha b - alpha k tau. The delay therefore acts as a negative damping. The
condition for a positive damping is

    d + b_a + alpha b > alpha k tau.                                                           (2)

For b = 0, condition (2) is sufficient for the stability of (1). If (1) had a solution s = j w on
the imaginary axis, the imaginary part of (1) would give
(d + b_a) w = alpha k sin(w tau) <= alpha k w tau. This contradicts (2).

The force of the arm reaches the virtual mass with a lag tau_h. This lag is caused by the servo of
the handle, the force sensor of the handle and the control loop. k_arm is the stiffness of the arm
without the centring spring. To first order in s tau_h, the lag subtracts k_arm tau_h from the
damping of the arm. In (1) to (3), b_a is therefore the damping of the arm minus k_arm tau_h. The
force of the centring spring has no lag, because this spring is a part of the admittance.

Condition (2) can be used only if the arm is known. If it is not known, another condition is used.
With b = 0, the virtual mass is stable with any passive hand if its damping d and the delayed
environment together are passive:

    Re{d + alpha k exp(-j w tau) / (j w)} = d - alpha k sin(w tau) / w >= 0    for all w

This is equivalent to d >= alpha k tau, which is the limit of condition (2) for `arm_stiffness` = 0
and `arm_damping` = 0.

The exact largest delay follows from the solutions s = j w on the imaginary axis. Without delay, (1)
is stable if d + b_a + alpha b > 0. With increasing delay, (1) becomes unstable at the smallest tau
for which (1) has a solution s = j w. The magnitudes in (1) give the equation

    (k_a - m w^2)^2 + (d + b_a)^2 w^2 = alpha^2 (k^2 + b^2 w^2)                                (3)

which is quadratic in w^2. For each solution w, the phase of (1) gives tau. If (3) has no solution,
for example if k_a > alpha k and the damping is large, (1) is stable with any delay.

Lost motion of the slave's transmission delays the force as well. For a sine with the amplitude A at
the slave, a play of half width delta < A multiplies the force by its describing function N(A):

    Re N = 1/2 + (asin u + u sqrt(1 - u^2)) / pi,    Im N = -4 delta / (pi A) (1 - delta / A),

with u = 1 - 2 delta / A. Im N acts like a negative damping of about -4 k delta / (pi w A), without
any delay. The loop keeps an oscillation of the amplitude A if (1), with k + b s multiplied by N(A),
has a root without damping. The amplitude is proportional to delta, but whether there is such an
amplitude does not depend on delta.

The command of the slave compensates a known lost motion (`teleop.control.tip_position`). What is
left are a short delay of the tip at each reversal, and the error of the calibration. The describing
function of inverse and play together is computed from their response to a sine.

Sources: W. S. Kim, B. Hannaford, A. K. Bejczy, "Force-reflection and shared compliant control in
operating telemanipulators with time delay", IEEE Trans. Robotics and Automation 8(2), 1992;
J. E. Marshall, H. Gorecki, A. Korytowski, K. Walton, "Time-Delay Systems: Stability and Performance
Criteria with Applications", 1992, for the solutions on the imaginary axis; A. Gelb, W. E. Vander
Velde, "Multiple-Input Describing Functions and Nonlinear System Design", McGraw-Hill, 1968.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from estimation.filters import Play
from teleop.control.tip_position import SMOOTHING, TipPosition

RATIOS = np.geomspace(1.001, 300.0, 80)
"""Amplitudes for which oscillations are looked for, divided by the half width of the play."""
POINTS = 300
"""Number of points of a period at which the response to a sine is computed."""
FREQUENCIES = np.geomspace(2.0, 600.0, 1500)
"""Angular frequencies for which oscillations are looked for [rad/s]."""


class LimitCycle(NamedTuple):
    """Oscillation of the loop whose amplitude stays constant."""

    amplitude: float
    """Amplitude at the slave [m]."""
    frequency: float
    """Frequency [Hz]."""


Responses = tuple[tuple[float, complex], ...]
"""Describing function: amplitudes of a sine [m], in increasing order, and the response to each."""


@dataclass(frozen=True)
class DelayedLoop:
    """Loop of position-force feedback with a delay tau, whose stability is computed.

    The characteristic equation of the loop is

        m s^2 + (d + b_a) s + k_a + alpha (k + b s) exp(-s tau) = 0

    k_a is the stiffness of the arm plus that of the centring spring. b_a is the damping of the arm,
    reduced by the effect of its lag. The module docstring explains the equation.
    """

    mass: float
    """Virtual mass m that the hand holds [kg]."""
    damping: float
    """Damping d of the virtual mass [N s/m]."""
    arm_stiffness: float
    """Stiffness of the arm [N/m]."""
    arm_damping: float
    """Damping of the arm [N s/m]."""
    k: float
    """Stiffness of the environment times the ratio of slave motion to master motion [N/m]."""
    b: float = 0.0
    """Damping of the environment times the ratio of slave motion to master motion [N s/m]."""
    gain: float = 1.0
    """Ratio alpha of the displayed force to the contact force."""
    arm_lag: float = 0.0
    """Lag tau_h with which the force of the arm reaches the virtual mass [s]."""
    spring: float = 0.0
    """Stiffness of the centring spring, which pulls the virtual mass to a centre [N/m]."""

    @property
    def resistance(self) -> float:
        """Damping of the virtual mass plus the effective damping of the arm, d + b_a [N s/m].

        The effective damping of the arm is its damping minus its stiffness times `arm_lag`.
        """
        return self.damping + self.arm_damping - self.arm_stiffness * self.arm_lag

    @property
    def safe_delay(self) -> float:
        """Delay tau up to which the approximate damping of the loop is positive [s].

        The condition is d + b_a + alpha b > alpha k tau. The result is 0 if no delay satisfies it.
        If b = 0, the loop is stable with any delay below the result.
        """
        return max(self.resistance + self.gain * self.b, 0.0) / (self.gain * self.k)

    @property
    def largest_delay(self) -> float:
        """Delay below which the loop is stable [s], computed exactly.

        The result is infinite if the loop is stable with any delay. It is 0 if the loop is unstable
        without delay.
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

    def limit_cycle(self, delay: float, played: Responses) -> LimitCycle | None:
        """Return the largest oscillation that the loop keeps with lost motion, or None.

        `delay` is tau [s], and `played` the describing function of the play at the slave.
        """
        w = FREQUENCIES
        linear = self.arm_stiffness + self.spring - self.mass * w * w + 1j * self.resistance * w
        force = self.gain * (self.k + 1j * self.b * w) * np.exp(-1j * w * delay)
        for amplitude, response in reversed(played):
            total = linear + force * response
            resonances = np.flatnonzero((total.real[:-1] > 0.0) & (total.real[1:] <= 0.0))
            undamped = resonances[total.imag[resonances] < 0.0]
            if len(undamped):
                return LimitCycle(amplitude, float(w[undamped[0]]) / (2.0 * math.pi))
        return None


def response_of_play(half_width: float) -> Responses:
    """Return the describing function of a play with this half width [m]."""
    return tuple((ratio * half_width, of_play(ratio)) for ratio in RATIOS.tolist() if half_width)


def of_play(ratio: float) -> complex:
    """Return N(A) of a play with the amplitude A = `ratio` times its half width, `ratio` > 1."""
    u = 1.0 - 2.0 / ratio
    real = 0.5 + (math.asin(u) + u * math.sqrt(1.0 - u * u)) / math.pi
    return complex(real, -4.0 / (math.pi * ratio) * (1.0 - 1.0 / ratio))


@lru_cache(maxsize=16)
def response_of_compensated_play(half_width: float, error: float = 0.0) -> Responses:
    """Return the describing function of the tip whose command compensates the play.

    `half_width` is the known half width of the play [m]. The true one is larger by `error` [m].
    """
    if half_width == 0.0:
        return response_of_play(error)
    angles = np.linspace(0.0, 4.0 * math.pi, 2 * POINTS, endpoint=False)
    last = np.exp(-1j * angles[POINTS:])
    found = []
    for amplitude in (SMOOTHING * RATIOS).tolist():
        inverse, play = TipPosition(half_width), Play(half_width + error)
        desired = (amplitude * np.sin(angles)).tolist()
        tip = [play.update(inverse.goal(r, 0.0, 0.0).position) for r in desired][POINTS:]
        found.append((amplitude, complex(2.0 * np.mean(tip * last) / amplitude * 1j)))
    return tuple(found)
