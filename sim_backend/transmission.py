"""The transmission between the slave's motor, with its encoder, and the tip.

A transmission of compliance c moves a tip on which dry friction F_c acts. The distance
delta = F_c c is called lost motion. After a reversal, the tip does not move until the motor has
moved by 2 delta. x is the position of the motor, y the position of the tip, f_s(y) the spring force
of the cube, and phi the friction force. The equilibrium of the tip is

    (x - y) / c = f_s(y) + phi,    |phi| <= F_c,    phi y' >= 0

Since g(y) = y + c f_s(y) increases with y, this is equivalent to

    g(y) = p = play(x),    phi = (x - p) / c

play is the play operator of half width delta [1]. Its output p is constant while
|x - p| <= delta, and otherwise follows x at the distance delta. If x is a sine of amplitude A and
angular frequency omega, the describing function of the play operator [2] gives the amplitude and
the phase lag of the force of the cube. The phase lag has the same effect as an additional damping
coefficient of -4 k delta (A - delta) / (pi omega A^2), in which k is the stiffness of cube and
transmission in series. If delta is much smaller than A, this coefficient is about
-4 k delta / (pi omega A).

These equations give the position and the speed of the tip. The damping force of the cube is
computed from this speed. The model neglects that the damping force also stretches the transmission.
Friction and damping of the model always dissipate energy.

[1] M. Brokate, J. Sprekels, Hysteresis and Phase Transitions, Springer, 1996, section 2.1.
[2] A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design,
    McGraw-Hill, 1968, section 2.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim_backend.body import Law


@dataclass(frozen=True)
class Transmission:
    """Elastic transmission with dry friction at the tip; rigid by default.

    Raises
    ------
    ValueError
        A value is negative or not finite, or there is lost motion without compliance.
    """

    lost_motion: float = 0.0
    """Distance delta by which the tip lags the motor due to dry friction, in either direction [m].
    """
    compliance: float = 0.0
    """Stretch of the transmission per newton of force on the tip [m/N]."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 <= value < math.inf:
                raise ValueError(f"{name} must be >= 0, got {value}")
        if self.lost_motion > 0.0 and self.compliance == 0.0:
            raise ValueError("lost motion needs a compliance > 0")

    @property
    def friction(self) -> float:
        """Dry friction at the tip [N]."""
        return self.lost_motion / self.compliance if self.compliance else 0.0

    def play(self, p: float, x: float) -> float:
        """Return the output of the play operator [m] for its last output p and its input x [m]."""
        low, high = x - self.lost_motion, x + self.lost_motion
        return low if p < low else high if p > high else p

    def load(self, law: Law, played: float, x: float, v: float) -> float:
        """Return the load [N] on the motor at position x [m] and velocity v [m/s].

        The load is the force of the body on the tip plus the friction at the tip. The motor moved
        to x without reversal.

        Parameters
        ----------
        law
            Law of the force of the body.
        played
            Output of the play operator before this motion [m].
        x, v
            Position [m] and velocity [m/s] of the motor.
        """
        compliance = self.compliance
        if compliance == 0.0:
            return law.force(x, v)
        played = self.play(played, x)
        return self.tip_force(law, played, x, v) + (x - played) / compliance

    def tip_force(self, law: Law, played: float, x: float, v: float) -> float:
        """Return the force of the body on the tip [N].

        `x` [m] and `v` [m/s] are the position and velocity of the motor. `played` is the output of
        the play operator at the position `x` [m].
        """
        compliance, lost = self.compliance, self.lost_motion
        tip = law.compressed(played, compliance)
        slips = played <= x - lost if v > 0.0 else played >= x + lost
        speed = v / (1.0 + compliance * law.stiffness(tip)) if slips else 0.0
        return law.force(tip, speed)


RIGID = Transmission()
"""Transmission without compliance and lost motion."""
