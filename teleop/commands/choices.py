"""Create the parts of a trial from their names in options, such as the signal and the model."""

from __future__ import annotations

from typing import get_args

from estimation.model import Model, model_named
from estimation.registry import named_estimators
from sim_backend.channel import ChannelSettings, parse_channel
from teleop.control.coupling import Coupling
from teleop.control.excitation_signals import AnySignal, Chirp, Multisine, Sine
from teleop.errors import InputError, as_input_error
from teleop.names import CouplingName, SignalName

POSITION_GAIN = 10.0
"""Position gain of the coupling with `--coupling position` [1/s]."""


def make_signal(name: SignalName, frequency: float) -> AnySignal:
    """Return an excitation signal: a sine, a multisine of five harmonics, or a two-octave chirp.

    Parameters
    ----------
    name
        Name of the signal.
    frequency
        Lowest frequency of the signal [Hz].

    Raises
    ------
    InputError
        The name is unknown, or the frequency is not positive.
    """
    try:
        if name == "sine":
            return Sine(frequency)
        if name == "multisine":
            return Multisine(tuple(frequency * harmonic for harmonic in range(1, 6)))
        if name == "chirp":
            return Chirp(frequency, 4.0 * frequency)
    except ValueError as error:
        raise InputError(f"frequency {frequency:g} Hz: {error}") from error
    raise InputError(f"signal {name!r}: expected one of {', '.join(get_args(SignalName))}")


def make_coupling(name: CouplingName) -> Coupling:
    """Return the coupling of master and slave: by velocity only, or by velocity and position.

    Raises
    ------
    InputError
        The name is unknown.
    """
    if name == "velocity":
        return Coupling()
    if name == "position":
        return Coupling(position_gain=POSITION_GAIN)
    raise InputError(f"coupling {name!r}: expected one of {', '.join(get_args(CouplingName))}")


def make_channel(text: str) -> ChannelSettings:
    """Convert a text such as `delay=100ms,jitter=20ms,loss=5%` to communication channel settings.

    Raises
    ------
    InputError
        The text is not valid.
    """
    with as_input_error():
        return parse_channel(text)


def choose_estimators(names: str) -> tuple[str, ...]:
    """Split a comma-separated list of estimator names; return all names for the text `all`.

    Raises
    ------
    InputError
        A name is unknown.
    """
    with as_input_error():
        return named_estimators(names)


def choose_model(name: str) -> Model:
    """Return the model of the environment that has the given name, such as kelvin-voigt.

    Raises
    ------
    InputError
        The name is unknown.
    """
    with as_input_error():
        return model_named(name)
