"""Compute what the hand felt in a recorded trial with force feedback: stiffness, force, energy."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.compiled import Floats
from teleop.evaluation.loop_oscillation import MOST_SUSTAINED, ArmDamping, RunningSpectra
from teleop.recording.recording import Recording

SETTLING = 4.0
"""Time at the start of a trial that is omitted, because the local model has not converged [s]. At
most half of the trial is omitted."""
LEAST_FORCE = 0.5
"""Contact force, multiplied by the force gain, above which a tick is evaluated [N]."""
OLDEST = 10.0
"""Time for which the motion of the hand is kept [s], to compare it with the delayed motion of the
slave. No communication channel delays a motion by this time."""


class Rendering(NamedTuple):
    """Summary of what the hand felt in a trial.

    If there are too few ticks with contact after the time `SETTLING`, the stiffness and the errors
    are NaN.
    """

    rendered_k: float
    """Secant stiffness that the hand felt [N/m]: sum of f x divided by sum of x^2."""
    rendered_k_error: float
    """Relative difference between `rendered_k` and the secant stiffness at the slave in the same
    motion, multiplied by force gain and motion scale."""
    felt_force_error: float
    """Root mean square difference between the felt force and the contact force of the same motion,
    divided by the root mean square contact force. The contact force is multiplied by the force
    gain."""
    energy_min_j: float
    """Lowest energy that the hand had given to the displayed environment up to any time [J];
    negative if the environment gave energy to the hand. The energy in the virtual damping and mass
    is not included."""
    stable: bool
    """Whether the trial had no safety stop, and no oscillation of the loop (see
    `teleop.evaluation.loop_oscillation`). A slow instability that has not reached the threshold of
    a stop by the end of the trial is counted as stable."""


class Hand(NamedTuple):
    """Quantities at the hand, each an array of shape (ticks,)."""

    position: Floats
    """Position of the virtual mass relative to the contact point [m]."""
    force: Floats
    """Force that the hand felt from the environment [N]."""
    velocity: Floats
    """Velocity of the virtual mass [m/s]."""


class RunningHand:
    """Computes quantities at the hand from the ticks in mode active, which are added in blocks.

    The admittance consists of a virtual mass, damping and spring. The force of the spring is zero
    at the initial position. The force that the hand felt from the environment is the measured force
    of the hand minus the force that moves the admittance. At some ticks, a limit changed the
    commanded velocity of the master. At these ticks, the velocity of the virtual mass is the
    applied velocity, and the force that the hand felt is the displayed force that the controller
    recorded.

    Parameters
    ----------
    mass, damping, stiffness
        Virtual mass [kg], damping [N s/m] and stiffness [N/m] of the admittance.
    scale
        Ratio of slave motion to master motion.
    """

    def __init__(self, mass: float, damping: float, stiffness: float, scale: float = 1.0) -> None:
        self._mass, self._damping, self._stiffness = mass, damping, stiffness
        self._scale = scale
        self._start: float | None = None
        self._v = self._moved = 0.0

    def add(self, active: Recording) -> Hand:
        """Return the quantities at the next ticks."""
        if not len(active):
            return Hand(np.empty(0), np.empty(0), np.empty(0))
        desired, dt = active["desired_master_velocity"], active["dt"]
        limited = active["commanded_master_velocity"] != desired
        v = np.where(limited, active["applied_master_velocity"], desired)
        before = np.concatenate(([self._v], v[:-1]))
        mean = np.where(limited, v, 0.5 * (v + before))
        moved = cumulative_sum(mean * dt, self._moved)
        force = active["drive_force"] - self._mass * (v - before) / dt - self._damping * mean
        force -= self._stiffness * (moved - 0.5 * mean * dt)
        force = np.where(limited, active["displayed_force"], force)
        if self._start is None:
            self._start = float(active["slave_position"][0]) / self._scale
        self._v, self._moved = float(v[-1]), float(moved[-1])
        return Hand(self._start + moved, force, mean)


def hand(
    recording: Recording, mass: float, damping: float, stiffness: float, scale: float = 1.0
) -> Hand:
    """Return the quantities at the hand at all ticks in mode active (see `RunningHand`)."""
    return RunningHand(mass, damping, stiffness, scale).add(recording)


class RunningRendering:
    """Computes the summary of what the hand felt in a trial.

    The ticks in mode active are added in blocks.

    Parameters
    ----------
    hand
        Computes the quantities at the hand.
    scale
        Ratio of slave motion to master motion.
    gain
        Ratio of the displayed force to the contact force.
    end
        Time of the last tick in mode active [s].
    arm_damping
        Damping of the arm [N s/m] at frequencies [Hz], if the arm is known.
    """

    def __init__(
        self,
        hand: RunningHand,
        scale: float,
        gain: float,
        end: float,
        arm_damping: ArmDamping | None = None,
    ) -> None:
        self._hand, self._scale, self._gain = hand, scale, gain
        self._settled = min(SETTLING, 0.5 * end)
        self._spectra = RunningSpectra(arm_damping)
        self._ticks = self._evaluated = 0
        self._energy = self._lowest = 0.0
        self._sums = np.zeros(6)
        self._earlier: Floats = np.empty((3, 0))
        """Times of earlier ticks, and position and force of the hand at these ticks."""

    def add(self, active: Recording) -> None:
        """Add the next ticks in mode active."""
        if not len(active):
            return
        self._ticks += len(active)
        t, x, f = active["time"], active["slave_position"], self._gain * active["contact_force"]
        felt = self._hand.add(active)
        energy = cumulative_sum(felt.force * felt.velocity * active["dt"], self._energy)
        self._energy, self._lowest = float(energy[-1]), min(self._lowest, float(energy.min()))
        settled = t > self._settled
        self._spectra.add(
            felt.velocity[settled], active["drive_force"][settled], active["dt"][settled]
        )
        part = settled & (np.abs(f) > LEAST_FORCE)
        times, positions, forces = self._earlier = np.concatenate(
            (self._earlier, (t, felt.position, felt.force)), axis=1
        )
        sent, x, f = (t - active["motion_age"])[part], x[part], f[part]
        position, force = np.interp(sent, times, positions), np.interp(sent, times, forces)
        self._evaluated += len(f)
        self._sums += (
            np.dot(force, position),
            np.dot(position, position),
            np.dot(f, x),
            np.dot(x, x),
            np.sum((force - f) ** 2),
            np.sum(f**2),
        )
        self._earlier = self._earlier[:, times > t[-1] - OLDEST]

    def result(self, fault: bool) -> Rendering:
        """Return the summary; `fault` is whether a fault stopped the trial."""
        if not self._ticks:
            return Rendering(math.nan, math.nan, math.nan, math.nan, stable=False)
        stable = not fault and self._spectra.sustained_share() < MOST_SUSTAINED
        count = self._evaluated
        if count < 100:
            return Rendering(math.nan, math.nan, math.nan, self._lowest, stable)
        felt, felt_square, touched, touched_square, error, square = self._sums.tolist()
        rendered = felt / felt_square
        expected = self._scale * (touched / touched_square)
        relative = math.sqrt((error / count) / (square / count))
        return Rendering(rendered, rendered / expected - 1.0, relative, self._lowest, stable)


def cumulative_sum(values: Floats, start: float) -> Floats:
    """Return the sums of `start` and the first 1, 2, ... n values, shape (n,)."""
    return np.cumsum(np.concatenate(([start], values)))[1:]
