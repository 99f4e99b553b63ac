"""Multi-estimator (ME): select the candidate (b, k) with the smallest squared force errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.checks import check_correlation
from estimation.estimator import Estimates, Estimator
from estimation.method_settings import MethodSettings
from estimation.methods.candidates import GridAxis, grid_axis, least_candidate
from estimation.methods.grid import Grid
from estimation.methods.monitoring import (
    NO_SUMS,
    MonitoringState,
    decay_and_add,
    deviation,
    least_point,
)
from estimation.step import B, K, Regressors

Indices = NDArray[np.int64]

TIE = 1e-9
"""Weight of the tie-breaking term in each monitoring signal, see `MultiEstimator`."""
FASTEST = 1e6
"""Largest forgetting rate [1/s]."""


@dataclass(frozen=True, slots=True)
class MultiEstimatorParameters:
    """Constant settings of the estimator `MultiEstimator`."""

    twice_lambda: float
    """Rate 2 lambda at which the weight of a sample decays [1/s]; lambda is the forgetting rate."""
    b: GridAxis
    """Candidate values of the damping [N s/m]."""
    k: GridAxis
    """Candidate values of the stiffness [N/m]."""
    correlation: float
    """Correlation length of the force noise, in samples, >= 1; 1 for white noise."""


def step(
    parameters: MultiEstimatorParameters,
    state: MonitoringState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Process one sample, and select the candidate (b, k) with the smallest monitoring signal.

    The monitoring signal is the weighted sum of the squared force errors of a candidate. The sample
    is first added to the sums from which the signals of all candidates are computed. The standard
    deviations of b and k are also computed.
    """
    v, x = phi
    b_axis, k_axis = parameters.b, parameters.k
    decay_and_add(parameters.twice_lambda, state, v, x, f, dt)
    b_free, k_free, b_variance, k_variance = least_point(parameters.correlation, state)
    b, k = least_candidate(state, b_axis, k_axis, TIE)
    state.theta[B], state.theta[K] = b, k
    state.std[B] = deviation(b_variance, b_free - b, b_axis.span)
    state.std[K] = deviation(k_variance, k_free - k, k_axis.span)


