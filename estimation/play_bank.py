"""Indicate lost motion from the latest seconds of a trial, with a bank of play operators.

The force is fitted with the position behind a play of each of a few half widths d. The model is

    f = P(x) + (b + b1 x + b2 x^2) v + m a + relaxing parts

P is a polynomial of degree 5. Each relaxing part is the position behind a high-pass filter of first
order with a given time constant, and its decaying initial value. All terms are linear in the
parameters. They describe the smooth hysteresis of damping, of a force lag, and of tissue that
relaxes. The hysteresis of a play is different: it is sharp at each reversal, and does not depend on
the speed.

A play is indicated only if it explains the force much better than no play (`EVIDENCE`). Position
and force are averaged over short blocks before the fit, so that noise and computing time are small.
The velocity of a block is the mean velocity, so that the averages satisfy the model, too.

References
----------
M. Brokate, J. Sprekels, "Hysteresis and Phase Transitions", Springer, 1996, section 2.1 (play).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.autocorrelation import correlation_of_successive, effective_samples
from estimation.filters import Play

WINDOW = 5.0
"""Length of the time window of the data [s]."""
HALF_WIDTHS = (0.0, 25e-6, 50e-6, 100e-6, 150e-6, 200e-6)
"""Half widths of the play operators of the bank [m]."""
BLOCK = 0.02
"""Length of the blocks over which position and force are averaged [s]."""
FEWEST_BLOCKS = 80
"""Smallest number of blocks in contact with which a lost motion is indicated."""
TIME_CONSTANTS = np.array([0.04, 0.15, 0.5, 2.0])
"""Time constants of the relaxing parts [s]."""
EVIDENCE = 20.0
"""Least n log(S0 / S) that indicates a play, with n independent values in the residual.

