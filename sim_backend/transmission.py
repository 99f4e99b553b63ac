"""The transmission between the slave's motor, with its encoder, and the tip.

The transmission is a spring with compliance c [m/N] between the motor and the tip. The tip presses
on a body (the specimen), and dry friction acts on the tip. The magnitude of the friction is at most
F_c. The distance delta = F_c c is called lost motion. After a reversal of the motor, the tip does
not move until the motor has moved by 2 delta. x is the position of the motor, y the position of the
tip, y' its velocity, f_s(y) the spring force of the body, and phi the friction force. In
equilibrium, the force of the transmission is equal to the sum of spring force and friction:

    (x - y) / c = f_s(y) + phi,    |phi| <= F_c,    phi y' >= 0

The function g(y) = y + c f_s(y) increases with y. The equilibrium is therefore equivalent to

    g(y) = p = play(x),    phi = (x - p) / c

play is the play operator (backlash) of half width delta [1]. Its output p is constant while
|x - p| <= delta, and otherwise follows x at the distance delta. If x is a sine of amplitude A and
angular frequency omega, the describing function of the play operator [2] gives the amplitude and
the phase lag of the force of the body. If the damping coefficient of the body is estimated with the
position x, the phase lag changes the estimate by -4 k delta (A - delta) / (pi omega A^2). k is the
stiffness of body and transmission in series. If delta is much smaller than A, this change is about
-4 k delta / (pi omega A).

These equations give the position and the velocity of the tip. The damping force of the body is
computed from this velocity. The model neglects that the damping force also stretches the
transmission. Friction and damping of the model nevertheless dissipate energy at all times.

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
    """Elastic transmission from the slave's motor to the tip, with dry friction at the tip.

    With the default values, the transmission is rigid and has no friction.
    """

    lost_motion: float = 0.0
    """Distance delta by which the tip lags the motor because of dry friction [m].

    It is the same in both directions of motion.
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
        """Largest magnitude of the dry friction at the tip [N]."""
        return self.lost_motion / self.compliance if self.compliance else 0.0

    def play(self, p: float, x: float) -> float:
        """Return the new output of the play operator (backlash) [m].

        The output is `p` while |x - p| is at most `lost_motion`. Otherwise it is the value nearest
        to `p` whose distance from `x` is `lost_motion`.
        """
        low, high = x - self.lost_motion, x + self.lost_motion
        return low if p < low else high if p > high else p

    def load(self, law: Law, played: float, tip: float, x: float, v: float) -> float:
        """Return the load [N] on the motor at position x [m] and velocity v [m/s].

        The load is the force of the body (the specimen) on the tip plus the friction at the tip.
        Before the motion to x, the output of the play operator is `played`, and the tip is at the
        position `tip` [m].
        """
        compliance = self.compliance
        if compliance == 0.0:
            return law.force(x, v)
        before, played = played, self.play(played, x)
        if played != before:
            tip = law.compressed(played, compliance)
        return self.tip_force(law, played, tip, x, v) + (x - played) / compliance

    def tip_force(self, law: Law, played: float, tip: float, x: float, v: float) -> float:
        """Return the force of the body (the specimen) on the tip [N]. `tip` is its position."""
        compliance, lost = self.compliance, self.lost_motion
        slips = played <= x - lost if v > 0.0 else played >= x + lost
        speed = v / (1.0 + compliance * law.stiffness(tip)) if slips else 0.0
        return law.force(tip, speed)


RIGID = Transmission()
"""Transmission without compliance and without lost motion."""
