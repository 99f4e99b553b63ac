"""Identify the Hunt-Crossley model f = K x^n + B x^n v by one least-squares fit of ln f."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log, log1p, sqrt
from typing import Self

from estimation.checks import check_correlation
from estimation.estimator import UNKNOWN, Estimator
from estimation.linear_gain import NOISE_MEMORY
from estimation.method_settings import SIZES, MethodSettings
from estimation.methods.hunt_crossley import (
    CONTACT_FORCE,
    DAMPING,
    EXPONENT,
    HERTZ,
    LARGEST_LOG,
    NAMES,
    PRIOR,
    STEEPEST,
    STIFFNESS,
    TOUCH,
    HuntCrossleyParameters,
    clamp,
    contact_parameters,
)
from estimation.step import B, K, Regressors, State

MEMORY = 0.3
"""Time constant of forgetting in `hc_log`, in units of the memory.

The settling time (see `benchmarks/tuning.py`) is 0.26 s. It is 0.33 s for 1.25 times and 1.9 s for
0.8 times this value.
"""


@dataclass(frozen=True, slots=True)
class LogarithmicParameters(HuntCrossleyParameters):
    """Constant settings of the estimator `Logarithmic`, which `step` reads."""

    correlation: float
    """Correlation length of the force noise, in samples, >= 1."""


@dataclass(slots=True)
class LogarithmicState(State):
    """Sums and results of the fit y = a + n (l - l_mean) + d (u - u_mean), with d = v0 B/K.

    l is ln(x/x0), u is about v/v0, and y is about ln f. `step` gives the exact definitions.
    """

    w: float
    """`w` to `w_uu` are weighted sums R of products of 1, l, u; `w_y` to `w_uy` are sums with y."""
    w_l: float
    w_u: float
    w_ll: float
    w_lu: float
    w_uu: float
    w_y: float
    w_ly: float
    w_uy: float
    q: float
    """`q` to `q_uu` are the sums Q. They are the sums R with weights that decay twice as fast."""
    q_l: float
    q_u: float
    q_ll: float
    q_lu: float
    q_uu: float
    level: float
    """Result a of the fit: the value of y at the weighted means `l_mean` and `u_mean`."""
    damping: float
    """Result d of the fit: the estimate of v0 B / K."""
    l_mean: float
    u_mean: float
    c: float
    """`c` to `c_uu` are the covariance of (level, n, v0 B / K) for a noise variance of 1 N^2."""
    c_l: float
    c_u: float
    c_ll: float
    c_lu: float
    c_uu: float
    noise: float
    """Variance of the noise [N^2]."""
    evidence: float
    """Mean of 1 / spread over the samples from which `noise` is estimated, see `update_noise`."""


def step(
    parameters: LogarithmicParameters,
    state: LogarithmicState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Update the weighted least-squares fit of ln f with one sample, and compute the estimates.

    The model is ln f = ln K + n ln x + ln(1 + B v/K). Its last term is linearised at z, the present
    estimate of B v/K. For typical values x0 and v0, the result is y = ln(K x0^n) + n l + (v0 B/K) u
    with y = ln f - ln(1 + z) + z/(1 + z), l = ln(x/x0) and u = (v/v0)/(1 + z).
    """
    v, x = phi
    if x / parameters.x0 < TOUCH or f <= parameters.threshold:
        state.held = True
        return
    lx, u = log(x / parameters.x0), v / parameters.v0
    z = clamp(state.damping * u, -0.5, 1.0)
    u /= 1.0 + z
    y = log(f) - log1p(z) + z / (1.0 + z)
    weight = f * f
    if state.w > 0.0:
        slope = state.theta[EXPONENT]
        off_l, off_u = lx - state.l_mean, u - state.u_mean
        error = y - state.level - slope * off_l - state.damping * off_u
        weight *= exp(-1.5 * clamp(error, -0.7, 0.7))
        spread = 1.0 + weight * variance(state, 1.0, off_l, off_u)
        update_noise(state, f * (1.0 - exp(-clamp(error, -30.0, 30.0))), spread, dt)
    noise = max(state.noise, 1e-12 * f * f)
    accumulate(state, exp(-dt * parameters.rate), weight, lx, u, y)
    solve(state, noise)
    report(parameters, state, x, lx, parameters.correlation * noise)


