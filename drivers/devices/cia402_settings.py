"""The section of a CiA 402 drive in a rig file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat

from drivers.device import DeviceSettings

Positive = Annotated[FiniteFloat, Field(gt=0)]


class Cia402Settings(DeviceSettings):
    """A CiA 402 drive on a CANopen bus."""

    kind: Literal["cia402"]
    bus: str
    node_id: Annotated[int, Field(ge=1, le=126)]
    """127 is ours."""
    counts_per_turn: Positive
    """Increments of 6064h for a turn of the motor."""
    travel_mm_per_turn: Positive
    velocity_unit: Literal["counts_per_s", "rpm"] = "counts_per_s"
    """Unit of 60FFh and 606Ch."""
    watchdog_ms: Annotated[int, Field(ge=40, le=1000)] = 100
    """After this long without each other the drive stops, and the rig reports it."""
    vendor_id: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None
    """1018h:01, if only that is to be accepted."""
    product_code: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None
    """1018h:02, if only that is to be accepted."""
