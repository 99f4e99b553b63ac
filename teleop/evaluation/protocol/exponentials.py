"""Fit the time constants of a hold: the relaxation of a force, or creep.

    y(t) = c_0 + c u(t) + sum c_i z_i(t),    z_i' = u' - z_i / tau_i

u is the quantity that is controlled: the position in a relaxation test, where y is the force, and
the force in a creep test, where y is the position. While u is constant, each z_i decays
exponentially. The equations also hold while u changes, so that the finite time of the ramp does not
bias the time constants. A specimen that has not recovered from an earlier load has other
amplitudes, but the same time constants. The equations are fitted to the hold only, because the
elastic force may depend on the depth, which the ramp passes through.

For given time constants, the coefficients follow from linear least squares (variable projection).
The number of exponentials is the one with the least Bayesian information criterion. The number of
independent residuals is corrected for their correlation.

References
----------
G. H. Golub, V. Pereyra, "The differentiation of pseudo-inverses and nonlinear least squares
problems whose variables separate", SIAM J. Numerical Analysis 10(2), 1973.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.optimize import least_squares
from scipy.special import stdtrit

from estimation.arrays import Floats
from estimation.autocorrelation import effective_samples
from estimation.batch_models.relaxation import relaxing_part

MOST = 3
"""Largest number of exponentials."""
BLOCKS = 1500
"""Number of averages of successive samples that are fitted."""
LEAST_BIC = 10.0
"""Decrease of the Bayesian information criterion that another exponential needs."""
GRID = 9
"""Number of time constants from which the search starts."""
LONGER = "a time constant is not determined: expected a longer hold"
"""Reason if the hold is too short."""
FASTEST = 0.4
"""Shortest time constant that is looked for, relative to the time that is left out at the start."""
LONGEST = 0.6
"""Longest time constant that is determined, relative to the duration of the hold: a slower part of
the curve cannot be distinguished from a value that has not been reached."""
LARGEST_ERROR = 1.0
"""Half width of the interval of log tau above which a time constant is not determined."""


@dataclass(frozen=True)
class Exponential:
    """One exponential: amplitude and time constant with 95 % intervals."""

    amplitude: float
    """Value at the start of the hold minus that at its end [unit of y]."""
    amplitude_half: float
    """Half width of the interval of the amplitude."""
    tau: float
    """Time constant [s]."""
    low: float
    """Lower end of the interval of the time constant [s]."""
    high: float
    """Upper end of the interval of the time constant [s]."""


@dataclass(frozen=True)
class Decay:
    """Fit of a hold."""

    start: float
    """Value at the start of the hold, by the fit."""
    end: float
    """Value to which the sum of exponentials decays."""
    end_half: float
    """Half width of the 95 % interval of `end`."""
    parts: tuple[Exponential, ...]
    """Exponentials with increasing time constants; empty if nothing decays."""
    rms: float
    """Root mean square of the residual of the averages."""
    reason: str
    """Why the time constants are not determined; empty if they are."""


@dataclass(frozen=True)
class Held:
    """Averages of successive samples of a hold, and of the ramp before it."""

    t: Floats
    """Times since the start of the hold [s]."""
    u: Floats
    """Controlled quantity."""
    y: Floats
    """Other quantity."""
    rows: slice
    """Averages that are fitted."""
    rounding: float
    """Largest error of y that drifts slowly."""
    sign: float
    """Sign of the coefficients of a passive body."""

    @property
    def duration(self) -> float:
        """Duration of the fitted part [s]."""
        return float(self.t[-1] - self.t[self.rows][0])

    def signals(self, log_tau: Floats) -> Floats:
        """Return the decaying signals z_i, one column for each time constant."""
        period = float(self.t[1] - self.t[0])
        return np.column_stack(
            [np.empty((len(self.t), 0))]
            + [relaxing_part([self.u - self.u[0]], period, tau) for tau in np.exp(log_tau)]
        )

    def design(self, log_tau: Floats) -> Floats:
        """Return the columns of the linear least squares: 1, u and the signals z_i."""
        columns = [np.ones(len(self.t)), self.u - self.u.mean(), self.signals(log_tau)]
        return np.column_stack(columns)[self.rows]

    def fitted(self, log_tau: Floats) -> Fit:
        """Return the fit with given time constants."""
        columns, y = self.design(log_tau), self.y[self.rows]
        sizes = np.maximum(np.abs(columns).max(axis=0), 1e-300)
        coefficients = np.linalg.lstsq(columns / sizes, y, rcond=None)[0] / sizes
        if coefficients[1] < 0.0:  # no body has a negative stiffness: a drift of u is another cause
            used = np.arange(columns.shape[1]) != 1
            coefficients[1] = 0.0
            part = columns[:, used] / sizes[used]
            coefficients[used] = np.linalg.lstsq(part, y, rcond=None)[0] / sizes[used]
        residual = y - columns @ coefficients
        return Fit(log_tau, coefficients, residual, independent_samples(residual))


def independent_samples(residual: Floats) -> float:
    """Return the number of independent values, from the variance of the means of batches.

    Unlike the correlation of successive values, it contains a small error that changes slowly.
    """
    size = max(int(math.sqrt(len(residual))), 2)
    whole = residual[: len(residual) // size * size].reshape(-1, size)
    variance = max(float(np.var(residual)), 1e-300)
    inflation = size * float(np.var(whole.mean(axis=1))) / variance
    return min(effective_samples(residual), len(residual) / max(inflation, 1.0))


@dataclass(frozen=True)
class Fit:
    """Least-squares fit with certain time constants."""

    log_tau: Floats
    """Logarithms of the time constants."""
    coefficients: Floats
    """Coefficients of 1, u and the signals z_i."""
    residual: Floats
    """Measured minus fitted averages."""
    independent: float
    """Number of independent residuals."""

    def bic_above(self, other: Fit) -> float:
        """Return the Bayesian information criterion minus that of a fit with fewer exponentials.

        Both are computed with the number of independent residuals of this fit, because those of
        the other one also contain what it does not describe.
        """
        n, further = self.independent, len(self.log_tau) - len(other.log_tau)
        squares = [max(float(one.residual @ one.residual), 1e-300) for one in (self, other)]
        return n * math.log(squares[0] / squares[1]) + 2.0 * further * math.log(max(n, 2.0))


def fit_decay(
    t: Floats, u: Floats, y: Floats, settling: float, rounding: float = 0.0, sign: float = 1.0
) -> Decay:
    """Fit a hold.

    Parameters
    ----------
    t
        Times since the start of the hold [s], shape (n,); negative in the ramp before it.
    u, y
        Controlled quantity and other quantity, shape (n,).
    settling
        Time from which the hold is fitted [s].
    rounding
        Largest error of `y` due to the rounding of the position, which may drift slowly within
        one step of the encoder. The intervals contain its effect.
    sign
        Sign of the coefficients of a passive body: 1 for relaxation, -1 for creep.
    """
    size = max(1, len(t) // BLOCKS)
    whole = len(t) // size * size
    t, u, y = (values[:whole].reshape(-1, size).mean(axis=1) for values in (t, u, y))
    held = Held(t, u, y, slice(int(np.searchsorted(t, settling)), None), rounding, sign)
    best, unresolved = held.fitted(np.empty(0)), False
    for count in range(1, MOST + 1):
        found = best_fit(held, count)
        if found is None or found.bic_above(best) > -LEAST_BIC:
            continue
        parts = decay_of(held, found).parts
        if all(abs(one.amplitude) > one.amplitude_half for one in parts):
            best, unresolved = found, False
        else:
            unresolved = parts[-1].tau > 0.5 * LONGEST * held.duration  # a slow part remains
    decay = decay_of(held, best)
    if unresolved and decay.parts:
        return replace(decay, reason=LONGER)
    return decay


def best_fit(held: Held, count: int) -> Fit | None:
    """Return the best fit with a number of exponentials; None if none is that of a passive body.

    Exponentials with different signs could describe almost any curve.
    """
    duration, n = held.duration, len(held.t[held.rows])
    # a faster part has decayed before the hold has settled
    shortest = max(2.0 * duration / n, FASTEST * float(held.t[held.rows][0]))
    longest = 2.0 * duration
    grid = np.log(np.geomspace(2.0 * shortest, 0.6 * duration, GRID))

    def cost(start: tuple[float, ...]) -> float:
        residual = held.fitted(np.array(start)).residual
        return float(residual @ residual)

    found: list[Fit] = []
    for start in sorted(combinations(grid.tolist(), count), key=cost)[:3]:
        solution = least_squares(
            lambda log_tau: held.fitted(log_tau).residual,
            np.array(start),
            bounds=(math.log(shortest), math.log(longest)),
            x_scale=1.0,
        )
        fit = held.fitted(np.sort(solution.x))
        if np.all(held.sign * fit.coefficients[2:] > 0.0):
            found.append(fit)
    return min(found, key=lambda fit: float(fit.residual @ fit.residual), default=None)


def decay_of(held: Held, fit: Fit) -> Decay:
    """Return a fit with the intervals of its parameters."""
    columns, taus = held.design(fit.log_tau), np.exp(fit.log_tau)
    step = 1e-4
    slopes = []
    for i in range(len(taus)):
        ends = []
        for sign in (-1.0, 1.0):
            changed = fit.log_tau.copy()
            changed[i] += sign * step
            ends.append(held.design(changed) @ fit.coefficients)
        slopes.append((ends[1] - ends[0]) / (2.0 * step))
    jacobian = np.column_stack([columns, *slopes]) if slopes else columns
    sizes = np.maximum(np.abs(jacobian).max(axis=0), 1e-300)
    freedom = max(fit.independent - jacobian.shape[1], 1.0)
    variance = float(fit.residual @ fit.residual) / len(fit.residual)
    scaled = jacobian / sizes
    covariance = np.linalg.pinv(scaled.T @ scaled) * len(fit.residual) / freedom * variance
    t = held.t[held.rows]
    shapes = np.column_stack([t / t[-1], *(np.exp(-t / tau) for tau in taus)])
    by_rounding = held.rounding * np.abs(np.linalg.pinv(scaled) @ shapes).max(axis=1)
    by_noise = float(stdtrit(freedom, 0.975)) * np.sqrt(np.maximum(np.diag(covariance), 0.0))
    half = np.hypot(by_noise, by_rounding) / sizes
    begin = int(np.searchsorted(held.t, 0.0))
    size_at_start = held.signals(fit.log_tau)[begin]
    amplitudes = fit.coefficients[2:] * size_at_start
    halves = half[2 : 2 + len(taus)] * np.abs(size_at_start)
    spreads = half[2 + len(taus) :]
    parts = tuple(
        Exponential(amplitude, error, tau, tau * math.exp(-spread), tau * math.exp(spread))
        for amplitude, error, tau, spread in zip(
            amplitudes.tolist(), halves.tolist(), taus.tolist(), spreads.tolist(), strict=True
        )
    )
    reason = ""
    if not parts:
        reason = "no relaxation beyond the noise, or the signal changes in the other direction"
    elif spreads.max() > LARGEST_ERROR or parts[-1].high > LONGEST * held.duration:
        reason = LONGER
    last = held.u[held.rows].mean() - held.u.mean()
    end = float(fit.coefficients[0] + fit.coefficients[1] * last)
    start = end + float(amplitudes.sum())
    return Decay(start, end, float(half[0]), parts, math.sqrt(variance), reason)
