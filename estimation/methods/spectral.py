"""Estimate damping and stiffness from the frequency response at the frequency of the motion.

This is the signal processing method (SPM), see `SpectralRatio`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.estimator import Estimator
from estimation.step import B, K, Regressors, State

FASTEST = 500.0
"""Largest angular frequency of a motion [rad/s]."""
SLOWEST = 0.5
"""Smallest angular frequency of a motion [rad/s]."""
DISTINCT = 0.3
"""The equations F = b V + k X are solved only if their determinant is above this fraction of the
determinant for a sine."""


@dataclass(frozen=True, slots=True)
class SpectralParameters:
    """Constant settings of the function `step`."""

    angle: float
    """Time constant of the window, as a phase angle of the motion [rad]."""
    per_memory: float
    """1 / time constant of the frequency estimate [1/s]."""
    frequency: float
    """Angular frequency of the motion [rad/s]; 0 if it must be estimated."""
    least_variance: float
    """The estimate does not change if the variance of x is below this value [m^2]."""
    least_determinant: float
    """The estimate does not change if the determinant, divided by the root mean squares of v and
    x, is below this value."""


@dataclass(slots=True)
class Spectrum:
    """Means <s> and <e s> of a signal s over the window, with e = exp(j w (t_0 - t)).

    w is the angular frequency of the motion, and t_0 is the present time. `mean` is <s>. `re` and
    `im` are the real and the imaginary part of <e s>.
    """

    mean: float
    re: float
    im: float


@dataclass(slots=True)
class SpectralState(State):
    """Variables that the function `step` updates."""

    filled: float
    """Sum of the weights in `x_mean`, `x_variance` and `v_square`, from 0 to 1."""
    x_mean: float
    """Mean of x, with the time constant of the frequency estimate [m]."""
    x_variance: float
    """Variance of x, with the time constant of the frequency estimate [m^2]."""
    v_square: float
    """Mean square of v, with the time constant of the frequency estimate [m^2/s^2]."""
    window_filled: float
    """Sum of the weights in the window, from 0 to 1."""
    one: Spectrum
    """Means of the constant signal 1, and then of x, v and f."""
    x: Spectrum
    v: Spectrum
    f: Spectrum


def step(
    parameters: SpectralParameters, state: SpectralState, phi: Regressors, f: float, dt: float
) -> None:
    """Find the frequency of the motion, add the sample to the window, and solve F = b V + k X.

    X, V and F are the spectra of x, v and f at this frequency, see `SpectralRatio`. The solution is
    the estimate of b and k.
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

    This is the setting `frequency` if it is positive. Otherwise, w is estimated from
    w^2 = <v^2> / <(x - <x>)^2>, where < > is a mean over time.
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
    """Add a sample to the exponential window, and reduce the weights of the older samples.

    `angle` is the phase angle w dt [rad] by which the excitation has advanced.
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
    """Rotate <e s> in the complex plane, and add a sample to the means.

    `share` is the weight of the sample. `cos` and `sin` are the cosine and the sine of the angle of
    rotation, each multiplied by 1 - share. This angle is approximately the phase angle by which the
    excitation has advanced since the previous sample.
    """
    re, im = spectrum.re, spectrum.im
    spectrum.mean += share * (value - spectrum.mean)
    spectrum.re = cos * re - sin * im + share * value
    spectrum.im = cos * im + sin * re


def coefficient(state: SpectralState, signal: Spectrum) -> tuple[float, float]:
    """Return the real and the imaginary part of <e s> - <e> <s> for a signal s.

    `Spectrum` defines e and < >.
    """
    return signal.re - signal.mean * state.one.re, signal.im - signal.mean * state.one.im


class SpectralRatio(Estimator):
    """Estimator of damping and stiffness from the ratio of two spectra, k + j w b = F / X.

    The method is based on the signal processing method of D. Erickson, M. Weber and I. Sharf,
    "Contact stiffness and damping estimation for robotic systems", International Journal of
    Robotics Research, 2003. Their method is offline. It uses the mass of a robot in contact, and
    the frequency of the contact force from a Fourier transform. The present method is recursive
    and does not need a mass. Let < > be a mean over an exponential window that ends at the present
    time t_0, and let e = exp(j w (t_0 - t)). Then

        X = <e x> - <e> <x>,    V = <e v> - <e> <v>,    F = <e f> - <e> <f>,
        F = b V + k X.

    The real and the imaginary part of the last equation are two equations for b and k. For a
    steady oscillation and a long window V is j w X, and the result is the ratio F / X. For a short
    window V is not j w X, but the equations are still exact for every motion and every angular
    frequency w. The value of w only selects a part of the spectrum. A constant force has no effect.

    If `frequency` is not given, w is estimated from w^2 = <v^2> / <(x - <x>)^2>. These means have
    the time constant `memory`. The estimate of b and k changes only if the motion in the window is
    sufficient to distinguish b and k.

    There are no standard deviations.

    Parameters
    ----------
    periods
        Time constant of the window, in periods of the motion. With a short window, the estimate
        follows changes faster. With a long window, the estimate has less noise. For short windows,
        the noise depends strongly on `periods`, because the determinant of the equations is
        proportional to the sixth power of `periods`.
    frequency
        Frequency of the motion [Hz]. Default: estimated from the motion.
    motion
        Standard deviation of the displacement [m] below which the estimate does not change.
    memory
        Time constant of the frequency estimate [s].

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)

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
        if not 0.0 < memory < math.inf:
            raise ValueError(f"memory must be positive, got {memory}")
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


def sine_determinant(angle: float) -> float:
    """Return the determinant of the equations F = b V + k X for a sinusoidal motion.

    The determinant is |Re V Im X - Im V Re X|, divided by the root mean squares of v and x. `angle`
    is the time constant of the window, as a phase angle of the motion [rad].
    """
    return 2.0 * angle**6 / ((1.0 + angle**2) ** 2 * (1.0 + 4.0 * angle**2))
