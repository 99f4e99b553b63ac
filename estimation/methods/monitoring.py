"""Compute the monitoring signals of a multi-estimator: weighted sums of the squared force errors.

A multi-estimator compares candidates (b, k), which are pairs of a damping and a stiffness. The
force error of a candidate is e = b v + k x - f. The monitoring signal mu of a candidate is the sum
of the weighted e^2 of all past samples (T. Yamamoto et al., BioRob 2008, equation (11)). The
weights decrease exponentially with the age of a sample. mu is a quadratic function of (b, k), so
six weighted sums determine the signals of all candidates:

    mu(b, k) = ff - 2 b fv - 2 k fx + b^2 vv + 2 b k vx + k^2 xx.

The name of each sum is the product that is summed. For example, vx is the weighted sum of v x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.linear_gain import NOISE_MEMORY
from estimation.step import State


@dataclass(slots=True)
class MonitoringState(State):
    """State of a multi-estimator: weighted sums of products of f, v and x, and the noise variance.

    The weight of a sample is its duration, multiplied by exp(-2 lambda t). lambda is the forgetting
    rate [1/s], and t is the age of the sample [s]. The name of each sum is the product that is
    summed. For example, `vx` is the weighted sum of v x.
    """

    ff: float
    """Sum of f^2 [N^2 s]."""
    fv: float
    fx: float
    vv: float
    vx: float
    xx: float
    q_vv: float
    """Sum of v^2 with squared weights. `q_vx` and `q_xx` are such sums of v x and x^2."""
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
    """Weight of the last sample in the mean over time from which `noise` is estimated."""
    evidence: float
    """Sum of the weights in the mean over time from which `noise` is estimated, from 0 to 1."""
    noise: float
    """Estimated variance of the force noise [N^2]."""


NO_SUMS = (0.0,) * 16
"""Initial values of the fields of `MonitoringState`, except the fields of `State`."""


def decay_and_add(
    twice_lambda: float, state: MonitoringState, v: float, x: float, f: float, dt: float
) -> None:
    """Multiply the weighted sums by the forgetting factor, and add a sample.

    The sums are those of f^2, f v, f x, v^2, v x and x^2. They determine the monitoring signal mu
    of each candidate (b, k), which follows

        d mu / dt = -2 lambda mu + e^2,    e = b v + k x - f.

    If the force error e is constant over the time dt, the solution is

        mu <- exp(-2 lambda dt) mu + w e^2,    w = (1 - exp(-2 lambda dt)) / (2 lambda).

    Each sum is updated by the same equation, with its product instead of e^2.
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
    """Return the monitoring signal of (b, k): the weighted sum of (b v + k x - f)^2 [N^2 s], >= 0.

    The sum is over all past samples. The weights decrease exponentially with the age of a sample.
    """
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
    """Return the real numbers b and k that minimise the monitoring signal, and their variances.

    The monitoring signal mu is the weighted sum of (b v + k x - f)^2. The weights decrease
    exponentially with the age of a sample. The minimum is over all real b and k, not only over the
    candidates of a multi-estimator. With phi = (v, x), the minimum theta = (b, k) is the solution
    of R theta = r. R is the weighted sum of phi phi', and r is the weighted sum of phi f.

    Let Q be the sum of phi phi' with the squared weights. If the force noise is white and has the
    variance s, the covariance of theta is s R^-1 Q R^-1. If the noise is correlated, this
    covariance is multiplied by `correlation`.

    The variance s is estimated from the smallest mu. The expected value of this mu is c s, where
    c is (sum of the weights) - trace(R^-1 Q). So mu / c is an estimate of s. It is computed at each
    sample, and these values are averaged with the time constant `NOISE_MEMORY`.

    The result is b [N s/m], k [N/m] and their variances: (0, 0, inf, inf) if the data do not
    determine them. The estimate of the noise variance s in the state is updated.
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
    """Return the root mean square error of the value of b or k that a multi-estimator selects.

    A multi-estimator can select only a candidate value from a grid. The real number that fits the
    data best is usually between two candidate values. So the root mean square error is
    sqrt(variance + distance^2). The result is at most `most`.

    `variance` is that of the real number that fits the data best, and `distance` its distance from
    the selected candidate value.
    """
    square = variance + distance * distance
    std = math.sqrt(square) if square > 0.0 else 0.0
    return std if std < most else most
