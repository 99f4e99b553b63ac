"""Supervisory switching: the multi-estimator whose candidate changes only when it must."""

from __future__ import annotations

import math

from estimation.compiled import Parameters, Regressors, State
from estimation.estimator import Estimates
from estimation.methods.grid import Grid
from estimation.methods.multi_estimator import (
    TIE,
    MultiEstimator,
    decay_and_add,
    deviations,
    least_candidate,
)

SINCE, SWITCHES = 17, 18
"""Where the time [s] since the last switch and the count of switches are in the state."""


def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
    """Decay and add as the multi-estimator; then switch, if hysteresis and dwell time allow."""
    decay_and_add(parameters[0], state, phi[0], phi[1], f, dt)
    b, k = least_candidate(
        state,
        parameters[1],
        parameters[2],
        parameters[3],
        parameters[4],
        parameters[5],
        parameters[6],
        parameters[7],
        parameters[8],
        TIE,
    )
    state[SINCE] += dt
    bound = parameters[10] * signal(state, b, k)
    if state[SINCE] >= parameters[11] and signal(state, state[0], state[1]) > bound:
        state[0], state[1] = b, k
        state[SINCE] = 0.0
        state[SWITCHES] += 1.0
    state[2], state[3] = deviations(
        parameters[9], state, parameters[2] * parameters[3], parameters[6] * parameters[7], dt
    )


def signal(state: State, b: float, k: float) -> float:
    """(11) of a candidate, and `TIE` times that of (0, 0) so that none is zero."""
    ff = state[5]
    mu = (
        ff
        + b * (b * state[8] - 2.0 * state[6])
        + k * (k * state[10] - 2.0 * state[7])
        + 2.0 * b * k * state[9]
    )
    return (mu if mu > 0.0 else 0.0) + TIE * ff


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

    step = staticmethod(step)
    gated = True
    helpers = (*MultiEstimator.helpers, signal)

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
        super().__init__(
            grid,
            forgetting_rate,
            correlation,
            further_parameters=(1.0 + hysteresis, dwell),
            further_state=(dwell, 0.0),
        )

    @property
    def sigma(self) -> tuple[int, int]:
        """The switching signal: indices of the reported damping and stiffness on their axes."""
        b, k = self.grid.b, self.grid.k
        i = round((self.state[0] - b.first) / b.spacing)
        return i, round((self.state[1] - k.first) / k.spacing)

    @property
    def switches(self) -> int:
        """How often sigma has changed; the first sample's choice counts."""
        return int(self.state[SWITCHES])

    def note(self, estimates: Estimates) -> str | None:
        """How often sigma changed and where it is, and what the multi-estimator says."""
        told = f"{self.switches} switches, at candidate {self.sigma}"
        edge = super().note(estimates)
        return f"{told}; {edge}" if edge else told
