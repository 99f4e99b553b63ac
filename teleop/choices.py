"""Parts of a trial that a person chooses by name."""

from __future__ import annotations

from typing import Literal, get_args

from estimation import (
    Conditioner,
    FilteredDifference,
    FirstOrderAdaptiveWindowing,
    MatchedFilter,
    StateVariableFilter,
)
from teleop.admittance import Coupling
from teleop.errors import InputError
from teleop.injector import Chirp, Multisine, Signal, Sine

SignalName = Literal["sine", "multisine", "chirp"]
CouplingName = Literal["velocity", "position"]
ConditioningName = Literal["matched", "svf", "foaw", "difference"]

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


def make_conditioner(name: ConditioningName, bandwidth: float, resolution: float) -> Conditioner:
    """Signal conditioning with a filter bandwidth [Hz] or, for FOAW, a position resolution [m]."""
    try:
        if name == "matched":
            return MatchedFilter(bandwidth)
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
