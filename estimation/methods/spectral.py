"""Damping and stiffness from the response at the motion's frequency (SPM)."""

from __future__ import annotations

import math

from estimation.compiled import Parameters, Regressors, State
from estimation.estimator import Estimator

FASTEST = 500.0
"""Largest angular frequency of a motion [rad/s]."""
SLOWEST = 0.5
"""Least angular frequency of a motion [rad/s]."""
DISTINCT = 0.3
"""X and V are told apart if their determinant is this share of what a sine would give."""


def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
    """Find the frequency, move the window on, and solve F = b V + k X.

    From state[5] on: weight, mean x, variance of x and mean square of v over the frequency's
    memory; then over the window its weight, the means of e = exp(-j w (s - t)), e x, e v, e f
    (real and imaginary part), and those of x, v, f.
    """
    v, x = phi[0], phi[1]
    share = parameters[1] * dt
    share /= 1.0 + share
    state[5] += share * (1.0 - state[5])
    share /= state[5]
    off = x - state[6]
    state[6] += share * off
    state[7] = (1.0 - share) * (state[7] + share * off * off)
    state[8] += share * (v * v - state[8])
    frequency = parameters[2]
    if frequency == 0.0:
        frequency = FASTEST
        if state[8] < FASTEST * FASTEST * state[7]:
            frequency = max(math.sqrt(state[8] / state[7]), SLOWEST)
    angle = frequency * dt
    share = -math.expm1(-angle / parameters[0])
    state[9] += share * (1.0 - state[9])
    share /= state[9]
    # Cayley's form of the turn, whose length is 1 for every angle
    half = 0.5 * min(angle, 1.0)
    turn = (1.0 - share) / (1.0 + half * half)
    cos = turn * (1.0 - half * half)
    sin = turn * 2.0 * half
    one_re = cos * state[10] - sin * state[11] + share
    one_im = cos * state[11] + sin * state[10]
    x_re = cos * state[12] - sin * state[13] + share * x
    x_im = cos * state[13] + sin * state[12]
    v_re = cos * state[14] - sin * state[15] + share * v
    v_im = cos * state[15] + sin * state[14]
    f_re = cos * state[16] - sin * state[17] + share * f
    f_im = cos * state[17] + sin * state[16]
    state[10], state[11], state[12], state[13] = one_re, one_im, x_re, x_im
    state[14], state[15], state[16], state[17] = v_re, v_im, f_re, f_im
    state[18] += share * (x - state[18])
    state[19] += share * (v - state[19])
    state[20] += share * (f - state[20])
    x_re -= state[18] * one_re
    x_im -= state[18] * one_im
    v_re -= state[19] * one_re
    v_im -= state[19] * one_im
    f_re -= state[20] * one_re
    f_im -= state[20] * one_im
    determinant = v_re * x_im - v_im * x_re
    state[4] = 1.0
    if (
        state[7] > parameters[3]
        and state[8] > SLOWEST * SLOWEST * state[7]
        and abs(determinant) > parameters[4] * math.sqrt(state[7] * state[8])
    ):
        state[0] = (f_re * x_im - f_im * x_re) / determinant
        state[1] = (v_re * f_im - v_im * f_re) / determinant
        state[4] = 0.0


class SpectralRatio(Estimator):
    """Damping and stiffness from the ratio of spectra, k + j w b = F / X.

    The idea is the signal processing method of D. Erickson, M. Weber and I. Sharf, "Contact
    stiffness and damping estimation for robotic systems", International Journal of Robotics
    Research, 2003, which works off line: it takes the frequency from a Fourier transform of
    the force of a robot in contact. Here it is made recursive and needs no robot's mass.
    With means < > over an exponential window that ends now and e = exp(-j w (s - t)),

        X = <e x> - <e> <x>,    V and F likewise,    F = b V + k X,

    two real equations for b and k. Of a lasting oscillation over a long window V is j w X, and
    this is the ratio above. Of a short window it is not, but the equation holds exactly for
    every motion, whatever the frequency w: it only chooses what part of the spectrum is
    looked at. A constant force is no part of it.

    The frequency is w^2 = <v^2> / <(x - <x>)^2> over a longer memory. Where a window holds too
    little of a motion to tell b from k, the estimate is held.

    There is no standard deviation.

    Parameters
    ----------
    periods
        Memory of the window, in periods of the motion. A short one follows faster, a long one
        lets less noise through: the determinant of the equations falls as its sixth power.
    frequency
        Of the motion [Hz]; by default it is had from the motion.
    motion
        Least standard deviation of the displacement [m]; with less the estimate is held.
    memory
        Memory of the frequency [s].

    Raises
    ------
    ValueError
        A parameter is out of its range.
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
        super().__init__(
            (angle, 1.0 / memory, w, motion * motion, DISTINCT * sine_determinant(angle)),
            (0.0, 0.0, math.nan, math.nan, 1.0, *[0.0] * 16),
        )


def sine_determinant(angle: float) -> float:
    """|Re V Im X - Im V Re X| of a sine over its rms v and x, for a memory of this angle [rad]."""
    return 2.0 * angle**6 / ((1.0 + angle**2) ** 2 * (1.0 + 4.0 * angle**2))
