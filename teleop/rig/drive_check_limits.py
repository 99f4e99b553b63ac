"""Limits for the check of the drives, which are tighter than the limits of the rig."""

from __future__ import annotations

from dataclasses import replace

from teleop.errors import InputError
from teleop.rig.zeroing import ForceZero
from teleop.safety import Limits

REACH = 1e-3
"""Largest distance of the slave from its position at the start of the check [m]."""
SOFT_FORCE, HARD_FORCE = 0.025, 0.05
"""Soft and hard limit of the change of the contact force since the start of the check, as fractions
of the hard force limit of the rig."""


def narrow_limits(limits: Limits, zero: ForceZero) -> Limits:
    """Return narrow limits for the check of the drives, which permit only a small motion.

    The position limits are relative to the present position of the slave.
    """
    low, high = (end - zero.position for end in limits.hard_position)
    if not low <= 0.0 <= high:
        raise InputError(
            f"slave_position is {zero.position * 1e3:g} mm: expected it within "
            f"hard_position_mm, {limits.hard_position[0] * 1e3:g} to "
            f"{limits.hard_position[1] * 1e3:g} mm"
        )
    hard = max(low, -REACH), min(high, REACH)
    soft_force, hard_force = narrow_forces(limits)
    return replace(
        limits,
        soft_position=(0.8 * hard[0], 0.8 * hard[1]),
        hard_position=hard,
        soft_force=soft_force,
        hard_force=hard_force,
    )


def narrow_forces(limits: Limits) -> tuple[float, float]:
    """Return the soft and the hard limit of the contact force for the check of the drives [N].

    The contact force is zero at the start of the check. `limits` are the limits of the rig.
    """
    return min(SOFT_FORCE * limits.hard_force, limits.soft_force), HARD_FORCE * limits.hard_force
