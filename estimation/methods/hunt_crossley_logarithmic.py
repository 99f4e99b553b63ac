"""Single-stage identification of the Hunt-Crossley model on the logarithm of force."""

from __future__ import annotations

from math import exp, log, log1p, sqrt

from estimation.checks import check_correlation
from estimation.compiled import Parameters, Regressors, State
from estimation.estimator import UNKNOWN, Estimator
from estimation.linear_gain import NOISE_MEMORY

NAMES = ("b", "k", "K", "B", "n")
"""Damping and stiffness at the present displacement, and K, B and n of the model."""
HERTZ = 1.5
"""Exponent of a sphere on a plane: taken where samples do not tell."""
STEEPEST = 5.0
"""Largest exponent; the least is 0."""
PRIOR = 1e-8
"""Weight of n = 1.5 and B = 0, each give or take one, as a share of the samples' weight."""
TOUCH = 1e-6
"""Least displacement in contact, as a share of the typical one."""
LARGEST_LOG = 230.0
"""Largest logarithm of a force or stiffness that is reported."""


def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
    """Weighted least squares of ln f on (1, lx, u), lx = ln x/x0, u = v/v0, and what it says.

    With the damping so far in z, ln f = ln K + n lx + ln(1 + B v/K) is linearised to
    ln f - ln(1 + z) + z/(1 + z) = ln K + n lx + (v0 B/K) u/(1 + z).
    """
    x = phi[1] / parameters[1]
    if x < TOUCH or f <= parameters[3]:
        state[10] = 1.0
        return
    lx, u = log(x), phi[0] / parameters[2]
    level, slope, damping = state[26], state[4], state[27]
    z = min(max(damping * u, -0.5), 1.0)
    u /= 1.0 + z
    y = log(f) - log1p(z) + z / (1.0 + z)
    error = y - level - slope * (lx - state[28]) - damping * (u - state[29])
    weight = f * f
    if state[11] > 0.0:
        weight *= exp(-1.5 * min(max(error, -0.7), 0.7))
        spread = 1.0 + weight * variance(state, 1.0, lx - state[28], u - state[29])
        share = dt / (NOISE_MEMORY + dt)
        state[36] += share * (1.0 / spread - state[36])
        share /= spread * state[36]
        error = f * (1.0 - exp(-min(max(error, -30.0), 30.0)))
        state[37] += share * (error * error / spread - state[37])
    noise = max(state[37], 1e-12 * f * f)

    beta = exp(-dt * parameters[0])
    gather(state, beta, weight, lx, u, y)
    solve(state, noise)

    noise *= parameters[4]
    level, slope, damping = state[26], state[4], state[27]
    l_mean, u_mean = state[28], state[29]
    origin = l_mean + parameters[5]
    base = level - damping * u_mean
    static = exp(min(max(base + slope * (lx - l_mean), -LARGEST_LOG), LARGEST_LOG))
    stiffness = exp(min(max(base - slope * origin, -LARGEST_LOG), LARGEST_LOG))
    per_v = damping / parameters[2]
    own = 1.0 - damping * u_mean
    lx -= l_mean
    state[0] = per_v * static
    state[1] = static / phi[1]
    state[2] = stiffness
    state[3] = per_v * stiffness
    root = sqrt(noise)
    state[5] = root * static / parameters[2] * sqrt(variance(state, damping, damping * lx, own))
    state[6] = root * state[1] * sqrt(variance(state, 1.0, lx, -u_mean))
    state[7] = root * stiffness * sqrt(variance(state, 1.0, -origin, -u_mean))
    state[8] = (
        root * stiffness / parameters[2] * sqrt(variance(state, damping, -damping * origin, own))
    )
    state[9] = root * sqrt(state[33])


def gather(state: State, beta: float, weight: float, lx: float, u: float, y: float) -> None:
    """Let the sums fall by beta and add a sample: R from state[11] on, r from 17, Q from 20."""
    w_l, w_u = weight * lx, weight * u
    state[11] = beta * state[11] + weight
    state[12] = beta * state[12] + w_l
    state[13] = beta * state[13] + w_u
    state[14] = beta * state[14] + w_l * lx
    state[15] = beta * state[15] + w_l * u
    state[16] = beta * state[16] + w_u * u
    state[17] = beta * state[17] + weight * y
    state[18] = beta * state[18] + w_l * y
    state[19] = beta * state[19] + w_u * y
    beta *= beta
    state[20] = beta * state[20] + weight
    state[21] = beta * state[21] + w_l
    state[22] = beta * state[22] + w_u
    state[23] = beta * state[23] + w_l * lx
    state[24] = beta * state[24] + w_l * u
    state[25] = beta * state[25] + w_u * u