def update_noise(state: LogarithmicState, error: float, spread: float, dt: float) -> None:
    """Update the noise variance with an error [N] of variance `spread` times the noise variance."""
    share = dt / (NOISE_MEMORY + dt)
    state.evidence += share * (1.0 / spread - state.evidence)
    share /= spread * state.evidence
    state.noise += share * (error * error / spread - state.noise)


def accumulate(
    state: LogarithmicState, beta: float, weight: float, lx: float, u: float, y: float
) -> None:
    """Multiply the sums of the fit by the forgetting factor beta, and add the sample (l, u, y)."""
    w_l, w_u = weight * lx, weight * u
    state.w = beta * state.w + weight
    state.w_l = beta * state.w_l + w_l
    state.w_u = beta * state.w_u + w_u
    state.w_ll = beta * state.w_ll + w_l * lx
    state.w_lu = beta * state.w_lu + w_l * u
    state.w_uu = beta * state.w_uu + w_u * u
    state.w_y = beta * state.w_y + weight * y
    state.w_ly = beta * state.w_ly + w_l * y
    state.w_uy = beta * state.w_uy + w_u * y
    beta *= beta
    state.q = beta * state.q + weight
    state.q_l = beta * state.q_l + w_l
    state.q_u = beta * state.q_u + w_u
    state.q_ll = beta * state.q_ll + w_l * lx
    state.q_lu = beta * state.q_lu + w_l * u
    state.q_uu = beta * state.q_uu + w_u * u


def solve(state: LogarithmicState, noise: float) -> None:
    """Solve the fit y = a + n (l - l_mean) + d (u - u_mean) for a, n and d = v0 B/K.

    Their covariance for a noise variance of 1 N^2 is R^-1 Q R^-1, with R, Q in `LogarithmicState`.
    """
    inverse = 1.0 / state.w
    l_mean, u_mean = inverse * state.w_l, inverse * state.w_u
    prior = PRIOR * state.w
    ll = max(state.w_ll - state.w_l * l_mean, 0.0) + prior
    lu = state.w_lu - state.w_l * u_mean
    uu = max(state.w_uu - state.w_u * u_mean, 0.0) + prior
    determinant = max(ll * uu - lu * lu, 1e-12 * ll * uu)
    ly = state.w_ly - state.w_y * l_mean + HERTZ * prior
    uy = state.w_uy - state.w_y * u_mean
    slope = clamp((uu * ly - lu * uy) / determinant, 0.0, STEEPEST)
    state.theta[EXPONENT] = slope
    state.level = inverse * state.w_y
    state.damping = clamp((uy - lu * slope) / uu, -10.0, 10.0)
    state.l_mean, state.u_mean = l_mean, u_mean

    q, q_l, q_u = state.q, state.q_l, state.q_u
    first_guess = prior * (prior / noise)
    q_ll = state.q_ll + l_mean * (l_mean * q - 2.0 * q_l) + first_guess
    q_lu = state.q_lu + l_mean * (u_mean * q - q_u) - u_mean * q_l
    q_uu = state.q_uu + u_mean * (u_mean * q - 2.0 * q_u) + first_guess
    q_l -= l_mean * q
    q_u -= u_mean * q
    ll, lu, uu = uu / determinant, -lu / determinant, ll / determinant
    n_l, n_u = ll * q_ll + lu * q_lu, ll * q_lu + lu * q_uu
    d_l, d_u = lu * q_ll + uu * q_lu, lu * q_lu + uu * q_uu
    state.c = inverse * inverse * q
    state.c_l = inverse * (ll * q_l + lu * q_u)
    state.c_u = inverse * (lu * q_l + uu * q_u)
    state.c_ll = max(n_l * ll + n_u * lu, 0.0)
    state.c_lu = d_l * ll + d_u * lu
    state.c_uu = max(d_l * lu + d_u * uu, 0.0)


