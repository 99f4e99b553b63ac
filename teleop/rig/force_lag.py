"""The lag of a force channel, measured on a reference spring."""

from __future__ import annotations

from typing import Any, NamedTuple

from estimation.compiled import Floats
from estimation.stiffening import Interval, MatchedSignals
from teleop.errors import InputError

LONGEST = 0.1
"""Longest lag that can be found [s]."""


class ForceLag(NamedTuple):
    """Lag of a force channel, from a reference spring."""

    lag: Interval
    """Time constant of a first-order lag with its 95 % interval [s]."""
    k: float
    """Stiffness of the spring [N/m]."""
    rms: float
    """Root mean square of the residual [N]."""

    def summary(self) -> dict[str, Any]:
        """Return the values that `teleop lag --json` prints."""
        return {
            "lag_s": self.lag.value,
            "lag_low_s": self.lag.low,
            "lag_high_s": self.lag.high,
            "k": self.k,
            "rms": self.rms,
        }


def measure_lag(position: Floats, force: Floats, dt: Floats) -> ForceLag:
    """Fit f = L(k x) to a spring without damping, L a first-order lag.

    A lag delays the force of a spring relative to its displacement, f = k x - k lag v + ..., as
    negative damping does. So the reference must have no damping of its own: a steel spring.

    Parameters
    ----------
    position, force
        From the spring's rest [m], [N], each of shape (n,).
    dt
        Time since the sample before [s], of shape (n,).

    Raises
    ------
    InputError
        Nothing moves, or the best lag is nil or longer than `LONGEST`.
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
            f"the spring's stiffness comes out as {fit.k:.4g} N/m: expected force and position "
            "to be positive in compression"
        )
    if not 1e-5 < best < 0.99 * LONGEST:
        raise InputError(
            f"the best lag is {best * 1e3:.2f} ms: expected one between 0.01 and "
            f"{LONGEST * 1e3:g} ms, as on a spring without damping with the datum at its rest"
        )
    least, step = fit.rms**2, 0.05 * best
    curvature = (squared(best + step) - 2.0 * least + squared(best - step)) / step**2
    half = 1.96 * (2.0 * least / (signals.independent * curvature)) ** 0.5
    return ForceLag(Interval(best, best - half, best + half), fit.k, fit.rms)
