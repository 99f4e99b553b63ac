"""Make the remarks on the contact that are reported together with k and b.

The remarks concern adhesion, friction, inverted signs of force and position, and a record that
contains only a single ramp.
"""

from __future__ import annotations

import numpy as np

from teleop.evaluation.local_stiffness import LocalStiffness
from teleop.evaluation.prepared import Prepared
from teleop.evaluation.reason import INVERT_BOTH, Reason
from teleop.evaluation.unsuited import negative_force

LOWEST = 0.1
"""Fraction of the travel, from the lowest position, that is assumed to be out of contact."""
CONSTANT = 0.02
"""Largest standard deviation of the force out of contact, as a fraction of the force range."""
PULL = 0.05
"""Smallest adhesion that is reported, as a fraction of the force range."""
PULL_NOISE = 6.0
"""Smallest adhesion that is reported, in standard deviations of the noise of the smoothed force."""


def adhesion(record: Prepared) -> float | None:
    """Return the largest adhesion force [N]; None if there is no adhesion.

    If the specimen adheres to the tip, it pulls the tip during the retraction. The force is then
    lower than the force out of contact. The result is the difference of these two forces.
    """
    x, f = record.x, record.f
    span = float(np.ptp(f))
    out = f[x < x.min() + LOWEST * float(np.ptp(x))]
    if span == 0.0 or float(np.std(out)) > CONSTANT * span:
        return None
    pull = float(np.median(out) - f.min())
    return pull if pull > max(PULL * span, PULL_NOISE * record.f_noise_smoothed) else None


def contact_remarks(record: Prepared, local: LocalStiffness) -> list[Reason]:
    """Return remarks on adhesion, a single ramp, friction, and a negative force, if they apply.

    Parameters
    ----------
    record
        The prepared record. Its stiffness is identifiable.
    local
        Stiffness and damping of the record.
    """
    found = []
    if pull := adhesion(record):
        found.append(
            Reason(f"adhesion: the force falls by {pull:.3g} N below its level out of contact")
        )
    if record.ramp:
        found.append(
            Reason(
                "one ramp: a drift of the force during the ramp has the same effect as a "
                "stiffness; expected a motion that reverses, to see the difference"
            )
        )
    if local.friction:
        found.append(
            Reason(
                "friction: the loss does not depend on the speed; b holds for this frequency and "
                "amplitude only"
            )
        )
    if negative_force(record):
        found.append(
            Reason(
                "the force is negative: if it is negative in compression, k is that of unloading",
                INVERT_BOTH,
            )
        )
    return found
