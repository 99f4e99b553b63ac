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
"""Contact force, multiplied by the force gain, above which a tick is evaluated [N]."""
FASTEST = 4.0
"""Frequency above which motion is not voluntary, but tremor or an oscillation of the loop [Hz]."""
LEAST_DAMPING = 2.0
"""Damping that any arm has at least [N s/m]."""
MOST_SUSTAINED = 0.8
"""Greatest share of the power of the velocity in a stable trial that is above `FASTEST`, at
frequencies at which the hand receives more than `LEAST_DAMPING` |V|^2."""
SEGMENT = 1.0
"""Duration of the segments of the motion of which the spectra are averaged [s]."""
FIRST = 1 << 14
"""Number of samples whose mean period gives the number of samples in a segment."""
OLDEST = 10.0
"""Time for which the motion of the hand is kept [s], to compare it with the delayed motion of the
slave. No communication channel delays a motion by this time."""


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
    divided by the root mean square contact force. The contact force is multiplied by the force
    gain."""
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


class RunningHand:
    """Quantities at the hand in a trial whose ticks in mode active arrive in blocks.

    The force of the environment is the measured force of the hand minus the force that the
    admittance needs for its motion. The centre of its spring is the position at the start. Where a
    limit reduced the velocity of the master, the virtual mass moved at the applied velocity, and
    the force is the displayed force that the controller recorded.

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
    """Summary of what the hand felt in a trial whose ticks in mode active arrive in blocks.

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
    """

    def __init__(self, hand: RunningHand, scale: float, gain: float, end: float) -> None:
        self._hand, self._scale, self._gain = hand, scale, gain
        self._settled = min(SETTLING, 0.5 * end)
        self._spectra = RunningSpectra()
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


class RunningSpectra:
    """Spectra of velocity and force, from which oscillations of the loop are detected.

    The spectra are averages over overlapping segments (P. D. Welch, IEEE Trans. Audio
    Electroacoust. 15(2), 1967). The sample period is the mean period of the first `FIRST` samples
    or more.
    """

    def __init__(self) -> None:
        self._pending: Floats = np.empty((3, 0))
        self._step = 0.0
        self._length = 0
        self._motion: Floats = np.empty(0)
        self._from_hand: Floats = np.empty(0)

    def add(self, velocity: Floats, force: Floats, dt: Floats) -> None:
        """Add samples.

        Parameters
        ----------
        velocity
            Velocity of the virtual mass [m/s].
        force
            Force of the hand on the virtual mass [N].
        dt
            Time step of each sample [s].
        """
        self._pending = np.concatenate((self._pending, (velocity, force, dt)), axis=1)
        if self._pending.shape[1] >= FIRST:
            self._add_segments()

    def sustained_share(self) -> float:
        """Return the share of the power of the motion that is in an oscillation of the loop.

        It is the fraction of the power of the velocity above `FASTEST`, at frequencies at which the
        hand receives more energy than an arm with the damping `LEAST_DAMPING` dissipates.
        """
        if not self._length:
            if not self._pending.shape[1]:
                return 0.0
            self._add_segments()
        fast = np.fft.rfftfreq(self._length, self._step) > FASTEST
        total = float(self._motion.sum())
        oscillating = fast & (self._from_hand < -LEAST_DAMPING * self._motion)
        return float(self._motion[oscillating].sum()) / total if total > 0.0 else 0.0

    def _add_segments(self) -> None:
        velocity, force, dt = self._pending
        if not self._length:
            self._step = float(np.mean(dt))
            self._length = min(max(round(SEGMENT / self._step), 2), len(velocity))
            self._motion = np.zeros(self._length // 2 + 1)
            self._from_hand = np.zeros(self._length // 2 + 1)
        length, stride = self._length, max(self._length // 2, 1)
        if len(velocity) < length:
            return
        window = np.hanning(length)
        v, f = (
            np.fft.rfft(window * sliding_window_view(signal, length)[::stride], axis=1)
            for signal in (velocity, force)
        )
        self._motion += np.sum(np.abs(v) ** 2, axis=0)
        self._from_hand += np.sum((f * v.conj()).real, axis=0)
        self._pending = self._pending[:, len(v) * stride :].copy()


def sustained_share(velocity: Floats, force: Floats, dt: Floats) -> float:
    """Return the share of a motion's power that is in an oscillation (see `RunningSpectra`)."""
    spectra = RunningSpectra()
    spectra.add(velocity, force, dt)
    return spectra.sustained_share()
