"""Multi-estimator whose estimate changes less often, due to a hysteresis and a dwell time.

A multi-estimator selects its estimate from a grid of candidates (b, k).
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Self

from estimation.estimator import Estimates
from estimation.method_settings import MethodSettings
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

FORGETTING = 1.5
"""Forgetting rate of `me_switching`, in units of the forgetting rate of `me`.

The settling time (see `benchmarks/tuning.py`) is 0.28 s, and 0.33 s for 0.8 times this value.
"""
HYSTERESIS = 0.05
"""Hysteresis h of `me_switching`, which switches between candidates (b, k).

The selected candidate changes only if its monitoring signal exceeds 1 + h times the smallest
monitoring signal. With the settings of the paper, the memory is N = 33 samples. So the candidate
does not change while it is at most sqrt(h N) = 1.3 standard deviations away from the minimum.

The settling time is 0.28 s, and noise causes 29 switches per second. With 0.1 times this value
there are 69 switches per second. With 10 times this value there are 2 switches per second, and the
settling time is 0.33 s.
"""
DWELL = 0.25
"""Minimum time between two switches of `me_switching`, in units of the memory.

During this time, the weight of the past samples in `me_switching` decreases by
1 - exp(-`FORGETTING` / 4) = 31 %. The settling time is 0.28 s, and 0.37 s for 10 times
this value. The settling time for 0.5 times this value and that for 2 times this value differ by
0.02 s.
"""


@dataclass(frozen=True, slots=True)
class SwitchingParameters(MultiEstimatorParameters):
    """Constant settings of the switching multi-estimator."""

    factor: float
    """1 + h, with the hysteresis h of `SwitchingMultiEstimator`."""
    dwell: float
    """Minimum time between two changes of the selected candidate [s]."""


@dataclass(slots=True)
class SwitchingState(MonitoringState):
    """Variables of the switching multi-estimator that change at each sample."""

    since: float
    """Time since the last change of the selected candidate [s]."""
    switches: int
    """Number of changes of the selected candidate."""


def step(
    parameters: SwitchingParameters,
    state: SwitchingState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Process one sample: update the sums of products of f, v and x, and select a candidate (b, k).

    The sums are those of `MultiEstimator`. The selected candidate changes only if the hysteresis
    and the dwell time permit it, see `SwitchingMultiEstimator`.
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
    """Multi-estimator whose estimate changes less often, due to a hysteresis and a dwell time.

    A multi-estimator selects its estimate from a grid of candidates (b, k). The monitoring signal
    mu_p of candidate p is a weighted integral of its squared force error, equation (11) of the
    paper. Let sigma be the selected candidate. There are two rules:

    - sigma does not change while mu_sigma <= (1 + h) min_p mu_p, or during the dwell time after the
      last change;
    - otherwise sigma becomes the candidate with the smallest monitoring signal, arg min_p mu_p.

    So noise does not cause frequent changes (chattering), and the number of changes per time is
    bounded. If all signals are multiplied by the same factor, sigma does not change. The selected
    candidate may differ from the (b, k) with the smallest signal. The standard deviations include
    this difference.

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
    grid
        The candidates.
    forgetting_rate
        lambda in equation (11) [1/s], >= 0. The weight of a squared error decays as
        e^(-2 lambda t).
    hysteresis
        Hysteresis h, >= 0. For example, let the force differ from the model only by white noise,
        and let the estimate use N recent samples. Then sigma does not change while the selected
        (b, k) differs from the (b, k) with the smallest signal by at most about sqrt(h N) standard
        deviations.
    dwell
        Dwell time: minimum time between two changes of sigma [s], >= 0.
    correlation
        Correlation length of the force noise, in samples; 1 for white noise.

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)  # type: ignore[assignment]  # it has more parameters
    gated = True
    parameter_type = SwitchingParameters
    used_settings = ("forgetting", "grid", "forgetting_rate")
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

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        return cls(
            settings.grid,
            FORGETTING * settings.forgetting_rate,
            HYSTERESIS,
            DWELL * settings.memory,
            settings.correlation,
        )

    def first_state(self, parameters: SwitchingParameters) -> SwitchingState:
        """Return the state before the first sample.

        The selected candidate can change at the first sample, without waiting for the dwell time.
        """
        return SwitchingState(
            **asdict(super().first_state(parameters)), since=parameters.dwell, switches=0
        )

    @property
    def sigma(self) -> tuple[int, int]:
        """Selected candidate: indices of its b and its k in the values of the grid, from 0."""
        b, k = self.grid.b, self.grid.k
        i = round((self.state.theta[B] - b.first) / b.spacing)
        return i, round((self.state.theta[K] - k.first) / k.spacing)

    @property
    def switches(self) -> int:
        """Number of changes of the selected candidate, including a change at the first sample."""
        return self.state.switches

    def note(self, estimates: Estimates) -> str | None:
        """Return a text: number of changes of the candidate, its indices, and possibly a warning.

        The warning is that of `MultiEstimator`: the estimate is at the edge of the grid.
        """
        switching = f"{self.switches} switches, at candidate {self.sigma}"
        edge = super().note(estimates)
        return f"{switching}; {edge}" if edge else switching
