"""Excitation that is chosen while it runs, so that k and b become precise soon.

The slave moves along mean + amplitude sin(phase). After a pilot, mean, amplitude and frequency are
chosen again and again from the information matrix of the motion so far (D-optimal design), within
limits of force, depth, speed and acceleration.

References
----------
G. C. Goodwin, R. L. Payne, "Dynamic System Identification: Experiment Design and Data Analysis",
Academic Press, 1977, chapter 6; V. V. Fedorov, "Theory of Optimal Experiments", Academic Press,
1972.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from drivers import Measurement
from estimation import Conditioner, ExpectedIntervals
from estimation.estimator import LEVEL_95
from estimation.expected_intervals import half_width_text
from teleop.control.admittance import AdmittanceParameters
from teleop.control.alignment import Alignment
from teleop.control.excitation_signals import Derivatives
from teleop.control.injector import RAMP, Injector
from teleop.control.wanted_precision import WantedPrecision

PILOT = 1.0
"""Duration of the pilot [s]. The ramp from zero displacement is its first half."""
PILOT_DEPTHS = (0.1, 0.7)
"""Smallest and largest displacement of the pilot, as fractions of the depth. The stiffness is not
known yet, and a body that stiffens exceeds the force first at a large depth. The frequency is the
highest that is permitted."""
TOUCH = 0.1
"""Smallest displacement as a fraction of the depth, so that the slave stays in contact."""
PERIOD = 0.5
"""Time between two choices [s]."""
FORCE_SHARE, SPEED_SHARE, ACCELERATION_SHARE = 0.8, 0.8, 0.6
"""Largest shares of the soft limits of force, speed and acceleration that a motion may reach."""
TRANSITION_SHARE = 0.15
"""Largest share of the speed limit that a change of mean and amplitude may need in addition."""
TRANSITION = 0.3
"""Shortest time in which the motion changes to the next choice [s]."""
DEEPER = 0.7
"""Largest increase of the depth from one choice to the next, as a fraction of the depth reached."""
STIFFENING = 1.5
"""Factor by which the stiffness is assumed to increase beyond the depth reached."""
SHARES = (1.0, 0.84, 0.71, 0.59, 0.5, 0.35, 0.25, 0.12)
"""Frequencies that are compared, as fractions of the highest permitted one."""
AMPLITUDES = (1.0, 0.7, 0.5)
"""Amplitudes that are compared, as fractions of the largest permitted one."""
SAME = 0.03
"""Largest relative difference of two motions that are treated as the same."""
LEAST = 1e-9
"""Least k [N/m] and b [N s/m] by which half widths are divided."""
SHORTEST = 0.1
"""Shortest time that is stated [s]."""
CURVATURE = 9.0
"""Factor by which an unknown curvature increases the variance of the slope of a sine at its mean:
with x^3 as a further regressor, the sine determines k with a ninth of the information."""


@dataclass(frozen=True)
class Design:
    """What the choice of an excitation needs to know."""

    depth: float
    """Largest displacement of the slave [m]."""
    highest: float
    """Highest frequency [Hz]."""
    max_force: float
    """Soft limit of the contact force [N]."""
    max_speed: float
    """Soft limit of the speed of the slave [m/s]."""
    max_acceleration: float
    """Soft limit of the acceleration of the slave [m/s^2]."""
    conditioner: Conditioner
    """Filters of position and force."""
    wanted: WantedPrecision | None
    """Wanted half widths; None to make the product of the half widths of k and b small."""


class Motion(NamedTuple):
    """A sine about a mean displacement."""

    mean: float
    """Mean displacement of the slave [m]."""
    amplitude: float
    """Amplitude [m]."""
    omega: float
    """Angular frequency [rad/s]."""

    @property
    def text(self) -> str:
        """Description of frequency, amplitude and mean."""
        return (
            f"{self.omega / (2.0 * math.pi):.2g} Hz, ± {1e3 * self.amplitude:.2g} mm about "
            f"{1e3 * self.mean:.2g} mm"
        )


class Known(NamedTuple):
    """Estimates from the motion so far."""

    k: float
    """Stiffness at the mean displacement [N/m]."""
    b: float
    """Damping [N s/m]."""
    k_information: float
    """Inverse of the variance of k."""
    b_information: float
    """Inverse of the variance of b."""
    noise: float
    """Spectral density of the noise of the force [N^2 s]."""


class Transition:
    """A change from one motion to the next, with a continuous acceleration.

    From the time `start` on, mean, amplitude and frequency change within `duration` [s] along a
    polynomial of degree 5. `phase` is the phase at `start` [rad].
    """

    def __init__(
        self, start: float, duration: float, before: Motion, after: Motion, phase: float
    ) -> None:
        self.after = after
        self._start, self._duration = start, duration
        self._before, self._phase = before, phase

    def phase(self, t: float) -> float:
        """Return the phase at the time t [s], in [0, 2 pi)."""
        span, before = self._duration, self._before.omega
        change, elapsed = self.after.omega - before, t - self._start
        u = min(max(elapsed / span, 0.0), 1.0)
        integral = span * u**4 * (2.5 - 3.0 * u + u * u) + max(elapsed - span, 0.0)
        return (self._phase + before * elapsed + change * integral) % (2.0 * math.pi)

    def at(self, t: float) -> Derivatives:
        """Return the displacement of the slave at the time t [s], and its derivatives."""
        span = self._duration
        u = min(max((t - self._start) / span, 0.0), 1.0)
        share = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        rate = 30.0 * u * u * (1.0 - u) ** 2 / span
        acceleration = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / span**2
        before, after = self._before, self.after
        by_mean, by_amplitude, by_omega = (b - a for a, b in zip(before, after, strict=True))
        size = before.amplitude + share * by_amplitude
        size_rate, size_acceleration = rate * by_amplitude, acceleration * by_amplitude
        omega, slew = before.omega + share * by_omega, rate * by_omega
        phase = self.phase(t)
        sine, cosine = math.sin(phase), math.cos(phase)
        return Derivatives(
            before.mean + share * by_mean + size * sine,
            rate * by_mean + size_rate * sine + size * omega * cosine,
            acceleration * by_mean
            + (size_acceleration - size * omega * omega) * sine
            + (2.0 * size_rate * omega + size * slew) * cosine,
        )


class DesignedInjector(Injector):
    """Computes the force that moves the slave along an excitation which it chooses while it runs.

    The pilot shows stiffness, damping and noise. Then the frequency, amplitude and mean with the
    best predicted intervals after one more `PERIOD` are chosen, once per `PERIOD`. Without a wanted
    precision, the best has the smallest product of the half widths of k and b (D-optimality). With
    a wanted one, its largest ratio of a half width to the wanted one is the smallest. The half
    widths are those that result from noise, because the errors of lag and lost motion between
    encoder and tip depend little on the choice.

    The depth increases only step by step, and the force at a greater depth is predicted from the
    largest measured force and the stiffness there, so that a body that stiffens does not exceed the
    force limit.

    Attributes
    ----------
    note
        The latest choice and its reason, as text.
    """

    def __init__(
        self, design: Design, admittance: AdmittanceParameters, scale: float, duration: float
    ) -> None:
        super().__init__(None, design.depth, admittance, scale, duration)
        self._design = design
        self._scale = scale
        low, high = (share * design.depth for share in PILOT_DEPTHS)
        amplitude = 0.5 * (high - low)
        omega = min(2.0 * math.pi * design.highest, *fastest(design, amplitude))
        pilot = Motion(0.5 * (low + high), amplitude, omega)
        self._path = Transition(0.0, RAMP, pilot, pilot, 0.0)
        self._alignment = Alignment()
        self._expected = ExpectedIntervals()
        self._due = PILOT
        self._time = math.nan
        self._deepest = self._force = 0.0
        """Largest displacement so far [m], and largest contact force [N]."""
        self.note = f"pilot: {pilot.text}"

    def motion(self, t: float) -> Derivatives:
        """Return the motion of the master with which the slave follows the chosen motion [m]."""
        ramp, ramp_rate, ramp_acceleration = self.ramp(t)
        x, v, a = self._path.at(t)
        return Derivatives(
            ramp * x / self._scale,
            (ramp_rate * x + ramp * v) / self._scale,
            (ramp_acceleration * x + 2.0 * ramp_rate * v + ramp * a) / self._scale,
        )

    def observe(self, t: float, measurement: Measurement) -> None:
        """Process the measurement at the time t [s], and choose the motion if this is due."""
        dt, self._time = t - self._time, t
        self._deepest = max(self._deepest, measurement.slave_position)
        self._force = max(self._force, measurement.contact_force)
        if not dt > 0.0:
            return
        pair = self._alignment.update(measurement, dt)
        if pair:
            sample = self._design.conditioner.update(*pair)
            if t > RAMP:  # before, the filters settle
                self._expected.update(sample.x, sample.v, sample.f, pair.dt)
        if t >= self._due:
            self._due = t + PERIOD
            if known := self._expected.known:
                self._choose(t, Known(*known))

    def _choose(self, t: float, known: Known) -> None:
        """Change to the motion with the best predicted intervals, and state why."""
        design, present = self._design, self._path.after
        low, high = self._depths(known)
        best, least = present, math.inf
        for amplitude_share in AMPLITUDES:
            amplitude = amplitude_share * 0.5 * (high - low)
            limit = min(2.0 * math.pi * design.highest, *fastest(design, amplitude))
            mean = 0.5 * (low + high)
            for share in SHARES:
                motion = Motion(mean, amplitude, share * limit)
                if known.b * motion.omega * amplitude > FORCE_SHARE * design.max_force:
                    continue
                cost = self._cost(motion, known)
                if cost < least:
                    best, least = motion, cost
        if is_same(best, present):
            return
        self.note = self._reason(best, known)
        jump = abs(best.mean - present.mean) + abs(best.amplitude - present.amplitude)
        span = max(TRANSITION, 1.875 * jump / (TRANSITION_SHARE * design.max_speed))
        self._path = Transition(t, span, present, best, self._path.phase(t))

    def _depths(self, known: Known) -> tuple[float, float]:
        """Return the smallest and the largest displacement that are permitted now [m]."""
        design = self._design
        left = FORCE_SHARE * design.max_force - self._force
        by_force = self._deepest + left / (STIFFENING * max(known.k, LEAST))
        high = min(design.depth, by_force, (1.0 + DEEPER) * self._deepest)
        low = TOUCH * design.depth
        return low, max(high, 2.0 * low)

    def _cost(self, motion: Motion, known: Known) -> float:
        """Return how bad the intervals are after one more period with this motion."""
        k, b = self._halves(motion, known, PERIOD)
        wanted = self._design.wanted
        if wanted is None:
            return k * b
        ratios = [half / most for half, most in ((k, wanted.k), (b, wanted.b)) if most is not None]
        # of motions that are equally good for the worst part, the one that is better for the other
        return max(ratios) + 1e-3 * (k + b)

    def _halves(self, motion: Motion, known: Known, time: float) -> tuple[float, float]:
        """Return the relative half widths of k and b after this motion for some time [s]."""
        power = 0.5 * time / known.noise
        of_k = known.k_information + power * motion.amplitude**2 / CURVATURE
        of_b = known.b_information + power * (motion.omega * motion.amplitude) ** 2
        return (
            LEVEL_95 / (math.sqrt(of_k) * max(abs(known.k), LEAST)),
            LEVEL_95 / (math.sqrt(of_b) * max(abs(known.b), LEAST)),
        )

    def _reason(self, motion: Motion, known: Known) -> str:
        """Return the choice and its reason as text."""
        k_half, b_half = self._halves(motion, known, 0.0)
        wanted = self._design.wanted
        of_k = k_half / (wanted.k or math.inf) if wanted else k_half
        of_b = b_half / (wanted.b or math.inf) if wanted else b_half
        part, half = ("k", k_half) if of_k > of_b else ("b", b_half)
        speed = motion.amplitude / math.sqrt(CURVATURE)
        if part == "b":
            speed = motion.omega * motion.amplitude
        information = known.k_information if part == "k" else known.b_information
        # four times the information halves the part of the noise
        time = max(3.0 * information * 2.0 * known.noise / speed**2, SHORTEST)
        return (
            f"{motion.text}: {time:.2g} s halve the part of the noise in the interval of {part}, "
            f"now {half_width_text(half)}"
        )


def is_same(one: Motion, other: Motion) -> bool:
    """Return whether two motions differ so little that a change would not improve anything."""
    return all(abs(a - b) <= SAME * abs(b) for a, b in zip(one, other, strict=True))


def fastest(design: Design, amplitude: float) -> tuple[float, float]:
    """Return the largest angular frequencies that speed and acceleration permit [rad/s]."""
    return (
        SPEED_SHARE * design.max_speed / amplitude,
        math.sqrt(ACCELERATION_SHARE * design.max_acceleration / amplitude),
    )
