"""Make the signal conditioner with a given name.

A signal conditioner is a filter that computes displacement, velocity and force from the measured
position and force.
"""

from __future__ import annotations

from estimation.conditioning import (
    Conditioner,
    FilteredDifference,
    FirstOrderAdaptiveWindowing,
    MatchedFilter,
    StateVariableFilter,
)
from estimation.filters import angular
from estimation.model import KELVIN_VOIGT, Model

CONDITIONERS = ("matched", "svf", "foaw", "difference")
"""Names of the signal conditioners."""
LONGEST_LAG = 0.5
"""Largest time constant of a lag of the force channel that can be compensated [s]."""


def make_conditioner(
    name: str,
    bandwidth: float,
    resolution: float,
    force_lag: float = 0.0,
    model: Model = KELVIN_VOIGT,
) -> Conditioner:
    """Return a new signal conditioner with this name.

    A signal conditioner is a filter that computes displacement, velocity and force from the
    measured position and force.

    Parameters
    ----------
    name
        `matched` for `MatchedFilter`, `svf` for `StateVariableFilter`, `foaw` for
        `FirstOrderAdaptiveWindowing`, or `difference` for `FilteredDifference`.
    bandwidth
        Bandwidth of the filter [Hz]. The conditioner `foaw` does not use this value.
    resolution
        Distance per encoder count [m]. Only the conditioner `foaw` uses this value.
    force_lag
        Time constant of the lag of the force channel [s]. Only the conditioner `matched`
        compensates this lag.
    model
        Model that defines the regressors. Only the conditioner `matched` computes regressors other
        than velocity and displacement.

    Raises
    ------
    ValueError
        The name is unknown, a number is out of its range, or the named conditioner does not
        support the lag or the model.
    """
    if name not in CONDITIONERS:
        raise ValueError(f"conditioning {name!r}: expected one of {', '.join(CONDITIONERS)}")
    if force_lag != 0.0 and name != "matched":
        raise ValueError(f"force lag {force_lag:g} s: expected conditioning matched, not {name}")
    if force_lag > LONGEST_LAG:
        raise ValueError(f"force lag {force_lag:g} s: expected at most {LONGEST_LAG:g} s")
    if model.further and name != "matched":
        raise ValueError(f"model {model.name}: expected conditioning matched, not {name}")
    try:
        angular(bandwidth)
        if name == "matched":
            return MatchedFilter(bandwidth, force_lag, model)
        if name == "svf":
            return StateVariableFilter(bandwidth)
        if name == "difference":
            return FilteredDifference(bandwidth)
        return FirstOrderAdaptiveWindowing(resolution)
    except ValueError as error:
        raise ValueError(f"conditioning {name}: {error}") from error
