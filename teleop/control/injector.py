"""The PE (persistent excitation) injector: a force that makes the slave follow a signal."""

from __future__ import annotations

import math

from teleop.control.admittance import AdmittanceParameters
from teleop.control.excitation_signals import Motion, Signal

RAMP = 0.5
"""Duration of each of the two ramps of the displacement, at the start and at the end [s]."""


def ramp_time(duration: float, ramp: float = RAMP) -> float:
    """Return the duration of each ramp [s]: `ramp`, or half of the trial if that is shorter."""
    return min(ramp, 0.5 * duration)


class Injector:
    """Computes the force that moves the slave along an excitation signal.

    The displacement of the slave is x(t) = ramp(t) (mean + half signal(t)). ramp(t) increases from
    0 to 1 at the start of the trial, and decreases to 0 at the end. Between the two ramps, x varies
    between `touch` times the depth and the depth, so that the slave stays in contact. `mean` is the
    middle of this range, and `half` is half of its width. The computed force is the force that the
    virtual mass of the admittance needs for this motion.

    Parameters
    ----------
    signal
        The excitation signal.
    depth
        Largest displacement of the slave [m], > 0.
    admittance
        Mass, damping and stiffness of the virtual dynamics of the master.
    scale
        Ratio of slave motion to master motion.
    duration
        Duration of the trial [s]. At its end the displacement is zero again.
    touch
        Smallest displacement as a fraction of the depth, 0 <= touch < 1.
    ramp
        Duration of each of the two ramps, at the start and at the end [s]; at most half of
        `duration`.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    def __init__(
        self,
        signal: Signal,
        depth: float,
        admittance: AdmittanceParameters,
        scale: float,
        duration: float,
        touch: float = 0.1,
        ramp: float = RAMP,
    ) -> None:
        if not 0.0 < depth < math.inf:
            raise ValueError(f"excitation depth must be positive, got {depth} m")
        if not (0.0 < duration < math.inf and 0.0 < ramp < math.inf):
            raise ValueError(f"duration and ramp must be positive, got {duration} s and {ramp} s")
        if not 0.0 <= touch < 1.0:
            raise ValueError(f"touch must be in [0, 1), got {touch}")
        if not 0.0 < scale < math.inf:
            raise ValueError(f"motion scale must be positive, got {scale}")
        self._signal = signal
        self._mean = 0.5 * depth * (1.0 + touch) / scale
        self._half = 0.5 * depth * (1.0 - touch) / scale
        self._admittance = admittance
        self._duration = duration
        self._ramp = ramp_time(duration, ramp)

    def motion(self, t: float) -> Motion:
        """Return position [m], velocity [m/s] and acceleration [m/s^2] of the master at t [s]."""
        in_out, sign = (t, 1.0) if 2.0 * t < self._duration else (self._duration - t, -1.0)
        u = min(max(in_out / self._ramp, 0.0), 1.0)
        ramp = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        ramp_rate = sign * 30.0 * u * u * (1.0 - u) ** 2 / self._ramp
        ramp_acceleration = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / self._ramp**2
        signal = self._signal.at(t)
        offset = self._mean + self._half * signal.value
        return Motion(
            ramp * offset,
            ramp_rate * offset + ramp * self._half * signal.rate,
            ramp_acceleration * offset
            + 2.0 * ramp_rate * self._half * signal.rate
            + ramp * self._half * signal.acceleration,
        )

    def force(self, t: float) -> float:
        """Return the force on the virtual mass of the admittance [N] at time t [s]."""
        return self._admittance.force(*self.motion(t))
