"""Compute baselines. A baseline is the part of a signal that is slower than the palpation.

`baseline_regressors` returns the cosines cos(pi j (t - t0) / T), j = 0 ... m, and a parabola as the
regressors of a baseline. t0 is the start of the record, and T is its length. The highest frequency
of the cosines is m / (2 T). `without_baseline` subtracts a baseline that consists of the cosines
only.

The parabola is needed for a drift, for the following reason. At both ends of the record, the time
derivative of each cosine is zero, but that of a drift is not. The cosine coefficients of a drift
therefore decrease only as 1 / j^2, and a part of the drift remains at the frequency of the
palpation. A parabola can have the same time derivatives at both ends as the drift. If this parabola
is subtracted from the drift, the cosine coefficients of the difference decrease as 1 / j^4
(Lanczos).

If the cosines and the parabola are among the regressors of a fit, a slow drift of force and
position does not affect the other parameters (Frisch and Waugh). But the information in the slow
part of the motion is lost.

References
----------
R. Frisch, F. V. Waugh, "Partial time regressions as compared with individual trends",
Econometrica 1(4), 1933; C. Lanczos, "Discourse on Fourier series", Oliver & Boyd, 1966 (convergence
after the subtraction of a polynomial).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.fft import dct

from estimation.arrays import Floats

BELOW = 0.6
"""Ratio of two frequencies: the highest frequency of a baseline, and the lower end of the band in
which the force follows the displacement."""
MOST = 300
"""Largest number of cosines. In a long record, the highest frequency of a baseline is therefore
lower than `BELOW` permits."""
FEWEST_CYCLES = 3.0
"""Smallest length of a record with a baseline, in periods of the lower end of the band in which the
force follows the displacement."""

BLOCK = 4096
"""Approximate number of samples for which the regressors of a baseline are computed together, to
limit the memory."""


def baseline_order(low: float, seconds: float) -> int:
    """Return the number m of cosines in a baseline: the slow part of a signal.

    The cosines are cos(pi j (t - t0) / T), j = 1 ... m, for a record with the start t0 and the
    length T. m is 0 if the record is shorter than `FEWEST_CYCLES` periods of the frequency `low`.
    """
    if low * seconds < FEWEST_CYCLES:
        return 0
    return min(math.floor(2.0 * BELOW * low * seconds), MOST)


def cosines(t: Floats, start: float, seconds: float, order: int) -> Floats:
    """Return a column of ones, and one column for each cosine, shape (n, 1 + order).

    Column j is cos(pi j (t - t0) / T), j = 0 ... `order`.
    """
    return np.asarray(np.cos(np.pi / seconds * np.outer(t - start, np.arange(order + 1))))


def baseline_regressors(t: Floats, start: float, seconds: float, order: int) -> Floats:
    """Return the regressors of a baseline: a constant, slow cosines and a parabola.

    A baseline is the part of a signal that is slower than the palpation. A fit with these
    regressors usually has other regressors as well, for example v and x.

    The shape is (n, order + 3): the last two columns are the linear and the quadratic term of the
    parabola. If `order` is 0, the constant is the only column. `order` is from `baseline_order`.
    """
    columns = cosines(t, start, seconds, order)
    if order == 0:
        return columns
    s = 2.0 * (t - start) / seconds - 1.0
    return np.column_stack([columns, s, s**2])


def baseline(t: Floats, start: float, seconds: float, coefficients: Floats) -> Floats:
    """Return a fitted baseline at n times, shape (n,).

    A baseline is the part of a signal that is slower than the palpation.
    """
    order = max(len(coefficients) - 3, 0)
    parts = np.array_split(t, math.ceil(len(t) / BLOCK))
    return np.concatenate(
        [baseline_regressors(part, start, seconds, order) @ coefficients for part in parts]
    )


def without_baseline(values: Floats, order: int) -> Floats:
    """Return the values minus their baseline, shape (n,).

    A baseline is the part of a signal that is slower than the palpation. Here the baseline is a
    constant and slow cosines, fitted to the values by least squares. The baseline has no parabola,
    because a parabola would follow the palpation at the ends of the record. If `order` is 0, the
    values are returned unchanged.

    The samples are evenly spaced. The scalar products of the cosines and the values are therefore
    computed by a discrete cosine transform (DCT-I), in a time proportional to n log n. In the fit,
    all samples have the same weight. With equal weights, the cosines are not exactly orthogonal.
    The coefficients are therefore computed by solving 1 + `order` linear equations.

    The samples must be evenly spaced, and `order` less than n - 1.
    """
    if order == 0:
        return values
    n, count = len(values), order + 1
    signs = np.where(np.arange(count) % 2, -1.0, 1.0)
    products = 0.5 * (dct(values, 1)[:count] + values[0] + signs * values[-1])
    gram = 0.5 * (1.0 + np.outer(signs, signs))
    gram[np.diag_indices(count)] += np.where(np.arange(count), 0.5, 1.0) * (n - 1)
    coefficients = np.zeros(n)
    coefficients[:count] = 0.5 * np.linalg.solve(gram, products)
    coefficients[0] *= 2.0
    return np.asarray(values - dct(coefficients, 1))
