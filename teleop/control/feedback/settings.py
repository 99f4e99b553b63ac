"""Force-feedback laws by name, and the settings of the force feedback."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from drivers.rig_file import RigFile
from teleop.control.conditions import BY_HAND
from teleop.control.feedback.law import MasterHalf
from teleop.control.feedback.model_mediated import ModelMediatedMaster
from teleop.control.feedback.position_force import PositionForceMaster
from teleop.errors import InputError
from teleop.names import FeedbackName, RemovedFeedbackName

LAWS: dict[str, type[MasterHalf]] = {
    "none": MasterHalf,
    "position-force": PositionForceMaster,
    "model-mediated": ModelMediatedMaster,
}
"""Master half of each force-feedback law, by the name in the settings."""


@dataclass(frozen=True)
class FeedbackSettings:
    """Settings of the force feedback, by which the hand feels the contact force.

    Raises
    ------
    ValueError
        `stiffness` or `gain` is not positive and finite.
    """

    law: FeedbackName | RemovedFeedbackName = "none"
    """Name of the force-feedback law: none, position-force or model-mediated."""
    gain: float = 1.0
    """Ratio of the force that the hand feels to the contact force, > 0."""
    glued: bool | None = None
    """Whether the specimen is glued to the slave's plate, so that it also pulls the slave. If None,
    the setting of the simulated body is used, or True on a hardware rig."""

    stiffness: float | None = None
    """Largest expected stiffness of the specimen [N/m]. It is used to check the stability of the
    law position-force. It is also used to limit the approach speed of the slave if the law has no
    model. If None, the stiffness of the simulated body is used. On a hardware rig, None means that
    the stability is not checked and that `STIFF_PRIOR` limits the speed."""

    def __post_init__(self) -> None:
        if self.stiffness is not None and not 0.0 < self.stiffness < math.inf:
            raise ValueError(f"stiffness of the feedback must be positive, got {self.stiffness}")
        if not 0.0 < self.gain < math.inf:
            raise ValueError(f"gain of the feedback must be positive, got {self.gain}")

    def problems(self, condition: str, by_hand: bool, rig: RigFile | None) -> Iterator[str]:
        """Yield a message for each reason why a trial cannot use these feedback settings.

        `condition` is the name of the condition, and `by_hand` whether a person holds the handle in
        it. `rig` is None on the simulated rig.
        """
        if self.law != "none" and not by_hand:
            yield (
                f"feedback {self.law}: nobody holds the handle in the condition {condition}: "
                f"expected {' or '.join(BY_HAND)}"
            )
        if (
            self.law != "none"
            and rig
            and rig.sections.has_master
            and not rig.sections.drives.master
        ):
            yield (
                f"feedback {self.law}: the handle of the rig {rig.sections.name!r} is passive: "
                "expected a rig file with [drives.master]"
            )

    @property
    def law_type(self) -> type[MasterHalf]:
        """Master half of the law, which states the properties of the law."""
        if self.law in LAWS:
            return LAWS[self.law]
        raise InputError(
            f"feedback {self.law}: is not in this version: expected one of {', '.join(LAWS)}"
        )
