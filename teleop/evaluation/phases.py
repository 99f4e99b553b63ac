"""Phases of a palpation: free motion, loading, hold and unloading, and the contact point.

**Contact.** Out of contact the position moves and the force stays at one level; in contact no
motion leaves the force alone. So the record is out of contact where, within one stretch of time
that the force spends near its lowest level, the position travels several times the distance that
the stiffness above that level allows. This needs no zero of position or force, no name of a column,
and holds where a surface drifts. A record whose force never rests at a level while the position
moves is in contact throughout, or never: the second shows in that the force does not follow the
displacement (`teleop.evaluation.result`). The same at the highest level is a saturated sensor.

**Contact point.** The force of each approach is a level before the contact, and a quadratic in the
depth with damping after it: f = f0 + a d + q d^2 + b v [d > 0], d = (x - xc)+, fitted to the
record as measured for a grid of xc. The least sum of squares gives xc, and the positions whose sum
of squares the noise allows give its interval. Over several approaches the median is reported, and
the interval is that of one approach: the larger of the median interval and of Student's t times
their standard deviation.

**Phases.** In contact, loading and unloading are the monotone parts between turning points that
exceed 5 % of the travel; a hold is where the position stays within 2 % of its range for longer
than a third of the median monotone part.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, stdtrit

from estimation.baseline import without_baseline
from estimation.compiled import Floats
from estimation.stiffening import Interval
from teleop.evaluation.prepared import Prepared
from teleop.evaluation.turning_points import turning_points

LEVEL = 0.015
"""Least width of a level, as a share of the force range."""
NOISE = 6.0
"""Least width of a level in standard deviations of the smoothed force."""
TRAVEL = 4.0
"""Travel within a level, as a multiple of what the stiffness allows, that is free motion."""
LAG = 1.5
"""Allowance for the travel at a turn of the force, which leads that of a lossy body's position."""
TURN = 0.05
"""A turn of the motion is reported when it goes back by this share of the range."""
STILL = 0.02
"""A hold stays within this share of the range of the position."""
HOLD = 0.33
"""Shortest hold as a share of the median monotone part."""
APPROACHES, MOST_POINTS = 10, 300
"""Approaches that are fitted for the contact point, and samples of each, approximately."""
GUARD = 2.5
"""Samples this many kernel widths from the begin or end of a contact are not used for fits."""


class Phase(NamedTuple):
    """A phase of the record."""

    name: str
    """`free`, `loading`, `hold` or `unloading`."""
    start: int
    """Index of its first sample on the grid of the prepared record."""
    end: int
    """Index after its last sample."""


@dataclass(frozen=True)
class Phases:
    """What the record consists of."""

    contact: NDArray[np.bool_]
    """Whether there is contact, shape (n,)."""
    usable: NDArray[np.bool_]
    """Contact, away from its begins and ends, where the smoothing does not mix phases."""
    free_force: float | None
    """Force out of contact [N]; None where contact is never left."""
    free_spread: float
    """Standard deviation of the smoothed force out of contact [N]."""
    contact_point: Interval | None
    """Position of the contact [m]; None where contact is never begun."""
    saturated: bool
    """Whether the force rests at its highest level while the position moves."""
    phases: tuple[Phase, ...]


def find_phases(record: Prepared) -> Phases:
    """Return the phases of a prepared record."""
    x, f = record.x, record.f
    low, high = (float(v) for v in np.percentile(f, [0.5, 99.5]))
    width = max(NOISE * record.f_noise_smoothed, LEVEL * (high - low))
    free, saturated = levels(record, low, high, width)
    saturated = saturated or clipped(record)
    guard = max(1, round(GUARD * record.width / record.period))
    contact = np.ones(len(x), dtype=np.bool_)
    free_force = point = None
    spread = 0.0
    if free is not None:
        free_force, spread = float(np.median(f[free])), float(np.std(f[free]))
        contact = hysteresis(f - free_force, 0.5 * width, width)
        contact = without_short(contact, 2 * guard)
        point = contact_point(record, contact, free_force, width)
    usable = eroded(contact, guard) if free is not None else contact.copy()
    for start in record.starts[1:]:
        usable[max(0, start - guard) : start + guard] = False
    return Phases(contact, usable, free_force, spread, point, saturated, split(record, contact))


