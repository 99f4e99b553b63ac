"""Fit a Kelvin-Voigt body with stiffening to a record whose force channel has a lag.

    f = L(b v + k x + k3 x^3),    where L is the first-order lag of the force channel

All signals are filtered by a `MatchedFilter`. The position, the velocity and the cube of the
position are also filtered by L, so that the equation is exact except for noise. Both filters are
linear, so L can be applied after the matched filter. For fits with several values of the lag, the
matched filter is therefore applied only once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from estimation.compiled import Floats
from estimation.conditioning import BANDWIDTH, MatchedFilter
from estimation.filters import Lag
from estimation.model import STIFFENING

CHI2_95 = 3.841458820694124
"""95 % quantile of the chi-squared distribution with one degree of freedom."""


class StiffeningFit(NamedTuple):
    """Result of a least-squares fit of f = L(b v + k x + k3 x^3), with a given lag L."""

    b: float
    """Damping [N s/m]; 0 if the damping was not fitted."""
    k: float
    """Stiffness at zero displacement [N/m]."""
    k3: float
    """Coefficient of stiffening [N/m^3]; 0 if this coefficient was not fitted."""
    rms: float
    """Root mean square of the residual, which is filtered [N]."""


class Interval(NamedTuple):
    """A value, and the lower and upper end of its interval, all in the unit of the value."""

    value: float
    low: float
    high: float


class LagProfile(NamedTuple):
    """Least-squares fits for several lags of the force channel, as arrays of shape (lags,)."""

    lag: Floats
    """Lag of the force channel [s]."""
    b: Floats
    """Damping [N s/m]."""
    k: Floats
    """Stiffness at zero displacement [N/m]."""
    rms: Floats
    """Root mean square of the filtered residual [N]."""
    independent: float
    """Number of independent samples that have the same information as the filtered samples."""

    def lag_interval(self) -> Interval:
        """Return the lag [s] of the best fit, with a 95 % likelihood-ratio interval."""
        return self._interval(self.lag)

    def b_interval(self) -> Interval:
        """Return the damping [N s/m] of the best fit.

        The interval contains the damping values of all fits whose lag is in `lag_interval`.
        """
        return self._interval(self.b)

    def _interval(self, values: Floats) -> Interval:
        best = float(self.rms.min())
        within = values[self.rms <= best * math.sqrt(1.0 + CHI2_95 / self.independent)]
        value = values[int(np.argmin(self.rms))]
        return Interval(float(value), float(within.min()), float(within.max()))


class MatchedSignals:
    """Filtered signals, to which the model can be fitted for any lag of the force channel.

    Parameters
    ----------
    position, force
        Measured position [m] and force [N], each of shape (n,).
    dt
        Time since the previous sample [s], of shape (n,), or one number for all.
    bandwidth
        Natural frequency of the state-variable filter [Hz].
    part
        Samples to which the model is fitted. The filters process all samples.

    Raises
    ------
    ValueError
        As in `Estimator.run`; or the bandwidth is not positive.
    """

    def __init__(
        self,
        position: ArrayLike,
        force: ArrayLike,
        dt: ArrayLike,
        bandwidth: float = BANDWIDTH,
        part: slice = slice(None),
    ) -> None:
        matched = MatchedFilter(bandwidth, model=STIFFENING)
        self.x, self.v, filtered_force, self.dt, further = matched.run(position, force, dt)
        self.x3 = further[:, 0]
        self.f = filtered_force[part]
        self.part = part
        self.independent = len(self.f) / matched.correlation(float(np.mean(self.dt[part])))

    def fit(self, lag: float, damping: bool = True, stiffening: bool = True) -> StiffeningFit:
        """Return the least-squares fit for a given lag of the force channel.

        Parameters
        ----------
        lag
            Time constant of the force channel [s], >= 0.
        damping, stiffening
            Whether b is fitted, and whether k3 is fitted. A parameter that is not fitted is 0.
        """
        fitted = [True, damping, stiffening]
        regressors = np.column_stack((self.x, self.v, self.x3))[:, fitted]
        regressors = np.column_stack(
            [lagged(column, self.dt, lag)[self.part] for column in regressors.T]
        )
        scale = np.sqrt(np.mean(regressors**2, axis=0))
        scaled, *_ = np.linalg.lstsq(regressors / scale, self.f, rcond=None)
        values = np.zeros(3)
        values[fitted] = scaled / scale
        residual = self.f - regressors @ (scaled / scale)
        k, b, k3 = values.tolist()
        return StiffeningFit(b, k, k3, float(np.sqrt(np.mean(residual**2))))

    def profile(self, lags: ArrayLike, damping: bool = True, stiffening: bool = True) -> LagProfile:
        """Return the results of `fit` for several lags of the force channel [s].

        The arguments `damping` and `stiffening` are those of `fit`.
        """
        lag = np.asarray(lags, dtype=np.float64)
        fits = [self.fit(float(value), damping, stiffening) for value in lag]
        b, k, _, rms = np.array(fits).T
        return LagProfile(lag, b, k, rms, self.independent)


def lagged(signal: Floats, dt: Floats, lag: float) -> Floats:
    """Return a signal after a first-order lag with the time constant `lag` [s], shape (n,)."""
    period = float(dt[0]) if len(dt) else 0.0
    if lag > 0.0 and len(dt) > 1 and np.ptp(dt[1:]) < 1e-9 * period:
        return evenly_lagged(signal, float(dt[1]), lag)
    channel = Lag(lag)
    rows = zip(signal.tolist(), dt.tolist(), strict=True)
    return np.array([channel.update(u, step) for u, step in rows])


def evenly_lagged(signal: Floats, period: float, lag: float) -> Floats:
    """Do the same as `lagged`, but faster, for a constant sample period [s].

    The lag is computed by convolution.
    """
    decay = math.exp(-period / lag)
    ratio = lag / period
    start = signal - signal[0]
    driven = start * (1.0 - ratio * (1.0 - decay))
    driven[1:] += start[:-1] * (ratio * (1.0 - decay) - decay)
    taps = min(len(signal), math.ceil(40.0 * ratio) + 1)
    out: Floats = signal[0] + np.convolve(driven, decay ** np.arange(taps))[: len(signal)]
    return out
