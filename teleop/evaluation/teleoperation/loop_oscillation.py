"""Detect oscillations of the control loop in a recorded trial with force feedback.

Tremor and an oscillation of the loop have similar frequencies, but the energy flows in opposite
directions. The hand moves a virtual mass, on which the feedback force acts. The source of this
force is called the displayed environment. Let F be the Fourier transform of the force of the hand
on the virtual mass, and V that of the velocity of this mass. At one frequency, the mean power from
the hand to the mass and the environment is proportional to

    Re{F V*} = Re{Z} |V|^2,

where Z = F / V is the displayed impedance, and V* is the complex conjugate of V.

- Tremor: the muscles of the hand cause the motion. If Z is passive, Re{Z} >= 0 at each
  frequency [1]. The power is then not negative.
- Oscillation of the loop without tremor: the muscles cause no motion, and the arm follows the mass.
  Then F = -Z_a V, where Z_a is the impedance of the arm. The power is -Re{Z_a} |V|^2 < 0: the
  displayed environment supplies energy, and the arm dissipates it.

Therefore, motion is an oscillation of the loop only at frequencies at which Re{Z} is negative. This
is not sufficient: if -Re{Z_a} < Re{Z} < 0, the environment amplifies the tremor, but the damping of
the arm keeps the loop stable. Motion is therefore counted as an oscillation only at frequencies at
which -Re{Z} is above a threshold:

- On a hardware rig, the damping of the arm is not known. The threshold is `LEAST_DAMPING`. The
  damping of any arm is at least this value. If the damping of the arm is larger, a stable trial can
  be counted as not stable.
- On the simulated rig, the damping Re{Z_a} of the arm is known. The threshold is `SUSTAINING` times
  Re{Z_a}, but at least `LEAST_DAMPING`.

A loop with -Re{Z} > Re{Z_a} can be stable too, at frequencies far from a resonance of arm and
environment. If tremor moves such a loop, a stable trial is counted as not stable.

[1] J. E. Colgate, N. Hogan, Int. J. Control 48(1), 1988, 65-88.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from estimation.arrays import Floats
from teleop.evaluation.teleoperation.thresholds import FASTEST_HAND, LEAST_DAMPING, SUSTAINING

ArmDamping = Callable[[Floats], Floats]
"""Function that takes frequencies [Hz], and returns the damping of the arm at these [N s/m]."""
SEGMENT = 1.0
"""Duration of a segment [s]. The spectra of all segments of a trial are averaged."""
FIRST = 1 << 14
"""Smallest number of samples that are processed together. The mean period of the samples that are
processed first gives the number of samples in a segment."""


class LoopOscillation(NamedTuple):
    """Motion of the hand that the control loop sustains."""

    amplitude: float
    """Amplitude of the sine with the same power as this motion [m]; 0 if there is none."""
    frequency: float
    """Frequency with the largest velocity of this motion [Hz]; NaN if there is none."""
    share: float
    """Share of the power of the whole velocity that is in this motion, 0 to 1."""
    tremor: float
    """Amplitude of the other motion above `FASTEST_HAND` [m]."""


NO_OSCILLATION = LoopOscillation(0.0, math.nan, 0.0, 0.0)


class RunningSpectra:
    """Spectra of velocity and force of a trial, from which oscillations of the loop are detected.

    `arm_damping` returns the damping of the arm [N s/m] at frequencies [Hz]; None if it is not
    known. `velocity` [m/s] is that of the virtual mass, and `force` [N] that of the hand on it.

    The samples can arrive in blocks. The spectra are averages over overlapping segments (P. D.
    Welch, IEEE Trans. Audio Electroacoust. 15(2), 1967). The sample period is treated as constant:
    it is the mean period of the samples that are processed first, about `FIRST` samples.
    """

    def __init__(self, arm_damping: ArmDamping | None = None) -> None:
        self._arm_damping = arm_damping
        self._pending: Floats = np.empty((3, 0))
        self._step = 0.0
        self._length = self._segments = 0
        self._motion: Floats = np.empty(0)
        self._from_hand: Floats = np.empty(0)

    def add(self, velocity: Floats, force: Floats, dt: Floats) -> None:
        """Add the next samples of the trial."""
        self._pending = np.concatenate((self._pending, (velocity, force, dt)), axis=1)
        if self._pending.shape[1] >= FIRST:
            self._add_segments()

    def result(self) -> LoopOscillation:
        """Return the motion above `FASTEST_HAND` that the loop sustains.

        This is the motion at the frequencies at which -Re{Z} is above a threshold (see the
        documentation of the module). Z is the impedance that the hand feels.
        """
        if self._pending.shape[1]:
            self._add_segments()
        if not self._segments:
            return NO_OSCILLATION
        frequency = np.fft.rfftfreq(self._length, self._step).astype(np.float64)
        threshold = np.full(len(frequency), LEAST_DAMPING)
        if self._arm_damping:
            threshold = np.maximum(threshold, SUSTAINING * self._arm_damping(frequency))
        active = self._from_hand < -threshold * self._motion
        oscillating = (frequency > FASTEST_HAND) & active
        # Parseval's theorem, with the mean power of the window
        window = np.hanning(self._length)
        if not window.any():
            return NO_OSCILLATION
        scale = 4.0 / (self._segments * self._length * float(window @ window))
        displaced = scale * self._motion / np.maximum(2.0 * np.pi * frequency, 1e-9) ** 2
        tremor = displaced[(frequency > FASTEST_HAND) & ~oscillating]
        # The voluntary motion on a body that is left has harmonics, which decrease with frequency.
        harmonics = (frequency >= 0.5 * FASTEST_HAND) & (frequency <= FASTEST_HAND)
        largest = float(np.max(self._motion[oscillating], initial=0.0))
        if largest <= float(np.max(self._motion[harmonics], initial=0.0)):
            return NO_OSCILLATION._replace(tremor=math.sqrt(float(tremor.sum())))
        power = np.where(oscillating, self._motion, 0.0)
        return LoopOscillation(
            math.sqrt(float(displaced[oscillating].sum())),
            float(frequency[int(np.argmax(power))]),
            float(power.sum() / self._motion.sum()),
            math.sqrt(float(tremor.sum())),
        )

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
        self._segments += len(v)
        self._motion += np.sum(np.abs(v) ** 2, axis=0)
        self._from_hand += np.sum((f * v.conj()).real, axis=0)
        self._pending = self._pending[:, len(v) * stride :].copy()


def loop_oscillation(
    velocity: Floats, force: Floats, dt: Floats, arm_damping: ArmDamping | None = None
) -> LoopOscillation:
    """Return the part of a motion of the hand that the control loop sustains."""
    spectra = RunningSpectra(arm_damping)
    spectra.add(velocity, force, dt)
    return spectra.result()
