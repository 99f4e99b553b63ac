"""Compute the safety limits for a palpation on the simulated rig.

The limits are computed from the palpation depth and from the properties of the palpated body.
"""

from __future__ import annotations

import math
from dataclasses import replace

from sim_backend import RIGID, ForceMaster, Law, Transmission
from teleop.safety.limits import ChannelLimits, Limits, default_channel_limits

SOFT, HARD = 1.5, 1.8
"""Soft and hard upper position limit, as multiples of the palpation depth.

The force limits are the forces of the body at these positions.
"""
SPEED = 14.0
"""Largest speed, in palpation depths per second. A palpation with a sine of 2 Hz needs 6.3."""
BRAKING_TIME = 0.015
"""Time in which the slave can brake from the largest speed to zero [s]."""
ACCELERATION = 26.0
"""Largest acceleration, as a multiple of depth times frequency squared. A sine needs the factor
19.7."""
FOLLOWING, FROZEN = 0.15, 0.03
"""Largest following error, and largest commanded travel while the encoder value is constant.

Both are fractions of the palpation depth.
"""
FROZEN_SPEED = 0.1
"""Largest commanded change of velocity while the measured velocity does not change.

It is given as a fraction of the largest speed.
"""


def simulated_rig_limits(
    law: Law,
    depth: float,
    scale: float,
    fastest: float,
    compliance: float,
    transmission: Transmission = RIGID,
    force_master: ForceMaster | None = None,
) -> Limits:
    """Return the safety limits for a palpation on the simulated rig.

    Parameters
    ----------
    law
        Contact force of the palpated body as a function of displacement and velocity. The force
        limits are the forces at the upper position limits.
    depth
        Intended depth of the palpation [m].
    scale
        Ratio of the motion of the slave to the motion of the master (the handle).
    fastest
        Highest frequency of the intended motion [Hz].
    compliance
        Displacement of the slave's drive per newton of contact force [m/N].
    transmission
        Compliance and dry friction between the drive and the tip, which touches the body. The
        compliance reduces the force limits. The friction increases the limit of the following
        error (commanded minus measured travel).
    force_master
        Force-commanded master. Its handle moves as the hand does, not as commanded, and its force
        is computed.
    """
    velocity = max(SPEED, 5.0 * fastest) * depth
    acceleration = max(velocity / BRAKING_TIME, ACCELERATION * fastest**2 * depth)
    frozen = FROZEN * depth
    channels = default_channel_limits()
    travels = {
        "master_position": frozen / scale,
        "slave_position": frozen,
        "slave_velocity": FROZEN_SPEED * velocity,
    }
    for name, travel in travels.items():
        channels[name] = replace(channels[name], frozen_travel=travel, required=True)
    if force_master:
        most = force_master.max_force
        channels["master_force"] = ChannelLimits(-most, most)
        channels["master_position"] = replace(channels["master_position"], frozen_travel=math.inf)
    return Limits(
        max_velocity=velocity,
        max_acceleration=acceleration,
        max_master_velocity=velocity / scale,
        max_master_acceleration=acceleration / scale,
        soft_position=(-0.5 * depth, SOFT * depth),
        hard_position=(-HARD / SOFT * 0.5 * depth, HARD * depth),
        soft_force=law.force(law.compressed(SOFT * depth, transmission.compliance), 0.0),
        hard_force=law.force(law.compressed(HARD * depth, transmission.compliance), 0.0),
        following_error=FOLLOWING * depth + compliance * transmission.friction,
        drive_compliance=compliance,
        rest_velocity=0.02 * velocity,
        channels=channels,
    )