def report(
    parameters: LogarithmicParameters,
    state: LogarithmicState,
    x: float,
    lx: float,
    noise: float,
) -> None:
    """Compute b, k, K and B, and the standard deviations of b, k, K, B and n.

    b and k are those at the displacement x [m]. lx is ln(x/x0), and noise is a variance [N^2].
    """
    theta, std, v0 = state.theta, state.std, parameters.v0
    n, damping = theta[EXPONENT], state.damping
    off = lx - state.l_mean
    origin = state.l_mean + parameters.log_x0
    base = state.level - damping * state.u_mean
    force = exp(clamp(base + n * off, -LARGEST_LOG, LARGEST_LOG))
    stiffness = exp(clamp(base - n * origin, -LARGEST_LOG, LARGEST_LOG))
    theta[B] = damping / v0 * force
    theta[K] = force / x
    theta[STIFFNESS] = stiffness
    theta[DAMPING] = damping / v0 * stiffness

    root = sqrt(noise)
    own = 1.0 - damping * state.u_mean
    std[B] = root * force / v0 * sqrt(variance(state, damping, damping * off, own))
    std[K] = root * theta[K] * sqrt(variance(state, 1.0, off, -state.u_mean))
    std[STIFFNESS] = root * stiffness * sqrt(variance(state, 1.0, -origin, -state.u_mean))
    std[DAMPING] = root * stiffness / v0 * sqrt(variance(state, damping, -damping * origin, own))
    std[EXPONENT] = root * sqrt(state.c_ll)


def variance(state: LogarithmicState, p: float, q: float, r: float) -> float:
    """Return the variance of p a + q n + r d for a noise variance of 1 N^2.

    a, n and d are the results of the fit y = a + n (l - l_mean) + d (u - u_mean), see `solve`.
    """
    total = p * (p * state.c + 2.0 * (q * state.c_l + r * state.c_u))
    total += q * (q * state.c_ll + 2.0 * r * state.c_lu) + r * r * state.c_uu
    return total if total > 0.0 else 0.0


class Logarithmic(Estimator):
    """Estimator of the Hunt-Crossley model f = K x^n + B x^n v by least squares on ln f.

        ln f = ln K + n ln x + z + (ln(1 + z) - z),    z = B v / K

    The right-hand side is linear in ln K, n and B/K, except for the remainder in brackets. Haddadi
    and Hashtrudi-Zaad omit the remainder, so |z| must be below 0.1. Here the remainder is
    linearised at the present estimate of z, so that there is no bias for z between -0.5 and 1.
    The weight of a sample is f^2 (predicted/f)^(3/2), where `predicted` is the force computed with
    the previous estimate. The factor f^2 is used because force noise of variance s causes noise of
    variance s/f^2 in ln f. The other factor removes the bias due to the noise in ln f and in f^2.

    b and k are the Kelvin-Voigt parameters at the present displacement: b = B x^n and
    k = K x^(n-1), so that b v + k x is the force. The initial guess is n = 1.5 +- 1 and
    B = 0 +- K/v0. If the motion does not determine n or B, its standard deviation does not change.

    References
    ----------
    A. Haddadi, K. Hashtrudi-Zaad, "Real-time identification of Hunt-Crossley dynamic models of
    contact environments", IEEE Trans. Robotics 28(3), 2012, is the source of the fit of ln f. It
    does not contain the linearised remainder, the weights and the standard deviations.

    Parameters
    ----------
    memory, displacement, velocity
        As in `DoubleStage`.
    threshold
        A sample with this force [N] or less, or with x < 1e-6 x0, does not change the estimate.
        The threshold must be > 0. A good value is one or two standard deviations of the noise. With
        a larger threshold, weak forces are used only if noise increases them, which causes a bias.
    correlation
        Correlation length of the force noise, in samples; 1 for white noise.

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)
    used_settings = ("forgetting", *SIZES)

    def __init__(
        self,
        memory: float,
        displacement: float = 5e-3,
        velocity: float = 25e-3,
        threshold: float = 0.03,
        correlation: float = 1.0,
    ) -> None:
        check_correlation(correlation)
        super().__init__(
            LogarithmicParameters(
                **contact_parameters(memory, displacement, velocity, threshold),
                correlation=correlation,
            ),
            LogarithmicState(
                [0.0, 0.0, 0.0, 0.0, HERTZ], [*[UNKNOWN] * 4, 1.0], False, *(0.0,) * 27
            ),
            names=NAMES,
        )

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        return cls(
            MEMORY * settings.memory,
            settings.x_size,
            settings.v_size,
            CONTACT_FORCE * settings.f_size,
            settings.correlation,
        )
