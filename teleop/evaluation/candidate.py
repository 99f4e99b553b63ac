"""Fit one candidate model of the contact, and compute its stiffness (see `local_stiffness`)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Floats
from teleop.evaluation.contact_rows import Rows
from teleop.evaluation.prepared import Prepared

BAND = 0.08
"""Samples are used for the slope if the distance of their force from half of the force range is
less than this fraction of the range."""
SLOPE_SAMPLES = 3
"""Samples for the slope in each pass through half of the force range. If there are fewer on
average, neighbouring samples are used in addition (`with_neighbours`)."""
SLOPE_NOISE = 50.0
"""Smallest distance between two positions from which a slope is computed (`surroundings`), in
standard deviations of the noise of the smoothed position."""

FINEST = 0.0005
"""Relative standard deviation of k that smoothing and grid cause if the force of the body relaxes.

This value is the median error of k for synthetic records without noise
(`estimation.testing_records`). For a model without relaxing parts the error is zero, because such a
model holds exactly for the smoothed signals.
"""


class Candidate(NamedTuple):
    """A candidate model that was fitted to the record."""

    degree: int
    """Degree of the polynomial P of the elastic force."""
    times: tuple[float, ...]
    """Time constants of the relaxing parts [s]."""
    bic: float
    """Bayesian information criterion."""
    k: float
    """Stiffness [N/m]."""
    k_std: float
    """Standard deviation of k [N/m]."""
    b: float
    """Damping [N s/m]."""
    b_std: float
    """Standard deviation of b [N s/m]."""
    rms: float
    """Root mean square of the residual [N]."""
    position: float
    """Position at which the stiffness is evaluated [m]."""
    force: float
    """Force at half of the force range, including the mean of the baseline [N]."""
    theta: Floats
    """Coefficients of the baseline, velocity, powers of the normalised position, relaxing parts."""


def evaluate(
    rows: Rows,
    degree: int,
    times: tuple[float, ...],
    relaxing: list[Floats],
    cornered: list[Floats],
) -> Candidate:
    """Fit a candidate, and compute its stiffness at half of the force range.

    Parameters
    ----------
    rows
        Samples that are fitted.
    degree
        Degree of the polynomial.
    times
        Time constants of the relaxing parts [s].
    relaxing
        Relaxing parts z_j of the elastic force (see `local_stiffness`) after the smoothing. There
        is one array of shape (n,) for each time constant.
    cornered
        The same arrays, but with the values before the smoothing at sharp corners (see
        `with_corners`).
    """
    fit = rows.fit(degree, relaxing)
    theta, first = fit.theta, rows.v_column + 1
    n, m = len(rows.f), len(theta)
    index, sharp_x = rows.fine, rows.sharp_x
    powers = np.arange(1, degree + 1)
    coefficients = theta[first : first + degree]
    without = rows.fine_powers[:, :degree] @ coefficients
    for c, z in zip(theta[first + degree :], cornered, strict=True):
        without = without + c * z[index]
    constant = float(rows.basis.mean(axis=0) @ theta[: rows.v_column])
    low, high = float(without.min()), float(without.max())
    top, bottom = int(np.argmax(without)), int(np.argmin(without))

    def effect(i: int) -> Floats:
        """Return the derivative of the elastic force with respect to each parameter.

        The derivatives are those at sample `i` of the samples `rows.fine`.
        """
        found = np.zeros(m)
        found[first:] = [*rows.fine_powers[i, :degree], *(z[index[i]] for z in cornered)]
        return found

    force_effect = 0.5 * (effect(top) + effect(bottom))
    if rows.phases.free_force is not None and rows.order == 0:
        low = min(rows.phases.free_force - constant, high)
        force_effect = 0.5 * effect(top)
        force_effect[0] = -0.5
    force = 0.5 * (low + high)
    distance = np.abs(without - force)
    near = with_neighbours(rows.loading & (distance < BAND * (high - low)), index)
    if len(near) < 6:
        order = np.argsort(np.where(rows.loading, distance, np.inf))
        near = np.sort(order[: min(6, int(rows.loading.sum()))])
    x, v = rows.fine_x[near], rows.fine_v[near]
    position = middle_position(x, without[near], force)
    gradient = np.zeros(m)
    s = (position - rows.origin) / rows.scale
    gradient[first : first + degree] = powers * s ** (powers - 1) / rows.scale
    breaks = np.diff(index[near], prepend=index[near[0]]) > 1
    pass_of = np.cumsum(breaks, dtype=np.int_)
    along = gradient.copy()
    nearest = near[int(np.argmin(distance[near]))]
    before, after = surroundings(sharp_x, int(index[nearest]), len(near), rows.record)
    for j, z in enumerate(relaxing):
        gradient[first + degree + j] = loading_slope(x, v, z[index[near]], pass_of)
        step = sharp_x[after] - sharp_x[before]
        along[first + degree + j] = (z[after] - z[before]) / step if step else 0.0
    path_doubt = abs(float((along - gradient) @ theta)) / 1.5
    damping = np.zeros(m)
    damping[rows.v_column] = 1.0
    squares = float(np.mean(fit.residual**2))
    bic = n * math.log(max(squares, 1e-300)) + (m + len(times)) * math.log(n)
    curvature = float(coefficients[1:] @ (powers[1:] * (powers[1:] - 1) * s ** (powers[1:] - 2)))
    k = float(gradient @ theta)
    curvature /= rows.scale**2
    elastic = effect(nearest)
    elastic[first : first + degree] = s**powers
    total = gradient + curvature / (k or 1e-300) * (force_effect - elastic)
    slopes = rows.scaled_powers[:, :degree] * powers @ coefficients / rows.scale
    rounding = rows.rounding_error(np.vstack([total, damping]) @ fit.inverse, slopes)
    s_top = (rows.fine_x[top] - rows.origin) / rows.scale
    top_slope = float(powers * s_top ** (powers - 1) @ coefficients) / rows.scale
    force_std = 0.5 * math.hypot(
        top_slope * rows.record.count / math.sqrt(12.0), rows.phases.free_error
    )
    range_doubt = force_std * curvature / (k or 1e-300)
    smoothing = FINEST * k if times else 0.0
    return Candidate(
        degree,
        times,
        bic,
        k,
        math.hypot(
            fit.deviation(total, rows.cycles), range_doubt, path_doubt, rounding[0], smoothing
        ),
        float(theta[rows.v_column]),
        math.hypot(fit.deviation(damping, rows.cycles), rounding[1]),
        math.sqrt(squares),
        position,
        force + constant,
        theta,
    )


def surroundings(x: Floats, at: int, most: int, record: Prepared) -> tuple[int, int]:
    """Return the indices of two samples that are suitable to compute the slope of a signal over x.

    One sample is before a given sample, and the other is after it. The distance between the two
    samples is doubled until one of two conditions holds: their positions differ by much more than
    the noise, or a further doubling would exceed `most`.

    Parameters
    ----------
    x
        Position [m], shape (n,).
    at
        Index of the given sample.
    most
        Largest distance between the two indices [samples].
    record
        The prepared record.
    """
    least = SLOPE_NOISE * record.x_noise * record.noise_gain
    half = 1
    while True:
        before, after = max(at - half, 0), min(at + half, len(x) - 1)
        if abs(x[after] - x[before]) >= least or 4 * half > most:
            return before, after
        half *= 2


def with_neighbours(mask: NDArray[np.bool_], index: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the indices of the samples that a mask selects, and of neighbours if necessary.

    The selected samples form runs, one run for each pass through half of the force range. To
    compute a slope, at least three samples in a run are necessary. If the runs have fewer samples
    on average, the samples directly before and after each run are added. This occurs in fast
    motions.

    Parameters
    ----------
    mask
        Samples to use, shape (n,).
    index
        Index of each sample on the grid, shape (n,). A step of more than 1 ends a run.
    """
    chosen = np.flatnonzero(mask)
    passes = np.count_nonzero(np.diff(index[chosen]) > 1) + 1
    if len(chosen) >= SLOPE_SAMPLES * passes:
        return chosen
    joined = np.diff(index) == 1
    wider = mask.copy()
    wider[1:] |= mask[:-1] & joined
    wider[:-1] |= mask[1:] & joined
    return np.flatnonzero(wider)


