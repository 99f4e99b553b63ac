"""Compute stiffness and damping in contact, with intervals that include the choice of the model.

The candidate models are

    f(t) = baseline(t) + P(x) + b v + sum_j c_j z_j,    z_j' = dP/dt - z_j / tau_j

with the force f, the position x, the velocity v and the time constants tau_j.

- P is a polynomial of degree 1 to 5.
- The baseline is a constant. For a palpation of many cycles, it also contains cosines that are
  slower than the palpation.
- z_j are the relaxing parts of the elastic force (quasi-linear viscoelasticity), at most two.
- k is the slope of the elastic force against displacement at half of the force range, in loading.
  The elastic force includes the relaxing parts. For a Kelvin-Voigt body, k is the stiffness of the
  body; in a steady sine, k is the storage stiffness. k does not depend on the zero of position and
  force.
- b is the coefficient of the velocity. Without relaxing parts, b is the loss stiffness k'' divided
  by the angular frequency omega.

Each candidate is fitted to the smoothed samples by linear least squares. The candidates are
weighted by the Bayesian information criterion. A candidate that does not determine k is omitted.
Each candidate gives a normal distribution of k, with the value and the standard deviation of the
candidate (`estimation.robust_error`). With the weights, these distributions form a mixture. The
result is the median of the mixture, and its interval contains 95 % of the mixture. Uncertainty
about the model therefore widens the interval. The interval is not computed from the variance of the
mixture, because one unlikely candidate that is far from the others can make the variance very
large. The distribution of b is computed in the same way.

References
----------
Y. C. Fung, "Biomechanics: mechanical properties of living tissues", 2nd ed., Springer, 1993
(chapter 7, quasi-linear viscoelasticity); D. Turek, D. Fletcher, "Model-averaged
Wald confidence intervals", Computational Statistics & Data Analysis 56(9), 2012.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from estimation.batch_models.relaxation import relaxing_part, value_at_start
from estimation.compiled import Floats
from estimation.estimator import LEVEL_95
from teleop.evaluation.candidate import Candidate, evaluate
from teleop.evaluation.contact_rows import DEGREES, Rows, with_corners
from teleop.evaluation.phases import Phases
from teleop.evaluation.prepared import Prepared
from teleop.evaluation.resampled import measurement_noise

TIMES = 10
"""Number of relaxation time constants that are tried. They are between 4 widths of the smoothing
kernel and `Rows.longest_time`."""
EXPLAINED = 0.9
"""If the model has a baseline, relaxing parts are fitted only if R^2 without them exceeds this
value. A larger misfit is not caused by relaxation, because slow relaxation is in the baseline."""
REFINEMENTS = 3
"""Number of times that the step of log tau is halved in the search around the best time
constant."""
LARGEST_SCORE = 10.0
"""Distance from the mean beyond which a normal distribution is taken as 0 [standard deviations]."""
FRICTION = 0.5
"""Friction is reported if the residual with Coulomb friction is less than this fraction of the
residual of the best candidate."""
SAME_TIME = 1.5
"""Ratio of two time constants below which they are reported as one."""
HALVINGS = 60
"""Number of bisections, with which the result is accurate to rounding errors."""


@dataclass(frozen=True)
class LocalStiffness:
    """Stiffness and damping: median and spread of the mixture of the candidates."""

    k: float
    """Stiffness [N/m]."""
    k_std: float
    """Standard deviation of k [N/m]. The half width of the 95 % interval is 1.96 times this
    value."""
    b: float
    """Damping [N s/m]."""
    b_std: float
    """Standard deviation of b [N s/m]."""
    best: Candidate
    """Candidate with the smallest Bayesian information criterion."""
    kelvin_voigt: Candidate
    """The Kelvin-Voigt model: candidate of degree 1 without relaxing parts."""
    baseline_size: float
    """Peak-to-peak size of the baseline [N]."""
    samples: int
    """Number of nearly independent samples that were fitted."""
    r2: float
    """R^2 of the best candidate, for the force minus its baseline."""
    friction: bool
    """Whether a force of constant size against the motion describes the loss better than b v."""
    frequency: float
    """Frequency at which b is k''/omega [Hz]; NaN if relaxing parts may cause part of the loss."""


def local_stiffness(
    record: Prepared, phases: Phases, baseline: bool = True
) -> LocalStiffness | None:
    """Return stiffness and damping in contact; None if there are too few samples.

    Parameters
    ----------
    record, phases
        The prepared record and its phases.
    baseline
        Whether the baseline may contain cosines.
    """
    rows = Rows(record, phases, baseline)
    found = [evaluate(rows, degree, (), [], []) for degree in DEGREES if rows.allow(degree)]
    if not found:
        return None
    plain = found[0]
    if rows.relaxation and (rows.order == 0 or explained(rows, found) > EXPLAINED):
        found += with_relaxation(rows, rows.normalised(record.raw_x), DEGREES[:3])
        best = min(found, key=lambda one: one.bic)
        if best.degree > 1 and best.times:
            found += with_relaxation(
                rows, rows.polynomial(best.theta[: rows.v_column + 1 + best.degree]), DEGREES[1:4]
            )
    found = [one for one in found if one.k_std < abs(one.k)] or found
    weights = model_weights(found)
    k, k_std = averaged(weights, [(one.k, one.k_std) for one in found])
    b, b_std = averaged(weights, [(one.b, one.b_std) for one in found])
    best = min(found, key=lambda one: one.bic)
    slow = rows.basis[:, 1:] @ best.theta[1 : rows.v_column]
    return LocalStiffness(
        k,
        k_std,
        b,
        b_std,
        best,
        plain,
        float(np.ptp(slow)) if rows.order else 0.0,
        len(rows.f),
        explained(rows, [best]),
        has_friction(rows, best),
        math.nan if rows.relaxation else record.frequency,
    )


def explained(rows: Rows, found: list[Candidate]) -> float:
    """Return the largest coefficient of determination R^2 of the candidates.

    It is the fraction of the variance of the force without its baseline that a candidate explains.
    """
    least = min(one.rms for one in found)
    return 1.0 - least**2 / max(float(np.mean(rows.fits.rest**2)), 1e-300)


def has_friction(rows: Rows, best: Candidate) -> bool:
    """Return whether Coulomb friction describes the loss of energy better than the best candidate.

    For this test, Coulomb friction replaces the damping b v and the relaxing parts of the best
    candidate. The result is True if the residual then becomes less than half as large.
    """
    record = rows.record
    sign = record.smoothed(np.sign(record.v))[rows.rows]
    columns = np.column_stack([sign, *rows.powers[: best.degree]])
    return bool(np.std(rows.fits.fit(columns).residual) < FRICTION * best.rms)


def with_relaxation(rows: Rows, y: Floats, degrees: tuple[int, ...]) -> list[Candidate]:
    """Return the candidates with one and two relaxing parts.

    Parameters
    ----------
    rows
        Samples that are fitted.
    y
        Elastic force from which the relaxing parts are computed [N], shape (n,).
    degrees
        Degrees of the polynomial to try.
    """
    record = rows.record
    y = rows.in_contact(y)
    y = (y - y[0]) / max(float(np.std(y)), 1e-300)
    pieces = [piece - value_at_start(piece) for piece in np.split(y, record.starts[1:])]
    times = np.geomspace(4.0 * record.width, rows.longest_time, TIMES).tolist()
    noise = measurement_noise(y)
    largest = rows.largest_corner * float(np.std(y)) / max(float(np.std(record.raw_x)), 1e-300)
    parts: dict[float, tuple[Floats, Floats]] = {}

    def tried(degree: int, chosen: tuple[float, ...]) -> Candidate:
        for tau in chosen:
            if tau not in parts:
                z = relaxing_part(pieces, record.period, tau)
                smoothed = record.smoothed(z)
                parts[tau] = smoothed, with_corners(z, smoothed, noise, largest)
        relaxing, cornered = (
            list(one) for one in zip(*(parts[tau] for tau in chosen), strict=True)
        )
        return evaluate(rows, degree, chosen, relaxing, cornered)

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
    return [one for one in found if rows.order == 0 or is_passive(one)]


def is_passive(candidate: Candidate) -> bool:
    """Return whether the coefficients of all relaxing parts are zero or positive.

    This is the case for a passive body (generalised Maxwell body). Two relaxing parts with opposite
    signs can describe any change of the force, for example the change at the start of a motion. If
    the model also has a baseline, the stiffness cannot be determined with such parts.
    """
    return bool(np.all(candidate.theta[len(candidate.theta) - len(candidate.times) :] >= 0.0))


def merged(times: tuple[float, ...]) -> tuple[float, ...]:
    """Return the time constants [s], for a report.

    Two time constants that are nearly equal are replaced by their geometric mean.
    """
    if len(times) == 2 and max(times) < SAME_TIME * min(times):
        return (math.sqrt(times[0] * times[1]),)
    return times


def model_weights(found: list[Candidate]) -> Floats:
    """Return the weights of the candidates, shape (m,).

    Candidates with the same degree and the same number of time constants form one model. The weight
    of a model is proportional to exp(-BIC / 2) of its best candidate, so that a model with more
    candidates has no larger weight. The candidates of a model share its weight in proportion to
    their own exp(-BIC / 2). The weights of all candidates sum to 1.
    """
    bics = np.array([one.bic for one in found])
    weights = np.exp(-0.5 * (bics - bics.min()))
    models = [(one.degree, len(one.times)) for one in found]
    for model in set(models):
        member = np.array([one == model for one in models])
        weights[member] *= weights[member].max() / max(float(weights[member].sum()), 1e-300)
    return np.asarray(weights / weights.sum())


def averaged(weights: Floats, values: list[tuple[float, float]]) -> tuple[float, float]:
    """Return median and standard deviation of a mixture of normal distributions.

    The standard deviation is defined as h / 1.96, where 95 % of the mixture is within the distance
    h from the median.

    Parameters
    ----------
    weights
        Weights that sum to 1, shape (m,).
    values
        Means of the m normal distributions with their standard deviations.
    """
    value, std = np.array(values).T
    std = np.maximum(std, 1e-12 * np.max(np.abs(value)) + 1e-300)

    def share(x: float) -> float:
        """Return the fraction of the mixture below x."""
        return float(weights @ ndtr((x - value) / std))

    span = float(np.ptp(value)) + LARGEST_SCORE * float(std.max())
    median = crossing(share, 0.5, float(value.min()) - span, float(value.max()) + span)
    half = crossing(lambda h: share(median + h) - share(median - h), 0.95, 0.0, 2.0 * span)
    return median, half / LEVEL_95


def crossing(function: Callable[[float], float], level: float, low: float, high: float) -> float:
    """Return where an increasing function reaches `level`, by bisection from `low` to `high`."""
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if function(middle) < level:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
