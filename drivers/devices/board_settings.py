"""Rig file section of a board, and the signals that it defines."""

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
"""Signals in the order of a sample's counts: name, SI unit, setting unit, setting, number."""


class BoardSettings(DeviceSettings):
    """Rig file section of a board.

    Each list has one entry per input or axis in use, from the first one on.
    """

    kind: Literal["board"]
    bus: str
    sample_rate_hz: Annotated[int, Field(ge=50, le=4000)] = 1000
    watchdog_ms: Annotated[int, Field(ge=5, le=500)] = 50
    """Time without a command after which the axes stop."""
    force_n_per_count: Annotated[tuple[Scale, ...], Field(max_length=codec.FORCES)] = ()
    position_um_per_count: Annotated[tuple[Scale, ...], Field(max_length=codec.AXES)] = ()
    velocity_um_per_s_per_count: Annotated[tuple[Scale, ...], Field(max_length=codec.AXES)] = ()
    """Scale of the velocity commands and of the measured velocities."""
    analogue_mv_per_count: Annotated[tuple[Scale, ...], Field(max_length=codec.ANALOGUES)] = ()


def gains(settings: BoardSettings) -> Iterator[tuple[int, str, float]]:
    """Yield for each signal the index of its count in a sample, its name, and SI unit per count."""
    first = 0
    for name, _, unit, key, number in QUANTITIES:
        for i, scale in enumerate(getattr(settings, key)):
            yield first + i, f"{name}_{i}", scale * unit
        first += number
