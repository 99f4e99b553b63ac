"""Observe during a trial whether the loop sustains an oscillation at the hand.

Tremor and an oscillation of the loop have similar frequencies. They differ in the direction of the
energy (see `teleop.evaluation.loop_oscillation`). With the force f of the hand, the velocity v of
the virtual mass and the displayed impedance Z, the mean power from the hand at one frequency is
Re{Z} |V|^2 / 2, where V is the amplitude of v. In tremor, the hand causes the motion, and the power
is positive if Z is passive. In an oscillation of the loop, the loop moves the arm, and the arm
dissipates energy. The power from the hand is then negative.

In this file, f and v pass the same filters. The filters do not change the sign of the power at a
frequency. A high-pass filter removes the voluntary motion. A second filter then divides the motion
into two bands, below and above the frequency `SPLIT`. In contact with a stiff body, the tremor can
have more power than a faster oscillation. With two bands, the faster oscillation is still detected.
A band oscillates while the mean of

    (f + c v) v

is negative. Here c is the smallest damping that an arm can have. If the displayed environment gives
out less power than c |V|^2 / 2, it amplifies the tremor, but cannot sustain an oscillation. The
result is the mean square velocity of the oscillating bands, divided by the mean square velocity of
the whole motion. Both means are exponential averages with the time constant `MEMORY`.

The observer in `port_energy` detects a large oscillation within a fraction of a second, because a
large oscillation gives out much energy. The observer in this file detects an oscillation with an
amplitude that stays small, for example because the body stiffens. A small oscillation gives out
little energy.

Source of the filter: V. Zavalishin, "The Art of VA Filter Design", 2012, chapter 4 (state-variable
filter with the trapezoidal rule).
"""

from __future__ import annotations

import math

SLOWEST = 4.0
"""Frequency above which motion is not voluntary, but tremor or an oscillation of the loop [Hz]."""
SPLIT = 14.0
"""Frequency between the two bands [Hz]. The tremor of the hand, at 8 to 12 Hz, is in the lower
band."""
LEAST_DAMPING = 2.0
"""Damping c that any arm has at least [N s/m]. The simulated arms, with stiffnesses of 150 to
1500 N/m, have a damping of 7 to 23 N s/m. The lag of the handle reduces this damping, but at least
3 N s/m remain at the frequencies of the oscillations."""
AVERAGING = 0.08
"""Time constant of each of the two averages that give the mean power of a band [s]. After only
one average, the mean power would still have a ripple. For a stiff spring, it would then be negative
half of the time, although a spring generates no energy."""
MEMORY = 4.0
"""Time constant of the mean square velocities, and time after arming without a result [s]. It is
longer than several presses on the body, so that an oscillation that pauses between the presses is
also detected."""
LEAST_SPEED = 1e-3
"""Root mean square velocity of an oscillation below which the result is 0 [m/s]. At 40 Hz, it is an
amplitude of 6 um."""
MOST_SHARE = 0.75
"""Largest share of the mean square velocity that the loop may sustain. After the trial, the share
is computed from spectra, with the threshold 0.8 (`teleop.evaluation.loop_oscillation`)."""
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
    """Butterworth filter of second order, with a high-pass and a low-pass output.

    A sample is a complex number. Its real and its imaginary part pass the filter separately.

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
        """Set the time between two samples [s]."""
        self._g = g = math.tan(math.pi * min(self._frequency * dt, HIGHEST))
        self._scale = 1.0 / (1.0 + g * (g + ROOT_2))

    def update(self, value: complex) -> tuple[complex, complex]:
        """Return the high-pass and the low-pass output for the next sample."""
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
    """Frequency band in which the loop may sustain the motion of the hand."""

    def __init__(self) -> None:
        self._first = self._power = 0.0

    def update(self, motion: complex, weight: float) -> float:
        """Return the square of the velocity [m^2/s^2] if the band oscillates; otherwise 0.

        Parameters
        ----------
        motion
            Complex number for this band. Its real part is the velocity [m/s], and its imaginary
            part is the force [N].
        weight
            Weight of a new value in each of two exponential averages. The power is averaged, and
            the average is then averaged once more.
        """
        velocity = motion.real
        first, power = self._first, self._power
        first += ((motion.imag + LEAST_DAMPING * velocity) * velocity - first) * weight
        power += (first - power) * weight
        self._first, self._power = first, power
        return velocity * velocity if power < 0.0 else 0.0


class Oscillation:
    """Observer of an oscillation that the loop sustains at the port of the hand."""

    def __init__(self) -> None:
        self.reset(0.0)

    def reset(self, position: float) -> None:
        """Discard all samples, and begin at a position [m] of the virtual mass."""
        self.share = 0.0
        """Share of the mean square velocity that the loop sustains, 0 to about 1."""
        self._position = position
        self._impulse = self._span = self._age = 0.0
        self._high_pass, self._split = Split(SLOWEST), Split(SPLIT)
        self._tune(PERIOD)
        self._fast, self._slow = Band(), Band()
        self._sustained = self._motion = 0.0

    def update(self, force: float, position: float, dt: float) -> float:
        """Process the motion of one tick, and return `share`.

        `share` is the fraction of the mean square velocity of the hand that the loop sustains.

        Parameters
        ----------
        force
            Force of the hand during the motion [N].
        position
            Position of the virtual mass at the end of the motion [m].
        dt
            Duration of the motion [s].
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
        """Set the time between two samples [s]."""
        self._dt = dt
        self._high_pass.tune(dt)
        self._split.tune(dt)
        self._weight, self._slow_weight = dt / (AVERAGING + dt), dt / (MEMORY + dt)

    def _sample(self, force: float, velocity: float, dt: float) -> None:
        """Process the mean force [N] and the mean velocity [m/s] of the last dt [s]."""
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
