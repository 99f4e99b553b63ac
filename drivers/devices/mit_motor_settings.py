"""Define the settings of a motor with the MIT mode in the rig file."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, FiniteFloat, field_validator, model_validator

from drivers.codecs.mit_motor import CUBEMARS, DAMIAO, Maker, Ranges
from drivers.device import DeviceSettings

Positive = Annotated[FiniteFloat, Field(gt=0)]
RANGES = ("p_max_rad", "v_max_rad_per_s", "t_max_nm")


class MitMotorSettings(DeviceSettings):
    """Settings of a motor with the MIT mode (Damiao, CubeMars, T-Motor) in the rig file."""

    kind: Literal["mit_motor"]
    bus: str
    model: str
    """Model of the motor, a key of `DAMIAO` or `CUBEMARS`."""
    mode: Literal["impedance", "torque"]
    """`impedance`: the motor closes a virtual coupling. `torque`: it accepts a force."""
    can_id: Annotated[int, Field(ge=1, le=0x7E)]
    """CAN identifier to which the motor listens; at most 15 for a Damiao motor."""
    reply_id: Annotated[int, Field(ge=0, le=0x7FE)]
    """CAN identifier of the answers of the motor; "Master ID" of a Damiao motor."""
    travel_mm_per_turn: Positive
    """Displacement of the moving part per turn of the output shaft of the motor [mm]."""
    watchdog_ms: Annotated[FiniteFloat, Field(ge=5, le=1000)]
    """CAN time-out that is set on the motor [ms]."""
    p_max_rad: Positive | None = None
    """Range of the position. The three ranges are needed for a motor that cannot be asked, and for
    a Damiao motor whose ranges were changed."""
    v_max_rad_per_s: Positive | None = None
    t_max_nm: Positive | None = None

    @property
    def maker(self) -> Maker:
        """Maker of the motor."""
        return "damiao" if self.model in DAMIAO else "cubemars"

    @property
    def ranges(self) -> Ranges:
        """Ranges of the values in the frames of the motor."""
        given = (self.p_max_rad, self.v_max_rad_per_s, self.t_max_nm)
        usual = DAMIAO.get(self.model) or CUBEMARS[self.model]
        return Ranges(*(u if g is None else g for g, u in zip(given, usual, strict=True)))

    @field_validator("model")
    @classmethod
    def _is_known(cls, model: str) -> str:
        if model not in DAMIAO | CUBEMARS:
            known = ", ".join((*DAMIAO, *CUBEMARS))
            raise ValueError(f"expected one of {known}")
        return model

    @model_validator(mode="after")
    def _fits_the_model(self) -> Self:
        missing = [key for key in RANGES if getattr(self, key) is None]
        if self.maker == "damiao":
            if self.can_id > 15:
                raise ValueError(f"can_id {self.can_id}: expected 1 to 15 for a Damiao motor")
            if 0 < len(missing) < len(RANGES):
                raise ValueError(f"{', '.join(missing)} missing: expected all ranges or none")
            if self.reply_id == 0:
                raise ValueError("reply_id 0: expected the Master ID of the motor, not 0")
            return self
        usual = CUBEMARS[self.model]
        if missing:
            raise ValueError(
                f"{', '.join(missing)} missing: the {self.model} cannot be asked for its ranges: "
                f"expected those of its manual, which should be {usual.text}"
            )
        if self.ranges != usual:
            raise ValueError(
                f"ranges {self.ranges.text}: expected {usual.text} for the model {self.model}"
            )
        return self
