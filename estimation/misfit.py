"""Compute the misfit of the present estimates: the systematic part of the force error.

The force error is e = f - phi' theta, with the estimate theta. If the model and the estimate are
correct, e is noise, and successive values of e are uncorrelated. If the model or the estimate is
wrong, e depends on the motion, and successive values of e are similar. The misfit measures this
similarity. For this purpose, the samples are divided into short blocks of successive samples:

    misfit = sqrt(max(0, <e_i e_(i-1)>) / <f_i^2>)

e_i and f_i are the means of e and f over block i, for the present estimate. A block is longer than
the correlation time of the filtered noise. <> is a mean over the blocks, with weights that decay
exponentially with the age of a block. The misfit is near 0 if the present b and k are those of the
specimen, even with much noise. The misfit is about 1 for the estimate b = k = 0.

If the force is linear in theta, <e_i e_(i-1)> can be computed from products such as <f_i x_(i-1)>.
These products are the same for all estimators, and are stored once. The force of the Hunt-Crossley
model is not linear in its exponent. For this model the means over the recent blocks are stored
instead (`RecentBlocks`).

References
----------
R. K. Mehra, "On the identification of variances and adaptive Kalman filtering", IEEE Transactions
on Automatic Control 15(2), 1970; L. Ljung, "System Identification: Theory for the User", 2nd ed.,
Prentice Hall, 1999, section 16.6 (residual analysis).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.compiled import looped
from estimation.conditioning import Regression
from estimation.estimator import Estimate, Estimates, Estimator

BLOCKS = 50
"""Number of blocks per window, which is the time constant of the weights. For a window of 1 s, a
block has 20 ms, which is longer than the correlation time of the noise."""
MEMORY = 3
"""For the Hunt-Crossley model, the blocks of this number of windows are stored. The weights of all
older blocks are together about 5 % of all weights."""
LARGEST_MISFIT = 0.05
"""If the misfit is larger than this limit, the program reports that the model does not explain the
force.

