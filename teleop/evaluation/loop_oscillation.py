"""Detect oscillations of the control loop in a recorded trial with force feedback.

Tremor and an oscillation of the loop have similar frequencies, but the energy flows in opposite
directions. Let F be the Fourier transform of the force of the hand on the virtual mass, and V that
of the velocity. At one frequency, the mean power from the hand to the virtual mass and the
environment is proportional to

    Re{F V*} = Re{Z} |V|^2,

where Z is the displayed impedance. In tremor, the hand moves a passive impedance. A passive linear
port has Re{Z} >= 0 at each frequency [1]. The power is therefore not negative. In a pure
oscillation of the loop, the muscles of the hand cause no motion. Then F = -Z_a V, where Z_a is the
impedance of the arm. The arm dissipates energy, and the displayed environment supplies this energy.
The power is therefore -Re{Z_a} |V|^2 < 0. For this reason, an oscillation of the loop is a motion
at frequencies at which the hand receives energy.

If -Re{Z_a} < Re{Z} < 0, the environment amplifies the tremor, but the loop is stable because of the
arm. Motion is therefore counted as an oscillation only at frequencies at which -Re{Z} is above a
threshold:

- On a hardware rig, the damping of the arm is not known. The threshold is `LEAST_DAMPING`, the
  smallest damping of any arm. If the real damping is larger, a stable trial can be counted as not
  stable.
- On the simulated rig, the damping Re{Z_a} of the arm is known. The threshold is the product of
  `SUSTAINING` and Re{Z_a}. If this product is below `LEAST_DAMPING`, the threshold is
  `LEAST_DAMPING`.

Far from a resonance, a loop with -Re{Z} > Re{Z_a} can be stable too. If tremor moves such a loop,
the trial is counted as not stable.

[1] J. E. Colgate, N. Hogan, Int. J. Control 48(1), 1988, 65-88.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from estimation.compiled import Floats

ArmDamping = Callable[[Floats], Floats]
FASTEST = 4.0
"""Frequency above which motion is not voluntary, but tremor or an oscillation of the loop [Hz]."""
LEAST_DAMPING = 2.0
"""Damping that any arm has at least [N s/m]."""
SUSTAINING = 0.75
"""Ratio r of -Re{Z} to the damping Re{Z_a} of a known arm above which the motion is counted as an
oscillation of the loop. In an oscillation without tremor, r is 1. At a resonance of arm and
environment, the velocity that tremor causes is 1 / (1 - r) times that with an environment with
Re{Z} = 0, here 4 times."""
MOST_SUSTAINED = 0.8
"""Greatest share of the power of the velocity in a stable trial that is above `FASTEST`, at
frequencies at which -Re{Z} is above the threshold."""
SEGMENT = 1.0
"""Duration of the segments of the motion of which the spectra are averaged [s]."""
FIRST = 1 << 14
"""Number of samples whose mean period gives the number of samples in a segment."""


class RunningSpectra:
    """Spectra of velocity and force, from which oscillations of the loop are detected.

    The spectra are averages over overlapping segments (P. D. Welch, IEEE Trans. Audio
    Electroacoust. 15(2), 1967). The spectra are computed with a constant sample period. This is the
    mean period of about the first `FIRST` samples.

    Parameters
    ----------
    arm_damping
        Damping of the arm [N s/m] at frequencies [Hz], if the arm is known.
    """

    def __init__(self, arm_damping: ArmDamping | None = None) -> None:
        self._arm_damping = arm_damping
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

        The power of the velocity is summed over the frequencies above `FASTEST` at which -Re{Z} is
        above the threshold (see the documentation of the module). The result is this sum divided by
        the power of the velocity at all frequencies.
        """
        if not self._length:
            if not self._pending.shape[1]:
                return 0.0
            self._add_segments()
        frequency = np.fft.rfftfreq(self._length, self._step).astype(np.float64)
        threshold = np.full(len(frequency), LEAST_DAMPING)
        if self._arm_damping:
            threshold = np.maximum(threshold, SUSTAINING * self._arm_damping(frequency))
        total = float(self._motion.sum())
        oscillating = (frequency > FASTEST) & (self._from_hand < -threshold * self._motion)
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


def sustained_share(
    velocity: Floats, force: Floats, dt: Floats, arm_damping: ArmDamping | None = None
) -> float:
    """Return the share of a motion's power that is in an oscillation (see `RunningSpectra`)."""
    spectra = RunningSpectra(arm_damping)
    spectra.add(velocity, force, dt)
    return spectra.sustained_share()
