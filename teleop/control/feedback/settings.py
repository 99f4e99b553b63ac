"""Settings of the force feedback, from which the two halves of the force-feedback law are created.

One half of the law runs at the master, and the other half at the slave.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from drivers.rig_file import RigFile
from teleop.control.admittance import Admittance
from teleop.control.conditions import BY_HAND
from teleop.control.coupling import Coupling
from teleop.control.feedback.law import STIFF_PRIOR, Master, Slave
from teleop.control.feedback.local_model import LocalModel, ModelMediatedSlave
from teleop.control.feedback.model_mediated import ModelMediatedMaster
from teleop.control.feedback.passivity import PassivityMaster, PassivitySlave
from teleop.control.feedback.position_force import PositionForceMaster
from teleop.names import ConditionName, FeedbackName


@dataclass(frozen=True)
class FeedbackSettings:
    """Settings of the force feedback, by which the hand feels the contact force.

    Raises
    ------
    ValueError
        `stiffness` or `gain` is not positive and finite.
    """

    law: FeedbackName = "none"
    """Name of the force-feedback law: none, position-force, model-mediated or passivity."""
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

    def problems(self, condition: ConditionName, rig: RigFile | None) -> Iterator[str]:
        """Yield a message for each reason why a trial cannot use these feedback settings.

        Parameters
        ----------
        condition
            Control condition of the trial.
        rig
            Content of the rig file of the hardware rig; None for the simulated rig.
        """
        if self.law != "none" and condition not in BY_HAND:
            yield (
                f"feedback {self.law}: nobody holds the handle in the condition {condition}: "
                f"expected {' or '.join(BY_HAND)}"
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
        """Create the two halves of the force-feedback law, for the master and for the slave.

        Parameters
        ----------
        admittance
            Virtual mass, whose velocity is the desired velocity of the master.
        coupling
            Computes the desired velocity of the slave from the motion of the virtual mass.
        force_lag
            Lag of the signal of the contact force sensor [s]. Only the law model-mediated uses it,
            to correct the estimate of the damping.
        glued
            Whether the specimen is glued, so that it also pulls the slave. Only the law
            model-mediated uses it.
        stiffness
            Expected slope of the contact force over the position of the slave [N/m]. The law
            model-mediated does not use it, because it estimates the stiffness.

        Returns
        -------
        master, slave
            The two halves of the law.
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