def levels(
    record: Prepared, low: float, high: float, width: float
) -> tuple[NDArray[np.bool_] | None, bool]:
    """Return the samples at a lowest level through free motion, and whether a highest one is."""
    x, f = record.palpation, record.f
    if width > 0.2 * (high - low):
        return None, False
    v = np.gradient(x, record.period)
    elastic = without_baseline(f, record.clock, record.order)
    b, k, _ = np.linalg.lstsq(np.column_stack([v, x, np.ones(len(x))]), elastic, rcond=None)[0]
    loss = min(1.0, abs(b) * float(np.std(v)) / max(abs(k) * float(np.std(x)), 1e-300))
    turn = float(np.arccos(1.0 - min(1.0, 2.0 * width / (high - low))))
    lag = float(np.ptp(x)) * np.sin(np.arctan(loss)) * turn
    fast = np.abs(v) > 0.1 * np.percentile(np.abs(v), 95)
    rate = np.gradient(elastic, record.period)
    free = None
    saturated = False
    for bottom in (True, False):
        level = f < low + width if bottom else f > high - width
        middle = 0.5 * (low + high)
        beside = fast & ~level & ((f < middle) if bottom else (f > middle))
        if beside.sum() < 3:
            beside = fast & ~level
        if beside.sum() < 3:
            continue
        stiffness = float(np.median(rate[beside] / v[beside]))
        allowed = TRAVEL * width / max(stiffness, 1e-300) + LAG * lag
        resting = np.zeros(len(f), dtype=np.bool_)
        for start, end in runs(level):
            if np.ptp(x[start:end]) > allowed:
                resting[start:end] = True
        if resting.any():
            if bottom:
                free = resting
            else:
                saturated = True
    return free, saturated


def clipped(record: Prepared) -> bool:
    """Return whether many samples have the very same extreme force while the position moves."""
    f = record.raw_f
    for extreme in (f.max(), f.min()):
        equal = f == extreme
        for start, end in runs(equal):
            if end - start >= 8 and np.ptp(record.raw_x[start:end]) > 20.0 * record.x_noise:
                before = slice(max(0, start - (end - start)), start)
                after = slice(end, end + (end - start))
                around = np.concatenate([f[before], f[after]])
                if extreme == f.max() and len(around) and extreme - around.min() > 0.02 * np.ptp(f):
                    return True
    return False


def hysteresis(values: Floats, low: float, high: float) -> NDArray[np.bool_]:
    """Return where the values are above `high`, or above `low` since they were above `high`."""
    state = np.where(values > high, 1, np.where(values < low, 0, -1))
    known = np.flatnonzero(state >= 0)
    if not len(known):
        return np.zeros(len(values), dtype=np.bool_)
    last = np.searchsorted(known, np.arange(len(values)), side="right") - 1
    return np.asarray(state[known[np.maximum(last, 0)]] == 1)


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first index and index after the last of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def without_short(mask: NDArray[np.bool_], shortest: int) -> NDArray[np.bool_]:
    """Return the mask without runs of fewer samples."""
    kept = mask.copy()
    for start, end in runs(mask):
        if end - start < shortest:
            kept[start:end] = False
    return kept


def eroded(mask: NDArray[np.bool_], guard: int) -> NDArray[np.bool_]:
    """Return the mask without this many samples at each end of a run inside the record."""
    kept = mask.copy()
    for start, end in runs(mask):
        if start > 0:
            kept[start : start + guard] = False
        if end < len(mask):
            kept[max(end - guard, 0) : end] = False
    return kept


