"""Limits for a palpation, scaled from its depth and from what is palpated."""

from __future__ import annotations

from dataclasses import replace

from sim_backend import RIGID, Cube, Transmission
from teleop.safety.limits import Limits, usual_channels

SOFT, HARD = 1.5, 1.8
"""Position and force limits, as a share of depth and of the force there."""
SPEED = 14.0
"""Greatest speed, in depths a second; a sine of 2 Hz takes 6.3."""
STOPPING = 0.015
"""Time in which the greatest speed is brought to zero [s]."""
LIVELY = 26.0
"""Greatest acceleration, in depths times the square of the frequency; a sine takes 19.7."""
FOLLOWING, FROZEN = 0.15, 0.03
"""Following error and the commanded travel that shows a frozen encoder, as a share of depth."""
FROZEN_SPEED = 0.1
"""The commanded change of velocity that shows a frozen one, as a share of the greatest speed."""


def palpation_limits(
    cube: Cube,
    depth: float,
    scale: float,
    fastest: float,
    compliance: float,
    transmission: Transmission = RIGID,
) -> Limits:
    """Limits of a palpation on the simulated rig.

    Parameters
    ----------
    cube
        What is palpated.
    depth
        Depth that is aimed for [m].
    scale
        Slave motion for a unit of master motion.
    fastest
        Highest frequency of the excitation [Hz].
    compliance
        Of the slave's drive [m/N].
    transmission
        Between the drive and the cube. It gives way under force, and the contact force does not
        show its friction.
    """
    velocity = max(SPEED, 5.0 * fastest) * depth
    acceleration = max(velocity / STOPPING, LIVELY * fastest**2 * depth)
    frozen = FROZEN * depth
    channels = usual_channels()
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
