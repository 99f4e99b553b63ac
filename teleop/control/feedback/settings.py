"""Settings of the force feedback. They create the two halves of the force-feedback law."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from drivers.rig_file import RigFile
from teleop.control.admittance import Admittance
from teleop.control.coupling import Coupling
from teleop.control.feedback.law import STIFF_PRIOR, Master, Slave
from teleop.control.feedback.local_model import LocalModel, ModelMediatedSlave
from teleop.control.feedback.model_mediated import ModelMediatedMaster
from teleop.control.feedback.passivity import PassivityMaster, PassivitySlave
from teleop.control.feedback.position_force import PositionForceMaster
from teleop.names import ConditionName, FeedbackName


@dataclass(frozen=True)
class FeedbackSettings:
    """Settings of the force feedback.

    Raises
    ------
    ValueError
        A value is out of its range.
    """

    law: FeedbackName = "none"
    """Name of the law: none, position-force, model-mediated or passivity."""
    gain: float = 1.0
    """Ratio of the displayed force to the contact force, > 0."""
    glued: bool | None = None
    """Whether the specimen is glued to the slave's plate, so that it also pulls. By default, this
    is the setting of the simulated body. On a hardware rig, the default is glued."""

    stiffness: float | None = None
    """Largest expected stiffness of the specimen [N/m]. It is used to check the stability of the
    law position-force, and to limit the approach speed of the slave if the law has no model. By
    default, it is the stiffness of the simulated body. On a hardware rig, it is unknown."""

    def __post_init__(self) -> None:
        if self.stiffness is not None and not 0.0 < self.stiffness < math.inf:
            raise ValueError(f"stiffness of the feedback must be positive, got {self.stiffness}")
        if not 0.0 < self.gain < math.inf:
            raise ValueError(f"gain of the feedback must be positive, got {self.gain}")

    def problems(self, condition: ConditionName, rig: RigFile | None) -> Iterator[str]:
        """Yield the reasons why a trial cannot use these feedback settings.

        Parameters
        ----------
        condition
            Control condition.
        rig
            Hardware rig; None for the simulated rig.
        """
        if self.law != "none" and condition == "autonomous":
            yield (
                f"feedback {self.law}: nobody holds the handle in the condition autonomous: "
                "expected free or mimic"
            )
        if self.law != "none" and rig and not rig.sections.drives.master:
            yield (
                f"feedback {self.law}: the handle of the rig {rig.sections.name!r} is passive: "
                "expected a rig file with [drives.master]"
            )

    def halves(
        self,
        admittance: Admittance,
        coupling: Coupling,
        force_lag: float,
        glued: bool,
        stiffness: float = STIFF_PRIOR,
    ) -> tuple[Master, Slave]:
        """Return the two halves of the force-feedback law, at the master and at the slave.

        Parameters
        ----------
        admittance, coupling
            Virtual mass of the master, and map from the motion of the master to the motion of the
            slave.
        force_lag
            Lag of the force channel that the estimator compensates [s].
        glued
            Whether the specimen is glued.
        stiffness
            Expected slope of the contact force [N/m]. The law model-mediated does not use it, but
            estimates it.
        """
        master = admittance, coupling.scale, self.gain
        match self.law:
            case "none":
                return Master(*master), Slave(coupling, stiffness)
            case "position-force":
                return PositionForceMaster(*master), Slave(coupling, stiffness)
            case "passivity":
                return PassivityMaster(*master), PassivitySlave(coupling, stiffness, self.gain)
            case "model-mediated":
                return (
                    ModelMediatedMaster(*master, glued),
                    ModelMediatedSlave(coupling, LocalModel(force_lag, glued)),
                )
