"""What the supervisor has to say: its modes, what can trip it, and the events that it tells."""

from __future__ import annotations

from enum import IntEnum, StrEnum
from typing import NamedTuple


class Mode(IntEnum):
    """What the telemanipulator is doing, as far as safety is concerned."""

    DISCONNECTED = 0
    """Nothing has been read yet."""
    IDLE = 1
    """Drives out of operation."""
    READY = 2
    """All channels are well and the slave rests where it should; may be armed."""
    ACTIVE = 3
    """Armed: drives follow the command within the limits."""
    STOPPING = 4
    """On the way to standstill, and then to idle."""
    FAULT = 5
    """Stopped by a fault; stays until a person re-arms."""


DISCONNECTED, IDLE, READY, ACTIVE, STOPPING, FAULT = Mode
"""The modes by themselves: `Mode.IDLE` takes 90 ns to look up in Python 3.11, this 7."""


class Fault(StrEnum):
    """What can trip the supervisor, the most severe first.

    Where several are found at one tick, they are reported in this order. A value that is no
    number comes before the failure of the condition that it causes.
    """

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
    CONTROL_FAILURE = "control failure"
    ESTIMATION_FAILURE = "estimation failure"


SEVERITY = {fault: rank for rank, fault in enumerate(Fault)}
"""Rank of each fault; 0 is the most severe."""
LAST_AT_ONCE = SEVERITY[Fault.NOT_AT_REST]


def stops_at_once(fault: Fault) -> bool:
    """Whether a fault idles the drives without a ramp (stop category 0 of IEC 60204-1).

    At all others the command ramps to zero first (category 1): the drives can still be
    commanded.
    """
    return SEVERITY[fault] <= LAST_AT_ONCE


class Event(NamedTuple):
    """Something that happened at a tick: a change of mode, or a fault."""

    time: float
    """[s] of the trial."""
    mode: Mode
    """The mode from then on."""
    text: str
    """What happened, for a person."""
    fault: Fault | None = None
    """What tripped; None for a mere change of mode."""
    source: str = ""
    """Channel or part that it came from."""
    value: float = float("nan")
    """What was seen, in SI units."""
    limit: float = float("nan")
    """What it was held against."""
    since: float = float("nan")
    """Since when it had been so [s]."""


def time_text(time: float) -> str:
    """Return the time of a fault [s] as a part of a sentence."""
    return f"at {time:.3f} s" if time >= 0.0 else "before the drives were armed"


UNITS = {"force": "N", "position": "m", "velocity": "m/s", "": ""}


def unit_of(source: str) -> str:
    """Unit of a channel."""
    return UNITS.get(source.rpartition("_")[2], "")


def describe(fault: Fault, source: str, value: float, limit: float) -> str:
    """One line for a person: what was seen where, and what was expected."""
    name, unit = source.replace("_", " "), unit_of(source)
    if fault is Fault.NOT_A_NUMBER or fault is Fault.INFINITE:
        return f"{name} is {value}: expected a number"
    if fault is Fault.STALE:
        return f"{name} is stale: last sample {value * 1e3:.1f} ms old, at most {limit * 1e3:g} ms"
    if fault is Fault.OUT_OF_RANGE:
        return f"{name} is out of range: {value:.4g} {unit}, the sensor ends at {limit:.4g} {unit}"
    if fault is Fault.JUMP:
        return (
            f"{name} jumped by {value:.4g} {unit} in one tick: at most {limit:.4g} {unit} "
            "is possible"
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
    if fault is Fault.OVERRUN:
        return f"the loop overran: {source}"
    if fault in (Fault.POSITION_LIMIT, Fault.VELOCITY_LIMIT, Fault.FORCE_LIMIT):
        return f"{fault}: {name} {value:.4g} {unit}, at most {limit:.4g} {unit}"
    return f"{fault}: {source}"
