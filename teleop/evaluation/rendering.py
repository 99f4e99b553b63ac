"""Force that the hand felt in a recorded trial with force feedback, and contact force.

Tremor and an oscillation of the loop have similar frequencies. They differ in the direction of the
energy. With the Fourier transforms F of the force of the hand on the virtual mass and V of the
velocity, the mean power from the hand to virtual mass and environment at one frequency is
proportional to

    Re{F V*} = Re{Z} |V|^2,

where Z is the displayed impedance. In tremor the hand moves a passive impedance, so that the power
is positive: Re{Z} >= 0 at each frequency is the definition of a passive linear port [1]. In an
oscillation without a voluntary or involuntary motion of the hand, F = -Z_a V with the impedance Z_a
of the arm. The arm dissipates energy, so that the power is -Re{Z_a} |V|^2 < 0: the displayed
environment must replace the energy that the arm dissipates. So an oscillation of the loop is motion
at frequencies at which the hand receives energy.

The arm dissipates at least `LEAST_DAMPING` |V|^2. An environment that gives out less, Re{Z} above
-`LEAST_DAMPING`, amplifies the tremor, but the arm keeps the loop stable. Such motion is not
counted. If the displayed environment gives out more at the frequency of the tremor, and only a
greater damping of the arm keeps the loop stable, the trial is counted as not stable.

[1] J. E. Colgate, N. Hogan, Int. J. Control 48(1), 1988, 65-88.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from estimation.compiled import Floats
from teleop.recording.recording import Recording

SETTLING = 4.0
"""Time at the start of a trial that is omitted, because the local model has not converged [s]. At
most half of the trial is omitted."""
LEAST_FORCE = 0.5
"""Contact force above which a tick is evaluated [N]."""
FASTEST = 4.0
"""Frequency above which motion is not voluntary, but tremor or an oscillation of the loop [Hz]."""
LEAST_DAMPING = 2.0
"""Damping that any arm has at least [N s/m]."""
MOST_SUSTAINED = 0.8
"""Greatest share of the power of the velocity in a stable trial that is above `FASTEST`, at
frequencies at which the hand receives more than `LEAST_DAMPING` |V|^2."""
SEGMENT = 1.0
"""Duration of the segments of the motion of which the spectra are averaged [s]."""


class Rendering(NamedTuple):
    """Summary of what the hand felt in a trial.

    Without contact after `SETTLING`, the stiffness and the errors are NaN.
    """

    rendered_k: float
    """Secant stiffness that the hand felt [N/m]: sum of f x divided by sum of x^2."""
    rendered_k_error: float
    """Relative difference between `rendered_k` and the secant stiffness at the slave in the same
    motion, multiplied by force gain and motion scale."""
    felt_force_error: float
    """Root mean square difference between the felt force and the contact force of the same motion,
    divided by the root mean square contact force."""
    energy_min_j: float
    """Lowest energy that the hand had given to the displayed environment up to any time [J];
    negative if the environment gave energy to the hand. The energy in the virtual damping and mass
    is not included."""
    stable: bool
    """Whether the trial had no safety stop, and no oscillation of the loop above `FASTEST`. A slow
    instability that has not reached the threshold of a stop by the end of the trial is counted as
    stable."""


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

    The force of the environment is the measured force of the hand minus the force that the
    admittance needs for its motion. The centre of its spring is the position at the start. Where a
    limit reduced the velocity of the master, the virtual mass moved at the applied velocity, and
    the force is the displayed force that the controller recorded.

    Parameters
    ----------
    recording
        A trial with force feedback or a channel, in mode active.
    mass, damping, stiffness
        Virtual mass [kg], damping [N s/m] and stiffness [N/m] of the admittance.
    scale
        Ratio of slave motion to master motion.
    """
    desired, dt = recording["desired_master_velocity"], recording["dt"]
    limited = recording["commanded_master_velocity"] != desired
    v = np.where(limited, recording["applied_master_velocity"], desired)
    before = np.concatenate(([0.0], v[:-1]))
    mean = np.where(limited, v, 0.5 * (v + before))
    moved = np.cumsum(mean * dt)
    force = recording["drive_force"] - mass * (v - before) / dt - damping * mean
    force -= stiffness * (moved - 0.5 * mean * dt)
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
    oscillation = sustained_share(
        felt.velocity[settled], active["drive_force"][settled], active["dt"][settled]
    )
    stable = active.fault is None and oscillation < MOST_SUSTAINED
    part = settled & (np.abs(f) > LEAST_FORCE)
    lowest = min(float(energy.min()), 0.0)
    if part.sum() < 100:
        return Rendering(math.nan, math.nan, math.nan, lowest, stable)
    sent = (t - active["motion_age"])[part]
    position, force = np.interp(sent, t, felt.position), np.interp(sent, t, felt.force)
    rendered = secant(position, force)
    touched = scale * secant(x[part], f[part])
    error = math.sqrt(np.mean((force - f[part]) ** 2) / np.mean(f[part] ** 2))
    return Rendering(rendered, rendered / touched - 1.0, error, lowest, stable)


def secant(x: Floats, f: Floats) -> float:
    """Return the slope of the line through the contact point that fits force and position [N/m]."""
    return float(np.dot(f, x) / np.dot(x, x))


def sustained_share(velocity: Floats, force: Floats, dt: Floats) -> float:
    """Return the share of a motion's power that is in an oscillation of the loop.

    It is the fraction of the power of the velocity above `FASTEST`, at frequencies at which the
    hand receives more energy than an arm with the damping `LEAST_DAMPING` dissipates. The spectra
    are averages over overlapping segments (P. D. Welch, IEEE Trans. Audio Electroacoust. 15(2),
    1967).

    Parameters
    ----------
    velocity
        Velocity of the virtual mass [m/s].
    force
        Force of the hand on the virtual mass [N].
    dt
        Time step of each sample [s].
    """
    if not len(velocity):
        return 0.0
    step = float(np.mean(dt))
    length = min(max(round(SEGMENT / step), 2), len(velocity))
    starts = slice(None, None, max(length // 2, 1))
    window = np.hanning(length)
    v, f = (
        np.fft.rfft(window * sliding_window_view(signal, length)[starts], axis=1)
        for signal in (velocity, force)
    )
    motion = np.sum(np.abs(v) ** 2, axis=0)
    from_hand = np.sum((f * v.conj()).real, axis=0)
    fast = np.fft.rfftfreq(length, step) > FASTEST
    total = float(motion.sum())
    sustained = fast & (from_hand < -LEAST_DAMPING * motion)
    return float(motion[sustained].sum()) / total if total > 0.0 else 0.0
