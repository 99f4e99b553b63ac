"""Detect recordings from which no tangent stiffness (slope of force over depth) can be computed."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from estimation.arrays import Floats
from teleop.evaluation.batch.constancy import rise_at_rest
from teleop.evaluation.batch.masks import runs
from teleop.evaluation.batch.phases import Phases
from teleop.evaluation.batch.prepared import Prepared
from teleop.evaluation.batch.single_stroke import LEAST_RISE, is_single_stroke, typical_speed
from teleop.evaluation.reason import INVERT_BOTH, Reason

FEWEST_PER_CYCLE = 8.0
"""Smallest number of samples per cycle of the motion that is sufficient."""
SMOOTHED = 9
"""Length of the median filter that is applied before the search for a puncture [samples]."""
FALL = 0.25
"""Smallest fall of the force in loading that counts as a puncture, as a fraction of its range."""
FALL_NOISE = 12.0
"""Smallest fall of the force that counts as a puncture, in standard deviations of its noise."""
FALL_TRAVEL = 0.02
"""Largest travel during a puncture, as a fraction of the travel of the record."""
CREEP = 0.3
"""Shortest time at a constant force in a creep test, as a fraction of the record."""
CREPT = 0.1
"""Smallest travel at the constant force of a creep test, as a fraction of the travel of the
record."""
ZERO = 0.1
"""Largest magnitude of the highest force that counts as zero, as a fraction of the force range."""


def unsuited(record: Prepared, phases: Phases) -> Reason | None:
    """Return the reason why a test gives no tangent stiffness; None if no reason is found.

    The function searches for inverted signs of force and position, a creep test, a puncture of the
    specimen, and a drift of the force at rest.

    Parameters
    ----------
    record
        The prepared record of the test.
    phases
        The phases of the record, such as loading and unloading.
    """
    if phases.saturated and rests_at_zero(record):
        return Reason(
            "the force rests near zero at the highest positions, and is negative at the lowest: "
            "expected force and position positive in compression",
            INVERT_BOTH,
        )
    if (level := creep_force(record, phases)) is not None:
        return Reason(
            f"the force is constant at {level:.3g} N while the position creeps: a creep test has "
            "no tangent stiffness"
        )
    if (fall := puncture(record)) is not None:
        before, after, position = fall
        return Reason(
            f"the force falls from {before:.3g} to {after:.3g} N in loading, at a position of "
            f"{position * 1e3:.4g} mm: the specimen is punctured or slips. Expected a recording "
            "that ends before"
        )
    if rise := rise_at_rest(record):
        return Reason(
            f"the force drifts: it rises by {rise[0]:.3g} N in {rise[1]:.3g} s at rest, where that "
            "of a passive body does not"
        )
    return None


def no_contact(record: Prepared) -> str:
    """Return the text of the message that the force does not follow the displacement.

    This function does not check the force. It only uses the record to select one of two texts: the
    text for a motion that never reverses, or the text for any other motion.
    """
    if is_single_stroke(record.raw_x, record.x_noise):
        return (
            f"the force changes by less than {LEAST_RISE:g} standard deviations of its scatter "
            "while the position moves in one direction: no contact, or a change that the force "
            "sensor does not resolve"
        )
    return "the force does not follow the displacement: no contact"


def rests_at_zero(record: Prepared) -> bool:
    """Return whether the highest force of a record is nearly zero, relative to the force range.

    If the result is True, the force is nearly zero or negative in the whole record.
    """
    low, high = record.force_range
    return abs(high) < ZERO * (high - low)


def negative_force(record: Prepared) -> bool:
    """Return whether the force is mainly negative.

    This is the case if the lowest force is negative, and its magnitude is more than three times the
    highest force.
    """
    low, high = record.force_range
    return low < 0.0 and high < -low / 3.0


def too_few_per_cycle(record: Prepared) -> str | None:
    """Return a message if a record has too few samples per cycle of the motion; otherwise None."""
    each = 1.0 / (record.band.centre * record.period)
    if record.band.coherence == 0.0 or each >= FEWEST_PER_CYCLE:
        return None
    return (
        f"{each:.2g} samples per cycle of {record.band.centre:.3g} Hz: expected a sampling rate of "
        f"{FEWEST_PER_CYCLE * record.band.centre:.3g} Hz or more"
    )


def creep_force(record: Prepared, phases: Phases) -> float | None:
    """Return the constant force of a creep test [N]; None for another test.

    In a creep test, the force is constant. The position continues to move in one direction, with
    decreasing speed.
    """
    f, noise = record.f, record.f_noise_smoothed
    level = float(np.median(f[len(f) // 2 :]))
    width = max(6.0 * noise, 0.015 * float(np.ptp(f)))
    for start, end in runs((np.abs(f - level) < width) & phases.contact):
        if end - start < CREEP * len(f):
            continue
        travels = np.diff(record.x[np.linspace(start, end - 1, 5).astype(np.int_)])
        if (
            (np.diff(travels) < 0.0).all()
            and travels[-1] > 3.0 * record.x_noise
            and travels.sum() > CREPT * float(np.ptp(record.x))
        ):
            return level
    return None


def puncture(record: Prepared) -> tuple[float, float, float] | None:
    """Find a puncture of the specimen, at which the force falls suddenly during loading.

    Returns
    -------
    Three values: the force before the puncture [N], the force after it [N], and the position at
    which the force begins to fall [m]. None if there is no puncture.
    """
    f = median_filter(record.raw_f, SMOOTHED, mode="nearest")
    x, v = record.x, record.v
    fast = v > 0.3 * typical_speed(v)
    least = max(FALL * float(np.ptp(f)), FALL_NOISE * record.f_noise)
    for start, end in runs(fast):
        if end - start < 4 * SMOOTHED:
            continue
        before, after = largest_fall(x[start:end], f[start:end], FALL_TRAVEL * float(np.ptp(x)))
        if f[start + before] - f[start + after] > least:
            return float(f[start + before]), float(f[start + after]), float(x[start + before])
    return None


def largest_fall(x: Floats, f: Floats, travel: float) -> tuple[int, int]:
    """Return the indices of the two samples between which the force falls most.

    Only samples whose positions differ by at most `travel` are compared.

    Parameters
    ----------
    x, f
        Position [m], which increases, and force [N], shape (n,).
    travel
        Largest distance between the positions of the two samples [m].
    """
    ends = np.searchsorted(np.maximum.accumulate(x), x + travel, side="right") - 1
    before = int(np.argmax(f - f[ends]))
    return before, int(ends[before])
