"""Stiffness and damping of the contact phases, with intervals that survive a misfit.

The model is the smallest that describes the record, not one that is taken for granted:

    f(t) = baseline(t) + P(x) + b v + sum_j c_j z_j,    z_j' = dP/dt - z_j / tau_j

P is a polynomial of degree 1 to 5, the baseline a constant or, for a palpation of many cycles,
cosines slower than the palpation, and z_j are up to two relaxing parts of the elastic force
(quasi-linear viscoelasticity). k is the slope of the elastic force, relaxing part included, over
displacement at half of the force range, in loading. For a Kelvin-Voigt body it is k, for a steady
sine the storage modulus. It needs no zero of position and force. b multiplies the velocity.

Each candidate is a linear fit of smoothed samples. Candidates are weighted by the Bayesian
information criterion, and the variance has the spread between them besides that of each
(`estimation.robust_error`), so that a doubt about the model widens the interval.

References
----------
Y. C. Fung, "Biomechanics: mechanical properties of living tissues", 2nd ed., Springer, 1993
(chapter 7, quasi-linear viscoelasticity); S. T. Buckland, K. P. Burnham, N. H. Augustin, "Model
selection: an integral part of inference", Biometrics 53(2), 1997 (the variance over models).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from estimation.compiled import Floats
from estimation.robust_error import robust_fit
from teleop.evaluation.contact_rows import DEGREES, Rows
from teleop.evaluation.phases import Phases
from teleop.evaluation.prepared import Prepared

TIMES = 10
"""Time constants of relaxation that are tried, from the smoothing's to twice the record's."""
BAND = 0.08
"""Samples count as at half of the force range within this share of it."""
REFINEMENTS = 3
"""Halvings of the step of log tau about the best time constant."""
HALF_FORCE = 0.002
"""Doubt about half of the force range, as a share of the range, one standard deviation."""
FINEST = 0.001
"""Standard deviation of k below which the smoothing and the grid decide, as a share of it."""


class Candidate(NamedTuple):
    """One model of the record."""

    degree: int
    times: tuple[float, ...]
    """Time constants of its relaxing parts [s]."""
    bic: float
    k: float
    k_std: float
    b: float
    b_std: float
    rms: float
    """Root mean square of the residual [N]."""
    position: float
    """Where the stiffness is taken [m]."""
    force: float
    """Half of the force range [N]."""
    theta: Floats
    """Parameters: baseline, b, powers of the normalised position, relaxing parts."""


@dataclass(frozen=True)
class LocalStiffness:
    """The weighted answer of the candidates."""

    k: float
    k_std: float
    """Standard deviation of k [N/m]: 1.96 of it are 95 %."""
    b: float
    b_std: float
    best: Candidate
    kelvin_voigt: Candidate
    """Degree 1 without relaxation."""
    baseline_size: float
    """Peak-to-peak size of the baseline [N]."""
    r2: float
    """Share of the variance of the force, its baseline taken off, that the best explains."""


def local_stiffness(
    record: Prepared, phases: Phases, baseline: bool = True
) -> LocalStiffness | None:
    """Return stiffness and damping of the contact phases; None where there are too few samples."""
    rows = Rows(record, phases, baseline)
    found = [evaluate(rows, degree, (), []) for degree in DEGREES if rows.allow(degree)]
    if not found:
        return None
    if rows.order == 0:
        found += with_relaxation(rows, rows.normalised(record.raw_x), DEGREES[:3])
        best = min(found, key=lambda one: one.bic)
        if best.degree > 1 and best.times:
            found += with_relaxation(
                rows, rows.polynomial(best.theta[: rows.v_column + 1 + best.degree]), DEGREES[1:4]
            )
    bics = np.array([one.bic for one in found])
    weights = np.exp(-0.5 * (bics - bics.min()))
    weights /= weights.sum()
    k, k_std = averaged(weights, [(one.k, one.k_std) for one in found])
    b, b_std = averaged(weights, [(one.b, one.b_std) for one in found])
    best = found[int(np.argmin(bics))]
    plain = [one for one in found if one.degree == 1 and not one.times]
    rest = robust_fit(rows.basis, rows.f).residual
    slow = rows.basis[:, 1:] @ best.theta[1 : rows.order + 1]
    return LocalStiffness(
        k,
        k_std,
        b,
        b_std,
        best,
        plain[0],
        float(np.ptp(slow)) if rows.order else 0.0,
        1.0 - best.rms**2 / max(float(np.mean(rest**2)), 1e-300),
    )


def with_relaxation(rows: Rows, y: Floats, degrees: tuple[int, ...]) -> list[Candidate]:
    """Return candidates with one and two parts of the elastic force y that relax."""
    record = rows.record
    y = rows.in_contact(y)
    y = y / max(float(np.std(y)), 1e-300)
    times = np.geomspace(4.0 * record.width, 2.0 * float(record.clock[-1]), TIMES).tolist()
    parts: dict[float, Floats] = {}

    def tried(degree: int, chosen: tuple[float, ...]) -> Candidate:
        for tau in chosen:
            if tau not in parts:
                parts[tau] = record.smoothed(relaxing_part(record, y, tau))
        return evaluate(rows, degree, chosen, [parts[tau] for tau in chosen])

    found = []
    for degree in degrees:
        chosen: tuple[float, ...] = ()
        for _ in range(2):
            if not rows.allow(degree + len(chosen) + 1):
                break
            trials = [tried(degree, (*chosen, tau)) for tau in times if tau not in chosen]
            best = min(trials, key=lambda one: one.bic)
            step = math.sqrt(times[1] / times[0])
            for _ in range(REFINEMENTS):
                tau = best.times[-1]
                step = math.sqrt(step)
                trials += [
                    tried(degree, (*chosen, tau * step)),
                    tried(degree, (*chosen, tau / step)),
                ]
                best = min(trials, key=lambda one: one.bic)
            found += trials
            chosen = best.times
    return found


def averaged(weights: Floats, values: list[tuple[float, float]]) -> tuple[float, float]:
    """Return mean and standard deviation over weighted values with standard deviations."""
    value, std = np.array(values).T
    mean = float(weights @ value)
    return mean, math.sqrt(float(weights @ (std**2 + (value - mean) ** 2)))


def relaxing_part(record: Prepared, y: Floats, tau: float) -> Floats:
    """Return z of z' = y' - z / tau, zero at the start of each piece between gaps."""
    decay = math.exp(-record.period / tau)
    gain = tau / record.period * (1.0 - decay)
    pieces = np.split(y, record.starts[1:])
    return np.concatenate([lfilter([gain, -gain], [1.0, -decay], p - p[0]) for p in pieces])


def evaluate(
    rows: Rows, degree: int, times: tuple[float, ...], relaxing: list[Floats]
) -> Candidate:
    """Fit a candidate, and return it with its stiffness at half of the force range."""
    fit = robust_fit(rows.regressors(degree, relaxing), rows.f)
    theta, first = fit.theta, rows.v_column + 1
    n, m = len(rows.f), len(theta)
    index = rows.fine
    sharp_x, sharp_v = rows.sharp_x, rows.sharp_v
    v = sharp_v[index]
    powers = np.arange(1, degree + 1)
    coefficients = theta[first : first + degree]
    without = rows.normalised(sharp_x[index])[:, None] ** powers @ coefficients
    for c, z in zip(theta[first + degree :], relaxing, strict=True):
        without = without + c * z[index]
    constant = float(theta[0])
    low, high = float(without.min()), float(without.max())
    if rows.phases.free_force is not None:
        low = min(rows.phases.free_force - constant, high)
    force = 0.5 * (low + high)
    moving = v > 0.1 * np.percentile(np.abs(v), 95)
    if moving.sum() < 4:
        moving = np.abs(v) > 0.0
    near = np.flatnonzero(moving & (np.abs(without - force) < BAND * (high - low)))
    if len(near) < 6:
        order = np.argsort(np.where(moving, np.abs(without - force), np.inf))
        near = np.sort(order[: min(6, int(moving.sum()))])
    x = sharp_x[index][near]
    position = middle_position(x, without[near], force)
    gradient = np.zeros(m)
    s = (position - rows.origin) / rows.scale
    gradient[first : first + degree] = powers * s ** (powers - 1) / rows.scale
    breaks = np.diff(index[near], prepend=index[near[0]]) > 1
    pass_of = np.cumsum(breaks, dtype=np.int_)
    along = gradient.copy()
    at = index[near[int(np.argmin(np.abs(without[near] - force)))]]
    at = min(max(int(at), 1), len(sharp_x) - 2)
    for j, z in enumerate(relaxing):
        gradient[first + degree + j] = loading_slope(x, v[near], z[index][near], pass_of)
        step = sharp_x[at + 1] - sharp_x[at - 1]
        along[first + degree + j] = (z[at + 1] - z[at - 1]) / step if step else 0.0
    path_doubt = abs(float((along - gradient) @ theta)) / 1.5
    damping = np.zeros(m)
    damping[rows.v_column] = 1.0
    squares = float(np.mean(fit.residual**2))
    bic = n * math.log(max(squares, 1e-300)) + (m + len(times)) * math.log(n)
    curvature = float(coefficients[1:] @ (powers[1:] * (powers[1:] - 1) * s ** (powers[1:] - 2)))
    k = float(gradient @ theta)
    range_doubt = (
        math.hypot(HALF_FORCE * (high - low), 0.3 * rows.peak_spread(without))
        * curvature
        / rows.scale**2
        / (k or 1e-300)
    )
    return Candidate(
        degree,
        times,
        bic,
        k,
        math.hypot(fit.deviation(gradient), range_doubt, path_doubt, FINEST * k),
        float(theta[rows.v_column]),
        fit.deviation(damping),
        math.sqrt(squares),
        position,
        force + constant,
        theta,
    )


def middle_position(x: Floats, f: Floats, force: float) -> float:
    """Return the position at which a parabola through the samples has this force."""
    if np.ptp(f) == 0.0 or len(x) < 4:
        return float(x.mean())
    size = float(np.max(np.abs(f - force)))
    powers = ((f - force) / size)[:, None] ** np.arange(3)
    position = np.linalg.lstsq(powers, x - x.mean(), rcond=1e-8)[0][0] + x.mean()
    return float(np.clip(position, x.min(), x.max()))


def loading_slope(x: Floats, v: Floats, z: Floats, pass_of: NDArray[np.int_]) -> float:
    """Return the slope of z over x within the passes, the part in proportion to v taken out."""
    spread = float(np.std(v) / np.mean(np.abs(v)))
    x, v, z = (values - pass_means(values, pass_of) for values in (x, v, z))
    columns = [x]
    if len(x) > 8 and spread > 0.02:
        columns.append(v)
    return float(np.linalg.lstsq(np.column_stack(columns), z, rcond=1e-6)[0][0])


def pass_means(values: Floats, pass_of: NDArray[np.int_]) -> Floats:
    """Return for each sample the mean over its pass."""
    return np.asarray((np.bincount(pass_of, values) / np.bincount(pass_of))[pass_of])
