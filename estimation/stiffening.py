"""Batch fits of a stiffening Kelvin-Voigt body behind a lagging force channel.

    f = L(b v + k x + k3 x^3),    L the lag of the force channel

All signals pass through a `MatchedFilter`, and position and its cube through the lag as well, so
that the regression is exact but for noise. Both are linear, so the lag may come last: the signals
are filtered once, and then fitted for any lag.
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
"""95 % quantile of chi-squared with one degree of freedom."""


class StiffeningFit(NamedTuple):
    """A fit to all samples together."""

    b: float
    """Damping [N s/m]; 0 where it was taken for nil."""
    k: float
    """Stiffness at no displacement [N/m]."""
    k3: float
    """Stiffening [N/m^3]; 0 where it was taken for nil."""
    rms: float
    """Root mean square residual [N], filtered."""


class Interval(NamedTuple):
    """A value with the bounds of its 95 % interval."""

    value: float
    low: float
    high: float


class LagProfile(NamedTuple):
    """The best fit for each of many lags, arrays of shape (lags,), and how many samples count."""

    lag: Floats
    """[s]"""
    b: Floats
    """[N s/m]"""
    k: Floats
    """[N/m]"""
    rms: Floats
    """[N]"""
    independent: float
    """Independent samples among the filtered ones."""

    def lag_interval(self) -> Interval:
        """The lags [s] that the data cannot tell from the best, by likelihood ratio."""
        return self._interval(self.lag)

    def b_interval(self) -> Interval:
        """The damping [N s/m] that goes with these lags."""
        return self._interval(self.b)

    def _interval(self, values: Floats) -> Interval:
        best = float(self.rms.min())
        within = values[self.rms <= best * math.sqrt(1.0 + CHI2_95 / self.independent)]
        value = values[int(np.argmin(self.rms))]
        return Interval(float(value), float(within.min()), float(within.max()))


class MatchedSignals:
    """Filtered position, its cube, and force, ready to be fitted for any lag.

    Parameters
    ----------
    position, force
        As measured [m], [N], each of shape (n,).
    dt
        Time since the sample before [s], of shape (n,), or one number for all.
    bandwidth
        Natural frequency of the state-variable filter [Hz].
    part
        The samples that are fitted; the filters run over all.

    Raises
    ------
    ValueError
        As `Estimator.run`; or the bandwidth is not positive.
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
        self.x, self.v, force_behind, self.dt, further = matched.run(position, force, dt)
        self.x3 = further[:, 0]
        self.f = force_behind[part]
        self.part = part
        self.independent = len(self.f) / matched.correlation(float(np.mean(self.dt[part])))

    def fit(self, lag: float, damping: bool = True, stiffening: bool = True) -> StiffeningFit:
        """Least squares with the force channel's lag [s] given.

        Parameters
        ----------
        lag
            Time constant of the force channel [s], >= 0.
        damping, stiffening
            Whether b and k3 are sought; else they are nil.
        """
        sought = [True, damping, stiffening]
        regressors = np.column_stack((self.x, self.v, self.x3))[:, sought]
        regressors = np.column_stack(
            [lagged(column, self.dt, lag)[self.part] for column in regressors.T]
        )
        scale = np.sqrt(np.mean(regressors**2, axis=0))
        scaled, *_ = np.linalg.lstsq(regressors / scale, self.f, rcond=None)
        values = np.zeros(3)
        values[sought] = scaled / scale
        residual = self.f - regressors @ (scaled / scale)
        k, b, k3 = values.tolist()
        return StiffeningFit(b, k, k3, float(np.sqrt(np.mean(residual**2))))

    def profile(self, lags: ArrayLike, damping: bool = True, stiffening: bool = True) -> LagProfile:
        """The best fit for each of many lags [s], shape (lags,)."""
        lag = np.asarray(lags, dtype=np.float64)
        fits = [self.fit(float(value), damping, stiffening) for value in lag]
        b, k, _, rms = np.array(fits).T
        return LagProfile(lag, b, k, rms, self.independent)


def lagged(signal: Floats, dt: Floats, lag: float) -> Floats:
    """A signal behind a first-order lag, shape (n,)."""
    period = float(dt[0]) if len(dt) else 0.0
    if lag > 0.0 and len(dt) > 1 and np.ptp(dt[1:]) < 1e-9 * period:
        return evenly_lagged(signal, float(dt[1]), lag)
    channel = Lag(lag)
    rows = zip(signal.tolist(), dt.tolist(), strict=True)
    return np.array([channel.update(u, step) for u, step in rows])


def evenly_lagged(signal: Floats, period: float, lag: float) -> Floats:
    """`lagged` for an even sample period [s], by convolution, since it is needed lag after lag."""
    decay = math.exp(-period / lag)
    ratio = lag / period
    start = signal - signal[0]
    driven = start * (1.0 - ratio * (1.0 - decay))
    driven[1:] += start[:-1] * (ratio * (1.0 - decay) - decay)
    taps = min(len(signal), math.ceil(40.0 * ratio) + 1)
    out: Floats = signal[0] + np.convolve(driven, decay ** np.arange(taps))[: len(signal)]
    return out
