"""Define the settings of a microcontroller board in the rig file, and the signals of the board."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal, Self

from pydantic import Field, FiniteFloat, model_validator

from drivers.codecs import board as codec
from drivers.device import DeviceSettings

Scale = Annotated[FiniteFloat, Field(gt=0)]
ScaleOrNone = Annotated[FiniteFloat, Field(ge=0)]

QUANTITIES = (
    ("force", "N", 1.0, "force_n_per_count", codec.FORCES),
    ("position", "m", 1e-6, "position_um_per_count", codec.AXES),
    ("velocity", "m/s", 1e-6, "velocity_um_per_s_per_count", codec.AXES),
    ("analogue", "V", 1e-3, "analogue_mv_per_count", codec.ANALOGUES),
)
"""Groups of signals, in the order of their values in a sample of the board.

For each group, the entries are: the name, the SI unit, the factor from the unit of the setting to
the SI unit, the name of the setting that contains the scales, and the number of values in a sample.
"""


class BoardSettings(DeviceSettings):
    """Settings of a microcontroller board in the rig file.

    The board sends and receives values as integers, called counts. A scale is the value of one
    count. Each setting with a name that ends with `_per_count` is a list of scales. The first entry
    is for the first input or axis of the board, the second entry for the second. An input or axis
    without an entry is not used.
    """

    kind: Literal["board"]
    bus: str
    sample_rate_hz: Annotated[int, Field(ge=50, le=4000)] = 1000
    watchdog_ms: Annotated[int, Field(ge=5, le=500)] = 50
    """If the board receives no command during this time [ms], it stops the axes."""
    force_n_per_count: Annotated[tuple[Scale, ...], Field(max_length=codec.FORCES)] = ()
    position_um_per_count: Annotated[tuple[Scale, ...], Field(max_length=codec.AXES)] = ()
    velocity_um_per_s_per_count: Annotated[tuple[Scale, ...], Field(max_length=codec.AXES)] = ()
    """Scales of the velocity commands and of the measured velocities."""
    axis_force_n_per_count: Annotated[tuple[ScaleOrNone, ...], Field(max_length=codec.AXES)] = ()
    """Scales of the force commands. The scale 0 stands for an axis that accepts velocities."""
    analogue_mv_per_count: Annotated[tuple[Scale, ...], Field(max_length=codec.ANALOGUES)] = ()

    @property
    def axes(self) -> int:
        """Number of axes in use."""
        return max(len(self.velocity_um_per_s_per_count), len(self.axis_force_n_per_count))

    def force_scale(self, axis: int) -> float:
        """Return the scale of the force command of an axis; 0 if it accepts velocities."""
        scales = self.axis_force_n_per_count
        return scales[axis] if axis < len(scales) else 0.0

    @model_validator(mode="after")
    def _each_axis_has_a_scale(self) -> Self:
        for i in range(len(self.velocity_um_per_s_per_count), self.axes):
            if not self.force_scale(i):
                raise ValueError(
                    f"axis_{i} has no scale: expected one in velocity_um_per_s_per_count, or in "
                    "axis_force_n_per_count if it accepts forces"
                )
        return self


def gains(settings: BoardSettings) -> Iterator[tuple[int, str, float]]:
    """Yield the index, the name and the scale of each signal that has a scale in the settings.

    The index is the position of the signal in the tuple `counts` of a sample, which contains the
    values as integers (counts). The scale is the value of one count, in the SI unit of the signal.
    """
    first = 0
    for name, _, unit, key, number in QUANTITIES:
        for i, scale in enumerate(getattr(settings, key)):
            yield first + i, f"{name}_{i}", scale * unit
        first += number
