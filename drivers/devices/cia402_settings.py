"""Define the settings of a CiA 402 drive in the rig file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, FiniteFloat

from drivers.codecs.cia402 import Mode, VelocityUnit
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
    mode: Mode = "csv"
    """What the drive accepts: velocities (csv), positions (csp) or torques (cst)."""
    velocity_unit: VelocityUnit = "counts_per_s"
    """Unit of the objects 60FFh (target velocity) and 606Ch (velocity actual value)."""
    rated_torque_unit: Literal["milli_nm", "micro_nm"] = "milli_nm"
    """Unit of the object 6076h (rated torque). Drives of maxon have uN m, others mN m."""
    watchdog_ms: Annotated[int, Field(ge=40, le=1000)] = 100
    """If there is no communication for this time [ms], the drive stops and an error is reported."""
    vendor_id: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None
    """Required value of the object 1018h:01 (vendor ID); None if any value is permitted."""
    product_code: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None
    """Required value of the object 1018h:02 (product code); None if any value is permitted."""
