"""Compute the monitoring signals of all candidates (b, k), and the (b, k) with the smallest signal.

The monitoring signal of a candidate, equation (11) of the paper, is a quadratic form in (b, k). So
six exponentially weighted sums of products of f, v and x determine the signals of all candidates:

    mu(b, k) = ff - 2 b fv - 2 k fx + b^2 vv + 2 b k vx + k^2 xx.

The name of each sum is the product that is summed: vx is the sum of v x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.linear_gain import NOISE_MEMORY
from estimation.step import State


@dataclass(slots=True)
class MonitoringState(State):
    """Exponentially weighted sums of products of f, v and x, and an estimate of the noise.

    The weight of a sample decays as e^(-2 lambda t). The name of each sum is the product that is
    summed.
    """

    ff: float
    """Sum of f^2 [N^2 s]."""
    fv: float
    fx: float
    vv: float
    vx: float
    xx: float
    q_vv: float
    """Sum of v^2 with squared weights. `q_vx` and `q_xx` are the same sums of v x and x^2."""
    q_vx: float
    q_xx: float
    weights: float
    """Sum of the weights [s]."""
    dt: float
    """Time between the last two samples [s]. The next three fields depend on this time."""
    decay: float
    """Factor by which the sums are multiplied at each sample."""
    weight: float
    """Weight of the last sample [s]."""
    noise_share: float
    """Weight of the last sample in the mean from which `noise` is estimated."""
    evidence: float
    """Sum of the weights in the mean from which `noise` is estimated, from 0 to 1."""
    noise: float
    """Variance of the noise [N^2]."""


NO_SUMS = (0.0,) * 16
"""Initial values of the fields of `MonitoringState`, except the fields of `State`."""


def decay_and_add(
    twice_lambda: float, state: MonitoringState, v: float, x: float, f: float, dt: float
) -> None:
    """Multiply the sums by the forgetting factor, and add a sample v [m/s], x [m], f [N].

    If the force error e = b v + k x - f is constant over `dt`, equation (11) of the paper is
    mu <- exp(-2 lambda dt) mu + w e^2 with w = (1 - exp(-2 lambda dt)) / (2 lambda). e^2 is a sum
    of products of f, v and x.
    """
    if dt != state.dt:  # usually the sample period is constant
        state.dt = dt
        loss = -math.expm1(-twice_lambda * dt)
        state.decay = 1.0 - loss
        state.weight = loss / twice_lambda if twice_lambda > 0.0 else dt
        state.noise_share = dt / (NOISE_MEMORY + dt)
    decay, weight = state.decay, state.weight
    weighted_f, weighted_v = weight * f, weight * v
    vv, vx, xx = weighted_v * v, weighted_v * x, weight * x * x
    state.ff = state.ff * decay + weighted_f * f
    state.fv = state.fv * decay + weighted_f * v
    state.fx = state.fx * decay + weighted_f * x
    state.vv = state.vv * decay + vv
    state.vx = state.vx * decay + vx
    state.xx = state.xx * decay + xx
    decay_twice = decay * decay
    state.q_vv = state.q_vv * decay_twice + weight * vv
    state.q_vx = state.q_vx * decay_twice + weight * vx
    state.q_xx = state.q_xx * decay_twice + weight * xx
    state.weights = state.weights * decay + weight


def monitoring_signal(state: MonitoringState, b: float, k: float) -> float:
    """Return the monitoring signal [N^2 s], >= 0, of the candidate (b, k)."""
    mu = (
        state.ff
        + b * (b * state.vv - 2.0 * state.fv)
        + k * (k * state.xx - 2.0 * state.fx)
        + 2.0 * b * k * state.vx
    )
    return mu if mu > 0.0 else 0.0


UNDETERMINED = (0.0, 0.0, math.inf, math.inf)
"""Return value of `least_point` if the data do not determine b and k."""


def least_point(correlation: float, state: MonitoringState) -> tuple[float, float, float, float]:
    """Return the (b, k) with the smallest monitoring signal mu, and the variances of b and k.

    b and k are real numbers, which need not be candidates. They are the solution theta of the
    weighted normal equations R theta = r. R is the weighted sum of phi phi', and r is the weighted
    sum of phi f. Let Q be the same sum as R, but with squared weights. For white force noise with
    the variance s, the covariance of theta is s R^-1 Q R^-1. If the noise is correlated, this
    covariance is multiplied by `correlation`.

    The expected value of the smallest mu is s (sum of the weights - trace(R^-1 Q)). So s is
    estimated by the smallest mu divided by the expression in brackets. This estimate is averaged
    with the time constant `NOISE_MEMORY`.
    """
    vv, vx, xx = state.vv, state.vx, state.xx
    determinant = vv * xx - vx * vx
    if not determinant > 1e-12 * vv * xx + 1e-300:
        return UNDETERMINED
    inverse = 1.0 / determinant
    bb, bk, kk = xx * inverse, -vx * inverse, vv * inverse
    q_vv, q_vx, q_xx, weights = state.q_vv, state.q_vx, state.q_xx, state.weights
    b_v, b_x = bb * q_vv + bk * q_vx, bb * q_vx + bk * q_xx
    k_v, k_x = bk * q_vv + kk * q_vx, bk * q_vx + kk * q_xx
    freedom = weights - b_v - k_x
    if not freedom > 1e-6 * weights:
        return UNDETERMINED
    fv, fx = state.fv, state.fx
    b, k = bb * fv + bk * fx, bk * fv + kk * fx
    residual = state.ff - b * fv - k * fx
    share = state.noise_share
    evidence = state.evidence
    evidence += share * (1.0 - evidence)
    state.evidence = evidence
    share /= evidence * freedom
    state.noise += share * ((residual if residual > 0.0 else 0.0) - freedom * state.noise)
    noise = correlation * state.noise
    return b, k, noise * (b_v * bb + b_x * bk), noise * (k_v * bk + k_x * kk)


def deviation(variance: float, distance: float, most: float) -> float:
    """Return the root mean square error of a candidate value, sqrt(variance + distance^2).

    `least_point` computes the best real number for a parameter. `variance` is the variance of this
    number. `distance` is the difference between this number and the candidate value. The root mean
    square error is limited to `most`.
    """
    square = variance + distance * distance
    std = math.sqrt(square) if square > 0.0 else 0.0
    return std if std < most else most
