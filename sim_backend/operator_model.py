"""Parameters of the simulated operator.

The stiffness of the hand depends on posture and on muscle activation. Measured values are several
hundred N/m [1, 2]. A relaxed arm has about 150 N/m and a tense arm about 1500 N/m. The damping D of
the arm depends on its stiffness K and its mass m [3]. Here m is constant, and the damping ratio
D / (2 sqrt(K m)) is the same for each K. Therefore D is proportional to sqrt(K). The stiffness and
the damping of the default arm, `operators.ARM`, determine the factor of proportionality.

[1] F. A. Mussa-Ivaldi, N. Hogan, E. Bizzi, J. Neurosci. 5(10), 1985.
[2] T. Tsuji, P. G. Morasso, K. Goto, K. Ito, Biol. Cybern. 72, 1995.
[3] J. M. Dolan, M. B. Friedman, M. L. Nagurka, IEEE Trans. Syst. Man Cybern. 23(3), 1993.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim_backend.operators import ARM, WITHDRAWAL
from sim_backend.plant import Arm

STIFFNESS = (50.0, 2000.0)
"""Lowest and highest stiffness of the arm [N/m]."""
WITHDRAWN = (-0.3, 0.8)
"""Lowest and highest value of `OperatorModel.withdrawal`."""


@dataclass(frozen=True)
class OperatorModel:
    """Parameters of the arm and of the intended motion of the simulated operator.

    Raises
    ------
    ValueError
        A value is out of range.
    """

    arm_stiffness: float = ARM.stiffness
    """Stiffness of the arm [N/m], 50 to 2000. The damping is computed from the stiffness."""
    aim_force: float | None = None
    """Force of the hand on the handle at which a movement into the specimen ends, if the depth is
    not reached before [N]. By default, the force is not limited, and the movement always ends at
    the depth. Only for the control condition `free`."""
    withdrawal: float = WITHDRAWAL
    """Mean intended position of the hand between two pokes, divided by the depth, -0.3 to 0.8. If
    the value is negative, the hand moves back beyond the contact point, and the slave leaves a body
    that is not glued. Only for the control condition `free`."""

    def __post_init__(self) -> None:
        for name, value, (low, high), unit in (
            ("arm_stiffness", self.arm_stiffness, STIFFNESS, " N/m"),
            ("withdrawal", self.withdrawal, WITHDRAWN, ""),
        ):
            if not low <= value <= high:
                raise ValueError(f"{name} {value:g}{unit}: expected {low:g} to {high:g}{unit}")
        if self.aim_force is not None and not 0.0 < self.aim_force < math.inf:
            raise ValueError(f"aim_force {self.aim_force:g} N: expected more than 0")

    @property
    def arm(self) -> Arm:
        """Stiffness and damping of the arm.

        The damping ratio is the same as that of the default arm `operators.ARM`.
        """
        ratio = self.arm_stiffness / ARM.stiffness
        return Arm(self.arm_stiffness, ARM.damping * math.sqrt(ratio))
