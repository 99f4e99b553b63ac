"""Find faults of sensors, logger and data stream in a record, and remove their effect if possible.

**Held samples.** A channel that is updated more slowly than the file is written repeats each value
until the next update. The repeated values are delayed by half of the time between two updates, on
average. Only the samples at which the channel is updated are then used, for both channels. At rest,
updates are assumed at the same distance, unless they are irregular.
Quantisation also repeats values, but between two values that differ by several steps of the
resolution, there is then no repeated value.

**Stalled stream.** A channel that is constant while the other channel continues to move is left
out for this time. A rest, a hold, a loss of contact, a saturated sensor and a rigid stop also have
a constant channel. In these cases, the record has the same pairs of position and force at other
times, or the force only decreases (relaxation).

A channel that jumps to a constant value and back, such as zero while a plug is loose, is left out
too.

**Spikes.** A single sample of the force that differs from its neighbours by a large part of the
force range is an outlier, and is left out.

**Signs and times.** If the force decreases while the position increases, one of the two signs is
wrong. If the force lags behind the position by a large part of a period, neither a force channel
nor lost motion explains it: the time stamps are wrong, or the channels are of different records.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.baseline import without_baseline
from teleop.evaluation.batch.masks import runs
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.spikes import without_spikes
from teleop.evaluation.batch.thresholds import (
    FEWEST_STALLED,
    FEWEST_UPDATES,
    HELD_STEPS,
    LAGGING_R2,
    LEAST_DROP,
    LEAST_STALLED_FORCE,
    OPPOSITE_SIGNS,
    REGULAR_UPDATES,
    SHORTEST_STALL,
    STALL_MARGIN,
    STALLED_SHARE,
    STEEPEST_LOSS,
)
from teleop.evaluation.reading.signals import Signals, selected, smallest_step
from teleop.evaluation.reason import Reason


class Checked(NamedTuple):
    """A record without the effects of logger faults, and the remarks on these faults."""

    signals: Signals
    """Samples that are used."""
    remarks: tuple[Reason, ...]
    """Remarks on faults, with the name of the channel."""


def without_sampling_faults(signals: Signals) -> Checked:
    """Return the record without held samples, stalled streams and isolated spikes of the force."""
    signals, stalls = without_stalls(signals)
    signals, held = without_held(signals)
    signals, spikes = without_spikes(signals)
    return Checked(signals, (*stalls, *held, *spikes))


def updates(values: Floats) -> tuple[NDArray[np.intp], float] | None:
    """Return the indices at which a held channel is updated, and the typical distance [samples].

    The result is None if the channel is not held. Only updates by more than `HELD_STEPS` steps of
    the resolution show whether a channel is held. If the updates are irregular, the indices are
    those at which the value changes.
    """
    changed = np.flatnonzero(np.diff(values)) + 1
    if len(changed) < FEWEST_UPDATES:
        return None
    distance = np.diff(changed)
    if 2 * np.count_nonzero(distance == 1) > len(distance):
        return None
    jumps = np.abs(values[changed[1:]] - values[changed[1:] - 1])
    large = distance[jumps > HELD_STEPS * smallest_step(values)]
    if len(large) < FEWEST_UPDATES:
        return None
    typical = float(np.median(large))
    if typical < 2.0 or np.mean(large > 1) < REGULAR_UPDATES:
        return None
    regular = np.abs(large - typical) <= max(1.0, 0.3 * typical)
    if np.mean(regular) < REGULAR_UPDATES:
        return changed, float(np.mean(large))
    typical = float(np.mean(large[regular]))
    # At rest, and between values that are rounded to the same number, an update shows no change.
    filled = [
        start + np.round(np.arange(count) * (end - start) / count).astype(np.intp)
        for start, end, count in zip(
            changed[:-1],
            changed[1:],
            np.maximum(1, np.round(distance / typical).astype(np.intp)),
            strict=True,
        )
    ]
    return np.concatenate([*filled, changed[-1:]]), typical


def without_held(signals: Signals) -> tuple[Signals, list[Reason]]:
    """Return the samples at which the held channel is updated; all samples without such a channel.

    If both channels are held, the samples are those of the slower channel, and the other channel is
    interpolated between its updates.
    """
    channels = {"position": signals.x, "force": signals.f}
    held = {name: found for name, values in channels.items() if (found := updates(values))}
    if not held:
        return signals, []
    slowest = max(held, key=lambda name: held[name][1])
    used = selected(signals, held[slowest][0])
    for name, values in channels.items():
        if name in held and name != slowest:
            at = held[name][0]
            between = np.interp(used.t, signals.t[at], values[at])
            used = used._replace(x=between) if name == "position" else used._replace(f=between)
    period = float(np.median(signals.dt))
    remarks = [
        Reason(
            f"the {name} is updated every {typical * period * 1e3:.3g} ms on average, and repeated "
            f"in the samples between ({1.0 / period:.4g} samples/s): only the updates are used, "
            "because repeated values are delayed"
        )
        for name, (_, typical) in held.items()
    ]
    return used, remarks


def without_stalls(signals: Signals) -> tuple[Signals, list[Reason]]:
    """Return the samples without those at which one of the channels is stalled."""
    kept = np.ones(len(signals.t), dtype=np.bool_)
    remarks = []
    least = max(FEWEST_STALLED, int(SHORTEST_STALL * len(signals.t)))
    for name, values in (("position", signals.x), ("force", signals.f)):
        same = np.concatenate([[False], np.diff(values) == 0.0])
        for start, end in runs(same):
            start -= 1  # the value that is repeated
            lost = dropped(values, start, end)
            if lost or (end - start > least and is_stalled(signals, name, start, end)):
                # a value that jumps is wrong from its first sample, a stalled one is right there
                kept[start if lost else start + 1 : end] = False
                remarks.append(
                    Reason(
                        f"the {name} is constant from {signals.t[start]:.4g} to "
                        f"{signals.t[end - 1]:.4g} s while the "
                        f"{'force' if name == 'position' else 'position'} changes: its data "
                        "stream stalled, and this time is not used"
                    )
                )
    if not remarks or np.count_nonzero(kept) < FEWEST_STALLED:
        return signals, []
    return selected(signals, kept, breaks=~kept), remarks


def dropped(values: Floats, start: int, end: int) -> bool:
    """Return whether a channel jumps to a constant value at `start` and back at `end`.

    The value is outside of the values just before and just after this time.
    """
    if end - start <= FEWEST_STALLED or start == 0 or end == len(values):
        return False
    to, back = values[start] - values[start - 1], values[end] - values[end - 1]
    least = max(LEAST_DROP * float(np.ptp(values)), HELD_STEPS * smallest_step(values))
    return bool(to * back < 0.0 and min(abs(to), abs(back)) > least)


def is_stalled(signals: Signals, name: str, start: int, end: int) -> bool:
    """Return whether a channel that is constant from `start` to `end` is stalled.

    The forces in this time are compared with those at the same positions in the other samples. If
    the position is constant, the force must also rise, because it decreases in a hold.
    """
    x, f = signals.x, signals.f
    span = float(np.ptp(f))
    part = np.zeros(len(x), dtype=np.bool_)
    part[start:end] = True
    if name == "position":
        near = ~part & (np.abs(x - x[start]) < STALL_MARGIN * float(np.ptp(x)))
        low, high = (f[near].min(), f[near].max()) if near.any() else (f[start], f[start])
        pieces = [piece.mean() for piece in np.array_split(f[part], min(40, end - start))]
        rise = float(np.max(np.array(pieces) - np.minimum.accumulate(pieces)))
        fall = float(np.max(np.maximum.accumulate(pieces) - np.array(pieces)))
        if min(rise, fall) < LEAST_STALLED_FORCE * span:
            return False
        outside = (f[part] < low - STALL_MARGIN * span) | (f[part] > high + STALL_MARGIN * span)
        return bool(np.mean(outside) > STALLED_SHARE)
    edges = np.linspace(float(x.min()), float(x.max()), 21)
    bins = np.clip(np.searchsorted(edges, x) - 1, 0, 19)
    count = 0
    for each in np.unique(bins[part]):
        here = bins == each
        others = f[here & ~part]
        if not len(others):
            continue
        low, high = np.percentile(others, [2.0, 98.0])
        if not low - LEAST_STALLED_FORCE * span < f[start] < high + LEAST_STALLED_FORCE * span:
            count += int(np.count_nonzero(here & part))
    return count > STALLED_SHARE * (end - start)


def opposite_signs(record: SmoothedRecord) -> Reason | None:
    """Return the reason that the force decreases while the position increases; otherwise None."""
    if record.band.coherence == 0.0:
        return None
    moved, changed = (np.diff(values[:: record.stride]) for values in (record.x, record.f))
    size = math.sqrt(float(moved @ moved) * float(changed @ changed))
    if size == 0.0 or float(moved @ changed) > OPPOSITE_SIGNS * size:
        return None
    low, high = record.force_range
    both = "--invert force or --invert position reverses one sign"
    if high < -low / 3.0:
        sign, hint = "the sign of the force is wrong", "--invert force reverses the sign"
    elif low > -high / 3.0:
        sign = "the sign of the position is wrong, or that of the force and its zero"
        hint = "--invert position reverses the sign of the position, --invert force of the force"
    else:
        sign, hint = "the sign of the force or of the position is wrong", both
    return Reason(
        f"the force decreases while the position increases: {sign}, or forces of inertia dominate "
        "(expected force and position positive in compression)",
        hint,
    )


def impossible_lag(record: SmoothedRecord) -> Reason | None:
    """Return the reason that the force lags by more than a measuring chain can; otherwise None."""
    if not math.isfinite(record.frequency):
        return None
    omega = 2.0 * math.pi * record.frequency
    x, f = record.palpation, without_baseline(record.f, record.order)
    columns = np.column_stack([np.ones(len(x)), x - x.mean(), record.v / omega])
    theta = np.linalg.solve(columns.T @ columns, columns.T @ f)
    rest = f - columns @ theta
    if float(np.var(rest)) > (1.0 - LAGGING_R2) * float(np.var(f)):
        return None
    if theta[2] > -STEEPEST_LOSS * abs(theta[1]):
        return None
    lag = math.atan2(-theta[2], theta[1]) / omega
    return Reason(
        f"the force lags behind the position by {lag * 1e3:.3g} ms ({lag * record.frequency:.2g} "
        "periods), more than a force channel or lost motion causes: wrong time stamps, a wrong "
        "sign, or position and force of different recordings"
    )
