"""Compute stiffness and damping in contact by averaging over several models of the force.

These models are called candidates. Each candidate is

    f(t) = baseline(t) + P(x) + b v + sum_j c_j z_j,    z_j' = dP/dt - z_j / tau_j

with the force f, the position x, the velocity v and the time constants tau_j.

- P is a polynomial. Its degree is one of `DEGREES`.
- The baseline is a constant. For a palpation of many cycles, it also contains cosines that are
  slower than the palpation.
- z_j are the relaxing parts of the force (quasi-linear viscoelasticity). There are at most three.
  Their coefficients c_j are positive. If the record begins in contact, the model also contains the
  decays exp(-t / tau_j) of what arose before.
- k is the slope of the elastic force P(x) + sum_j c_j z_j against the displacement, in loading and
  at half of the force range. For a Kelvin-Voigt body, k is the stiffness of the body. In a steady
  sine, k is the storage stiffness. k does not depend on the zero of position and force.
- b is the coefficient of the velocity. Without relaxing parts, b is the loss stiffness k'' divided
  by the angular frequency omega.

These candidates are extended by a knot of the stiffness, by damping that depends on depth, by the
mass beyond the force sensor, or by friction in the specimen, if this describes the force clearly
better (`teleop.evaluation.batch.extensions`). If a linear body relaxes in a sine, its k and b are
k' and k''/omega (`relaxation_search.linear_with_relaxation`). The slope of the residual near the
position of k widens the interval of k.

Each candidate is fitted to the smoothed samples by linear least squares. The weights of the
candidates are computed from the Bayesian information criterion with the effective number of
samples. Candidates with a knot that are neither clearly better nor clearly worse are averaged with
the others. A candidate is left out if its standard deviation of k is not smaller than k, unless
this is so for all candidates.

Each candidate gives a normal distribution of k: its mean is the k of the candidate, and its
standard deviation is that of `estimation.robust_error`. The weighted sum of these distributions is
a mixture distribution. The result is the median of the mixture, with an interval that contains 95 %
of the mixture. If the candidates differ, the interval is therefore wider. The interval is not
computed from the variance of the mixture, because one unlikely candidate with a very different k
can make this variance very large. b and its interval are computed in the same way.

References
----------
Y. C. Fung, "Biomechanics: mechanical properties of living tissues", 2nd ed., Springer, 1993
(chapter 7, quasi-linear viscoelasticity); S. T. Buckland, K. P. Burnham, N. H. Augustin, "Model
selection: an integral part of inference", Biometrics 53(2), 1997; D. Turek, D. Fletcher,
"Model-averaged Wald confidence intervals", Computational Statistics & Data Analysis 56(9), 2012.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr

from estimation.arrays import Floats
from estimation.autocorrelation import effective_samples
from estimation.batch_models.relaxation import relaxing_part
from estimation.estimator import LEVEL_95
from estimation.robust_error import robust_fit
from estimation.stiffening import Interval
from teleop.evaluation.batch.candidate import (
    DEPTH_DAMPING,
    FRICTION,
    KNOT,
    Candidate,
    Value,
    fit_candidate,
    knot_terms,
    pass_means,
)
from teleop.evaluation.batch.contact_phases import Phases
from teleop.evaluation.batch.extensions import extended
from teleop.evaluation.batch.lag_search import ForceLag, lag_instead_of_relaxation
from teleop.evaluation.batch.regression_rows import DEGREES, RegressionRows
from teleop.evaluation.batch.relaxation_search import linear_with_relaxation, with_relaxation
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.thresholds import (
    BASELINE_PERCENTILES,
    BETTER_BIC,
    FEWEST_FIT_SAMPLES,
    FRICTION_RESIDUAL,
    LARGEST_REST_SHARE,
    LEAST_R2_FOR_RELAXATION,
    LEAST_SPEED_CHANGE,
    LOADING_BAND,
    MISFIT_BANDS,
    MISFIT_NOISE,
    NOISE_MARGIN,
    SAME_TIME_RATIO,
)

LAW_DEGREES, LAW_STEPS = DEGREES[1:4], 3
"""Degrees of an elastic force that relaxes, and largest number of its improvements."""
TIME_ERROR = 0.05
"""Half width of the interval of the logarithm of a time constant besides that of the fit. The
contact point and the elastic law, which are not exact, change it by about 4 %."""
LARGEST_TIME_ERROR = math.log(100.0)
"""Largest half width of the interval of the logarithm of a time constant. It is not determined."""
LARGEST_SCORE = 10.0
"""Distance from the mean beyond which a normal density is taken as 0 [standard deviations]."""


@dataclass(frozen=True)
class LocalStiffness:
    """Stiffness and damping in contact: averages over several fitted models (candidates)."""

    k: float
    """Stiffness [N/m]."""
    k_std: float
    """Standard deviation of k [N/m]: the half width of the 95 % interval, divided by 1.96."""
    b: float
    """Damping [N s/m]."""
    b_std: float
    """Standard deviation of b [N s/m], computed like `k_std`."""
    best: Candidate
    """Candidate with the smallest Bayesian information criterion."""
    kelvin_voigt: Candidate
    """The Kelvin-Voigt model: candidate of degree 1 without relaxing parts."""
    baseline_size: float
    """Range of the baseline of the best candidate between the percentiles
    `BASELINE_PERCENTILES` [N]; 0 if it is a constant."""
    samples: int
    """Number of nearly independent samples that were fitted."""
    r2: float
    """R^2 of the best candidate, for the force minus its baseline."""
    stiffens: bool
    """Whether the stiffness changes notably with depth, in all models that are not clearly worse
    than the best one."""
    friction: bool
    """Whether a force of constant size against the motion describes the loss better than b v."""
    frequency: float
    """Frequency at which b is k''/omega [Hz]; NaN if relaxing parts may cause part of the loss."""
    loading: LoadingTangent | None = None
    """Slope of the measured force in loading, if the damping depends on depth."""
    loss_force: float | None = None
    """Force of friction and damping together [N], if the speed hardly changes, so that they cannot
    be separated; None if the speed changes."""
    times: tuple[Interval, ...] = ()
    """Time constants of the relaxing parts of `best` [s]."""
    lag: ForceLag | None = None
    """Lag of the force that describes it at least as well as the relaxing parts of `best`."""
    curved: Floats | None = None
    """Elastic force of the best candidate that is not proportional to the position, at all samples
    [N]; None if the motion is not a sine in contact throughout."""

    @property
    def is_linear(self) -> bool:
        """Whether no candidate is clearly better than the Kelvin-Voigt model.

        This is also so if the best model is a linear one that relaxes.
        """
        return self.best.is_storage or self.kelvin_voigt.bic < self.best.bic + BETTER_BIC


class LoadingTangent(NamedTuple):
    """The slope of the measured force against the position in loading, with the loss included."""

    slope: Value
    """Slope [N/m]."""
    force: float
    """Force at which it is the slope: the middle of the range of the measured force [N]."""
    position: float
    """Position at which the force has this value in loading [m]."""


def local_stiffness(
    record: SmoothedRecord, phases: Phases, baseline: bool = True, friction: bool = True
) -> LocalStiffness | None:
    """Return stiffness and damping in contact; None if there are too few samples.

    `friction` states whether the candidates may contain friction in the specimen.
    """
    rows = RegressionRows(record, phases, baseline)
    found = [fit_candidate(rows, degree, (), [], []) for degree in DEGREES if rows.allow(degree)]
    if not found:
        return None
    plain = found[0]
    follows = rows.order == 0 or explained(rows, found) > LEAST_R2_FOR_RELAXATION
    if rows.relaxation and follows:
        position = rows.normalised(record.raw_x)
        best = min(found, key=lambda one: one.bic)
        found += with_relaxation(rows, position, DEGREES[:3], best.bic)
        found += with_relaxing_law(rows, found)
    elif follows and phases.free_force is None:
        best = min(found, key=lambda one: one.bic)
        if best is not plain:
            found += linear_with_relaxation(rows, 2.0 * math.pi * record.frequency)
    similar: list[Candidate] = []
    if follows:
        better, similar = extended(rows, found, friction)
        found += better
    found = [one for one in found if one.k_std < abs(one.k)] or found
    best = min(found, key=lambda one: one.bic)
    averaged_over = found + similar
    weights = model_weights(averaged_over)
    k, k_std = averaged(weights, [(one.k, one.k_std) for one in averaged_over])
    b, b_std = averaged(weights, [(one.b, one.b_std) for one in averaged_over])
    lag = lag_instead_of_relaxation(rows, best)
    k_std = math.hypot(k_std, misfit_slope(rows, best), k - lag.k if lag else 0.0)
    b_std = math.hypot(b_std, b - lag.b if lag else 0.0)
    slow = rows.basis[:, 1:] @ best.theta[1 : rows.v_column]
    return LocalStiffness(
        k,
        k_std,
        b,
        b_std,
        best,
        plain,
        float(np.ptp(np.percentile(slow, BASELINE_PERCENTILES))) if rows.order else 0.0,
        len(rows.f),
        explained(rows, [best]),
        all(one.stiffens for one in found if one.bic < best.bic + BETTER_BIC),
        has_friction(rows, best),
        math.nan if rows.relaxation else record.frequency,
        loading_tangent(rows, best) if best.part(DEPTH_DAMPING) else None,
        inseparable_loss(rows, best),
        relaxation_times(rows, best, found),
        lag,
        curved_force(rows, best) if record.sinusoidal and phases.free_force is None else None,
    )


def with_relaxing_law(rows: RegressionRows, found: Sequence[Candidate]) -> list[Candidate]:
    """Return models in which the elastic force P(x) relaxes, and not only the position.

    P(x) must be known for its relaxing parts. It is first that of the best model without
    relaxation, and then that of the best model so far, as long as the fit becomes better. The
    result is empty if a model that was found before leaves only noise.
    """
    noise = NOISE_MARGIN * rows.record.f_noise_smoothed
    laws = [one for one in found if not one.times and one.degree in LAW_DEGREES]
    law = min(laws, key=lambda one: one.bic, default=None)
    new: list[Candidate] = []
    for step in range(LAW_STEPS):
        best = min([*found, *new], key=lambda one: one.bic)
        if step and best.degree > 1:
            law = best
        if law is None or best.rms < noise:
            break
        elastic = rows.polynomial(law.theta[: rows.v_column + 1 + law.degree])
        new += with_relaxation(rows, elastic, LAW_DEGREES, best.bic)
        if step and not any(one.bic < best.bic - BETTER_BIC for one in new):
            break
    return new


def inseparable_loss(rows: RegressionRows, best: Candidate) -> float | None:
    """Return the force of friction and damping together [N]; None if the speed separates them.

    At a constant speed, both are constant forces against the motion. Only the reversals then
    separate them, where the friction builds up, and the form of this is not known.
    """
    speed = np.abs(rows.velocity[rows.index])
    path = max(float(speed.sum()), 1e-300)  # the slow samples of the reversals have little weight
    mean = float(speed @ speed) / path
    spread = math.sqrt(max(float((speed**2) @ speed) / path - mean**2, 0.0))
    at_rest = float(np.mean(speed < 0.1 * mean))
    if spread > LEAST_SPEED_CHANGE * mean or at_rest > LARGEST_REST_SHARE:
        return None
    friction = best.part(FRICTION)
    return (friction.values[0].value if friction else 0.0) + best.b * mean


def curved_force(rows: RegressionRows, best: Candidate) -> Floats:
    """Return the elastic force that is not proportional to the position, smoothed like the force.

    It has the shape (n,), and is 0 for a polynomial of degree 1 without knot.
    """
    s = rows.depth
    force = s[:, None] ** np.arange(2, best.degree + 1) @ best.powers[1:]
    at = len(best.theta) - sum(len(one.columns) for one in best.extensions)
    for one in best.extensions:
        if one.kind == KNOT:
            for i, part in enumerate(knot_terms(s, *one.values).force):
                force = force + best.theta[at + i] * part
        at += len(one.columns)
    return rows.record.smoothed(force)


def loading_tangent(rows: RegressionRows, best: Candidate) -> LoadingTangent | None:
    """Return the slope of the force in loading, at the middle of its range; None if not known.

    If the damping depends on depth, the slope differs from the tangent stiffness k, which is that
    of the elastic force.
    """
    record, index = rows.record, rows.index
    x, v = record.x[index], record.v[index]
    f = rows.f - rows.basis[:, 1:] @ best.theta[1 : rows.v_column]
    middle = 0.5 * float(f.min() + f.max())
    if rows.phases.free_force is not None:
        middle = 0.5 * (rows.phases.free_force + float(f.max()))
    near = (np.abs(f - middle) < LOADING_BAND * np.ptp(f)) & (v > 0.0)
    if near.sum() < FEWEST_FIT_SAMPLES:
        return None
    place = float(np.polyval(np.polyfit(f[near] - middle, x[near], 1), 0.0))
    s = (x[near] - place) / rows.scale
    fit = robust_fit(s[:, None] ** np.arange(4), f[near])
    unit = np.array([0.0, 1.0, 0.0, 0.0])
    deviation = fit.deviation(unit, rows.cycles) / rows.scale
    slope = Value(float(fit.theta[1]) / rows.scale, deviation)
    return LoadingTangent(slope, float(fit.theta[0]), place)


def misfit_slope(rows: RegressionRows, best: Candidate) -> float:
    """Return the error of k that the systematic misfit of the best model can cause [N/m].

    It is the slope of the residual in loading near the position of k, within single passes. The
    part of the slope that noise explains is subtracted.
    """
    record, index = rows.record, rows.index
    step = float(np.median(np.diff(index)))
    x, v = record.x[index], record.v[index]
    found = 0.0
    for band in MISFIT_BANDS:
        near = np.flatnonzero((np.abs(x - best.position) < band * rows.scale) & (v > 0.0))
        breaks = np.diff(index[near], prepend=index[near[:1]]) > 1.5 * step
        passes = np.cumsum(breaks, dtype=np.int_)
        if len(near) < FEWEST_FIT_SAMPLES + (passes[-1] + 1 if len(near) else 0):
            continue
        places, residual = (
            values[near] - pass_means(values[near], passes) for values in (x, best.residual)
        )
        fit = robust_fit(places[:, None], residual)
        noise = fit.deviation(np.ones(1), rows.cycles)
        found = max(found, fit.theta[0] ** 2 - MISFIT_NOISE * noise**2)
    return math.sqrt(found)


def explained(rows: RegressionRows, found: list[Candidate]) -> float:
    """Return the coefficient of determination R^2 of the fitted model with the smallest residual.

    R^2 is 1 minus the mean square of the residual, divided by that of the force. The baseline (slow
    part of the force) is subtracted from this force.
    """
    least = min(one.rms for one in found)
    return 1.0 - least**2 / max(float(np.mean(rows.fits.rest**2)), 1e-300)


def has_friction(rows: RegressionRows, best: Candidate) -> bool:
    """Return whether Coulomb friction describes the loss of energy better than viscous damping.

    For this test, the damping b v and the relaxing parts of the best model (`best`) are replaced by
    a friction force proportional to sign(v), and this model is fitted. The result is True if the
    residual is less than `FRICTION_RESIDUAL` times that of the best model.
    """
    record = rows.record
    sign = record.smoothed(np.sign(record.v))[rows.index]
    columns = np.column_stack([sign, *rows.powers[: best.degree]])
    return bool(np.std(rows.fits.fit(columns).residual) < FRICTION_RESIDUAL * best.rms)


def relaxation_times(
    rows: RegressionRows, best: Candidate, others: Sequence[Candidate]
) -> tuple[Interval, ...]:
    """Return the time constants of the relaxing parts of a model [s] with their 95 % intervals.

    The intervals contain the time constants of the other models with as many relaxing parts that
    are not clearly worse. The derivatives of the relaxing parts z to the logarithms of the time
    constants are further regressors. The derivative w of z to a time constant tau satisfies
    w' = z / tau^2 - w / tau.
    """
    if not best.times or best.is_storage:
        return ()
    record = rows.record
    coefficients = best.theta[len(best.theta) - best.extended - len(best.relaxing) :]
    derivatives = []
    for i, (tau, z) in enumerate(zip(best.times, best.relaxing, strict=False)):
        pieces = [np.cumsum(piece) for piece in np.split(z / tau, record.starts[1:])]
        pieces = [record.period * (piece - piece[0]) for piece in pieces]
        change = coefficients[i] * relaxing_part(pieces, record.period, tau)
        if len(best.relaxing) > len(best.times):  # what arose before the record decays
            decay = best.relaxing[len(best.times) + i]
            change = change + coefficients[len(best.times) + i] * decay * record.clock / tau
        derivatives.append(change[rows.index])
    extensions = [column for one in best.extensions for column in one.columns]
    fit = rows.fit(best.degree, best.relaxing, [*extensions, *derivatives])
    units = np.eye(len(fit.theta))[-len(derivatives) :]
    errors = [LEVEL_95 * fit.deviation(unit, rows.cycles) for unit in units]
    similar = [
        one.times
        for one in others
        if len(one.times) == len(best.times) and one.bic < best.bic + BETTER_BIC
    ]
    apart = np.abs(np.log(np.array(similar) / best.times)).max(axis=0)
    return time_intervals(best.times, np.hypot(np.hypot(errors, apart), TIME_ERROR).tolist())


def time_intervals(times: Sequence[float], errors: Sequence[float]) -> tuple[Interval, ...]:
    """Return time constants [s] with their 95 % intervals, from the errors of their logarithms.

    If there are two whose ratio is below `SAME_TIME_RATIO`, the result is their geometric mean.
    """
    found = sorted(zip(times, errors, strict=True))
    if len(found) == 2 and found[1][0] < SAME_TIME_RATIO * found[0][0]:
        (short, first), (long, second) = found
        found = [(math.sqrt(short * long), 0.5 * math.log(long / short) + max(first, second))]
    factors = [math.exp(min(error, LARGEST_TIME_ERROR)) for _, error in found]
    return tuple(
        Interval(tau, tau / factor, tau * factor)
        for (tau, _), factor in zip(found, factors, strict=True)
    )


def model_weights(found: list[Candidate]) -> Floats:
    """Return the weights with which m candidates (fitted models) are averaged, shape (m,).

    Candidates form a group if they differ only in the values of their time constants. The weight of
    a group is proportional to the largest exp(-BIC / 2) in the group. Therefore, it does not
    increase with the number of candidates in the group. Within the group, the weight is divided in
    proportion to exp(-BIC / 2) of each candidate. All weights sum to 1.
    """
    best = min(found, key=lambda one: one.bic)
    n = effective_samples(best.residual)
    bics = np.array(
        [2.0 * n * math.log(max(one.rms, 1e-150)) + one.parameters * math.log(n) for one in found]
    )
    weights = np.exp(-0.5 * (bics - bics.min()))
    models = [
        (one.degree, len(one.times), *(part.kind for part in one.extensions)) for one in found
    ]
    for model in set(models):
        member = np.array([one == model for one in models])
        weights[member] *= weights[member].max() / max(float(weights[member].sum()), 1e-300)
    return np.asarray(weights / weights.sum())


def averaged(weights: Floats, values: list[tuple[float, float]]) -> tuple[float, float]:
    """Return the median and the spread of a mixture (weighted sum) of m normal distributions.

    The spread is h / 1.96, where 95 % of the mixture is within the distance h from the median. For
    a single normal distribution, the spread is the standard deviation.
    """
    value, std = np.array(values).T
    std = np.maximum(std, 1e-12 * np.max(np.abs(value)) + 1e-300)

    def share(x: float) -> float:
        """Return the cumulative distribution function of the mixture at x."""
        return float(weights @ ndtr((x - value) / std))

    span = float(np.ptp(value)) + LARGEST_SCORE * float(std.max())
    # No absolute tolerance, because b can have any size, and be 0.
    exact = {"xtol": 1e-300, "rtol": 4.0 * np.finfo(float).eps}
    low, high = float(value.min()) - span, float(value.max()) + span
    median = float(brentq(lambda x: share(x) - 0.5, low, high, **exact))
    half = brentq(lambda h: share(median + h) - share(median - h) - 0.95, 0.0, 2.0 * span, **exact)
    return median, float(half) / LEVEL_95