def contact_point(
    record: Prepared, contact: NDArray[np.bool_], free_force: float, width: float
) -> Interval | None:
    """Return the position at which contact begins; None without an approach."""
    found = []
    approaches = [(start, end) for start, end in runs(contact) if start > 0]
    every = max(1, len(approaches) // APPROACHES)
    for start, end in approaches[::every]:
        top = int(np.argmax(record.f[start:end])) + start
        rise = record.f[start : top + 1] - free_force
        reach = int(np.argmax(rise > 0.35 * rise[-1])) + start + 1
        free_before = start - 1
        while free_before > 0 and not contact[free_before - 1] and start - free_before < len(rise):
            free_before -= 1
        part = slice(free_before, reach, max(1, (reach - free_before) // MOST_POINTS))
        if reach - free_before >= 8 and record.x[reach - 1] > record.x[free_before]:
            fitted = onset(record.x[part], record.v[part], record.raw_f[part], record.f_noise)
            if fitted:
                found.append(fitted)
    if not found:
        return None
    values = np.array([one.value for one in found])
    value = float(np.median(values))
    half = float(np.median([one.high - one.low for one in found])) / 2.0
    if len(values) > 2:
        quantile = float(stdtrit(len(values) - 1, 0.975))
        half = max(half, quantile * float(np.std(values, ddof=1)))
    return Interval(value, value - half, value + half)


def onset(x: Floats, v: Floats, f: Floats, noise: float) -> Interval | None:
    """Return the change-point of a level followed by a quadratic, with its interval."""
    points = np.linspace(float(x.min()), float(x.max()), 82)[1:-1]
    squares = np.empty(len(points))
    for i, point in enumerate(points):
        depth = np.maximum(x - point, 0.0) / np.ptp(x)
        regressors = np.column_stack([np.ones(len(x)), depth, depth**2, v * (depth > 0.0)])
        theta = np.linalg.lstsq(regressors, f, rcond=None)[0]
        squares[i] = np.sum((f - regressors @ theta) ** 2)
    best = int(np.argmin(squares))
    variance = max(squares[best] / max(len(x) - 5, 1), noise**2)
    allowed = points[squares <= squares[best] + chdtri(1, 0.05) * variance]
    step = points[1] - points[0]
    return Interval(float(points[best]), float(allowed[0] - step), float(allowed[-1] + step))


def split(record: Prepared, contact: NDArray[np.bool_]) -> tuple[Phase, ...]:
    """Return the phases in their order in time."""
    bounds = sorted({0, len(contact), *record.starts, *np.flatnonzero(np.diff(contact) != 0) + 1})
    whole = float(np.ptp(record.palpation))
    found: list[Phase] = []
    parts = []
    for start, end in pairwise(bounds):
        if not contact[start]:
            found.append(Phase("free", int(start), int(end)))
            continue
        turns = turning_points(record.palpation[start:end], TURN * whole)
        parts += [(start + a, start + b) for a, b in pairwise(turns)]
    monotone = [(int(start), int(end)) for start, end in parts]
    cores = []
    for start, end in monotone:
        x = record.x[start:end]
        range_ = max(float(np.ptp(x)), 1e-300)
        moving = np.flatnonzero(
            (np.abs(x - x[0]) > STILL * range_) & (np.abs(x - x[-1]) > STILL * range_)
        )
        a, b = (int(moving[0]), int(moving[-1]) + 1) if len(moving) else (0, end - start)
        cores.append((start, start + a, start + b, end))
    typical = float(np.median([b - a for _, a, b, _ in cores])) if cores else 0.0
    for start, a, b, end in cores:
        name = "loading" if record.x[end - 1] > record.x[start] else "unloading"
        a = a if a - start > HOLD * typical else start
        b = b if end - b > HOLD * typical else end
        for label, first, last in (("hold", start, a), (name, a, b), ("hold", b, end)):
            if last > first:
                found.append(Phase(label, first, last))
    return tuple(merged(sorted(found, key=lambda phase: phase.start)))


def merged(phases: list[Phase]) -> list[Phase]:
    """Return the phases with adjacent ones of the same name as one."""
    joined: list[Phase] = []
    for phase in phases:
        if joined and joined[-1].name == phase.name and joined[-1].end == phase.start:
            joined[-1] = joined[-1]._replace(end=phase.end)
        else:
            joined.append(phase)
    return joined
