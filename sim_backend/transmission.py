"""The transmission between the slave's motor, with its encoder, and the tip.

An elastic transmission of compliance c moves a tip that is held by dry friction of F_c. The tip
then does not follow the motor on a reversal until the motor has moved by 2 delta, delta = F_c c:
lost motion. With the spring force f_s(y) of the cube at the tip y, the equilibrium of the tip is

    (x - y) / c = f_s(y) + phi,    |phi| <= F_c,    phi y' >= 0

or, since g(y) = y + c f_s(y) rises with y,

    g(y) = p = play(x),    phi = (x - p) / c

where play is the play operator of half width delta [1]: p stays as it is while |x - p| <= delta
and is pushed along beyond it. To a sine of amplitude A the cube then shows the describing function
of the play [2]. Its phase reads as damping of -4 k delta (A - delta) / (pi omega A^2), about
-4 k delta / (pi omega A), where k is the stiffness of cube and transmission in series.

The damping of the cube is taken from the speed of the tip that these equations give; the stretch
of the transmission under the damping force is neglected. Friction and damping always take energy.

[1] M. Brokate, J. Sprekels, Hysteresis and Phase Transitions, Springer, 1996, section 2.1.
[2] A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design,
    McGraw-Hill, 1968, section 2.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Transmission:
    """Elastic transmission with dry friction at the tip; rigid by default.

    Raises
    ------
    ValueError
        A value is negative or not finite, or there is lost motion without compliance.
    """

    lost_motion: float = 0.0
    """How far the tip stays behind the motor by dry friction, in either direction [m]."""
    compliance: float = 0.0
    """Stretch of the transmission for each newton on the tip [m/N]."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 <= value < math.inf:
                raise ValueError(f"{name} must be >= 0, got {value}")
        if self.lost_motion > 0.0 and self.compliance == 0.0:
            raise ValueError("lost motion needs a compliance > 0: friction stretches it")

    @property
    def friction(self) -> float:
        """Dry friction at the tip [N]."""
        return self.lost_motion / self.compliance if self.compliance else 0.0

    def play(self, p: float, x: float) -> float:
        """Output of the play operator that was p, with its input moved on to x [m]."""
        return min(max(p, x - self.lost_motion), x + self.lost_motion)


RIGID = Transmission()