def middle_position(x: Floats, f: Floats, force: float) -> float:
    """Return the position [m] at the force `force` [N].

    A polynomial of degree 2 in the force is fitted to the positions.

    Parameters
    ----------
    x, f
        Position [m] and force [N], shape (n,).
    force
        Force at which the position is computed [N].
    """
    if np.ptp(f) == 0.0 or len(x) < 4:
        return float(x.mean())
    size = float(np.max(np.abs(f - force)))
    powers = ((f - force) / size)[:, None] ** np.arange(3)
    position = np.linalg.lstsq(powers, x - x.mean(), rcond=1e-8)[0][0] + x.mean()
    return float(np.clip(position, x.min(), x.max()))


def loading_slope(x: Floats, v: Floats, z: Floats, pass_of: NDArray[np.int_]) -> float:
    """Return the slope of z against x, from a least-squares fit.

    In this fit, each pass through half of the force range has its own constant. If the velocity v
    varies enough, v is an additional regressor. Then a part of z that is proportional to v does not
    change the slope.

    Parameters
    ----------
    x, v, z
        Position [m], velocity [m/s] and a relaxing part, each of shape (n,).
    pass_of
        For each sample, the number of its pass through half of the force range, shape (n,).
    """
    spread = float(np.std(v) / np.mean(np.abs(v)))
    x, v, z = (values - pass_means(values, pass_of) for values in (x, v, z))
    columns = [x]
    if len(x) > 8 and spread > 0.02:
        columns.append(v)
    return float(np.linalg.lstsq(np.column_stack(columns), z, rcond=1e-6)[0][0])


def pass_means(values: Floats, pass_of: NDArray[np.int_]) -> Floats:
    """Return for each value the mean of the values in the same pass, shape (n,)."""
    return np.asarray((np.bincount(pass_of, values) / np.bincount(pass_of))[pass_of])
