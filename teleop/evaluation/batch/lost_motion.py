"""Find lost motion between the position sensor and the tip in a record of tissue.

After each reversal, lost motion (play, or friction in an elastic transmission) keeps the force
behind the position by a distance that does not depend on the speed. A model of the body alone
describes this by damping, which is often negative, or by relaxation.

The force is fitted with the position x, and with the position behind a hysteresis of half width d.
The hysteresis is a play operator, or two play operators with equal weights, for friction whose
force builds up gradually. If d is given, all models are linear, so that the sum of squares is
computed as a function of d alone (variable projection).

The evidence must be strong, because a body that no model describes exactly is often fitted a little
better with a hysteresis. The number of samples in the information criterion is therefore the number
of independent values in the residual (`independent_values`): a misfit that is the same in all
cycles counts as one cycle. In addition, the hysteresis must predict each half of the record better,
with parameters that are fitted to the other half (mean of both).

References
----------
G. H. Golub, V. Pereyra, "The differentiation of pseudo-inverses and nonlinear least squares
problems whose variables separate", SIAM J. Numer. Anal. 10(2), 1973; M. Brokate, J. Sprekels,
"Hysteresis and Phase Transitions", Springer, 1996; C. R. Rao, "Large sample tests of statistical
hypotheses concerning several parameters", Math. Proc. Cambridge Phil. Soc. 44(1), 1948 (score
test); A. E. Raftery, "Bayesian model selection in social research", Sociological Methodology 25,
1995.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.batch_models.relaxation import relaxing_part
from estimation.estimator import LEVEL_95
from estimation.smoothing import extended, slope_kernel, smoothing_kernel
from estimation.stiffening import Interval
from teleop.evaluation.batch.candidate import Candidate
from teleop.evaluation.batch.contact_phases import Phases
from teleop.evaluation.batch.friction import friction_forces
from teleop.evaluation.batch.regression_rows import RegressionRows
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.thresholds import (
    FEWEST_LOST_MOTION_SAMPLES,
    LEAST_LOST_MOTION,
    LEAST_LOST_MOTION_COUNTS,
    LEAST_LOST_MOTION_SHARE,
    LONGEST_SLIP,
    LOST_MOTION_BIC,
    LOST_MOTION_LAG_ERROR,
    LOST_MOTION_PREDICTION,
    LOST_MOTION_RESIDUAL,
    NOISE_MARGIN,
    WIDEST_LOST_MOTION,
)

SHAPES: dict[str, tuple[float, ...]] = {"play": (1.0,), "gradual": (0.423, 1.577)}
"""Half widths of the play operators in each shape of hysteresis, divided by d. Those of `gradual`
are the nodes of the Gauss-Legendre quadrature for half widths between 0 and 2 d."""
WIDTHS, REFINED = 12, 8
"""Number of half widths d that are tried over the whole range, and around the best of them."""
DEGREES, DAMPINGS = 5, 3
"""Largest degree of the polynomial P(x) in the models, and largest number of damping terms."""
TIMES = 4
"""Number of relaxing parts in the models that contain relaxation."""
LEAST_SLIP, SLIP_RATIOS = 0.002, (1.7, 1.15, 1.03)
"""Least slip of friction in the specimen, as a fraction of the amplitude, and largest ratios of the
refined slips to the best one."""
NEWTON_STEPS = 3
"""Number of steps that improve the half width of the best model."""
SPECTRAL_MEAN = 10
"""Half width of the mean over the values of a periodogram."""
CHI_SQUARE_95 = 3.841
"""Quantile of the chi-square distribution with one degree of freedom."""


class LostMotion(NamedTuple):
    """Lost motion that was found in a record."""

    half_width: float
    """Half width d of the hysteresis [m]."""
    error: float
    """Half width of the 95 % interval of d [m]."""
    shape: str
    """Shape of the hysteresis, one of `SHAPES`."""
    amplitude: float
    """Half of the travel of the measured position in contact [m]."""
    is_confirmed: bool = True
    """Whether each half of the record is predicted better with it, from the other half."""

    @property
    def interval(self) -> Interval:
        """Half width d with its 95 % interval [m]."""
        return Interval(self.half_width, self.half_width - self.error, self.half_width + self.error)

    def tip(self, x: Floats) -> Floats:
        """Return the position behind the lost motion [m], for a measured position x, shape (n,)."""
        widths = self.half_width * np.array(SHAPES[self.shape])
        return np.asarray(played(x, widths).mean(axis=0))


class Model(NamedTuple):
    """The terms of a linear model of the force."""

    degree: int
    """Degree of the polynomial P(x)."""
    dampings: int
    """Number of damping terms: 1 for b v, more for damping that depends on the position."""
    relaxes: bool
    """Whether the model has relaxing parts. They are needed for a sine too: behind lost motion, the
    motion of the tip contains further frequencies."""


class HysteresisFit(NamedTuple):
    """A model that was fitted to the force, with the position behind a hysteresis."""

    half_width: float
    """Half width d of the hysteresis [m]; 0 without a hysteresis."""
    shape: str
    """One of `SHAPES`, or "friction" for friction inside the specimen; empty without hysteresis."""
    model: Model
    parameters: int
    """Number of fitted parameters, including d."""
    residual: Floats

    def criterion(self, n: float) -> float:
        """Bayesian information criterion for n independent values of the residual."""
        squares = max(float(self.residual @ self.residual), 1e-300)
        return n * math.log(squares) + self.parameters * math.log(n)


def find_lost_motion(
    record: SmoothedRecord, phases: Phases, rigid_best: Candidate
) -> LostMotion | None:
    """Return the lost motion in a record; None if there is no strong evidence for any.

    It is not confirmed if only the prediction of each half from the other is not clearly better:
    with much noise, a large lost motion does not predict better either. `rigid_best` is the best
    model of the force without lost motion.
    """
    rows = RegressionRows(record, phases)
    least = max(
        LEAST_LOST_MOTION_COUNTS * record.count,
        LEAST_LOST_MOTION,
        LEAST_LOST_MOTION_SHARE * rows.scale,
    )
    widest = WIDEST_LOST_MOTION * rows.scale
    if len(rows.index) < FEWEST_LOST_MOTION_SAMPLES or widest < 2.0 * least:
        return None
    regressors = Regressors(rows)
    plain = regressors.fits(record.raw_x[None], np.zeros(1), "")
    # a hysteresis cannot be clearly better than a model that leaves only noise, except by replacing
    # several of its parameters: many powers of the position can also describe lost motion
    fewest = min(one.parameters for one in plain) + 1
    most = fewest + LOST_MOTION_BIC / math.log(len(rows.index))
    sufficient = [
        one for one in plain if one.parameters < most and beyond_noise(one, record) == 0.0
    ]
    if sufficient and regressors.score(sufficient[0]) < LOST_MOTION_BIC:
        return None
    found = []
    for shape, parts in SHAPES.items():
        coarse = np.geomspace(least, widest / max(parts), WIDTHS)
        tried = regressors.tried(shape, coarse)
        near = min(tried, key=lambda one: one.criterion(len(rows.index))).half_width
        ratio = float(coarse[1] / coarse[0])
        ends = max(near / ratio, coarse[0]), min(near * ratio, coarse[-1])
        found += tried + regressors.tried(shape, np.geomspace(*ends, REFINED))
    n = independent_values(min(found, key=lambda one: one.criterion(len(rows.index))).residual)
    best = min(found, key=lambda one: one.criterion(n))
    rigid = min(plain, key=lambda one: one.criterion(n))
    searched = HysteresisFit(0.0, "", rigid.model, rigid_best.parameters, rigid_best.residual)
    if min(one.criterion(n) for one in (rigid, searched)) - best.criterion(n) < LOST_MOTION_BIC:
        return None
    longest = LONGEST_SLIP * rows.scale
    rubbing = regressors.with_friction(np.geomspace(LEAST_SLIP * rows.scale, longest, WIDTHS))
    if rubbing:
        for ratio in SLIP_RATIOS:
            near = min(rubbing, key=lambda one: one.criterion(n)).half_width
            rubbing += regressors.with_friction(
                np.geomspace(near / ratio, min(near * ratio, longest), REFINED)
            )
        friction = min(rubbing, key=lambda one: one.criterion(n))
        if friction.criterion(n) - best.criterion(n) < LOST_MOTION_BIC:
            return None
    if beyond_noise(best, record) > LOST_MOTION_RESIDUAL * beyond_noise(rigid, record):
        return None
    half_width, error = minimum(profile(found, best, n))
    half_width, error = regressors.refined(best, half_width, min(error, 0.1 * half_width))
    # rounding is a hysteresis of half a step, and noise moves the extremes of the position
    resolution = math.hypot(0.5 * record.count, LEVEL_95 * record.x_noise)
    form = 0.0 if record.force_lag else LOST_MOTION_LAG_ERROR * half_width
    models = LEVEL_95 * other_models(found, best, half_width, n)
    error = math.hypot(error, models, resolution, form)
    if half_width - error <= 0.0 or half_width < least:
        return None
    chosen = LostMotion(half_width, error, best.shape, rows.scale)
    gain = regressors.prediction_error(record.raw_x, rigid.model) - regressors.prediction_error(
        chosen.tip(record.raw_x), best.model
    )
    fitted_gain = math.log(np.std(rigid.residual) / max(float(np.std(best.residual)), 1e-300))
    return chosen._replace(is_confirmed=gain > min(LOST_MOTION_PREDICTION, 0.5 * fitted_gain))


def beyond_noise(fit: HysteresisFit, record: SmoothedRecord) -> float:
    """Root mean square of the residual that the noise of the force does not explain [N]."""
    noise = NOISE_MARGIN * record.f_noise_smoothed
    return math.sqrt(max(float(np.var(fit.residual)) - noise**2, 0.0))


class Regressors:
    """Fits the linear models to the rows of a record, for any signals in place of the position."""

    def __init__(self, rows: RegressionRows) -> None:
        self._rows, self._record = rows, rows.record
        self._times = np.geomspace(4.0 * self._record.width, rows.longest_time, TIMES + 1)[:-1]
        basis = rows.basis
        if not rows.order:  # what relaxes from the time before the record
            since = self._record.clock[rows.index][:, None]
            basis = np.column_stack([basis, np.exp(-since / self._times)])
        self._basis, _ = np.linalg.qr(basis)
        self._force = rows.f - self._basis @ (self._basis.T @ rows.f)
        self._models = [
            Model(*terms) for terms in product((1, 2, 3, DEGREES), (1, DAMPINGS), (False, True))
        ]

    def tried(self, shape: str, half_widths: Floats) -> list[HysteresisFit]:
        """Fit all models with each of these half widths of the hysteresis."""
        parts = np.outer(half_widths, SHAPES[shape])
        outputs = self._played(parts.ravel()).reshape(*parts.shape, -1)
        return self.fits(outputs.mean(axis=1), half_widths, shape)

    def fits(self, x: Floats, half_widths: Floats, shape: str) -> list[HysteresisFit]:
        """Fit all models with each of m signals in place of the position, shape (m, n)."""
        return [
            fit
            for half_width, columns in zip(half_widths.tolist(), self._columns(x), strict=True)
            for fit, _ in self._fits(columns, half_width, shape)
        ]

    def score(self, fit: HysteresisFit) -> float:
        """Return the score statistic of a small lost motion in the residual of a model without it.

        Lost motion shifts the position in the direction of the last motion. Without lost motion,
        the statistic has the chi-square distribution with one degree of freedom (Rao).
        """
        shift = self._rows.shifts[:, 1] - self._basis @ (self._basis.T @ self._rows.shifts[:, 1])
        columns = self._columns(self._record.raw_x[None])[0][:, self._used(fit.model)]
        columns, _ = np.linalg.qr(columns)
        shift = shift - columns @ (columns.T @ shift)
        along = float(shift @ fit.residual) ** 2
        return along / max(float(np.var(fit.residual) * (shift @ shift)), 1e-300)

    def refined(self, best: HysteresisFit, half_width: float, step: float) -> tuple[float, float]:
        """Return the half width of the best model, and the half width of its 95 % interval.

        The half width is improved by Gauss-Newton steps. The noise is stationary, with any
        spectrum: only its power at the frequencies of the derivative changes the half width.
        """
        error = step
        for _ in range(NEWTON_STEPS):
            at = np.array([half_width - step, half_width, half_width + step])
            below, residual, above = (
                one.residual for one in self.tried(best.shape, at) if one.model == best.model
            )
            slope = (above - below) / (2.0 * step)
            squares = max(float(slope @ slope), 1e-300)
            error = LEVEL_95 * math.sqrt(noise_along(residual, slope)) / squares
            change = -float(slope @ residual) / squares
            half_width += float(np.clip(change, -2.0 * step, 2.0 * step))
            step = float(np.clip(error, 1e-3 * half_width, 0.1 * half_width))
        return half_width, error

    def with_friction(self, slips: Floats) -> list[HysteresisFit]:
        """Fit all models with friction inside the specimen, beside its elastic force.

        It has the opposite effect of lost motion.
        """
        width = self._record.width / self._record.period
        forces = self._at_rows(friction_forces(self._record, slips), smoothing_kernel(width))
        forces = forces - (forces @ self._basis) @ self._basis.T
        common = self._columns(self._record.raw_x[None])[0]
        return [
            fit
            for slip, force in zip(slips.tolist(), forces, strict=True)
            for fit, friction in self._fits(common, slip, "friction", force)
            if friction > 0.0
        ]

    def _fits(
        self, columns: Floats, half_width: float, shape: str, last: Floats | None = None
    ) -> Iterator[tuple[HysteresisFit, float]]:
        """Fit all models to their columns and to the column `last`; its coefficient is the second.

        The coefficient has no meaning without this column.
        """
        if last is not None:
            columns = np.column_stack([columns, last])
        gram, along = columns.T @ columns, columns.T @ self._force
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        gram, along = gram / np.outer(size, size), along / size
        for model in self._models:
            used = np.array(self._used(model) + ([] if last is None else [columns.shape[1] - 1]))
            theta = np.linalg.lstsq(gram[used[:, None], used], along[used], rcond=1e-12)[0]
            residual = self._force - columns[:, used] @ (theta / size[used])
            count = len(used) + self._basis.shape[1] + (half_width > 0.0)
            yield HysteresisFit(half_width, shape, model, count, residual), float(theta[-1])

    def prediction_error(self, x: Floats, model: Model) -> float:
        """Return the logarithm of the error with which each half predicts the other half.

        The baseline is removed from the whole record before, because it cannot be extrapolated.
        """
        columns, f = self._columns(x[None])[0][:, self._used(model)], self._force
        columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        first = np.arange(len(f)) < len(f) // 2
        errors = []
        for fitted in (first, ~first):
            theta = np.linalg.lstsq(columns[fitted], f[fitted], rcond=1e-10)[0]
            errors.append(float(np.std(f[~fitted] - columns[~fitted] @ theta)))
        return 0.5 * sum(math.log(max(error, 1e-300)) for error in errors)

    def _played(self, half_widths: Floats) -> Floats:
        pieces = self._split(self._record.raw_x)
        return np.concatenate([played(piece, half_widths) for piece in pieces], axis=1)

    def _used(self, model: Model) -> list[int]:
        used = [*range(model.degree), *range(DEGREES, DEGREES + model.dampings)]
        first = DEGREES + DAMPINGS
        return [*used, *range(first, first + TIMES)] if model.relaxes else used

    def _columns(self, x: Floats) -> Floats:
        """Regressors without baseline at the r rows, for m signals x; shape (m, r, columns).

        They are powers of the position, damping terms, and relaxing parts.
        """
        rows, record = self._rows, self._record
        width = record.width / record.period
        gaussian, derivative = smoothing_kernel(width), slope_kernel(width, record.period)
        s = rows.normalised(x)
        clipped = np.clip(s, -1.5, 1.5)
        powers = [self._at_rows(clipped**degree, gaussian) for degree in range(1, DEGREES + 1)]
        v = self._at_rows(s, derivative)
        y = np.array([rows.in_contact(one) for one in x])
        relaxing = self._relaxing((y - y[:, :1]) / rows.scale)
        columns = [*powers, v, *(power * v for power in powers[: DAMPINGS - 1])]
        columns += [self._at_rows(one, gaussian) for one in relaxing]
        stacked = np.stack(columns, axis=-1)
        return np.asarray(stacked - self._basis @ (self._basis.T @ stacked))

    def _relaxing(self, y: Floats) -> Floats:
        """Relaxing parts of m signals of shape (m, n), for each time constant: (times, m, n)."""
        pieces = [piece - piece[:, :1] for piece in self._split(y)]
        return np.array([relaxing_part(pieces, self._record.period, tau) for tau in self._times])

    def _at_rows(self, values: Floats, kernel: Floats) -> Floats:
        """Convolve each piece of m signals with a kernel; return the values at the rows, (m, r)."""
        half = len(kernel) // 2
        padded = np.concatenate([extended(piece, half) for piece in self._split(values)], axis=1)
        index = self._rows.index
        first = index + 2 * half * (np.searchsorted(self._record.starts, index, side="right") - 1)
        return np.asarray(sum(w * padded[:, first + i] for i, w in enumerate(kernel[::-1])))

    def _split(self, values: Floats) -> list[Floats]:
        return np.split(values, self._record.starts[1:], axis=-1)


def played(x: Floats, half_widths: Floats) -> Floats:
    """Return the outputs of m play operators for one input, shape (m, n)."""
    low, high = x[:, None] - half_widths, x[:, None] + half_widths
    out = np.empty_like(low)
    y = np.full(len(half_widths), x[0])
    for at_least, at_most, now in zip(low, high, out, strict=True):
        y = np.minimum(np.maximum(y, at_least, out=now), at_most, out=now)
    return out.T


def independent_values(residual: Floats) -> float:
    """Return the number of independent values among n values of a residual.

    It is n divided by the sum of the squared autocorrelation over all lags (Bartlett's formula for
    the correlation of two signals), without the part that white noise causes in this sum.
    """
    n = len(residual)
    spectrum = np.abs(np.fft.rfft(residual, 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[: n // 2]
    correlation = correlation / max(float(correlation[0]), 1e-300)
    return n / max(1.0, 1.0 + 2.0 * float(np.sum(correlation[1:] ** 2 - 1.0 / n)))


def noise_along(residual: Floats, slope: Floats) -> float:
    """Return the variance of the product of stationary noise with a vector.

    The spectrum of the noise is the smoothed periodogram of the residual.
    """
    n = len(residual)
    power = np.abs(np.fft.fft(residual)) ** 2 / n
    width = min(2 * SPECTRAL_MEAN + 1, n)
    around = np.concatenate([power[-(width // 2) :], power, power[: width // 2]])
    power = np.convolve(around, np.ones(width) / width, "valid")[:n]
    return float(np.abs(np.fft.fft(slope)) ** 2 @ power) / n


def profile(found: list[HysteresisFit], like: HysteresisFit, n: float) -> dict[float, float]:
    """Return the deviance n log(sum of squares) by the half width, for one shape and model.

    A half width that was tried twice, apart from rounding, is contained once.
    """
    return {
        float(f"{one.half_width:.9g}"): n
        * math.log(max(float(one.residual @ one.residual), 1e-300))
        for one in found
        if (one.shape, one.model) == (like.shape, like.model)
    }


def other_models(
    found: list[HysteresisFit], best: HysteresisFit, half_width: float, n: float
) -> float:
    """Return the standard deviation of d between the models [m], with their probabilities.

    A model has the probability that its Bayesian information criterion gives (Raftery).
    """
    weights, squares = 1.0, 0.0
    for kind in {(one.shape, one.model) for one in found}:
        one = min(
            (fit for fit in found if (fit.shape, fit.model) == kind),
            key=lambda fit: fit.criterion(n),
        )
        if kind == (best.shape, best.model):
            continue
        weight = math.exp(-0.5 * max(one.criterion(n) - best.criterion(n), 0.0))
        weights += weight
        squares += weight * (minimum(profile(found, one, n))[0] - half_width) ** 2
    return math.sqrt(squares / weights)


def minimum(deviances: dict[float, float]) -> tuple[float, float]:
    """Return the half width with the smallest deviance, and the half width of its 95 % interval.

    `deviances` contains n log(sum of squares) by the half width. It is interpolated by
    a parabola through the smallest value and its neighbours.
    """
    half_widths, deviance = np.array(sorted(deviances.items())).T
    at = int(np.clip(np.argmin(deviance), 1, len(deviance) - 2))
    near = slice(at - 1, at + 2)
    centre = half_widths[at]
    curvature, gradient, _ = np.polyfit(half_widths[near] - centre, deviance[near], 2)
    if curvature <= 0.0:
        return float(half_widths[at]), math.inf
    shift = float(np.clip(-0.5 * gradient / curvature, *(half_widths[near][[0, 2]] - centre)))
    return float(centre + shift), math.sqrt(CHI_SQUARE_95 / curvature)
