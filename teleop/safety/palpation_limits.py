"""Limits for a palpation, scaled from its depth and from the cube."""

from __future__ import annotations

from dataclasses import replace

from sim_backend import RIGID, Cube, Transmission
from teleop.safety.limits import Limits, default_channel_limits

SOFT, HARD = 1.5, 1.8
"""Depth of the soft and hard position limits, as multiples of the palpation depth.

The force limits are the cube's forces at these depths.
"""
SPEED = 14.0
"""Greatest speed, in depths per second; a sine of 2 Hz needs 6.3."""
STOPPING = 0.015
"""Time in which the slave brakes from the greatest speed to zero [s]."""
ACCELERATION = 26.0
"""Greatest acceleration, as a multiple of depth times frequency squared; a sine needs 19.7."""
FOLLOWING, FROZEN = 0.15, 0.03
"""Greatest following error, and commanded travel after which an unchanged encoder counts as frozen.

Both are fractions of the depth.
"""
FROZEN_SPEED = 0.1
"""Commanded change of velocity after which an unchanged velocity channel counts as frozen.

It is a fraction of the greatest speed.
"""


def palpation_limits(
    cube: Cube,
    depth: float,
    scale: float,
    fastest: float,
    compliance: float,
    transmission: Transmission = RIGID,
) -> Limits:
    """Return the limits for a palpation on the simulated rig.

    Parameters
    ----------
    cube
        The cube that is palpated.
    depth
        Intended depth of the palpation [m].
    scale
        Ratio of slave motion to master motion.
    fastest
        Highest frequency of the excitation [Hz].
    compliance
        Of the slave's drive [m/N].
    transmission
        Between the drive and the cube. It gives way under force, and the contact force does not
        show its friction.
    """
    velocity = max(SPEED, 5.0 * fastest) * depth
    acceleration = max(velocity / STOPPING, ACCELERATION * fastest**2 * depth)
    frozen = FROZEN * depth
    channels = default_channel_limits()
    travels = {
        "master_position": frozen / scale,
        "slave_position": frozen,
        "slave_velocity": FROZEN_SPEED * velocity,
    }
    for name, travel in travels.items():
        channels[name] = replace(channels[name], frozen_travel=travel, required=True)
    return Limits(
        max_velocity=velocity,
        max_acceleration=acceleration,
        max_master_velocity=velocity / scale,
        max_master_acceleration=acceleration / scale,
        soft_position=(-0.5 * depth, SOFT * depth),
        hard_position=(-HARD / SOFT * 0.5 * depth, HARD * depth),
        soft_force=cube.force(cube.compressed(SOFT * depth, transmission.compliance), 0.0),
        hard_force=cube.force(cube.compressed(HARD * depth, transmission.compliance), 0.0),
        following_error=FOLLOWING * depth + compliance * transmission.friction,
        drive_compliance=compliance,
        rest_velocity=0.02 * velocity,
        channels=channels,
    )