A body whose force has a cubic term, so that its stiffness doubles over the indentation, has a
misfit of 0.07 or more. A linear body has a misfit below 0.03, even if the noise is a tenth of the
force.
"""


class Misfit:
    """Computes the misfit (the systematic part of the force error) of each estimator of a bank.

    `window` is the time constant [s] with which past samples lose weight. A good value is one
    period of the palpation.
    """

    def __init__(self, bank: Mapping[str, Estimator], window: float = 1.0) -> None:
        if not 0.0 < window < math.inf:
            raise ValueError(f"window must be positive, got {window}")
        self.window = window
        self._block = window / BLOCKS
        self._further = [-1 if "n" in e.names else len(e.model.further) for e in bank.values()]
        self._size = 3 + max(0, *self._further)
        self._recent = RecentBlocks(MEMORY * BLOCKS) if min(self._further) < 0 else None
        self.reset()

    def reset(self) -> None:
        """Discard all processed samples."""
        size = self._size
        self._sums, self._span = [0.0] * size, 0.0
        self._before: list[float] | None = None
        if self._recent is not None:
            self._recent.clear()
        self._products = [[0.0] * size for _ in range(size)]
        self._square = 0.0
        self.values = (math.nan,) * len(self._further)
        """Present misfit of each estimator, in the order of the bank; NaN if not yet computed."""

    def update(
        self,
        x: float,
        v: float,
        f: float,
        dt: float,
        further: Sequence[float],
        estimates: Mapping[str, Estimate],
        is_open: bool = True,
    ) -> tuple[float, ...]:
        """Process one sample, and return the misfit of each estimator.

        The values of the sample are not checked. `estimates` are those after this sample, in the
        order of the bank. `is_open` is False without contact or motion; the sample is then not
        used. The misfit changes about every `window` / `BLOCKS` seconds.
        """
        if self._add(x, v, f, dt, further, is_open):
            self.values = tuple(
                self._misfit(e.b, e.k, e.further, count)
                for e, count in zip(estimates.values(), self._further, strict=True)
            )
        return self.values

    def run(
        self,
        regression: Regression,
        estimates: Mapping[str, Estimates],
        is_open: NDArray[np.bool_],
    ) -> dict[str, Floats]:
        """Process n samples, with the same results as n calls of `update`.

        The result has the misfit after each sample, shape (n,), by the name of the estimator.
        """
        ends = self.ends(regression, is_open)
        return {name: self.series(i, ends, e) for i, (name, e) in enumerate(estimates.items())}

    def ends(self, regression: Regression, is_open: NDArray[np.bool_]) -> BlockEnds:
        """Process n samples; return the data from which `series` computes the misfits.

        `regression` contains the samples. `is_open`, shape (n,), is True during contact and motion.
        """
        sums = list(self._sums)
        channels = (regression.f, regression.v, regression.x, *regression.further.T)
        span, totals = np.empty(len(is_open)), np.zeros((self._size, len(is_open)))
        for start, channel, total in zip(sums, channels, totals, strict=False):
            constants = (self._block, self._span, start)
            looped(block_sums, constants, (regression.dt, is_open, channel), (span, total))
        closed = np.concatenate(([0], np.cumsum(~is_open)))
        history = [] if self._recent is None else self._recent.blocks
        at, products, squares, positions = [], [], [], []
        before = 0
        for i in np.flatnonzero(span >= self._block).tolist():
            if closed[i + 1] > closed[before]:
                self._before = None
            self._span, self._sums = float(span[i]), totals[:, i].tolist()
            is_known = self._end_block()
            before = i + 1
            if self._recent is not None:
                history.append(self._recent.last)
            if is_known:
                at.append(i)
                products.append([list(row) for row in self._products])
                squares.append(self._square)
                positions.append(len(history))
        if closed[-1] > closed[before]:
            self._before = None
        if before < len(span):
            self._span, self._sums = float(span[-1]), totals[:, -1].tolist()
        size = self._size
        return BlockEnds(
            np.array(at, dtype=np.intp),
            len(span),
            np.reshape(products, (len(at), size, size)),
            np.array(squares),
            np.reshape(history, (-1, 4)),
            np.array(positions, dtype=np.intp),
        )

    def series(self, i: int, ends: BlockEnds, estimates: Estimates) -> Floats:
        """Return the misfit of one estimator after each sample, shape (n,).

        `ends` is the result of the method `ends` for the same samples.
        """
        at, samples, products, square, history, positions = ends
        count = self._further[i]
        b, k = estimates.b[at], estimates.k[at]
        further = [series.value[at] for series in estimates.further.values()]
        if count < 0 and self._recent is not None:
            covariance = self._recent.autocovariances(history, positions, further)
        else:
            weights = (np.ones(len(at)), -b, -k, *[-values for values in further[:count]])
            covariance = autocovariance(products.transpose(1, 2, 0), weights)
        positive = square > 0.0
        ratio = np.maximum(covariance, 0.0) / np.where(positive, square, 1.0)
        values = [self.values[i], *np.where(positive, np.sqrt(ratio), math.nan).tolist()]
        self.values = (*self.values[:i], values[-1], *self.values[i + 1 :])
        return np.repeat(np.array(values), np.diff([0, *at, samples]))

    def _add(
        self, x: float, v: float, f: float, dt: float, further: Sequence[float], is_open: bool
    ) -> bool:
        """Add a sample to the present block of samples. Return True if the misfits can change."""
        if not is_open:
            self._begin_block()
            self._before = None
            return False
        sums = self._sums
        sums[0] += f * dt
        sums[1] += v * dt
        sums[2] += x * dt
        if further:
            for i, value in enumerate(further, 3):
                sums[i] += value * dt
        self._span += dt
        if self._span < self._block:
            return False
        return self._end_block()

    def _begin_block(self) -> None:
        self._sums = [0.0] * self._size
        self._span = 0.0

    def _end_block(self) -> bool:
        """End the present block. Store the products of its means and those of the previous block.

        Return False if there is no block directly before the present block, and so no product.
        """
        span, before = self._span, self._before
        present = self._before = [total / span for total in self._sums]
        self._begin_block()
        share = span / (self.window + span)
        if self._recent is not None:
            self._recent.add(present, 0.0 if before is None else share)
        if before is None:
            return False
        self._square += share * (present[0] * present[0] - self._square)
        for row, now in zip(self._products, present, strict=True):
            for j, last in enumerate(before):
                row[j] += share * (now * last - row[j])
        return True

    def _misfit(self, b: float, k: float, further: Sequence[float], count: int) -> float:
        """Return the misfit of the estimate b, k and `further`; NaN if not yet computable.

        `further` begins with the parameters besides b and k. `count` is the number of these
        parameters, or -1 for the Hunt-Crossley model.
        """
        if self._square <= 0.0:
            return math.nan
        if count < 0 and self._recent is not None:
            covariance = self._recent.autocovariance(further)
        else:
            weights = (1.0, -b, -k, *[-value for value in further[:count]])
            covariance = autocovariance(self._products, weights)
        return math.sqrt(max(covariance, 0.0) / self._square)


def autocovariance(products: Iterable[Iterable[Any]], weights: Sequence[Any]) -> Any:
    """Return the mean product w' P w of the force errors of successive blocks [N^2].

    P_ij is the mean of u_i of a block times u_j of the previous block, where u is the mean of (f,
    v, x, further regressors) over a block. w is (1, -b, -k, -further parameters). The elements of P
    and w are numbers or have the shape (n,). If P is larger than w, its last rows and columns are
    not used.
    """
    covariance = 0.0
    for row, weight in zip(products, weights, strict=False):
        part = 0.0
        for product, other in zip(row, weights, strict=False):
            part += product * other
        covariance += weight * part
    return covariance


class BlockEnds(NamedTuple):
    """Sums at the end of each block of successive samples, for an array of samples.

    `Misfit.ends` returns these sums. `Misfit.series` computes the misfit of an estimate from them.
    A block is counted only if another block is directly before it. In the shapes of the
    arrays, `blocks` is the number of these blocks.
    """

    at: NDArray[np.intp]
    """Index of the last sample of each block, shape (blocks,)."""
    samples: int
    """Number of samples in the array."""
    products: Floats
    """Products of the means over successive blocks, shape (blocks, size, size).

    Let u = (f, v, x, further regressors) be the means over a block, shape (size,). The element i, j
    is a weighted mean of the product of u_i of a block and u_j of the previous block.
    """
    square: Floats
    """Weighted mean of the square of the mean force in a block [N^2], shape (blocks,)."""
    history: Floats
    """Means over all stored blocks, shape (stored, 4), with the columns of `RecentBlocks.blocks`.

    The array is empty if no estimator has the Hunt-Crossley model.
    """
    positions: NDArray[np.intp]
    """Number of rows of `history` up to and including each block, shape (blocks,)."""


def block_sums(
    block: float,
    span: float,
    total: float,
    dt: Sequence[float],
    is_open: Sequence[bool],
    values: Sequence[float],
    spans: list[float],
    totals: list[float],
) -> None:
    """Compute, at each sample, the time since its block began and the integral of a signal.

    A block ends when it is at least `block` seconds long, or when the contact gate closes (there is
    no contact or no motion).

    `span` [s] and `total` are the length of the unfinished block before the first sample, and the
    integral over it. `spans` [s] and `totals` get the time since the block began and the integral
    of the signal over this time, for each sample.
    """
    for n in range(len(dt)):
        if is_open[n]:
            total += values[n] * dt[n]
            span += dt[n]
        else:
            span = 0.0
            total = 0.0
        spans[n] = span
        totals[n] = total
        if span >= block:
            span = 0.0
            total = 0.0


class RecentBlocks:
    """The last `count` blocks, for the autocovariance of the force errors of a Hunt-Crossley model.

    For each block, the means of force, velocity and displacement are stored. The force error of a
    block is the mean force minus K x^n + B x^n v, computed from the mean x and v. When the estimate
    of K, B and n changes, the force errors of all stored blocks are computed again.
    """

    def __init__(self, count: int) -> None:
        self._blocks: deque[tuple[float, float, float, float]] = deque(maxlen=count)

    def clear(self) -> None:
        """Discard all stored blocks of samples."""
        self._blocks.clear()

    def add(self, means: Iterable[float], share: float) -> None:
        """Store the means of the signals over a new block of samples.

        `means` are those of f [N], v [m/s] and x [m]; further values are ignored. `share`, from 0
        to 1, is the weight of the new block in the autocovariance c, which becomes (1 - share) c +
        share e e_before with the force errors of this and of the previous block. It is 0 if no
        block directly precedes the new block.
        """
        f, v, x, *_ = means
        self._blocks.append((f, v, x, share))

    @property
    def blocks(self) -> list[tuple[float, float, float, float]]:
        """All stored blocks of samples, oldest first.

        Each block is a tuple: mean force [N], mean velocity [m/s], mean displacement [m], and its
        weight in the autocovariance (`share` in `add`).
        """
        return list(self._blocks)

    @property
    def last(self) -> tuple[float, float, float, float]:
        """Newest block of samples, a tuple as in `blocks`."""
        return self._blocks[-1]

    def autocovariances(
        self, history: Floats, positions: NDArray[np.intp], parameters: Sequence[Floats]
    ) -> Floats:
        """Return the autocovariance of the force error [N^2] at m times, shape (m,).

        Each time is the end of a block. The result for a time is the value that the method
        `autocovariance` returns at that time.
        """
        first = np.maximum(positions - (self._blocks.maxlen or 0), 0)
        found = np.empty(len(positions))
        f, v, x, share = history.T.copy()
        inputs = (f, v, x, share, *parameters[:3], first, positions)
        looped(window_autocovariances, (), inputs, (found,))
        return found

    def autocovariance(self, parameters: Sequence[float]) -> float:
        """Return the autocovariance of the force error [N^2].

        The force errors of all stored blocks are computed with the given parameters. The result is
        the weighted mean of the products of the force errors of successive blocks.
        """
        stiffness, damping, n = parameters[:3]
        covariance = last = 0.0
        for f, v, x, share in self._blocks:
            covariance, last = include(covariance, last, f, v, x, share, stiffness, damping, n)
        return covariance


def include(
    covariance: float,
    last: float,
    f: float,
    v: float,
    x: float,
    share: float,
    stiffness: float,
    damping: float,
    n: float,
) -> tuple[float, float]:
    """Update the autocovariance of the force error with a new block of samples.

    `last` is the force error of the previous block [N]. The result is the new autocovariance [N^2]
    and the force error of the new block [N]. The force of the model is 0 for x <= 0.
    """
    error = f
    if x > 0.0:
        error = f - (stiffness + damping * v) * x**n
    if share > 0.0:
        covariance += share * (error * last - covariance)
    return covariance, error


def window_autocovariances(
    f: Sequence[float],
    v: Sequence[float],
    x: Sequence[float],
    share: Sequence[float],
    stiffness: Sequence[float],
    damping: Sequence[float],
    n: Sequence[float],
    first: Sequence[int],
    end: Sequence[int],
    found: list[float],
) -> None:
    """Compute the autocovariance of the force error [N^2] at m times, and write it to `found`.

    `f`, `v`, `x` and `share` have one element per block of samples. The other arguments have one
    element per time. At time j, the autocovariance is computed from the blocks first[j] to
    end[j] - 1, with K = stiffness[j], B = damping[j] and n = n[j].
    """
    for j in range(len(found)):
        covariance = 0.0
        last = 0.0
        for i in range(first[j], end[j]):
            covariance, last = include(
                covariance, last, f[i], v[i], x[i], share[i], stiffness[j], damping[j], n[j]
            )
        found[j] = covariance
