"""PE injector, which moves the slave along a given signal.

The injector replaces the force of the hand in the control condition `autonomous`.
"""

from __future__ import annotations

import math

from drivers import Measurement
from teleop.control.admittance import AdmittanceParameters
from teleop.control.excitation_signals import Derivatives, Signal

RAMP = 0.5
"""Duration of the ramp at the start and of the ramp at the end of a trial [s]. On the ramps, the
displacement of the slave increases from zero and decreases to zero."""


def ramp_time(duration: float, ramp: float = RAMP) -> float:
    """Return the duration [s] of the ramp at the start of a trial, and of that at its end.

    It is `ramp`, but at most half of the duration of the trial.
    """
    return min(ramp, 0.5 * duration)


class Injector:
    """Computes the force that moves the slave along an excitation signal.

    The displacement of the slave is

        x(t) = r(t) (mean + half s(t))

    s(t) is the excitation signal, with values from -1 to 1. r(t) increases from 0 to 1 on a ramp at
    the start of the trial, and decreases to 0 on a ramp at the end. Between the two ramps, x varies
    between `touch` times `depth` and `depth`, so that the slave stays in contact. `mean` is the
    middle of this range, and `half` is half of its width. The displacement of the master is x(t)
    divided by `scale`. The computed force is the force that the virtual mass of the admittance
    needs for this motion of the master.

    Parameters
    ----------
    signal
        The excitation signal s(t); None if a derived class defines `motion`.
    depth
        Largest displacement of the slave [m], > 0.
    admittance
        Mass, damping and stiffness of the virtual dynamics of the master.
    scale
        Ratio of slave motion to master motion, > 0.
    duration
        Duration of the trial [s], > 0. At its end, the displacement is zero again.
    touch
        Smallest displacement between the ramps as a fraction of `depth`, 0 <= touch < 1.
    ramp
        Duration of the ramp at the start, and of the ramp at the end [s], > 0. It is reduced to
        half of `duration` if it is longer.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    note = ""
    """Latest statement about the motion, for the person."""

    def __init__(
        self,
        signal: Signal | None,
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

    def ramp(self, t: float) -> Derivatives:
        """Return the factor of the displacement at start and end, with its derivatives."""
        in_out, sign = (t, 1.0) if 2.0 * t < self._duration else (self._duration - t, -1.0)
        u = min(max(in_out / self._ramp, 0.0), 1.0)
        return Derivatives(
            u**3 * (10.0 - 15.0 * u + 6.0 * u * u),
            sign * 30.0 * u * u * (1.0 - u) ** 2 / self._ramp,
            60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / self._ramp**2,
        )

    def motion(self, t: float) -> Derivatives:
        """Return the motion of the master with which the slave follows the signal [m]."""
        ramp, ramp_rate, ramp_acceleration = self.ramp(t)
        assert self._signal
        signal = self._signal.at(t)
        offset = self._mean + self._half * signal.value
        return Derivatives(
            ramp * offset,
            ramp_rate * offset + ramp * self._half * signal.rate,
            ramp_acceleration * offset
            + 2.0 * ramp_rate * self._half * signal.rate
            + ramp * self._half * signal.acceleration,
        )

    def observe(self, t: float, measurement: Measurement) -> None:
        """Process the measurement at the time t [s]. A known signal does not depend on it."""

    def force(self, t: float) -> float:
        """Return the force [N] that moves the virtual mass along the signal."""
        return self._admittance.force(*self.motion(t))
