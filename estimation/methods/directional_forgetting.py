"""Recursive least squares that forgets in the direction of the sample alone."""

from __future__ import annotations

from estimation.methods.ud_factors import (
    FactoredEstimator,
    FactoredParameters,
    FactoredState,
    add,
    kept,
    learn,
    predicted_variance,
    take_in,
)
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, below

NO_NEWS = 1e-100
"""Least z' P z of which anything is forgotten: below, its inverse would soon overflow."""


def step(
    parameters: FactoredParameters, state: FactoredState, phi: Regressors, f: float, dt: float
) -> None:
    """P^-1 <- P^-1 + (beta - (1 - beta) / r) z z', r = z' P z; gain P z / (1 + r).

    Written as least squares without forgetting, then P <- P + (1 - beta) / beta P z z' P / z' P z
    with the new P: the same, and a sum of positive terms even where P grows.
    """
    m = len(phi)
    beta = kept(parameters, state, dt)
    r = predicted_variance(parameters, state, phi)
    spread = take_in(parameters, state, phi, 1.0)
    if r > NO_NEWS:
        y, L = state.y, state.L
        for i in below[m]:
            y[i] = L[i]
        add(state, (1.0 - beta) / (beta * r * spread), m)
    learn(parameters, state, phi, f, dt, spread)


class DirectionalForgetting(FactoredEstimator):
    """Recursive least squares with directional forgetting.

    Only what the sample itself speaks of is forgotten, so the covariance does not wind up
    where some direction rests, nor does anything change at phi = 0 (R. Kulhavy and M. Karny,
    "Tracking of slowly varying parameters by directional forgetting", 9th IFAC World Congress,
    Budapest, 1984, IFAC Proceedings Volumes 17(2), 687-692; as a case of forgetting in general,
    R. Kulhavy and M. B. Zarrop, "On a general concept of forgetting", International Journal of
    Control 58(4), 905-924, 1993). The variance of a sample's direction settles where
    phi' P phi = (1 - beta) / beta, however small the sample: it takes a sensor's noise for
    motion as well.

    Parameters
    ----------
    forgetting
        The forgetting factor beta, 0 < beta <= 1.
    initial_covariance
        Diagonal of P0, for b [(N s/m)^2] and k [(N/m)^2] and what else the model has, per N^2
        of force variance.
    sample_period
        Time [s] over which the information in a sample's direction falls by beta; without,
        it does so each sample whatever the `dt`.
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
        forgetting: float,
        initial_covariance: tuple[float, ...],
        sample_period: float | None = None,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        super().__init__(forgetting, initial_covariance, sample_period, model, correlation)
