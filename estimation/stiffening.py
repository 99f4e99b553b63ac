"""Fit a Kelvin-Voigt body with stiffening to a record whose force channel has a lag.

    f = L(b v + k x + k3 x^3),    where L is the first-order lag of the force channel

All signals are filtered by the same filter, a `MatchedFilter`. The position x, the velocity v and
x^3 are also filtered by L, so that the equation is exact except for noise. Both filters are linear,
so L can be applied after the matched filter. If the model is fitted for several time constants of
L, the matched filter is therefore applied only once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from estimation.arrays import Floats
from estimation.conditioning import BANDWIDTH, MatchedFilter
from estimation.filters import Lag
from estimation.model import STIFFENING

CHI2_95 = 3.841458820694124
"""95 % quantile of the chi-squared distribution with one degree of freedom."""


class StiffeningFit(NamedTuple):
    """Result of a least-squares fit of the model f = L(b v + k x + k3 x^3).

    L is the first-order lag of the force channel. Its time constant is given, and is not fitted.
    """

    b: float
    """Damping [N s/m]; 0 if the damping was not fitted."""
    k: float
    """Stiffness at zero displacement [N/m]."""
    k3: float
    """Coefficient of stiffening [N/m^3]; 0 if this coefficient was not fitted."""
    rms: float
    """Root mean square of the residual of the filtered signals [N]."""


class Interval(NamedTuple):
    """An estimated value with the lower and the upper end of its interval, all in the same unit."""

    value: float
    low: float
    high: float


class LagProfile(NamedTuple):
    """Results of least-squares fits, one for each of several assumed lags of the force channel.

    The results are arrays of shape (lags,).
    """

    lag: Floats
    """Time constant of the lag of the force channel [s]."""
    b: Floats
    """Damping [N s/m]."""
    k: Floats
    """Stiffness at zero displacement [N/m]."""
    rms: Floats
    """Root mean square of the residual of the filtered signals [N]."""
    independent: float
    """Number of independent samples that would contain the same information as the filtered
    samples, whose noise is correlated."""

    def lag_interval(self) -> Interval:
        """Return the lag [s] of the fit with the smallest residual, and its 95 % interval.

        The interval is that of a likelihood-ratio test. It contains all lags with which the
        residual is not significantly larger than the smallest residual.
        """
        return self._interval(self.lag)

    def b_interval(self) -> Interval:
        """Return the damping b [N s/m] of the fit with the smallest residual, and an interval.

        The interval contains the b of every fit whose lag is in the interval of `lag_interval`.
        """
        return self._interval(self.b)

    def _interval(self, values: Floats) -> Interval:
        best = float(self.rms.min())
        within = values[self.rms <= best * math.sqrt(1.0 + CHI2_95 / self.independent)]
        value = values[int(np.argmin(self.rms))]
        return Interval(float(value), float(within.min()), float(within.max()))


class MatchedSignals:
    """Filtered position and force, to which the model can be fitted for any lag of the force.

    The model is f = L(b v + k x + k3 x^3), where L is the first-order lag of the force channel.

    Position [m] and force [N] have the shape (n,). The filters process all samples, and the model
    is fitted to the slice `part`. `bandwidth` is the natural frequency of the matched filter [Hz].
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
        """Fit the model for a given lag [s]. A parameter that is not fitted is 0."""
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
        """Call `fit` for each of several lags of the force channel, and return all results."""
        lag = np.asarray(lags, dtype=np.float64)
        fits = [self.fit(float(value), damping, stiffening) for value in lag]
        b, k, _, rms = np.array(fits).T
        return LagProfile(lag, b, k, rms, self.independent)


def lagged(signal: Floats, dt: Floats, lag: float) -> Floats:
    """Return the output of a first-order lag whose input is `signal`, shape (n,).

    `dt` is the time since the previous sample [s], shape (n,). `lag` is the time constant [s].
    """
    period = float(dt[0]) if len(dt) else 0.0
    if lag > 0.0 and len(dt) > 1 and np.ptp(dt[1:]) < 1e-9 * period:
        return evenly_lagged(signal, float(dt[1]), lag)
    channel = Lag(lag)
    rows = zip(signal.tolist(), dt.tolist(), strict=True)
    return np.array([channel.update(u, step) for u, step in rows])


def evenly_lagged(signal: Floats, period: float, lag: float) -> Floats:
    """Return the output of a first-order lag whose input is `signal`, shape (n,).

    This function is faster than `lagged`. It needs a constant sample period `period` [s], and a
    time constant `lag` [s] that is positive. The difference between the input and the output of a
    lag relaxes with its time constant.
    """
    from estimation.batch_models.relaxation import relaxing_part  # its package imports this module

    return signal - relaxing_part([signal - signal[0]], period, lag)
