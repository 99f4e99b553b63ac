"""Recursive least squares with exponential forgetting (RLS)."""

from __future__ import annotations

import math

from estimation.compiled import State
from estimation.estimator import Estimates, Estimator, positive_pair

WINDUP = 1e10
"""A variance grows by forgetting to this multiple of its initial value at the most."""


def step(parameters: State, state: State, v: float, x: float, f: float, dt: float) -> State:
    """(3)-(4) for the regressors phi = [v, x] with P = [[p_bb, p_bk], [p_bk, p_kk]]."""
    beta, rate, p_bb_max, p_kk_max = parameters
    b, k, p_bb, p_bk, p_kk = state
    if rate > 0.0:
        beta = math.exp(-rate * dt)
    beta = min(max(beta, p_bb / p_bb_max, p_kk / p_kk_max), 1.0)
    phi_b = p_bb * v + p_bk * x
    phi_k = p_bk * v + p_kk * x
    scale = beta + v * phi_b + x * phi_k
    gain_b = phi_b / scale
    gain_k = phi_k / scale
    error = f - (b * v + k * x)
    return (
        b + gain_b * error,
        k + gain_k * error,
        (p_bb - gain_b * phi_b) / beta,
        (p_bk - gain_b * phi_k) / beta,
        (p_kk - gain_k * phi_k) / beta,
    )


class RecursiveLeastSquares(Estimator):
    """Recursive least squares with exponential forgetting, the paper's (3)-(4).

    Minimises sum_n beta^(N-n) (f_n - phi_n' theta)^2 + beta^N theta' P0^-1 theta.

    Without motion nothing is learned while forgetting goes on, and the covariance grows by
    1/beta a sample, or at once over a gap in the data. It grows no further once a variance is
    `WINDUP` times its initial value, before double precision gives out; a recording with
    motion does not come near.

    Parameters
    ----------
    forgetting
        The forgetting factor beta, 0 < beta <= 1.
    initial_covariance
        Diagonal of P0, for b [(N s/m)^2] and k [(N/m)^2] per N^2 of force variance.
    sample_period
        Time [s] over which a sample's weight falls by beta. Given it, forgetting honours a
        varying `dt`; without, a weight falls by beta each sample whatever the `dt`.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    step = staticmethod(step)

    def __init__(
        self,
        forgetting: float,
        initial_covariance: tuple[float, float],
        sample_period: float | None = None,
    ) -> None:
        if not 0.0 < forgetting <= 1.0:
            raise ValueError(f"forgetting factor must be in (0, 1], got {forgetting}")
        if sample_period is not None and not 0.0 < sample_period < math.inf:
            raise ValueError(f"sample period must be positive, got {sample_period}")
        p_bb, p_kk = positive_pair("initial covariance", initial_covariance)
        rate = -math.log(forgetting) / sample_period if sample_period else 0.0
        super().__init__(
            (forgetting, rate, WINDUP * p_bb, WINDUP * p_kk), (0.0, 0.0, p_bb, 0.0, p_kk)
        )

    def note(self, estimates: Estimates) -> str | None:
        """Whether the covariance has wound up."""
        _, _, p_bb_max, p_kk_max = self.parameters
        if self.state[2] > 0.5 * p_bb_max or self.state[4] > 0.5 * p_kk_max:
            return "too little motion: the covariance has wound up and forgetting is held"
        return None
