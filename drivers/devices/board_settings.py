"""A board's section in a rig file, and the signals that follow from it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field, FiniteFloat

from drivers.codecs import board as codec
from drivers.device import DeviceSettings

Scale = Annotated[FiniteFloat, Field(gt=0)]

QUANTITIES = (
    ("force", "N", 1.0, "force_n_per_count", codec.FORCES),
    ("position", "m", 1e-6, "position_um_per_count", codec.AXES),
    ("velocity", "m/s", 1e-6, "velocity_um_per_s_per_count", codec.AXES),
    ("analogue", "V", 1e-3, "analogue_mv_per_count", codec.ANALOGUES),
)
"""Signals in the order of a sample's counts: name, SI unit, setting's unit, setting, how many."""


class BoardSettings(DeviceSettings):
    """A board; each list has an entry for each input or axis in use, the first ones."""

    kind: Literal["board"]
    bus: str
    sample_rate_hz: Annotated[int, Field(ge=50, le=4000)] = 1000
    watchdog_ms: Annotated[int, Field(ge=5, le=500)] = 50
    """The axes stop if no command comes for so long."""
    force_n_per_count: Annotated[tuple[Scale, ...], Field(max_length=codec.FORCES)] = ()
    position_um_per_count: Annotated[tuple[Scale, ...], Field(max_length=codec.AXES)] = ()
    velocity_um_per_s_per_count: Annotated[tuple[Scale, ...], Field(max_length=codec.AXES)] = ()
    """Of the commands, and of the velocities that the board measures."""
    analogue_mv_per_count: Annotated[tuple[Scale, ...], Field(max_length=codec.ANALOGUES)] = ()


def gains(settings: BoardSettings) -> Iterator[tuple[int, str, float]]:
    """Each signal: the index of its count in a sample, its name, and what a count is [SI unit]."""
    first = 0
    for name, _, unit, key, number in QUANTITIES:
        for i, scale in enumerate(getattr(settings, key)):
            yield first + i, f"{name}_{i}", scale * unit
        first += number
