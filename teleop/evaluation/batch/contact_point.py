"""Find the contact point: the position at which the force begins to increase.

An approach is a motion from free motion into contact. The model of its force is one of

    f = f0 + a d + q d^2 + b v            (a body that is stiff from the beginning)
    f = f0 + a d^1.5 + q d^2.5 + b v      (a body that is soft at the beginning)
    f = f0 + a d^1.5 + q d^2.5 + b v d    (and whose damping grows with depth)

with the position x, the velocity v and the depth d = max(x - xc, 0). Out of contact (d = 0), the
force is f0. The contact point xc is common to all approaches; the other parameters are fitted to
each approach. The fit is generalized least squares: an autoregressive model of the noise is fitted
to the force out of contact and makes the residuals white, because the slow noise of a force sensor
moves the fitted contact point much more than white noise of the same size. For each model, the 95 %
interval contains the values of xc whose sum of squares is so little larger than the smallest that
noise can cause the difference. If the sums of the approaches do not agree, the interval is larger
(Birge's ratio). The interval of the contact point contains those of all models, without the models
that fit much worse than the best one.

Without contact point, the model is a body in contact throughout, f = f0 + a x + q x^2 + b v. If it
explains the approaches nearly as well, the record has no contact point.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.special import chdtri

from estimation.arrays import Floats
from estimation.stiffening import Interval
from teleop.evaluation.batch.masks import eroded, runs
from teleop.evaluation.batch.smoothed_record import SmoothedRecord

MOST_APPROACHES, MOST_SAMPLES, POINTS = 10, 300, 100
"""Approximate largest number of approaches, and of samples of each, that are used, and number of
contact points that are tried."""
REACHES, LARGEST_MISFIT = (0.35, 0.17, 0.08), 1.15
"""An approach ends where the force reaches a fraction of its largest value, because the models only
describe the beginning of contact. It is the first fraction for which the mean square of the
residual is less than this multiple of that of the noise, or else that with the smallest."""
DECISIVE = 10.0
"""Difference of the sum of squares, in variances of the noise, at which a model is rejected."""
FEWEST_SAMPLES, FEWEST_FREE, MOST_ORDER = 16, 40, 8
"""Fewest samples of an approach, fewest samples out of contact for a model of the noise, and
largest order of this model."""

Terms = Callable[[Floats, Floats], tuple[Floats, ...]]
MODELS: tuple[Terms, ...] = (
    lambda d, v: (d, d**2, v * (d > 0.0)),
    lambda d, v: (d**1.5, d**2.5, v * (d > 0.0)),
    lambda d, v: (d**1.5, d**2.5, v * d),
)


class Fits(NamedTuple):
    """The sums of squared residuals of the approaches, in variances of the noise."""

    points: Floats
    """The contact points that were tried, shape (points,) [m]."""
    sums: Floats
    """The sums of squares, shape (models, approaches, points)."""
    misfit: Floats
    """Mean square of the residual at the best contact point of each model, shape (models,)."""
    spacing: float
    """Distance between samples or contact points, whichever is larger [m]."""


def contact_point(
    record: SmoothedRecord, contact: NDArray[np.bool_], free_force: float, guard: int
) -> Interval | None:
    """Return the position at which contact begins, with its 95 % interval [m].

    The result is None if the record has no approach with enough samples, or no approach needs a
    contact point. Samples that are nearer than `guard` to contact are not used for the noise.
    """
    best: Fits | None = None
    free = eroded(~contact, guard)
    for reach in REACHES:
        found = fitted(record, approaches(record, contact, free_force, reach, guard), free)
        if found and (best is None or found.misfit.min() < best.misfit.min()):
            best = found
        if best and best.misfit.min() < LARGEST_MISFIT:
            break
    return interval(best) if best else None


def interval(fits: Fits) -> Interval | None:
    """Return the contact point with its 95 % interval [m]; None if no contact point is needed."""
    points, sums = fits.points, fits.sums
    totals = sums.sum(axis=1)
    smallest = totals.min(axis=1)
    apart = (smallest - sums.min(axis=2).sum(axis=1)) / max(sums.shape[1] - 1, 1)
    scale = np.maximum(1.0, np.maximum(apart, fits.misfit))
    rejected = smallest > smallest.min() + DECISIVE * scale
    if (totals[:, 0] <= smallest + DECISIVE * scale)[~rejected].any():
        return None
    near = totals <= (smallest + chdtri(1, 0.05) * scale)[:, None]
    allowed = points[near[~rejected].any(axis=0)]
    chosen = int(np.argmin(rejected))
    middle = points[totals[chosen] <= smallest[chosen] + 0.02 * scale[chosen]].mean()
    low, high = float(allowed[0] - fits.spacing), float(allowed[-1] + fits.spacing)
    return Interval(float(middle), low, high)


def fitted(
    record: SmoothedRecord, spans: list[tuple[int, int]], free: NDArray[np.bool_]
) -> Fits | None:
    """Fit all models to the approaches; None if no approach has enough samples."""
    stride = max(1, max((end - start for start, end in spans), default=0) // MOST_SAMPLES)
    parts = [slice(a, b, stride) for a, b in spans if b - a >= FEWEST_SAMPLES * stride]
    if not parts:
        return None
    noise = math.hypot(record.f_noise, record.f_count / math.sqrt(12.0))
    whitening = noise_filter([record.raw_f[a:b:stride] for a, b in runs(free)], noise)
    x = [record.raw_x[part] for part in parts]
    low, high = min(float(one.min()) for one in x), max(float(one.max()) for one in x)
    points = np.linspace(low, high, POINTS + 1)[:-1]
    sums = np.array([squares(record, part, whitening, points) for part in parts])
    sums = sums.transpose(1, 0, 2)
    freedom = max(sum(len(one) - 4 for one in x) - 1, 1)
    misfit = sums.sum(axis=1).min(axis=1) / freedom
    steps = [float(np.median(np.abs(np.diff(one)))) for one in x]
    return Fits(points, sums, misfit, max(float(points[1] - points[0]), *steps))


def approaches(
    record: SmoothedRecord,
    contact: NDArray[np.bool_],
    free_force: float,
    reach: float,
    guard: int,
) -> list[tuple[int, int]]:
    """Return the start and the end of the motions from free motion into contact.

    They end `guard` / 2 samples after the smoothed force has reached the fraction `reach` of its
    largest value: the smoothed force begins to increase earlier than the measured force.
    """
    found = []
    begun = [(start, end) for start, end in runs(contact) if start > 0]
    for start, end in begun[:: max(1, len(begun) // MOST_APPROACHES)]:
        top = int(np.argmax(record.f[start:end])) + start
        rise = record.f[start : top + 1] - free_force
        stop = start + 1 + min(int(np.argmax(rise > reach * rise[-1])) + guard // 2, len(rise) - 1)
        before = start - 1
        while before > 0 and not contact[before - 1] and start - before < len(rise):
            before -= 1
        if stop - before >= FEWEST_SAMPLES and record.x[stop - 1] > record.x[before]:
            found.append((before, stop))
    return found


def noise_filter(free: list[Floats], noise: float) -> Floats:
    """Return the filter that makes the noise of the force white: p + 1 coefficients.

    The order p of the autoregressive model is that with the smallest Bayesian information
    criterion, and its coefficients solve the Yule-Walker equations. The filtered noise has the
    variance 1. With few samples out of contact, white noise of the standard deviation `noise` [N]
    is assumed.
    """
    free = [part for part in free if len(part) > 2 * MOST_ORDER]
    count = sum(len(part) for part in free)
    if count < FEWEST_FREE:
        return np.array([1.0 / max(noise, 1e-15)])
    mean = float(np.concatenate(free).mean())
    products = np.zeros(MOST_ORDER + 1)
    for part in free:
        value = part - mean
        products += [float(value[i:] @ value[: len(value) - i]) for i in range(MOST_ORDER + 1)]
    products[0] = max(products[0], count * noise**2) * 1.000001 + 1e-30
    best, least = np.ones(1), np.inf
    for order in range(MOST_ORDER + 1):
        weights = (
            solve_toeplitz(products[:order], products[1 : order + 1]) if order else np.empty(0)
        )
        variance = (products[0] - weights @ products[1 : order + 1]) / count
        criterion = count * np.log(variance) + order * np.log(count)
        if criterion < least:
            best, least = np.append(1.0, -weights) / np.sqrt(variance), criterion
    return best


def squares(record: SmoothedRecord, part: slice, whitening: Floats, points: Floats) -> Floats:
    """Return the sums of squared residuals of one approach, shape (models, points).

    `whitening` are the coefficients of `noise_filter`.
    """
    x, v, f = record.raw_x[part], record.v[part], record.raw_f[part]
    target = filtered(whitening, f)
    depth = np.maximum(x[:, None] - points, 0.0) / max(points[-1] - points[0], 1e-300)
    speed = np.broadcast_to(v[:, None] / max(float(np.abs(v).max()), 1e-300), depth.shape)
    found = np.empty((len(MODELS), len(points)))
    for i, terms in enumerate(MODELS):
        design = np.stack([np.ones_like(depth), *terms(depth, speed)])
        white = filtered(whitening, design.transpose(1, 2, 0)).transpose(1, 0, 2)
        white = white / np.maximum(np.linalg.norm(white, axis=1, keepdims=True), 1e-12)
        normal = white.transpose(0, 2, 1) @ white + 1e-10 * np.eye(white.shape[2])
        theta = np.linalg.solve(normal, (target @ white)[..., None])
        found[i] = np.sum((target - (white @ theta)[..., 0]) ** 2, axis=1)
    return found


def filtered(coefficients: Floats, values: Floats) -> Floats:
    """Return the filtered values along axis 0, without those that need earlier values."""
    first, last = len(coefficients) - 1, len(values)
    parts = (c * values[first - i : last - i] for i, c in enumerate(coefficients))
    return np.asarray(sum(parts))