def solve(state: State, noise: float) -> None:
    """The level, n and v0 B/K, the means of lx and u, and the covariance by noise variance.

    About these weighted means the level, ln f there, is on its own. The covariance is
    R^-1 Q R^-1: noise in ln f has the variance s/f^2, and so Q is the sum of weights that have
    fallen twice.
    """
    inverse = 1.0 / state[11]
    l_mean, u_mean = inverse * state[12], inverse * state[13]
    prior = PRIOR * state[11]
    ll = max(state[14] - state[12] * l_mean, 0.0) + prior
    lu = state[15] - state[12] * u_mean
    uu = max(state[16] - state[13] * u_mean, 0.0) + prior
    determinant = max(ll * uu - lu * lu, 1e-12 * ll * uu)
    ly = state[18] - state[17] * l_mean + HERTZ * prior
    uy = state[19] - state[17] * u_mean
    slope = min(max((uu * ly - lu * uy) / determinant, 0.0), STEEPEST)
    state[4] = slope
    state[26] = inverse * state[17]
    state[27] = min(max((uy - lu * slope) / uu, -10.0), 10.0)
    state[28], state[29] = l_mean, u_mean

    q, q_l, q_u = state[20], state[21], state[22]
    first_guess = prior * (prior / noise)
    q_ll = state[23] + l_mean * (l_mean * q - 2.0 * q_l) + first_guess
    q_lu = state[24] + l_mean * (u_mean * q - q_u) - u_mean * q_l
    q_uu = state[25] + u_mean * (u_mean * q - 2.0 * q_u) + first_guess
    q_l -= l_mean * q
    q_u -= u_mean * q
    ll, lu, uu = uu / determinant, -lu / determinant, ll / determinant
    n_l, n_u = ll * q_ll + lu * q_lu, ll * q_lu + lu * q_uu
    c_l, c_u = lu * q_ll + uu * q_lu, lu * q_lu + uu * q_uu
    state[30] = inverse * inverse * q
    state[31] = inverse * (ll * q_l + lu * q_u)
    state[32] = inverse * (lu * q_l + uu * q_u)
    state[33] = max(n_l * ll + n_u * lu, 0.0)
    state[34] = c_l * ll + c_u * lu
    state[35] = max(c_l * lu + c_u * uu, 0.0)


def variance(state: State, p: float, q: float, r: float) -> float:
    """That of p level + q n + r B/K by the covariance in the state, by noise variance."""
    total = p * (p * state[30] + 2.0 * (q * state[31] + r * state[32]))
    total += q * (q * state[33] + 2.0 * r * state[34]) + r * r * state[35]
    return total if total > 0.0 else 0.0


class Logarithmic(Estimator):
    """Hunt-Crossley f = K x^n + B x^n v by one recursive least squares on ln f.

        ln f = ln K + n ln x + z + (ln(1 + z) - z),    z = B v / K

    is linear in ln K, n and B/K but for the remainder in brackets. The paper leaves it out, so
    that |z| < 0.1 is needed. Here it is put back: linearised at the estimate so far, which
    leaves no bias for z between -0.5 and 1. Noise of the force with variance s has s/f^2 in
    ln f, so a sample weighs f^2; times (estimate/f)^(3/2), by which the weight's and the
    logarithm's own bias cancel to second order in noise.

    b and k are what Kelvin-Voigt reads at the present displacement: b = B x^n and
    k = K x^(n-1), so that b v + k x is the force. Deviations are those of weighted least
    squares; where motion does not tell, those of the first guess n = 1.5 and B = 0, each give
    or take one (B in units of K/v0).

    References
    ----------
    A. Haddadi, K. Hashtrudi-Zaad, "Real-time identification of Hunt-Crossley dynamic models of
    contact environments", IEEE Trans. Robotics 28(3), 2012 (the logarithm). The remainder, the
    weights and the intervals are ours.

    Parameters
    ----------
    memory
        Time [s] over which a sample's weight falls by e.
    displacement, velocity
        Typical ones, x0 [m] and v0 [m/s], by which both are divided inside.
    threshold
        Force [N] up to which a sample is taken for no contact, > 0: one or two deviations of
        its noise, since a higher one takes weak forces in only where noise lifts them. So is a
        sample with x <= 0. The estimate is held then.
    correlation
        Samples for each independent one, see `LinearGainEstimator`.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    step = staticmethod(step)
    helpers = (gather, solve, variance)

    def __init__(
        self,
        memory: float,
        displacement: float = 5e-3,
        velocity: float = 25e-3,
        threshold: float = 0.03,
        correlation: float = 1.0,
    ) -> None:
        check_contact(memory, displacement, velocity, threshold)
        check_correlation(correlation)
        super().__init__(
            (
                1.0 / memory,
                displacement,
                velocity,
                threshold,
                correlation,
                log(displacement),
            ),
            (0.0, 0.0, 0.0, 0.0, HERTZ, *[UNKNOWN] * 4, 1.0, *[0.0] * 28),
            names=NAMES,
        )


def check_contact(memory: float, displacement: float, velocity: float, threshold: float) -> None:
    """Raise ValueError unless all are positive and of a size that can be squared."""
    for name, value in (
        ("memory", memory),
        ("displacement", displacement),
        ("velocity", velocity),
        ("threshold", threshold),
    ):
        if not 1e-30 <= value <= 1e30:
            raise ValueError(f"{name} must be positive, got {value}")
