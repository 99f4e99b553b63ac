"""A simulated operator who pokes until the felt force, or the depth, reaches an intended value.

The hand has an intended position p, and the arm is a spring of stiffness K between p and the
handle [1]. Before a movement, a person chooses p from an internal model of the object. After each
contact, the person uses the error of the internal model in this contact to correct the model
[2, 3]. Here the internal model is the stiffness s that the person expects at the handle. With the
intended force F, the person wants to reach the displacement x = min(F / s, depth). The intended
position is then

    p = x + s x / K

The felt stiffness is the felt force divided by the displacement. After each poke, s is corrected by
a fraction of the difference between the felt stiffness and s. In the first poke, s is 0, and p is
therefore the depth.

During a movement, a person reacts to a felt force after a reaction time [4]. In the model, this
time is `PERCEPTION`. The planned movement continues, and a second minimum-jerk movement is added to
it [5]. Let p1 be the intended position at the time when the force or the depth reached the intended
value. In the model, the sum of the two movements ends at p1.

The fraction by which s is corrected, and the duration of the second movement, are assumptions
without a source.

[1] N. Hogan, ASME J. Dyn. Sys. Meas. Control 107(1), 1985.
[2] M. Casadio, A. Pressman, F. A. Mussa-Ivaldi, Front. Comput. Neurosci. 9:118, 2015.
[3] R. A. Scheidt, J. B. Dingwell, F. A. Mussa-Ivaldi, J. Neurophysiol. 86(2), 2001.
[4] R. Chernikoff, F. V. Taylor, J. Exp. Psychol. 43(1), 1952.
[5] T. Flash, E. Henis, J. Cogn. Neurosci. 3(3), 1991.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from sim_backend.operators import (
    REACTION,
    TREMOR_AMPLITUDE,
    WITHDRAWAL,
    FreePalpation,
    Stroke,
)
from sim_backend.plant import Intention

PERCEPTION = 0.175
"""Reaction time: time from a felt force to the movement that this force causes [s]."""
CORRECTION = 0.25
"""Duration of the movement that a felt force causes [s]."""
LEARNING = 0.5
"""Correction of the expected stiffness after one poke, divided by the error of this stiffness."""


class Felt(NamedTuple):
    """Position and force that the operator feels at one time, and the intended position."""

    time: float
    """Time after the first movement began [s]."""
    intended: float
    """Intended position of the hand [m]."""
    position: float
    """Position of the handle [m]."""
    force: float
    """Force of the hand on the handle [N]."""


class ForcePalpation(FreePalpation):
    """Operator who pokes until a force or a depth is reached, whichever is reached first.

    Parameters
    ----------
    depth
        Largest intended depth of the handle [m], > 0.
    seed
        Seed of the random variations of the motion.
    force
        Force of the hand on the handle at which a movement into the specimen ends [N], > 0.
    arm_stiffness
        Stiffness of the operator's arm [N/m], > 0.
    withdrawal
        Mean intended position of the hand between two pokes, divided by the depth.

    Raises
    ------
    ValueError
        The depth, the force or the stiffness is not positive.
    """

    def __init__(
        self,
        depth: float,
        seed: int,
        force: float,
        arm_stiffness: float,
        withdrawal: float = WITHDRAWAL,
    ) -> None:
        super().__init__(depth, seed, withdrawal)
        for name, value in (("force", force), ("arm stiffness", arm_stiffness)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"palpation {name} must be positive, got {value:g}")
        self._aim = force
        self._arm_stiffness = arm_stiffness
        self.expected_stiffness = 0.0
        """Stiffness at the handle that the operator expects [N/m]."""
        self._held: list[tuple[float, float]] = []
        self._felt: deque[Felt] = deque()
        self._intended = 0.0
        self._correction: Stroke | None = None

    def movement(self, t: float) -> Intention:
        """Return the intended motion without tremor, at t [s] after the hand began to move.

        This is the planned movement plus a correction, if there is one. The correction is a second
        movement, which ends the poke. It begins `PERCEPTION` seconds after the handle has reached
        the intended force or the intended depth.
        """
        position, velocity = super().movement(t)
        if not self._correction:
            self._perceive(t)
        if self._correction:
            change, rate = self._correction.at(t)
            position, velocity = position + change, velocity + rate
        self._intended = position
        return Intention(position, velocity)

    def feel(self, t: float, position: float, force: float) -> None:
        """Store the handle position [m] and the force [N] that the hand feels at t [s].

        t is the time since the drives were enabled. The values are stored only during a movement
        into the specimen, and during the rest after this movement.
        """
        t -= REACTION
        if not self._inwards:
            return
        self._felt.append(Felt(t, self._intended, position, force))
        if t >= self._stroke.end:
            self._held.append((position, force))

    def _perceive(self, t: float) -> None:
        """Begin a correction if the intended force or depth was reached `PERCEPTION` seconds ago.

        t is the present time after the first movement began [s]. The correction is a second
        movement, which is added to the planned movement and ends the poke.
        """
        while self._inwards and self._felt and self._felt[0].time <= t - PERCEPTION:
            felt = self._felt.popleft()
            if felt.force >= self._aim or felt.position >= self.depth:
                self._correction = Stroke(t, CORRECTION, felt.intended - self._to)
                self._to = felt.intended
                self._end = max(self._end, t + CORRECTION + self._dwell)
                return

    def _next(self, start: float) -> None:
        self._felt.clear()
        self._correction = None
        super()._next(start)

    def _reach(self) -> float:
        """Return the intended position at the end of the next movement into the specimen [m].

        This position is computed from the stiffness that the operator expects at the handle. The
        expected stiffness is first corrected with the stiffness that was felt in the last poke.
        """
        if self._held:
            position, force = (
                sum(values) / len(values) for values in zip(*self._held, strict=True)
            )
            felt = max(force, 0.0) / max(position, TREMOR_AMPLITUDE)
            self.expected_stiffness += LEARNING * (felt - self.expected_stiffness)
            self._held.clear()
        stiffness = self.expected_stiffness
        x = min(self._aim / stiffness, self.depth) if stiffness else self.depth
        return x + stiffness * x / self._arm_stiffness