S and S0 are the sums of squares of the residuals with and without the play. The residuals are
whitened by a filter of first order.
"""
RANK = 1e-9
"""Smallest relative singular value of the terms that is not treated as 0."""
SMALLEST = 1e-30
"""Added to a divisor that may be 0."""


class IndicatedPlay(NamedTuple):
    """A play that explains the force better than the lost motion that was removed."""

    half_width: float
    """Half width of the play, one of `HALF_WIDTHS` [m]."""
    k_change: float
    """Change of k in f = f0 + k x + b v if this lost motion is removed instead [N/m]."""
    b_change: float
    """Change of b in f = f0 + k x + b v if this lost motion is removed instead [N s/m]."""


def indicated_play(
    t: Floats, x: Floats, f: Floats, contact: NDArray[np.bool_], removed: float = 0.0
) -> IndicatedPlay | None:
    """Return the play that the force indicates; None without strong evidence.

    Parameters
    ----------
    t, x, f
        Time [s], position [m] and force [N] of n samples, shape (n,).
    contact
        Whether there is contact, shape (n,). Samples without contact are not fitted.
    removed
        Half width of the play that is removed from the position before the estimates [m].
    """
    with np.errstate(all="ignore"):  # a value that overflows is no evidence
        try:
            return strongest(t, x, f, contact, removed)
        except np.linalg.LinAlgError:
            return None


def strongest(
    t: Floats, x: Floats, f: Floats, contact: NDArray[np.bool_], removed: float
) -> IndicatedPlay | None:
    """Do what `indicated_play` does; raise LinAlgError if a value overflows."""
    half_widths = np.unique([*HALF_WIDTHS, removed])
    valid = np.isfinite(t) & np.isfinite(x) & np.isfinite(f)
    blocks = divided(t[valid], contact[valid], is_settled(x[valid], float(half_widths[-1])))
    if blocks is None:
        return None
    force = blocks.means(f[valid])[blocks.used]
    moved = np.array([blocks.moved(Play(d).run(x[valid])) for d in half_widths.tolist()])
    terms = blocks.terms(moved)
    best_fit = min((residual(one, force) for one in terms), key=lambda r: float(r @ r))
    # without the correlation of coloured noise, the sharp reversals of a play are plain
    weight = correlation_of_successive(best_fit)
    white = force[1:] - weight * force[:-1]
    residuals = [residual(one[1:] - weight * one[:-1], white) for one in terms]
    squares = [max(float(r @ r), SMALLEST) for r in residuals]
    best, present = int(np.argmin(squares)), int(np.searchsorted(half_widths, removed))
    evidence = effective_samples(residuals[best]) * math.log(squares[present] / squares[best])
    if not evidence > EVIDENCE:
        return None
    k, b = np.transpose([kelvin_voigt(one[:, blocks.used], force) for one in moved])
    return IndicatedPlay(
        float(half_widths[best]), float(k[best] - k[present]), float(b[best] - b[present])
    )


class Blocks(NamedTuple):
    """Division of the last samples of a record into m blocks of successive samples."""

    size: int
    """Number of samples in each block."""
    limits: Floats
    """Times of the limits of the blocks [s], shape (m + 1,)."""
    used: NDArray[np.bool_]
    """Whether a block is fitted, shape (m,)."""

    def means(self, values: Floats) -> Floats:
        """Return the mean of each block, shape (m,)."""
        return np.asarray(last(values, self.size).mean(axis=1))

    def moved(self, x: Floats) -> tuple[Floats, Floats]:
        """Return mean position [m] and mean velocity [m/s] of each block."""
        return self.means(x), np.diff(limits(x, self.size)) / np.diff(self.limits)

    def terms(self, moved: Floats) -> Floats:
        """Return the terms of the model in the fitted blocks, shape (plays, blocks, terms).

        `moved` has the mean positions and velocities of all blocks, shape (plays, 2, m).
        """
        x, v = moved[:, 0] - moved[:, :1, self.used].mean(axis=2), moved[:, 1]
        x /= np.abs(x).max(axis=1, keepdims=True) + SMALLEST
        v = v / (np.abs(v).max(axis=1, keepdims=True) + SMALLEST)
        periods, since = np.diff(self.limits), self.limits[1:] - self.limits[0]
        decays = np.exp(-periods[:, None] / TIME_CONSTANTS)
        relaxing = np.zeros((*v.shape, len(TIME_CONSTANTS)))
        for i, decay in enumerate(decays[1:], 1):
            relaxing[:, i] = decay * relaxing[:, i - 1] + (periods[i] * v[:, i])[:, None]
        initial = np.exp(-since[:, None] / TIME_CONSTANTS)
        smooth = (
            np.ones_like(x),
            x,
            x**2,
            x**3,
            x**4,
            x**5,
            v,
            x * v,
            x**2 * v,
            np.gradient(v, axis=1),
        )
        terms = np.concatenate(
            (np.stack(smooth, 2), relaxing, np.broadcast_to(initial, relaxing.shape)), axis=2
        )[:, self.used]
        return np.asarray(terms / (np.linalg.norm(terms, axis=1, keepdims=True) + SMALLEST))


def divided(t: Floats, contact: NDArray[np.bool_], settled: NDArray[np.bool_]) -> Blocks | None:
    """Return the division of n samples into blocks; None if too few blocks can be fitted.

    A block is fitted if all its samples and those of the block before are in contact, and if the
    plays are settled in it.
    """
    period = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    size = max(1, round(BLOCK / period)) if period > 0.0 else 1
    if len(t) < FEWEST_BLOCKS * size:
        return None
    touching = np.asarray(last(contact, size).all(axis=1))
    used = last(settled, size).all(axis=1) & touching & np.append(False, touching[:-1])
    ends = limits(t, size)
    if np.count_nonzero(used) < FEWEST_BLOCKS or not np.diff(ends).min() > 0.0:
        return None
    return Blocks(size, ends, used)


def last(values: NDArray[Any], size: int) -> NDArray[Any]:
    """Return the last values as rows of `size` values, without the first that fill no row."""
    return values[len(values) % size :].reshape(-1, size)


def limits(values: Floats, size: int) -> Floats:
    """Return the values at the limits of the blocks: half way between two samples."""
    values = values[len(values) % size :]
    ends = 2.0 * values[0] - values[1], 2.0 * values[-1] - values[-2]
    padded = np.concatenate((ends[:1], values, ends[1:]))
    return np.asarray(0.5 * (padded[1:] + padded[:-1])[::size])


def is_settled(x: Floats, half_width: float) -> NDArray[np.bool_]:
    """Return whether the output of a play does not depend any more on its unknown initial state.

    This is so as soon as the range of the input is the whole width of the play.
    """
    return np.maximum.accumulate(x) - np.minimum.accumulate(x) >= 2.0 * half_width


def residual(terms: Floats, force: Floats) -> Floats:
    """Return the residual of the least-squares fit of the force, shape (blocks,)."""
    return np.asarray(force - terms @ np.linalg.lstsq(terms, force, RANK)[0])


def kelvin_voigt(moved: Floats, force: Floats) -> tuple[float, float]:
    """Return k [N/m] and b [N s/m] of the least-squares fit f = f0 + k x + b v."""
    x, v = (one - one.mean() for one in moved)
    matrix = np.array([[x @ x, x @ v], [x @ v, v @ v]])
    k, b = np.linalg.lstsq(matrix, np.array([x @ force, v @ force]), None)[0].tolist()
    return k, b
