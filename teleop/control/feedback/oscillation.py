"""Observe during a trial whether the control loop sustains an oscillation of the hand.

Tremor of the hand and an oscillation of the loop have similar frequencies. They differ in the
direction of the energy (see `teleop.evaluation.teleoperation.loop_oscillation`). Let f be the force
of the hand and v the velocity of the virtual mass. Let Z be the displayed impedance, which the hand
feels. At one frequency, the mean power from the hand is Re{Z} |V|^2 / 2, where V is the amplitude
of v. In tremor, the hand causes the motion, and the power is positive if Z is passive. In an
oscillation of the loop, the loop moves the arm, and the arm dissipates energy. The power from the
hand is then negative.

The same filters are applied to f and v. Therefore the filters do not change the sign of the power
at a frequency. A high-pass filter removes the voluntary motion. A second filter then divides the
motion into two frequency bands, below and above `SPLIT`. In contact with a stiff body, the tremor
can have more power than a faster oscillation. With two bands, the faster oscillation is still
detected. The motion in a band is an oscillation of the loop while the mean of

    (f + c v) v

is negative. Here c is the smallest damping that an arm can have. The power that the arm dissipates
is at least c |V|^2 / 2. If the displayed environment supplies less power to the arm, it can amplify
the tremor, but it cannot sustain an oscillation.

The result is the mean square velocity in the bands that oscillate, divided by the mean square
velocity of the whole motion. Both means are exponential averages with the time constant `MEMORY`.

The observer in `port_energy` detects an oscillation with a large amplitude within a fraction of a
second, because the displayed environment then generates much energy. The observer in this file
detects an oscillation whose amplitude stays small, for example because the body stiffens. The
generated energy is then small.

Source of the filter: V. Zavalishin, "The Art of VA Filter Design", 2012, chapter 4 (state-variable
filter with the trapezoidal rule).
"""

from __future__ import annotations

import math

SLOWEST = 4.0
"""Frequency above which motion is not voluntary, but tremor or an oscillation of the loop [Hz]."""
SPLIT = 14.0
"""Frequency between the two frequency bands [Hz]. The tremor of the hand, at 8 to 12 Hz, is in the
lower band."""
LEAST_DAMPING = 2.0
"""Damping c that any arm has at least [N s/m]. The simulated arms have a larger damping, although
the lag of the handle reduces their damping at the frequencies of the oscillations."""
AVERAGING = 0.08
"""Time constant of each of the two averages that give the mean power in a band [s]. After only one
average, the mean power would still have a ripple. For a stiff spring, it would then be negative
half of the time, although a spring generates no energy."""
MEMORY = 4.0
"""Time constant of the mean square velocities, and time after arming without a result [s]. It is
longer than several presses on the body, so that an oscillation that pauses between the presses is
also detected."""
LEAST_SPEED = 1e-3
"""Root mean square velocity of an oscillation below which the result is 0 [m/s]. At 40 Hz, this is
an amplitude of some micrometres."""
MOST_SHARE = 0.75
"""Largest share of the mean square velocity that the loop may sustain."""
PERIOD = 5e-3
"""Time over which force and velocity are averaged to one sample [s]."""
ROUNDING = 1e-6
"""Tolerance for rounding errors of times [s]."""
SHORTEST = PERIOD - ROUNDING
"""Shortest time that is averaged to one sample, with a tolerance for rounding errors [s]."""
HIGHEST = 0.45
"""Largest corner frequency of a filter, as a fraction of the sampling rate."""
ROOT_2 = math.sqrt(2.0)


