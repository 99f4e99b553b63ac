"""Define the settings of a CiA 402 drive in the rig file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat

from drivers.device import DeviceSettings

Positive = Annotated[FiniteFloat, Field(gt=0)]


class Cia402Settings(DeviceSettings):
    """Settings of a CiA 402 drive on a CANopen bus, in the rig file."""

    kind: Literal["cia402"]
    bus: str
    node_id: Annotated[int, Field(ge=1, le=126)]
    """Node id of the drive. The controller has the node id 127."""
    counts_per_turn: Positive
    """Position increments per turn of the motor, as in the object 6064h (actual position)."""
    travel_mm_per_turn: Positive
    """Displacement of the axis per turn of the motor [mm]."""
    velocity_unit: Literal["counts_per_s", "rpm"] = "counts_per_s"
    """Unit of the objects 60FFh (target velocity) and 606Ch (velocity actual value)."""
    watchdog_ms: Annotated[int, Field(ge=40, le=1000)] = 100
    """If there is no communication for this time [ms], the drive stops and an error is reported."""
    vendor_id: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None
    """Required value of the object 1018h:01 (vendor ID); None if any value is permitted."""
    product_code: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None
    """Required value of the object 1018h:02 (product code); None if any value is permitted."""
