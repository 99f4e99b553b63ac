"""Rig file section of a CiA 402 drive."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat

from drivers.device import DeviceSettings

Positive = Annotated[FiniteFloat, Field(gt=0)]


class Cia402Settings(DeviceSettings):
    """Rig file section of a CiA 402 drive on a CANopen bus."""

    kind: Literal["cia402"]
    bus: str
    node_id: Annotated[int, Field(ge=1, le=126)]
    """Node id of the drive. 127 is the controller."""
    counts_per_turn: Positive
    """Increments of 6064h per turn of the motor."""
    travel_mm_per_turn: Positive
    velocity_unit: Literal["counts_per_s", "rpm"] = "counts_per_s"
    """Unit of 60FFh and 606Ch."""
    watchdog_ms: Annotated[int, Field(ge=40, le=1000)] = 100
    """Time without communication after which the drive stops and the rig reports an error."""
    vendor_id: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None
    """Required value of 1018h:01; None for any."""
    product_code: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None
    """Required value of 1018h:02; None for any."""
