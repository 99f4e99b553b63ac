"""Monitoring signals of all candidates (b, k) at once, and the error of the least point.

The monitoring signal (11) of a candidate is a quadratic form in (b, k), so six exponentially
decayed sums of products of (f, v, x) give the signal of every candidate:

    mu(b, k) = ff - 2 b fv - 2 k fx + b^2 vv + 2 b k vx + k^2 xx.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.linear_gain import NOISE_MEMORY
from estimation.step import State


@dataclass(slots=True)
class MonitoringState(State):
    """The sums; each sample's weight has decayed by e^(-2 lambda t)."""

    ff: float
    """Sum of f^2 [N^2 s]."""
    fv: float
    fx: float
    vv: float
    vx: float
    xx: float
    q_vv: float
    """Sum of v^2 with squared weights."""
    q_vx: float
    q_xx: float
    weights: float
    """Sum of the weights [s]."""
    dt: float
    """Time between the last two samples [s], and what follows from it:"""
    decay: float
    """the factor by which the sums decay,"""
    weight: float
    """the weight of the last sample [s],"""
    noise_share: float
    """and its share in the mean that is the noise."""
    evidence: float
    """Share of the noise memory that has been filled."""
    noise: float
    """Variance of the noise [N^2]."""


NO_SUMS = (0.0,) * 16
"""The fields of a `MonitoringState`, but for those of `State`, before the first sample."""


def decay_and_add(
    twice_lambda: float, state: MonitoringState, v: float, x: float, f: float, dt: float
) -> None:
    """Let the sums decay and add a sample.

    With the force error held over `dt`, (11) is exactly mu <- e^(-2 lambda dt) mu + w e^2
    with w = (1 - e^(-2 lambda dt)) / 2 lambda. Its e^2 = (b v + k x - f)^2 expands into
    products of (f, v, x).
    """
    if dt != state.dt:  # samples are even for most of the time
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
    """(11) of a candidate [N^2 s], not below 0 by rounding."""
    mu = (
        state.ff
        + b * (b * state.vv - 2.0 * state.fv)
        + k * (k * state.xx - 2.0 * state.fx)
        + 2.0 * b * k * state.vx
    )
    return mu if mu > 0.0 else 0.0


UNDETERMINED = (0.0, 0.0, math.inf, math.inf)
"""What `least_point` returns where the data do not determine b and k."""


def least_point(correlation: float, state: MonitoringState) -> tuple[float, float, float, float]:
    """The least point (b, k) of the quadratic form, and the variances of b and k there.

    It is weighted least squares, R theta = r. White noise of variance s gives it the covariance
    s R^-1 Q R^-1, with Q the sum of squared weights, and mu the expectation
    s (sum of weights - tr R^-1 Q), which gives s, as a mean over `NOISE_MEMORY`.
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
    """Root mean square error of a value at a distance from the least point, at most `most`."""
    square = variance + distance * distance
    std = math.sqrt(square) if square > 0.0 else 0.0
    return std if std < most else most
