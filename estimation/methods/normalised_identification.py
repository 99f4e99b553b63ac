"""Adaptive identification by the gradient law with a normalised gain (NAI)."""

from __future__ import annotations

import math

from estimation.checks import positive_values
from estimation.compiled import Parameters, Regressors, State
from estimation.linear_gain import LinearGainEstimator, correct
from estimation.model import KELVIN_VOIGT, Model

LEAST = 0.1
"""A mean square counts for no less than this share of that of the typical size."""
MOST = 100.0
"""A sample's square counts for no more than this many times that of the typical size."""
LARGEST_SHARE = 0.1
"""A sample's share in a mean square at the most, however long a gap came before it."""


def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
    """(8) over one period with phi and f held, Gamma_i = rate / mean square of phi_i.

    The mean squares, in units of the typical ones, are the method's own state (m).
    """
    m = len(phi)
    gain = 2 * m + 3
    mean = 4 * m + 3 + m * m
    share = parameters[3] * dt
    share = min(share / (1.0 + share), LARGEST_SHARE)
    speed = 0.0
    for i in range(m):
        scaled = phi[i] * parameters[4 + i]
        square = scaled * scaled
        state[mean + i] += share * (min(square, MOST) - state[mean + i])
        adaptation = parameters[2] / max(state[mean + i], LEAST)
        state[gain + i] = adaptation * scaled * parameters[4 + i]
        speed += adaptation * square
    held = -math.expm1(-speed * dt) / speed if speed > 0.0 else dt
    for i in range(m):
        state[gain + i] *= held
    correct(parameters, state, phi, f, dt)


class NormalisedIdentification(LinearGainEstimator):
    """Adaptive identification with a gain normalised by each regressor's mean square.

    The paper's law (8), theta' = -Gamma phi (phi' theta - f), has a gain that must fit the
    cube and the depth. Here Gamma_i = rate / <phi_i^2>, so that where the regressors are
    independent every parameter converges at this one rate, whatever their units and sizes. It
    is the normalised gradient of P. A. Ioannou and J. Sun, "Robust Adaptive Control", 1996,
    section 4.3, regressor by regressor. (8) is taken exactly over a sample, so that no rate
    and no `dt` make it diverge.

    A gradient does not converge faster than phi turns: past a rate of about half the motion's
    angular frequency a higher one gains nothing.

    Parameters
    ----------
    rate
        Rate [1/s] at which parameters converge.
    sizes
        Typical size (rms) of each regressor, [m/s] for v, [m] for x. Orders of magnitude do:
        a mean square of a tenth to a hundred times the typical one is made up for in full.
    memory
        Memory [s] of the mean squares.
    model
        The regressors.
    correlation
        Samples for each independent one, see `LinearGainEstimator`.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    step = staticmethod(step)

    def __init__(
        self,
        rate: float,
        sizes: tuple[float, ...],
        memory: float = 0.05,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        for name, value in (("rate", rate), ("memory", memory)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be positive, got {value}")
        per_size = [1.0 / size for size in positive_values("sizes", sizes, model)]
        super().__init__(
            (rate, 1.0 / memory, *per_size),
            guess_variance=[scale * scale for scale in per_size],
            own_state=[1.0] * model.regressors,
            model=model,
            correlation=correlation,
        )
