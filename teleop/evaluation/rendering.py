"""Compare the force that the hand felt, in a trial with force feedback, to the contact force."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Floats
from teleop.recording.recording import Recording

SETTLING = 4.0
"""Time at the start of a trial that is omitted, because the local model has not converged [s]. At
most half of the trial is omitted."""
LEAST_FORCE = 0.5
"""Contact force above which a tick is evaluated [N]."""
FASTEST = 4.0
"""Frequency above which motion is not voluntary, but tremor or an oscillation of the loop [Hz]."""
MOST_FAST = 0.8
"""Largest fraction of the power of the velocity above `FASTEST` in a stable trial. The tremor of a
stiff arm on a soft specimen can exceed this fraction. Such a trial is counted as not stable."""


class Rendering(NamedTuple):
    """Summary of what the hand felt in a trial.

    Without contact after `SETTLING`, the stiffness and the errors are NaN.
    """

    rendered_k: float
    """Secant stiffness that the hand felt [N/m]: sum of f x divided by sum of x^2."""
    rendered_k_error: float
    """Relative difference between `rendered_k` and its reference. The reference is the secant
    stiffness at the slave, multiplied by the force gain and the motion scale."""
    felt_force_error: float
    """Root mean square difference between the felt force and the contact force of the same motion,
    divided by the root mean square contact force."""
    energy_min_j: float
    """Lowest energy that the hand had given to the displayed environment up to any time [J];
    negative if the environment gave energy to the hand. The energy in the virtual damping and mass
    is not included."""
    stable: bool
    """Whether the trial had no safety stop, and no oscillation above `FASTEST`. A slow instability
    that has not reached the threshold of a stop by the end of the trial is counted as stable."""


class Hand(NamedTuple):
    """Quantities at the hand, each an array of shape (ticks,)."""

    position: Floats
    """Position of the virtual mass relative to the contact point [m]."""
    force: Floats
    """Force that the hand felt from the environment [N]."""
    velocity: Floats
    """Velocity of the virtual mass [m/s]."""


def hand(
    recording: Recording, mass: float, damping: float, stiffness: float, scale: float = 1.0
) -> Hand:
    """Return what the hand felt at each tick in mode active.

    The felt force is the measured force of the hand minus the force that the admittance needs for
    its own motion. The centre of the admittance's spring is the position at the start. At ticks at
    which a limit acted, the felt force is the displayed force that the controller recorded.

    Parameters
    ----------
    recording
        A trial with force feedback or a channel, in mode active.
    mass, damping, stiffness
        Virtual mass [kg], damping [N s/m] and stiffness [N/m] of the admittance.
    scale
        Ratio of slave motion to master motion.
    """
    v, dt = recording["commanded_master_velocity"], recording["dt"]
    before = np.concatenate(([0.0], v[:-1]))
    mean = 0.5 * (v + before)
    moved = np.cumsum(mean * dt)
    force = recording["drive_force"] - mass * (v - before) / dt - damping * mean
    force -= stiffness * (moved - 0.5 * mean * dt)
    limited = recording["limited"] != 0
    force = np.where(limited, recording["displayed_force"], force)
    start = recording["slave_position"][0] / scale if len(v) else 0.0
    return Hand(start + moved, force, mean)


def rendering(
    active: Recording,
    mass: float,
    damping: float,
    stiffness: float,
    scale: float = 1.0,
    gain: float = 1.0,
) -> Rendering:
    """Return a summary of what the hand felt in a trial with force feedback or a channel.

    Parameters
    ----------
    active
        The ticks of the trial in mode active, and its events.
    mass, damping, stiffness
        Virtual mass [kg], damping [N s/m] and stiffness [N/m] of the admittance.
    scale
        Ratio of slave motion to master motion.
    gain
        Ratio of the displayed force to the contact force.
    """
    if not len(active):
        return Rendering(math.nan, math.nan, math.nan, math.nan, stable=False)
    t, x, f = active["time"], active["slave_position"], gain * active["contact_force"]
    felt = hand(active, mass, damping, stiffness, scale)
    energy = np.cumsum(felt.force * felt.velocity * active["dt"])
    settled = t > min(SETTLING, 0.5 * t[-1])
    fast = fast_share(felt.velocity[settled], active["dt"][settled])
    stable = active.fault is None and fast < MOST_FAST
    part = settled & (np.abs(f) > LEAST_FORCE)
    lowest = min(float(energy.min()), 0.0)
    if part.sum() < 100:
        return Rendering(math.nan, math.nan, math.nan, lowest, stable)
    rendered = secant(felt.position[part], felt.force[part])
    touched = scale * secant(x[part], f[part])
    sent = t - active["motion_age"]
    same_motion = np.interp(sent[part], t, felt.force)
    error = math.sqrt(np.mean((same_motion - f[part]) ** 2) / np.mean(f[part] ** 2))
    return Rendering(rendered, rendered / touched - 1.0, error, lowest, stable)


def secant(x: Floats, f: Floats) -> float:
    """Return the slope of the line through the contact point that fits force and position [N/m]."""
    return float(np.dot(f, x) / np.dot(x, x))


def fast_share(velocity: Floats, dt: Floats) -> float:
    """Return the fraction of a velocity's power at frequencies above `FASTEST`."""
    power: NDArray[np.float64] = np.abs(np.fft.rfft(velocity * np.hanning(len(velocity)))) ** 2
    frequency = np.fft.rfftfreq(len(velocity), float(np.mean(dt)))
    total = float(power.sum())
    return float(power[frequency > FASTEST].sum()) / total if total > 0.0 else 0.0
