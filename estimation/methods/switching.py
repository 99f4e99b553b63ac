"""Multi-estimator with supervisory switching, so that the selected candidate changes less often."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from estimation.estimator import Estimates
from estimation.methods.candidates import least_candidate
from estimation.methods.grid import Grid
from estimation.methods.monitoring import (
    MonitoringState,
    decay_and_add,
    deviation,
    least_point,
    monitoring_signal,
)
from estimation.methods.multi_estimator import (
    TIE,
    MultiEstimator,
    MultiEstimatorParameters,
)
from estimation.step import B, K, Regressors


@dataclass(frozen=True, slots=True)
class SwitchingParameters(MultiEstimatorParameters):
    """Constant settings of the function `step`."""

    factor: float
    """1 + h, where h is the hysteresis."""
    dwell: float
    """Minimum time between switches [s]."""


@dataclass(slots=True)
class SwitchingState(MonitoringState):
    """Variables that the function `step` updates."""

    since: float
    """Time since the last switch [s]."""
    switches: int
    """Number of changes of the selected candidate."""


def step(
    parameters: SwitchingParameters,
    state: SwitchingState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Update the sums as in the multi-estimator, and select a candidate.

    The selected candidate changes only if the hysteresis and the dwell time permit it.
    """
    v, x = phi
    theta, b_axis, k_axis = state.theta, parameters.b, parameters.k
    decay_and_add(parameters.twice_lambda, state, v, x, f, dt)
    b, k = least_candidate(state, b_axis, k_axis, TIE)
    state.since += dt
    if state.since >= parameters.dwell:
        # the same small offset is added to each signal, so that no signal is zero
        offset = TIE * state.ff
        bound = parameters.factor * (monitoring_signal(state, b, k) + offset)
        if monitoring_signal(state, theta[B], theta[K]) + offset > bound:
            theta[B], theta[K] = b, k
            state.since = 0.0
            state.switches += 1
    b_free, k_free, b_variance, k_variance = least_point(parameters.correlation, state)
    state.std[B] = deviation(b_variance, b_free - theta[B], b_axis.span)
    state.std[K] = deviation(k_variance, k_free - theta[K], k_axis.span)


class SwitchingMultiEstimator(MultiEstimator):
    """Multi-estimator with scale-independent hysteresis switching.

    Let mu_p be the monitoring signal of candidate p, equation (11) of the paper. Let sigma be the
    selected candidate. The estimate is the (b, k) of sigma. There are two rules:

    - sigma does not change while mu_sigma <= (1 + h) min_p mu_p, or during the dwell time after a
      switch;
    - otherwise sigma becomes arg min_p mu_p.

    A common factor of all signals, such as the forgetting factor, has no effect. Noise does not
    cause chattering, and the number of switches per time is bounded. The selected candidate may
    differ from the (b, k) with the smallest signal. The standard deviations include this
    difference.

    References
    ----------
    J. P. Hespanha, D. Liberzon, A. S. Morse, "Hysteresis-based switching algorithms for
    supervisory control of uncertain systems", Automatica 39(2), 2003 (hysteresis); A. S. Morse,
    "Supervisory control of families of linear set-point controllers, part 1", IEEE Trans.
    Automatic Control 41(10), 1996 (dwell time). In these papers, a supervisor selects a candidate
    and switches to the controller for this candidate. Here there is no controller, because the
    selected candidate is the estimate.

    Parameters
    ----------
    grid, forgetting_rate, correlation
        As in `MultiEstimator`.
    hysteresis
        Hysteresis h, >= 0. Let the force differ from the model only by noise, and let the memory be
        N samples. Then sigma does not change while its distance from the minimum is at most about
        sqrt(h N) standard deviations.
    dwell
        Minimum time [s] between switches, >= 0.

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)  # type: ignore[assignment]  # it has more parameters
    gated = True
    parameter_type = SwitchingParameters
    parameters: SwitchingParameters
    state: SwitchingState

    def __init__(
        self,
        grid: Grid,
        forgetting_rate: float,
        hysteresis: float = 0.1,
        dwell: float = 0.0,
        correlation: float = 1.0,
    ) -> None:
        if not 0.0 <= hysteresis < math.inf:
            raise ValueError(f"hysteresis must be >= 0, got {hysteresis}")
        if not 0.0 <= dwell < math.inf:
            raise ValueError(f"dwell time must be >= 0, got {dwell}")
        super().__init__(grid, forgetting_rate, correlation, factor=1.0 + hysteresis, dwell=dwell)

    def first_state(self, parameters: SwitchingParameters) -> SwitchingState:
        """Return the state before the first sample. The first switch needs no dwell time."""
        return SwitchingState(
            **asdict(super().first_state(parameters)), since=parameters.dwell, switches=0
        )

    @property
    def sigma(self) -> tuple[int, int]:
        """Switching signal: the indices of the selected b and k on the axes of the grid."""
        b, k = self.grid.b, self.grid.k
        i = round((self.state.theta[B] - b.first) / b.spacing)
        return i, round((self.state.theta[K] - k.first) / k.spacing)

    @property
    def switches(self) -> int:
        """Number of changes of sigma. A change at the first sample is also counted."""
        return self.state.switches

    def note(self, estimates: Estimates) -> str | None:
        """Return the number of switches, the value of sigma, and the note of `MultiEstimator`."""
        switching = f"{self.switches} switches, at candidate {self.sigma}"
        edge = super().note(estimates)
        return f"{switching}; {edge}" if edge else switching
