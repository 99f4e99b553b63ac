"""Parts of a trial that a person chooses by name."""

from __future__ import annotations

from typing import get_args

from estimation import (
    Conditioner,
    FilteredDifference,
    FirstOrderAdaptiveWindowing,
    MatchedFilter,
    StateVariableFilter,
)
from estimation.filters import angular
from estimation.model import KELVIN_VOIGT, Model, model_named
from estimation.registry import named_estimators
from teleop.control.admittance import Coupling
from teleop.control.injector import Chirp, Multisine, Signal, Sine
from teleop.errors import InputError
from teleop.names import ConditioningName, CouplingName, SignalName

LONGEST_LAG = 0.5
"""Longest lag of a force channel that is made up for [s]."""
POSITION_GAIN = 10.0
"""Rate at which a position-coupled slave makes up for a difference in position [1/s]."""


def make_signal(name: SignalName, frequency: float) -> Signal:
    """Excitation whose lowest frequency [Hz] is given: a sine, five harmonics, or two octaves."""
    try:
        if name == "sine":
            return Sine(frequency)
        if name == "multisine":
            return Multisine([frequency * harmonic for harmonic in range(1, 6)])
        if name == "chirp":
            return Chirp(frequency, 4.0 * frequency)
    except ValueError as error:
        raise InputError(f"frequency {frequency:g} Hz: {error}") from error
    raise InputError(f"signal {name!r}: expected one of {', '.join(get_args(SignalName))}")


def make_coupling(name: CouplingName) -> Coupling:
    """Slave velocity from the master's velocity alone, or from its position too."""
    if name == "velocity":
        return Coupling()
    if name == "position":
        return Coupling(position_gain=POSITION_GAIN)
    raise InputError(f"coupling {name!r}: expected one of {', '.join(get_args(CouplingName))}")


def choose_estimators(names: str) -> tuple[str, ...]:
    """Estimators named one after the other, with commas, or all; InputError for any other."""
    try:
        return named_estimators(names)
    except ValueError as error:
        raise InputError(str(error)) from error


def choose_model(name: str) -> Model:
    """A model of the environment by its name; InputError if there is none."""
    try:
        return model_named(name)
    except ValueError as error:
        raise InputError(str(error)) from error


def make_conditioner(
    name: ConditioningName,
    bandwidth: float,
    resolution: float,
    force_lag: float,
    model: Model = KELVIN_VOIGT,
) -> Conditioner:
    """Signal conditioning.

    Parameters
    ----------
    name
        Which one.
    bandwidth
        Bandwidth of its filter [Hz]; FOAW has none.
    resolution
        Position of one encoder count [m], for FOAW.
    force_lag
        Time constant of the force channel [s], which only a matched filter makes up for.
    model
        The regressors; only a matched filter forms others than velocity and displacement.

    Raises
    ------
    InputError
        The name is unknown, a number is out of its range, or the lag cannot be made up for.
    """
    if force_lag != 0.0 and name != "matched":
        raise InputError(f"force lag {force_lag:g} s: expected matched conditioning, not {name}")
    if force_lag > LONGEST_LAG:
        raise InputError(f"force lag {force_lag:g} s: expected at most {LONGEST_LAG:g} s")
    if model.further and name != "matched":
        raise InputError(f"model {model.name}: expected matched conditioning, not {name}")
    try:
        angular(bandwidth)
        if name == "matched":
            return MatchedFilter(bandwidth, force_lag, model)
        if name == "svf":
            return StateVariableFilter(bandwidth)
        if name == "difference":
            return FilteredDifference(bandwidth)
        if name == "foaw":
            return FirstOrderAdaptiveWindowing(resolution)
    except ValueError as error:
        raise InputError(f"conditioning {name}: {error}") from error
    raise InputError(
        f"conditioning {name!r}: expected one of {', '.join(get_args(ConditioningName))}"
    )