class Split:
    """Butterworth filter of second order, which splits a signal at a corner frequency.

    The high-pass output contains the signal above this frequency, and the low-pass output the
    signal below this frequency. A sample is a complex number. Its real part and its imaginary part
    are filtered separately.

    Parameters
    ----------
    frequency
        Corner frequency [Hz].
    """

    def __init__(self, frequency: float) -> None:
        self._frequency = frequency
        self._first = self._second = 0.0j
        self.tune(PERIOD)

    def tune(self, dt: float) -> None:
        """Compute the coefficients of the filter for a time `dt` between two samples [s]."""
        self._g = g = math.tan(math.pi * min(self._frequency * dt, HIGHEST))
        self._scale = 1.0 / (1.0 + g * (g + ROOT_2))

    def update(self, value: complex) -> tuple[complex, complex]:
        """Filter the next sample; return the high-pass output and the low-pass output."""
        g, first, second = self._g, self._first, self._second
        high = (value - (ROOT_2 + g) * first - second) * self._scale
        step = g * high
        band = first + step
        self._first = band + step
        step = g * band
        low = second + step
        self._second = low + step
        return high, low


class Band:
    """One frequency band of the motion of the virtual mass, which the hand holds.

    The class detects whether the control loop sustains the motion in this band.
    """

    def __init__(self) -> None:
        self._first = self._power = 0.0

    def update(self, motion: complex, weight: float) -> float:
        """Return the squared velocity [m^2/s^2] if the loop sustains the motion, and 0 otherwise.

        The loop sustains the motion if the mean of (f + c v) v is negative. f is the force of the
        hand, v is the velocity of the virtual mass, and c is `LEAST_DAMPING`.

        The filtered sample `motion` has the real part v [m/s] and the imaginary part f [N]. The
        product (f + c v) v is averaged exponentially twice, with the weight `weight`.
        """
        velocity = motion.real
        first, power = self._first, self._power
        first += ((motion.imag + LEAST_DAMPING * velocity) * velocity - first) * weight
        power += (first - power) * weight
        self._first, self._power = first, power
        return velocity * velocity if power < 0.0 else 0.0


class Oscillation:
    """Observer of an oscillation of the hand that the control loop sustains."""

    def __init__(self) -> None:
        self.reset(0.0)

    def reset(self, position: float) -> None:
        """Discard all samples. `position` is that of the virtual mass [m]."""
        self.share = 0.0
        """Mean square velocity that the loop sustains, divided by that of the whole motion, 0 to
        about 1."""
        self._position = position
        self._impulse = self._span = self._age = 0.0
        self._high_pass, self._split = Split(SLOWEST), Split(SPLIT)
        self._tune(PERIOD)
        self._fast, self._slow = Band(), Band()
        self._sustained = self._motion = 0.0

    def update(self, force: float, position: float, dt: float) -> float:
        """Process the motion of one tick, and return `share`.

        `share` is the mean square velocity of the motion that the loop sustains, divided by the
        mean square velocity of the whole motion. It is 0 in the first `MEMORY` seconds, and if the
        oscillation is small (see `LEAST_SPEED`).
        """
        self._impulse += force * dt
        self._span = span = self._span + dt
        if span >= SHORTEST:
            travel = position - self._position
            self._sample(self._impulse / span, travel / span, span)
            self._position = position
            self._impulse = self._span = 0.0
        return self.share

    def _tune(self, dt: float) -> None:
        """Compute the coefficients of all filters for a time `dt` between two samples [s]."""
        self._dt = dt
        self._high_pass.tune(dt)
        self._split.tune(dt)
        self._weight, self._slow_weight = dt / (AVERAGING + dt), dt / (MEMORY + dt)

    def _sample(self, force: float, velocity: float, dt: float) -> None:
        """Filter the means of force and velocity over the last `dt` seconds, and update `share`."""
        if abs(dt - self._dt) > ROUNDING:
            self._tune(dt)
        motion, _ = self._high_pass.update(complex(velocity, force))
        fast, slow = self._split.update(motion)
        sustained = self._fast.update(fast, self._weight) + self._slow.update(slow, self._weight)
        weight = self._slow_weight
        self._sustained += (sustained - self._sustained) * weight
        self._motion += (velocity * velocity - self._motion) * weight
        self._age += dt
        known = self._age >= MEMORY and self._sustained > LEAST_SPEED * LEAST_SPEED
        self.share = self._sustained / self._motion if known else 0.0
