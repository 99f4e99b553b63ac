"""Select the samples to which contact models are fitted, and compute the regressors of the models.

The models are f = baseline + P(x) + b v + relaxing parts
(`teleop.evaluation.batch.local_stiffness`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.baseline import baseline_regressors
from estimation.baseline_fit import BaselineFits
from estimation.robust_error import RobustFit
from teleop.evaluation.batch.contact_phases import Phases
from teleop.evaluation.batch.masks import runs
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.thresholds import (
    LEAST_SPEED_NOISE,
    LEAVING_SPEED,
    SHARP_CORNER_NOISE,
    SPARE_SAMPLES,
    STEADY_FREE_FORCE,
)


def digital_values(values: Floats, count: float) -> NDArray[np.intp] | None:
    """Return the level (digital value) of each measured value, as a number from 0, shape (n,).

    Values have the same level if they are equal after rounding to multiples of `count`, the
    resolution. If `count` is 0, the values are not rounded, and the result is None.
    """
    if count == 0.0:
        return None
    return np.unique(np.round(values / count), return_inverse=True)[1]


def summed_by_level(sensitivity: Floats, level: NDArray[np.intp] | None) -> Floats:
    """Return the sensitivity of fitted parameters to the rounding of measured values.

    The result, multiplied by the standard deviation of the rounding error, is the standard
    deviation of each of m parameters. `sensitivity` is the derivative of the parameters to n
    values, shape (m, n). All samples with the same rounded value have the same rounding
    error. Their derivatives are therefore added. This gives one sum for each rounded value. The
    errors of different rounded values are independent. The result is therefore the root of the sum
    of the squares of these sums.
    """
    if level is None:
        return np.zeros(len(sensitivity))
    sums = np.array([np.bincount(level, row) for row in sensitivity])
    return np.asarray(np.sqrt(np.sum(sums**2, axis=1)))


DEGREES = (1, 2, 3, 4, 5)
"""Degrees of the polynomial P(x) of the candidate models."""
MOST_ROWS = 20_000
"""Approximate largest number of samples in a fit. The samples are evenly spaced.

