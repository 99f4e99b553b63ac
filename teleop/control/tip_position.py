"""Compute the position of the slave's encoder at which the tip has a desired position.

The transmission between encoder and tip has lost motion (play of half width d) and the compliance
c. The position of the tip is play(x, d) - c f, where x is the position at the encoder and f the
contact force. To move the tip to r, the encoder has to be at

    x = r + c f + (d / h) (r - q),    q = play(r, h)

The last term is an approximate inverse of the play. While r moves in one direction, it is d or -d.
When r reverses, it changes from one of these values to the other while r moves by 2 h. The exact
inverse would jump. h is much smaller than d, and larger than the noise of r.

The inverse is a part of the command of the slave only. The play itself is never displayed to the
hand: a play that is displayed generates energy, about 2 d dF per cycle with a change dF of the
force.

References
----------
G. Tao, P. V. Kokotovic, "Adaptive Control of Systems with Actuator and Sensor Nonlinearities",
Wiley, 1996, section 2.3 (soft inverse of backlash).
"""

from __future__ import annotations

from typing import NamedTuple

from estimation.filters import Play

SMOOTHING = 10e-6
"""Half of the motion h of the tip in which the command crosses the play [m]."""


class EncoderGoal(NamedTuple):
    """Desired position of the encoder, and its change per change of the position of the tip."""

    position: float
    """Desired position of the encoder [m]."""
    slope: float
    """Velocity of the encoder per velocity of the tip, >= 1."""


class TipPosition:
    """Computes the position of the encoder from the desired position of the tip.

    `half_width` is that of the play [m]; it can be changed at any time.
    """

    def __init__(self, half_width: float = 0.0) -> None:
        self.half_width = half_width
        self._play = Play(SMOOTHING)

    def reset(self) -> None:
        """Start again with the tip in the middle of the play."""
        self._play.reset()

    def goal(self, tip: float, stretch: float, stretch_slope: float) -> EncoderGoal:
        """Return the goal of the encoder for the tip at `tip` [m].

        `stretch` is the stretch c f of the transmission [m], and `stretch_slope` its change per
        change of the position of the tip.
        """
        before = self._play.y
        middle = self._play.update(tip)
        share = self.half_width / SMOOTHING
        crossing = share if middle == before else 0.0
        return EncoderGoal(tip + stretch + share * (tip - middle), 1.0 + stretch_slope + crossing)
