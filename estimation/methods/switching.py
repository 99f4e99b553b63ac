"""Supervisory switching: the multi-estimator whose candidate changes only when it must."""

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
    """Parameters of `step`."""

    factor: float
    """1 + h, h the hysteresis."""
    dwell: float
    """Least time between switches [s]."""


@dataclass(slots=True)
class SwitchingState(MonitoringState):
    """State of `step`."""

    since: float
    """Time since the last switch [s]."""
    switches: int
    """How often the candidate has changed."""


def step(
    parameters: SwitchingParameters,
    state: SwitchingState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Decay and add as the multi-estimator; then switch, if hysteresis and dwell time allow."""
    v, x = phi
    theta, b_axis, k_axis = state.theta, parameters.b, parameters.k
    decay_and_add(parameters.twice_lambda, state, v, x, f, dt)
    b, k = least_candidate(state, b_axis, k_axis, TIE)
    state.since += dt
    if state.since >= parameters.dwell:
        # the same share of the force is added to each signal, so that none is zero
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
    """The multi-estimator under a supervisor's scale-independent hysteresis switching.

    Of the candidates p with the monitoring signals mu_p, (11), sigma is reported:

        sigma stays while mu_sigma <= (1 + h) min_p mu_p, or for the dwell time after a switch;
        then sigma = arg min_p mu_p.

    A factor common to all signals, such as the one by which they are forgotten, cancels. So
    noise does not make the estimate chatter, and the switches in a time are bounded. What is
    reported may be off the least point; its standard deviations grow by as much.

    References
    ----------
    J. P. Hespanha, D. Liberzon, A. S. Morse, "Hysteresis-based switching algorithms for
    supervisory control of uncertain systems", Automatica 39(2), 2003 (hysteresis); A. S. Morse,
    "Supervisory control of families of linear set-point controllers, part 1", IEEE Trans.
    Automatic Control 41(10), 1996 (dwell time). They switch controllers; here the supervisor
    alone is taken, since what it selects is the estimate.

    Parameters
    ----------
    grid, forgetting_rate, correlation
        As `MultiEstimator`.
    hysteresis
        h, >= 0. With N samples in memory and noise alone, sigma stays while it is nearer than
        about sqrt(h N) standard deviations to the least point.
    dwell
        Least time [s] between switches, >= 0.

    Raises
    ------
    ValueError
        A parameter is out of its range.
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
        """The state before the first sample, which may switch at once."""
        return SwitchingState(
            **asdict(super().first_state(parameters)), since=parameters.dwell, switches=0
        )

    @property
    def sigma(self) -> tuple[int, int]:
        """The switching signal: indices of the reported damping and stiffness on their axes."""
        b, k = self.grid.b, self.grid.k
        i = round((self.state.theta[B] - b.first) / b.spacing)
        return i, round((self.state.theta[K] - k.first) / k.spacing)

    @property
    def switches(self) -> int:
        """How often sigma has changed; the first sample's choice counts."""
        return self.state.switches

    def note(self, estimates: Estimates) -> str | None:
        """How often sigma changed and where it is, and what the multi-estimator says."""
        told = f"{self.switches} switches, at candidate {self.sigma}"
        edge = super().note(estimates)
        return f"{told}; {edge}" if edge else told