class MultiEstimator(Estimator):
    """Multi-estimator: select the best pair (b, k) from a grid of candidates.

    The method is that of T. Yamamoto et al., "Techniques for environment parameter estimation
    during telemanipulation", BioRob 2008, equations (10) and (11). Each point of the grid is a
    candidate (b, k). The monitoring signal of a candidate is the integral of the squared force
    error (b v + k x - f)^2. Old errors have exponentially smaller weights. The estimate is the
    candidate with the smallest monitoring signal.

    The signal is a quadratic function of (b, k). The minimum of this function over the grid is
    found without evaluating all candidates, so the computing time does not depend on the size of
    the grid.

    If several candidates have equal signals, the candidate nearest to (b, k) = (0, 0) is selected.
    For example, the data do not determine the damping while v is zero. The estimate of b is then
    the candidate value nearest to zero. For this purpose, a small term is added to each signal. The
    term does not change the result for candidates that the data distinguish: the signal of the
    selected candidate is larger than the smallest signal by at most 2 `TIE` times the integral that
    is the third factor below. If v and x are collinear within about 1e-4 of their size, another
    candidate than that of equation (11) can therefore be selected. Let B be the
    difference between the largest and the smallest candidate value of b, and K that of k. The term
    of a candidate (b, k) is the product of three factors:

    - the constant `TIE`;
    - ((b - b_0) / B)^2 + ((k - k_0) / K)^2, where (b_0, k_0) is the candidate nearest to (0, 0);
    - the integral of f^2 + (B v)^2 + (K x)^2, with the same weights as in the signal.

    Parameters
    ----------
    grid
        The candidate values of b and of k.
    forgetting_rate
        Forgetting rate lambda [1/s], >= 0. The weight of a squared force error of the age t is
        exp(-2 lambda t).
    correlation
        Correlation length of the force noise, in samples, see `LinearGainEstimator`.
    own
        Further settings, by name. Only a subclass whose function `step` needs further settings
        gives them.

    Raises
    ------
    ValueError
        The forgetting rate or the correlation is out of its range.
    """

    step = staticmethod(step)
    gated = False
    used_settings: ClassVar[tuple[str, ...] | None] = ("grid", "forgetting_rate")
    parameter_type: ClassVar[type[MultiEstimatorParameters]] = MultiEstimatorParameters
    parameters: MultiEstimatorParameters
    state: MonitoringState

    def __init__(
        self, grid: Grid, forgetting_rate: float, correlation: float = 1.0, **own: Any
    ) -> None:
        if not 0.0 <= forgetting_rate <= FASTEST:
            raise ValueError(
                f"forgetting rate must be between 0 and {FASTEST:g}/s, got {forgetting_rate}"
            )
        check_correlation(correlation)
        self.grid = grid
        axes = grid_axis(grid.b), grid_axis(grid.k)
        parameters = self.parameter_type(2.0 * forgetting_rate, *axes, correlation, **own)
        super().__init__(parameters, self.first_state(parameters))

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        return cls(settings.grid, settings.forgetting_rate, settings.correlation)

    def first_state(self, parameters: Any) -> MonitoringState:
        """Return the state before the first sample.

        The estimate is then the candidate (b, k) nearest to (0, 0). The standard deviation of b is
        the difference between the largest and the smallest candidate value of b, and that of k is
        computed in the same way. `parameters` contains the constant settings.
        """
        axes = parameters.b, parameters.k
        zero = [axis.first + axis.zero * axis.spacing for axis in axes]
        spans = [axis.span for axis in axes]
        return MonitoringState(zero, spans, False, *NO_SUMS)

    def monitoring_signal(self, b: Floats | float, k: Floats | float) -> Floats:
        """Return the monitoring signals [N^2 s] of candidates (b, k), >= 0.

        The monitoring signal is the weighted integral of the squared force error (b v + k x - f)^2.

        Parameters
        ----------
        b, k
            Damping [N s/m] and stiffness [N/m] of the candidates: numbers or arrays. Arrays of
            different shapes are broadcast as in numpy. The result has the broadcast shape.
        """
        s = self.state
        b, k = np.asarray(b, dtype=np.float64), np.asarray(k, dtype=np.float64)
        signal = s.ff + b * (b * s.vv - 2.0 * s.fv) + k * (k * s.xx - 2.0 * s.fx)
        return np.maximum(signal + 2.0 * b * k * s.vx, 0.0)

    def ties(self, margin: float) -> Floats:
        """Return the candidates whose monitoring signal is nearly as small as that of the estimate.

        The monitoring signal is the weighted integral of the squared force error. A candidate
        (b, k) is returned if its signal is at most (1 + margin) times the signal of the estimate.

        Parameters
        ----------
        margin
            Relative margin, >= 0. For example, 0.1 permits signals that are 10 % larger than the
            signal of the estimate.

        Returns
        -------
        Array of shape (n, 2). Each row is a candidate (b, k). The estimate is one of the rows.

        Raises
        ------
        ValueError
            The margin is negative.
        """
        first, last = self.tied_rows(margin)
        k = self.grid.k.values
        rows = [
            np.column_stack((np.full(max(0, b_last - b_first + 1), b), k[b_first : b_last + 1]))
            for b, b_first, b_last in zip(self.grid.b.values, first, last, strict=True)
        ]
        return np.concatenate(rows)

    def tied_rows(self, margin: float) -> tuple[Indices, Indices]:
        """Return the same candidates as the method `ties`, as ranges of indices of k.

        These are the candidates (b, k) whose monitoring signal is nearly as small as that of the
        estimate. For each value of b, such candidates have successive values of k. So the first and
        the last index of k are sufficient. The computing time does not depend on the number of
        values of k.

        Parameters
        ----------
        margin
            Relative margin of the monitoring signal, >= 0, as in `ties`.

        Returns
        -------
        Two arrays of integers with one element for each candidate value of b: the first and the
        last index of k. If there is no such candidate with this b, the first index is larger than
        the last index.

        Raises
        ------
        ValueError
            The margin is negative.
        """
        if not margin >= 0.0:
            raise ValueError(f"margin must be >= 0, got {margin}")
        winner = self.estimate
        s = self.state
        ff, fv, fx, vv, vx, xx = s.ff, s.fv, s.fx, s.vv, s.vx, s.xx
        rounding = 1e-12 * ff
        bound = (1.0 + margin) * float(self.monitoring_signal(winner.b, winner.k)) + rounding
        b, axis = self.grid.b.values, self.grid.k
        half = b * vx - fx
        rest = ff + b * (b * vv - 2.0 * fv) - bound
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(half**2 - xx * rest)
            low = (-half - root) / xx
            high = (-half + root) / xx
        if xx == 0.0:
            low = np.where(rest <= 0.0, -np.inf, np.nan)
            high = -low
        low = np.where(np.isnan(low), np.inf, (low - axis.first) / axis.spacing)
        high = np.where(np.isnan(high), -np.inf, (high - axis.first) / axis.spacing)
        first = np.ceil(np.clip(low - 1e-9, 0, axis.count)).astype(np.int64)
        last = np.floor(np.clip(high + 1e-9, -1, axis.count - 1)).astype(np.int64)
        row = round((winner.b - self.grid.b.first) / self.grid.b.spacing)
        column = round((winner.k - axis.first) / axis.spacing)
        first[row], last[row] = min(first[row], column), max(last[row], column)
        return first, last

    @property
    def at_edge(self) -> tuple[str, ...]:
        """Names of the parameters ("b", "k") whose estimate is at the edge of the grid.

        An estimate at the edge is the smallest or the largest candidate value of the parameter.
        """
        edges = self.edges()
        return tuple(name for name in edges if getattr(self.estimate, name) in edges[name])

    def edges(self) -> dict[str, tuple[float, float]]:
        """Return the smallest and the largest candidate value of each parameter ("b", "k")."""
        axes = {"b": self.parameters.b, "k": self.parameters.k}
        return {
            name: (axis.first, axis.first + axis.last * axis.spacing) for name, axis in axes.items()
        }

    def note(self, estimates: Estimates) -> str | None:
        """Return a warning if the estimate of b or k is at the edge of the grid; otherwise None.

        An estimate at the edge is the smallest or the largest candidate value of the parameter.
        There is a warning if the present estimate is at the edge, or if at least 10 % of
        `estimates` are at the edge. `estimates` contains the estimates after each sample.
        """
        shares = {
            name: float(np.mean(np.isin(getattr(estimates, name), edges)))
            for name, edges in self.edges().items()
            if len(estimates.b)
        }
        at_edge = [
            f"in {name} in {share:.0%} of the samples"
            for name, share in shares.items()
            if share >= 0.1 or name in self.at_edge
        ]
        return f"the estimate is at the grid's edge {' and '.join(at_edge)}" if at_edge else None
