"""Convert the texts of options, such as the name of a signal or a model, to objects."""

from __future__ import annotations

from typing import get_args

from estimation.model import Model, model_named
from estimation.registry import named_estimators
from teleop.control.channel import ChannelSettings, parse_channel
from teleop.control.coupling import Coupling
from teleop.control.excitation_signals import AnySignal, Chirp, Multisine, Sine
from teleop.errors import InputError, as_input_error
from teleop.names import CouplingName, SignalName

POSITION_GAIN = 10.0
"""Position gain of the coupling with `--coupling position` [1/s]."""


def make_signal(name: SignalName, frequency: float) -> AnySignal:
    """Return the excitation signal that has the given name.

    Parameters
    ----------
    name
        `sine`; `multisine`, a sum of sines at `frequency` and its first harmonics; or `chirp`, a
        sine whose frequency increases from `frequency` and decreases again.
    frequency
        Frequency of the sine, or lowest frequency of the multisine or the chirp [Hz].

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
    """Return the coupling, which computes the velocity of the slave from the motion of the master.

    Parameters
    ----------
    name
        `velocity`: the slave follows the velocity of the master. `position`: the slave also follows
        the position of the master.

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
    """Return the settings of the communication channel between master and slave.

    Parameters
    ----------
    text
        Settings as a text, such as `delay=100ms,jitter=20ms,loss=5%`.

    Raises
    ------
    InputError
        The text is not valid.
    """
    with as_input_error():
        return parse_channel(text)


def choose_estimators(names: str) -> tuple[str, ...]:
    """Return the names of estimators in a text in which they are separated by commas.

    For the text `all`, the names of all estimators are returned.

    Raises
    ------
    InputError
        A name is unknown or occurs twice, or there is no name.
    """
    with as_input_error():
        return named_estimators(names)


def choose_model(name: str) -> Model:
    """Return the model of the specimen that has the given name, such as kelvin-voigt.

    Raises
    ------
    InputError
        The name is unknown.
    """
    with as_input_error():
        return model_named(name)