This number limits memory and computing time for a record of more than about ten minutes. The
intervals of such a record are narrow, even with this number of samples.
"""


class RegressionRows:
    """The samples that are fitted, and the regressors of the contact models at these samples.

    Each model is f = baseline + P(x) + b v + relaxing parts. The baseline is the slow part of the
    force. P(x) is a polynomial in the position, and v is `velocity`. The relaxing parts decay with
    time constants. Each sample is a row of the regression matrix.

    With `baseline`, the baseline may contain slow cosines besides a constant. If the force out of
    contact is steady, it is always a constant.
    """

    def __init__(self, record: SmoothedRecord, phases: Phases, baseline: bool = True) -> None:
        self.record, self.phases = record, phases
        rows = []
        count = int(phases.usable.sum()) // record.stride
        stride = record.stride * max(1, math.ceil(count / MOST_ROWS))
        for start, end in runs(phases.usable):
            offset = ((end - start - 1) % stride) // 2
            rows.append(np.arange(start + offset, end, stride))
        self.index: NDArray[np.intp] = np.concatenate(rows) if rows else np.zeros(0, dtype=np.intp)
        level = phases.free_force is not None and phases.free_spread < STEADY_FREE_FORCE * np.ptp(
            record.f
        )
        self.order = record.order if baseline and not level else 0
        x = record.x[self.index] if len(self.index) else np.zeros(1)
        self.origin = 0.5 * float(x.min() + x.max())
        self.scale = max(0.5 * float(np.ptp(x)), 1e-12)
        seconds = float(record.clock[-1])
        self.basis = baseline_regressors(record.clock[self.index], 0.0, seconds, self.order)
        self.f = record.f[self.index]
        depth = np.clip(self.normalised(record.raw_x), -1.5, 1.5)
        self.depth = depth
        self.powers = [record.smoothed(depth**n)[self.index] for n in DEGREES]
        self.largest_corner = largest_corner(record)
        self.sharp_x = sharp_position(record)
        self.sharp_v = record.sharpened(record.v)
        self.fine = np.flatnonzero(phases.inner if phases.usable.any() else phases.usable)
        self.fine_x, self.fine_v = self.sharp_x[self.fine], self.sharp_v[self.fine]
        self.fine_powers = self.normalised(self.fine_x)[:, None] ** np.arange(1, DEGREES[-1] + 1)

    def normalised(self, x: Floats) -> Floats:
        """Return positions x [m], scaled such that the fitted samples are between -1 and 1."""
        return (x - self.origin) / self.scale

    def polynomial(self, theta: Floats) -> Floats:
        """Return the polynomial P(x) of a fitted model at each measured position [N]."""
        first = self.v_column + 1
        degree = len(theta) - first
        return np.asarray(
            self.normalised(self.record.raw_x)[:, None] ** np.arange(1, degree + 1) @ theta[first:]
        )

    def in_contact(self, y: Floats) -> Floats:
        """Return a signal with a constant value out of contact: its value at the contact point.

        If there is no contact point, the signal is returned unchanged.
        """
        point = self.phases.contact_point
        if point is None:
            return y
        near = int(np.argmin(np.abs(self.record.raw_x - point.value)))
        return np.where(self.record.raw_x < point.value, y[near], y)

    def allow(self, terms: int) -> bool:
        """Return whether there are enough samples for a model whose elastic force has `terms`."""
        return len(self.f) >= self.v_column + 1 + terms + SPARE_SAMPLES

    @property
    def cycles(self) -> float:
        """Number of cycles of the motion; infinite for a motion of fewer than three cycles."""
        record = self.record
        return record.frequency * float(record.clock[-1]) if record.order else math.inf

    @property
    def relaxation(self) -> bool:
        """Whether the models may contain relaxing parts: forces that decay with time constants.

        The result is False if the motion is a sine and one of two conditions holds: the baseline of
        the force contains cosines, or the whole record is in contact. In a steady sine, b v + k x
        describes any linear body without relaxing parts. Then k is the storage stiffness k', and b
        is the loss stiffness k'' divided by the angular frequency omega.
        """
        constant = self.order == 0 and self.phases.free_force is not None
        return constant or not self.record.sinusoidal

    @property
    def compliance(self) -> float:
        """Compliance whose velocity does not cause damping [m/N] (`velocity`)."""
        return self.record.compliance if self.relaxation else 0.0

    @cached_property
    def velocity(self) -> Floats:
        """Velocity to which the damping is proportional [m/s], shape (n,).

        Behind a compliance c, it is that of the tip, x' - c f'. A Kelvin-Voigt body behind a
        compliance is a relaxing body, f = k x + b v / (1 - c k), with this velocity v, and k and b
        of both in series. With the velocity of the encoder, k would increase with the frequency of
        the motion. In a steady sine (`relaxation` is False), k and b are those at its frequency.
        """
        record = self.record
        return np.asarray(record.v - self.compliance * record.derivative(record.f))

    @property
    def longest_time(self) -> float:
        """Longest time constant tau that is tried for the relaxation of the force [s].

        If the baseline contains cosines, it describes a slower relaxation.
        """
        seconds = float(self.record.clock[-1])
        return seconds / (math.pi * self.order) if self.order else 2.0 * seconds

    @cached_property
    def scaled_powers(self) -> Floats:
        """Powers 0, 1, 2, ... of the normalised position at the n fitted samples, shape (n, m).

        m is the largest degree in `DEGREES`. These powers are used for the derivative of P(x).
        """
        depth = np.clip(self.normalised(self.record.x[self.index]), -1.5, 1.5)
        return np.asarray(depth[:, None] ** np.arange(DEGREES[-1]))

    def rounding_error(self, to_force: Floats, slopes: Floats) -> Floats:
        """Return standard deviations of parameters due to the resolution of position and force.

        All samples at which a sensor has the same digital value have the same rounding error, for
        example all samples of a hold. An average over these samples does not reduce the error.
        `to_force` is the derivative of m parameters to the measured force, shape (m, n), and
        `slopes` that of the force to the position [N/m], shape (n,).
        """
        record = self.record
        x_level, f_level = self.levels
        position = summed_by_level(to_force * slopes, x_level)
        force = summed_by_level(to_force, f_level)
        return np.hypot(record.count / math.sqrt(12.0) * position, record.f_rounding * force)

    @cached_property
    def levels(self) -> tuple[NDArray[np.intp] | None, NDArray[np.intp] | None]:
        """Levels (digital values) of position and force at the n fitted samples."""
        record = self.record
        return (
            digital_values(record.raw_x[self.index], record.count),
            digital_values(record.raw_f[self.index], record.f_count),
        )

    @cached_property
    def fits(self) -> BaselineFits:
        """Object that fits the force by the baseline and by other regressors, which it receives.

        The baseline is the slow part of the force. All fits have the same regressors for it.
        """
        return BaselineFits(self.basis, self.f)

    def fit(
        self, degree: int, relaxing: Sequence[Floats], further: Sequence[Floats] = ()
    ) -> RobustFit:
        """Fit the force by a baseline, the velocity, powers of the position, and relaxing parts.

        `further` are other regressors at the fitted samples (`teleop.evaluation.batch.extensions`).
        """
        columns = [self.velocity[self.index], *self.powers[:degree]]
        columns += [z[self.index] for z in relaxing]
        return self.fits.fit(np.column_stack([*columns, *further]))

    @cached_property
    def loading(self) -> NDArray[np.bool_]:
        """Whether the tip moves into the specimen, at each of the samples in contact (`fine`).

        If the tip moves into the specimen at fewer than four of these samples, the result is True
        for each sample at which the tip moves in any direction.
        """
        record = self.record
        noise = record.x_noise * record.noise_gain / (math.sqrt(2.0) * record.width)
        slowest = max(
            0.1 * float(np.percentile(np.abs(self.fine_v), 95)), LEAST_SPEED_NOISE * noise
        )
        moving = self.fine_v > slowest
        return moving if moving.sum() >= 4 else np.abs(self.fine_v) > 0.0

    @cached_property
    def time_of_motion(self) -> float:
        """Inverse of the angular frequency of the motion [s], from the deviations of x and v."""
        x, v = self.record.x[self.index], self.record.v[self.index]
        return float(np.std(x)) / max(float(np.std(v)), 1e-300)

    @cached_property
    def shifts(self) -> Floats:
        """Change of the position per error of lag and lost motion, shape (n, 2), without signs.

        An error of the lag shifts the position in proportion to the velocity. An error of the lost
        motion shifts it in the direction of the last motion, also while the tip rests.
        """
        v = self.record.v
        moves = np.abs(v) > LEAVING_SPEED * float(np.percentile(np.abs(v), 95))
        last = np.maximum.accumulate(np.where(moves, np.arange(len(v)), 0))
        direction = self.record.smoothed(np.sign(v[last]))
        return np.column_stack([v[self.index], direction[self.index]])

    @property
    def v_column(self) -> int:
        """Index of the damping b (coefficient of the velocity) in the parameters of a model."""
        return int(self.basis.shape[1])


def largest_corner(record: SmoothedRecord) -> float:
    """Return the largest distance by which the smoothing moves a corner of the position [m]."""
    return record.width * float(np.percentile(np.abs(record.v), 99))


def sharp_position(record: SmoothedRecord) -> Floats:
    """Return the smoothed position with the height of its peaks, and the measured one at corners.

    The result has the shape (n,).
    """
    sharp = np.clip(record.sharpened(record.x), record.raw_x.min(), record.raw_x.max())
    return with_corners(record.raw_x, sharp, record.x_noise, largest_corner(record))


def with_corners(raw: Floats, smoothed: Floats, noise: float, largest: float) -> Floats:
    """Return the smoothed values of a signal, but the measured values at its sharp corners.

    Smoothing rounds a corner. For example, it reduces the peaks of a triangle wave. A sample is at
    a corner if the difference between its measured and its smoothed value is too large for noise.
    A difference above `largest`, which smoothing cannot cause, is an outlier.
    """
    difference = np.abs(raw - smoothed)
    return np.where(
        (difference > SHARP_CORNER_NOISE * noise) & (difference < largest), raw, smoothed
    )
