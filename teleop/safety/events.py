"""Define the modes of the safety supervisor, the kinds of fault, and the events of a trial."""

from __future__ import annotations

from enum import IntEnum, StrEnum
from typing import NamedTuple


class Mode(IntEnum):
    """Mode of the safety supervisor, which decides whether the drives may move."""

    DISCONNECTED = 0
    """No measurement has been read yet."""
    IDLE = 1
    """The drives are disabled."""
    READY = 2
    """All checks have passed and the slave is at rest, so that the drives may be armed."""
    ACTIVE = 3
    """The drives are armed. They follow the desired command within the limits."""
    STOPPING = 4
    """The command decreases to zero on a ramp; then the mode becomes idle."""
    FAULT = 5
    """A fault has stopped the rig. The mode does not change until a person re-arms the rig."""


DISCONNECTED, IDLE, READY, ACTIVE, STOPPING, FAULT = Mode
"""The modes as constants of this module, for fast access.

In Python 3.11, access to `Mode.IDLE` takes 90 ns. Access to `IDLE` takes 7 ns.
"""


class Fault(StrEnum):
    """Kinds of fault, in the order of severity, with the most severe kind first.

    The kinds up to NOT_AT_REST stop the drives immediately, those after it on a ramp, see
    `stops_immediately`. Faults that are detected at the same tick are reported in this order. For
    example, a measured NaN can cause an error in the controller. NOT_A_NUMBER is therefore before
    CONTROL_FAILURE, so that the cause is reported first.
    """

    MOVES_AFTER_STOP = "motion after a stop"
    NOT_STOPPED = "stop not confirmed"
    EMERGENCY_STOP = "emergency stop"
    RIG_FAILURE = "rig failure"
    DRIVE_ERROR = "drive error"
    FORCE_LIMIT = "force limit"
    POSITION_LIMIT = "position limit"
    VELOCITY_LIMIT = "velocity limit"
    NOT_FOLLOWING = "drive does not follow its command"
    OVERRUN = "loop overrun"
    NOT_AT_REST = "not at rest at the start"
    NOT_A_NUMBER = "not a number"
    INFINITE = "infinite"
    OUT_OF_RANGE = "out of range"
    STALE = "stale"
    JUMP = "impossible jump"
    FROZEN = "frozen"
    CHANNEL_SILENT = "communication channel"
    CHANNEL_SLOW = "delay of the channel"
    OTHER_STATION = "other station"
    PORT_ENERGY = "energy at the handle"
    OSCILLATION = "oscillation"
    CONTROL_FAILURE = "control failure"
    PAGE_LOST = "live page lost"


SEVERITY = {fault: rank for rank, fault in enumerate(Fault)}
"""Rank of each fault; 0 is the most severe."""
LAST_IMMEDIATE = SEVERITY[Fault.NOT_AT_REST]
"""Rank of the least severe fault that stops the drives immediately, without a ramp to zero."""


def stops_immediately(fault: Fault) -> bool:
    """Return whether a kind of fault stops the drives immediately (stop category 0).

    The other kinds of fault are less severe, and the drives can still be commanded. The command
    then first decreases to zero on a ramp (stop category 1). IEC 60204-1 defines the categories.
    """
    return SEVERITY[fault] <= LAST_IMMEDIATE


class Event(NamedTuple):
    """Event in a trial: a fault, a change of the mode of the safety supervisor, or a note."""

    time: float
    """Time of the event in the trial [s]."""
    mode: Mode
    """Mode after the event."""
    text: str
    """Description in one line."""
    fault: Fault | None = None
    """Kind of fault; None for a change of mode without a fault."""
    source: str = ""
    """Channel or part with the fault, or a text that describes the fault. Without a fault: the part
    of the program that states a note (`is_note`)."""
    value: float = float("nan")
    """Measured value, in SI units; NaN if there is none."""
    limit: float = float("nan")
    """Limit that the value exceeds, in SI units; NaN if there is none."""
    since: float = float("nan")
    """Time at which the fault began [s]; NaN if there is no fault."""


EXCITATION = "excitation"
"""Source of the notes in which the control condition states its choice of the motion."""


def is_note(fault: object, source: str) -> bool:
    """Return whether an event is a note: neither a fault nor a change of mode.

    A note states for example the present precision, or a choice of the excitation.
    """
    return not fault and bool(source)


def time_text(time: float | None) -> str:
    """Return the time of a fault as a part of a sentence, such as `at 1.250 s`.

    `time` is the time since the drives were armed [s]; negative before, and None if they were not.
    """
    armed = time is not None and time >= 0.0
    return f"at {time:.3f} s" if armed else "before the drives were armed"


UNITS = {"force": "N", "position": "m", "velocity": "m/s", "": ""}
"""SI unit of each quantity. The name of a channel ends with the name of its quantity."""


def unit_of(source: str) -> str:
    """Return the SI unit of a channel; empty if `source` is not a channel.

    `source` is the source of a fault: the name of a channel, or another text.
    """
    return UNITS.get(source.rpartition("_")[2], "")


def describe(fault: Fault, source: str, value: float, limit: float) -> str:
    """Return one line of text that describes a fault. Value and limit are NaN if it has none."""
    name, unit = source.replace("_", " "), unit_of(source)
    if fault is Fault.NOT_A_NUMBER or fault is Fault.INFINITE:
        return f"{name} is {value}: expected a number"
    if fault is Fault.STALE:
        return (
            f"{name} is stale: last sample {value * 1e3:.1f} ms old, expected at most "
            f"{limit * 1e3:g} ms; the device was silent, or other programs delayed the loop"
        )
    if fault is Fault.OUT_OF_RANGE:
        return (
            f"{name} is out of range: {value:.4g} {unit}, the sensor's range ends at "
            f"{limit:.4g} {unit}"
        )
    if fault is Fault.JUMP:
        return (
            f"{name} jumped by {value:.4g} {unit} between two samples: at most "
            f"{limit:.4g} {unit} is possible"
        )
    if fault is Fault.FROZEN:
        return f"{name} is frozen at {value:.6g} {unit}"
    if fault is Fault.NOT_AT_REST:
        return f"not at rest at the start: {name} {value:.4g} {unit}, at most {limit:.4g} {unit}"
    if fault is Fault.NOT_FOLLOWING:
        return (
            f"the slave does not follow its command: {value * 1e3:.3g} mm behind it, "
            f"at most {limit * 1e3:.3g} mm"
        )
    if fault is Fault.MOVES_AFTER_STOP:
        return (
            f"the slave moves although its drives are disabled: {value * 1e3:.3g} mm since the "
            f"stop, without coming to rest for {source}: use the hardware emergency stop"
        )
    if fault is Fault.OVERRUN:
        return f"the loop overran: {source}; other programs on the machine can be the cause"
    if fault in (Fault.POSITION_LIMIT, Fault.VELOCITY_LIMIT, Fault.FORCE_LIMIT):
        return f"{fault}: {name} {value:.4g} {unit}, at most {limit:.4g} {unit}"
    return f"{fault}: {source}"
