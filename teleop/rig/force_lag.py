"""The lag of a force channel, measured on a reference spring."""

from __future__ import annotations

from typing import Any, NamedTuple

from estimation.compiled import Floats
from estimation.stiffening import Interval, MatchedSignals
from teleop.errors import InputError

LONGEST = 0.1
"""Longest lag that can be found [s]."""


class ForceLag(NamedTuple):
    """Result of measuring the lag of a force channel on a reference spring."""

    lag: Interval
    """Time constant of a first-order lag with its 95 % interval [s]."""
    k: float
    """Stiffness of the spring [N/m]."""
    rms: float
    """Root mean square of the residual [N]."""

    def summary(self) -> dict[str, Any]:
        """Return the result in the form of `teleop lag --json`, in SI units."""
        return {
            "lag_s": self.lag.value,
            "lag_low_s": self.lag.low,
            "lag_high_s": self.lag.high,
            "k": self.k,
            "rms": self.rms,
        }


def measure_lag(position: Floats, force: Floats, dt: Floats) -> ForceLag:
    """Fit f = L(k x) to the data of a spring without damping, where L is a first-order lag.

    A lag delays the force of a spring relative to its displacement, f = k x - k lag v + ..., and
    has the same effect as negative damping. The reference must therefore have no damping, such as
    a steel spring.

    Parameters
    ----------
    position, force
        Displacement from the unloaded spring [m] and force [N], each of shape (n,).
    dt
        Time since the previous sample [s], shape (n,).

    Raises
    ------
    InputError
        Position or force is zero throughout, the stiffness is negative, or the lag with the
        smallest residual is close to zero or to `LONGEST`.
    """
    from scipy.optimize import minimize_scalar

    if not position.any() or not force.any():
        raise InputError("no lag to measure: position or force is zero throughout")
    settled = slice(int(0.3 / dt.mean()), None)
    signals = MatchedSignals(position, force, dt, part=settled)

    def squared(lag: float) -> float:
        return signals.fit(lag, damping=False, stiffening=False).rms ** 2

    best = float(
        minimize_scalar(squared, bounds=(0.0, LONGEST), method="bounded", options={"xatol": 1e-7}).x
    )
    fit = signals.fit(best, damping=False, stiffening=False)
    if fit.k <= 0.0:
        raise InputError(
            f"the estimated stiffness of the spring is {fit.k:.4g} N/m: expected force and "
            "position to be positive in compression"
        )
    if not 1e-5 < best < 0.99 * LONGEST:
        raise InputError(
            f"the estimated lag is {best * 1e3:.2f} ms: expected 0.01 to {LONGEST * 1e3:g} ms, "
            "from a spring without damping, with the datum at the unloaded spring"
        )
    least, step = fit.rms**2, 0.05 * best
    curvature = (squared(best + step) - 2.0 * least + squared(best - step)) / step**2
    half = 1.96 * (2.0 * least / (signals.independent * curvature)) ** 0.5
    return ForceLag(Interval(best, best - half, best + half), fit.k, fit.rms)
