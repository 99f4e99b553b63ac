"""Estimate damping and stiffness from the frequency response at the frequency of the motion.

This is the signal processing method (SPM). The class `SpectralRatio` describes the method.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

from estimation.checks import check_positive
from estimation.estimator import Estimator
from estimation.method_settings import MethodSettings
from estimation.step import B, K, Regressors, State

FASTEST = 500.0
"""Largest angular frequency of a motion [rad/s]."""
SLOWEST = 0.5
"""Smallest angular frequency of a motion [rad/s]."""
DISTINCT = 0.3
"""The two equations for b and k are solved only if their determinant is above this fraction of the
determinant for a sinusoidal motion, see `sine_determinant`."""
MOTION = 0.02
"""The estimate of `spectral` does not change if the standard deviation of x is below this limit.

The limit is relative to the typical displacement. For a typical displacement of 5 mm it is 0.1 mm,
which is 100 increments of the simulated encoder. The thresholds of the contact gate in
`scaled_preset` are also 2 % of typical values. In motion, 0.1 and 10 times this value give the same
result.
"""


@dataclass(frozen=True, slots=True)
class SpectralParameters:
    """Constant settings of the estimator `SpectralRatio`."""

    angle: float
    """Phase angle by which the motion advances in one time constant of the window [rad]."""
    per_memory: float
    """1 / time constant of the frequency estimate [1/s]."""
    frequency: float
    """Angular frequency of the motion [rad/s]; 0 if it must be estimated."""
    least_variance: float
    """The estimate does not change if the variance of x is below this value [m^2]."""
    least_determinant: float
    """Lower limit of the determinant of the two equations for b and k, divided by the root mean
    squares of v and x. Below this limit, the estimate does not change."""


@dataclass(slots=True)
class Spectrum:
    """Weighted means <s> and <e s> of a signal s, with e = exp(j w (t_0 - t)).

    w is the angular frequency of the motion, t is the time of a sample, and t_0 is the present
    time. < > is a mean over all past samples. The weights decrease exponentially with t_0 - t.
    """

    mean: float
    """Mean <s>."""
    re: float
    """Real part of <e s>."""
    im: float
    """Imaginary part of <e s>."""


@dataclass(slots=True)
class SpectralState(State):
    """Variables of the estimator `SpectralRatio` that change at each sample."""

    filled: float
    """Sum of the weights in the means `x_mean`, `x_variance` and `v_square`, from 0 to 1."""
    x_mean: float
    """Mean of x, with the time constant of the frequency estimate [m]."""
    x_variance: float
    """Variance of x, with the time constant of the frequency estimate [m^2]."""
    v_square: float
    """Mean square of v, with the time constant of the frequency estimate [m^2/s^2]."""
    window_filled: float
    """Sum of the weights in the means `one`, `x`, `v` and `f`, from 0 to 1."""
    one: Spectrum
    """Means of the constant signal 1."""
    x: Spectrum
    """Means of the displacement x."""
    v: Spectrum
    """Means of the velocity v."""
    f: Spectrum
    """Means of the force f."""


def step(
    parameters: SpectralParameters, state: SpectralState, phi: Regressors, f: float, dt: float
) -> None:
    """Process one sample: update the spectra of x, v and f, and compute b and k from them.

    X, V and F are the values of the spectra at the frequency of the motion, see `SpectralRatio`.
    The real and the imaginary part of F = b V + k X are two equations. Their solution is the
    estimate of b and k. If the motion is too small, or does not distinguish b and k, the estimate
    does not change.
    """
    v, x = phi
    frequency = find_frequency(parameters, state, v, x, dt)
    slide(parameters, state, v, x, f, frequency * dt)
    x_re, x_im = coefficient(state, state.x)
    v_re, v_im = coefficient(state, state.v)
    f_re, f_im = coefficient(state, state.f)
    determinant = v_re * x_im - v_im * x_re
    x_variance, v_square = state.x_variance, state.v_square
    if (
        x_variance > parameters.least_variance
        and v_square > SLOWEST * SLOWEST * x_variance
        and abs(determinant) > parameters.least_determinant * math.sqrt(x_variance * v_square)
    ):
        state.theta[B] = (f_re * x_im - f_im * x_re) / determinant
        state.theta[K] = (v_re * f_im - v_im * f_re) / determinant
    else:
        state.held = True


def find_frequency(
    parameters: SpectralParameters, state: SpectralState, v: float, x: float, dt: float
) -> float:
    """Return the angular frequency w of the motion [rad/s].

    If the setting `frequency` is positive, the result is this setting. Otherwise, w is estimated
    from w^2 = <v^2> / <(x - <x>)^2>, where < > is a mean over time. The means are updated with the
    new sample v [m/s], x [m]. `dt` is the time since the previous sample [s].
    """
    share = parameters.per_memory * dt
    share /= 1.0 + share
    state.filled += share * (1.0 - state.filled)
    share /= state.filled
    off = x - state.x_mean
    state.x_mean += share * off
    state.x_variance = (1.0 - share) * (state.x_variance + share * off * off)
    state.v_square += share * (v * v - state.v_square)
    if parameters.frequency > 0.0:
        return parameters.frequency
    if state.v_square < FASTEST * FASTEST * state.x_variance:
        return max(math.sqrt(state.v_square / state.x_variance), SLOWEST)
    return FASTEST


def slide(
    parameters: SpectralParameters,
    state: SpectralState,
    v: float,
    x: float,
    f: float,
    angle: float,
) -> None:
    """Add a sample to the means from which the spectra of x, v and f are computed.

    The weights of the older samples are reduced, so that a weight decreases exponentially with the
    age of the sample. `angle` is w dt [rad], the phase angle by which the sinusoidal motion has
    advanced since the previous sample. w is the angular frequency, and dt is the sample period.
    """
    share = -math.expm1(-angle / parameters.angle)
    state.window_filled += share * (1.0 - state.window_filled)
    share /= state.window_filled
    # rotation by the Cayley transform, which preserves the length for every angle
    half = 0.5 * min(angle, 1.0)
    turn = (1.0 - share) / (1.0 + half * half)
    cos = turn * (1.0 - half * half)
    sin = turn * 2.0 * half
    update(state.one, 1.0, share, cos, sin)
    update(state.x, x, share, cos, sin)
    update(state.v, v, share, cos, sin)
    update(state.f, f, share, cos, sin)


def update(spectrum: Spectrum, value: float, share: float, cos: float, sin: float) -> None:
    """Add a sample of a signal s to the means <s> and <e s>, with e = exp(j w (t_0 - t)).

    w is the angular frequency of the motion, t is the time of a sample, and t_0 is the present
    time. Since the previous sample, t_0 has increased by the sample period dt. So the earlier value
    of <e s> is first rotated in the complex plane by an angle of about w dt.

    `share`, from 0 to 1, is the weight of the sample. `cos` and `sin` of the angle are already
    multiplied by 1 - share.
    """
    re, im = spectrum.re, spectrum.im
    spectrum.mean += share * (value - spectrum.mean)
    spectrum.re = cos * re - sin * im + share * value
    spectrum.im = cos * im + sin * re


def coefficient(state: SpectralState, signal: Spectrum) -> tuple[float, float]:
    """Return the spectrum of a signal s at the frequency of the motion: real and imaginary part.

    The spectrum is <e s> - <e> <s> with e = exp(j w (t_0 - t)). w is the angular frequency, and t_0
    is the present time. < > is a mean over time with exponentially decreasing weights. The
    second term removes the effect of a constant in s.
    """
    return signal.re - signal.mean * state.one.re, signal.im - signal.mean * state.one.im


class SpectralRatio(Estimator):
    """Estimator of damping and stiffness from the ratio of two spectra, k + j w b = F / X.

    F and X are the spectra of the force and the displacement at the angular frequency w of the
    motion. The method is based on the signal processing method of D. Erickson, M. Weber and
    I. Sharf, "Contact stiffness and damping estimation for robotic systems", International Journal
    of Robotics Research, 2003. Their method is offline. It uses the mass of a robot in contact, and
    computes the frequency of the contact force by a Fourier transform. The present method is
    recursive and does not need a mass.

    Let t_0 be the present time, and let < > be a weighted mean over past times t. The weights
    decrease exponentially with t_0 - t. This is called an exponential window. With
    e = exp(j w (t_0 - t)), the spectra X, V and F of x, v and f are

        X = <e x> - <e> <x>,    V = <e v> - <e> <v>,    F = <e f> - <e> <f>.

    From f = b v + k x follows F = b V + k X. The real and the imaginary part of this equation are
    two equations for b and k. They are exact for every motion, every window and every w. The value
    of w only selects a part of the spectrum. For a steady oscillation and a long window, V is
    j w X, and the result is the ratio F / X. A constant force has no effect.

    If `frequency` is not given, w is estimated from w^2 = <v^2> / <(x - <x>)^2>. These means have
    the time constant `memory`. The estimate of b and k changes only if the motion is sufficient to
    distinguish b and k.

    Standard deviations are not computed (NaN).

    Parameters
    ----------
    periods
        Time constant of the window, in periods of the motion. With a short window, the estimate
        follows changes faster. With a long window, the estimate has less noise. For short windows,
        the noise depends strongly on `periods`, because the determinant of the two equations is
        proportional to the sixth power of `periods`.
    frequency
        Frequency of the motion [Hz]. Default: estimated from the motion.
    motion
        Standard deviation of the displacement [m] below which the estimate does not change.
    memory
        Time constant [s] of the means from which the frequency of the motion is estimated.

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)
    used_settings = ("x_size",)

    def __init__(
        self,
        periods: float = 0.07,
        frequency: float | None = None,
        motion: float = 1e-4,
        memory: float = 1.0,
    ) -> None:
        w = 0.0 if frequency is None else 2.0 * math.pi * frequency
        if not 0.01 <= periods <= 100.0:
            raise ValueError(f"window must be between 0.01 and 100 periods, got {periods}")
        if frequency is not None and not SLOWEST <= w <= FASTEST:
            slowest, fastest = SLOWEST / (2.0 * math.pi), FASTEST / (2.0 * math.pi)
            raise ValueError(
                f"frequency must be between {slowest:.2g} and {fastest:.2g} Hz, got {frequency}"
            )
        if not 1e-9 <= motion < math.inf:
            raise ValueError(f"motion must be at least 1e-9 m, got {motion}")
        check_positive(memory=memory)
        angle = 2.0 * math.pi * periods
        parameters = SpectralParameters(
            angle=angle,
            per_memory=1.0 / memory,
            frequency=w,
            least_variance=motion * motion,
            least_determinant=DISTINCT * sine_determinant(angle),
        )
        one, x, v, f = (Spectrum(0.0, 0.0, 0.0) for _ in range(4))
        nan = math.nan
        super().__init__(
            parameters,
            SpectralState([0.0, 0.0], [nan, nan], True, 0.0, 0.0, 0.0, 0.0, 0.0, one, x, v, f),
        )

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        return cls(motion=max(MOTION * settings.x_size, 1e-9))


def sine_determinant(angle: float) -> float:
    """Return the determinant of the equations for b and k if the motion is sinusoidal.

    The two equations are the real and the imaginary part of F = b V + k X, see `SpectralRatio`. The
    result is |Re V Im X - Im V Re X|, divided by the root mean squares of v and x. `angle` is the
    phase angle [rad] by which the motion advances in one time constant of the exponential window.
    """
    return 2.0 * angle**6 / ((1.0 + angle**2) ** 2 * (1.0 + 4.0 * angle**2))
