"""Read measured time, position and force from a file; find gaps and the resolution in them."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from teleop.errors import InputError
from teleop.evaluation.formats.columns import Picker, Wanted, find_columns, listed
from teleop.evaluation.formats.registry import read_tables
from teleop.evaluation.formats.table import Table
from teleop.evaluation.formats.units import LARGEST
from teleop.evaluation.reading.thresholds import (
    COARSE_TIMES,
    FEWEST_TABLE_SAMPLES,
    LONG_PERIOD,
    ROUNDING_OF_STEP,
    SHORTEST_PERIOD,
    SMALLEST_CHANNEL,
)

BLOCKS_SHOWN = 12
"""Largest number of tables that an error message lists."""


class Signals(NamedTuple):
    """Measured time, position and force; arrays have shape (n,)."""

    t: Floats
    """Time [s]."""
    x: Floats
    """Position [m]."""
    f: Floats
    """Force [N], positive in compression."""
    dt: Floats
    """Time since the previous sample [s]."""
    position_name: str
    """Name of the position's column, without its unit."""
    gaps: tuple[int, ...] = ()
    """Index of the first sample after each gap (an interval in which samples are missing)."""
    force_filter: str = ""
    """Description of the force filter in the file; empty if the file has none."""
    notes: tuple[str, ...] = ()
    """Texts that describe the changes that were made to the samples on reading."""
    measured_step: float | None = None
    """Resolution of the position sensor [m] if `x` is computed from its values, see `step`."""
    measured_force_step: float | None = None
    """Resolution of the force sensor [N] if `f` is computed from its values, see `force_step`."""
    filter_delay: float = 0.0
    """Delay of the force filter by which the force was advanced [s]; 0 if it was not."""

    @property
    def step(self) -> float:
        """Resolution of the position: its smallest step [m]; 0 if the position never changes."""
        return smallest_step(self.x) if self.measured_step is None else self.measured_step

    @property
    def force_step(self) -> float:
        """Resolution of the force: its smallest step [N]; 0 if the force never changes."""
        given = self.measured_force_step
        return smallest_step(self.f) if given is None else given


def periods(t: Floats) -> Floats:
    """Return, for each sample, the time since the previous sample [s], shape (n,).

    The first sample has no previous sample. Its value is the median of the other values.
    """
    steps = np.diff(t)
    return np.concatenate(([np.median(steps)], steps))


def selected(
    signals: Signals, kept: NDArray[Any], breaks: NDArray[np.bool_] | None = None
) -> Signals:
    """Return some of the samples; `kept` is a mask or contains indices.

    A gap of the record remains a gap. A sample in the mask `breaks` is also one.
    """
    marks = np.zeros(len(signals.t), dtype=np.intp) if breaks is None else breaks.astype(np.intp)
    marks[list(signals.gaps)] += 1
    gaps = np.flatnonzero(np.diff(np.cumsum(marks)[kept])) + 1
    t = signals.t[kept]
    return signals._replace(
        t=t, x=signals.x[kept], f=signals.f[kept], dt=periods(t), gaps=tuple(gaps.tolist())
    )


def read_signals(
    path: Path,
    position: str | None = None,
    force: str | None = None,
    time: str | None = None,
    wanted: Wanted | None = None,
) -> Signals:
    """Read time, position and force from a measurement file, in SI units."""
    wanted = (wanted or Wanted())._replace(position=position, force=force, time=time)
    return signals_of(chosen_table(path, wanted), wanted)


def chosen_table(path: Path, wanted: Wanted, whole: Collection[str] = ()) -> Table:
    """Select the table to evaluate from the tables in a measurement file, and return it.

    If the user states the number of a table, the table with this number is returned. Otherwise, the
    result is the only table that has columns of position, force and time; several are an error. If
    no table has these columns, the table with the most samples is returned. Of a table that has all
    columns in `whole`, all columns are read.
    """
    tables = read_tables(path, Picker(wanted, whole), wanted)
    if wanted.block is not None:
        if not 1 <= wanted.block <= len(tables):
            raise InputError(f"{path}: no block {wanted.block}: {blocks(tables)}")
        return tables[wanted.block - 1]
    usable = [table for table in tables if table.columns]
    if len(usable) > 1:
        raise InputError(f"{path}: {len(usable)} tables, expected --block N: {blocks(tables)}")
    return usable[0] if usable else max(tables, key=lambda table: table.samples)


def blocks(tables: Sequence[Table]) -> str:
    """Return a text for an error message that lists the tables in a file, numbered from 1."""
    shown = [
        f"{i} {table.title!r}, {table.samples} samples of {listed(table.headings)}"
        if table.title
        else f"{i} with {table.samples} samples of {listed(table.headings)}"
        for i, table in enumerate(tables[:BLOCKS_SHOWN], 1)
    ]
    more = f"; and {len(tables) - BLOCKS_SHOWN} more" if len(tables) > BLOCKS_SHOWN else ""
    return f"expected one of: {'; '.join(shown)}{more}"


def signals_of(table: Table, wanted: Wanted) -> Signals:
    """Convert a table of a measurement file to time, position and force in SI units.

    A sample with the same time as the previous sample is omitted. The attribute `notes` of the
    result states the number of omitted samples.
    """
    columns = find_columns(table.where, table.headings, wanted)
    if table.problem:
        raise table.problem
    if table.samples < FEWEST_TABLE_SAMPLES:
        raise InputError(
            f"{table.where}: {table.samples} samples: expected at least {FEWEST_TABLE_SAMPLES}"
        )
    channels = {kind: table.columns[c.place] * c.scale for kind, c in columns.items()}
    for kind, channel in channels.items():
        finite = np.isfinite(channel)
        if not finite.all():
            i, place = int(np.argmin(finite)), columns[kind].place
            raise InputError(
                f"{table.sample(i)}: {table.headings[place].title!r} is "
                f"{table.columns[place][i]}, expected a finite number"
            )
        largest = np.abs(channel).max()
        if 0.0 < largest < SMALLEST_CHANNEL:
            raise InputError(
                f"{table.where}: every {kind} is at most {largest:g} in SI units, "
                f"expected a value above {SMALLEST_CHANNEL:g}"
            )
        if not largest < LARGEST:
            i = int(np.argmax(np.abs(channel)))
            raise InputError(
                f"{table.sample(i)}: a {kind} of {channel[i]:g} in SI units, "
                f"expected less than {LARGEST:g}"
            )
    x, f, notes = channels["position"], channels["force"], list(table.notes)
    if wanted.rate:
        t = np.arange(len(x)) / wanted.rate
    else:
        t = channels["time"]
        kept = rising(table, t)
        if not kept.all():
            count = int((~kept).sum())
            coarse = count > COARSE_TIMES * len(t)
            notes.append(
                f"{count} of {len(t)} samples have the time of the previous sample and are left out"
                + ("; if the times are rounded, use --rate HZ" if coarse else "")
            )
            t, x, f = t[kept], x[kept], f[kept]
    dt = periods(t)
    return Signals(
        t,
        x,
        f,
        dt,
        columns["position"].name,
        tuple(long_periods(dt).tolist()),
        table.about.get("force_filter", ""),
        tuple(notes),
    )


def rising(table: Table, t: Floats) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return a mask that selects samples with increasing times, shape (n,).

    The mask is False at a sample with the same time as the previous sample.
    """
    steps = np.diff(t)
    kept = np.concatenate(([True], steps > 0.0))
    backwards = steps < 0.0
    if backwards.any() or kept.sum() < FEWEST_TABLE_SAMPLES:
        i = int(np.argmax(backwards) if backwards.any() else np.argmin(kept[1:]))
        what = "decreases" if backwards.any() else "repeats"
        raise InputError(
            f"{table.sample(i + 1)}: time {what}, from {t[i]:g} s to {t[i + 1]:g} s: "
            "expected increasing times, or --rate HZ for evenly sampled data"
        )
    if (smallest := steps[steps > 0.0].min()) < SHORTEST_PERIOD:
        raise InputError(
            f"{table.where}: times {smallest:g} s apart: expected {SHORTEST_PERIOD:g} s or more"
        )
    return kept


def long_periods(dt: Floats) -> NDArray[np.intp]:
    """Return the index of the first sample after each gap.

    A gap is a sample period that is longer than `LONG_PERIOD` times the median period.
    """
    return np.flatnonzero(dt > LONG_PERIOD * np.median(dt))


def closed_up(dt: Floats, gaps: Sequence[int]) -> Floats:
    """Return the sample periods [s], shape (n,), with the duration of gaps removed.

    At the first sample after each gap, the period is replaced by the median period.
    """
    periods = dt.copy()
    periods[list(gaps)] = np.median(dt)
    return periods


def smallest_step(values: Floats) -> float:
    """Return the smallest change of the value between successive samples, without zero changes.

    The result is 0 if the value never changes. For a channel with an encoder or an analogue-digital
    converter, the result is the resolution.
    """
    steps = np.abs(np.diff(values))
    steps = steps[steps > ROUNDING_OF_STEP * float(np.max(np.abs(values), initial=0.0))]
    return float(steps.min()) if len(steps) else 0.0


def repeated_rounding(count: float, noise: float) -> float:
    """Return the standard deviation of the repeatable part of the rounding error of a signal.

    A signal that is rounded to multiples of the resolution `count` has a rounding error with the
    standard deviation count / sqrt(12). Without noise, the error is the same whenever the signal
    has the same value: the error is repeatable. If the signal contains noise before the rounding,
    the error varies randomly. The repeatable part is then the mean error at a given value of the
    signal. The noise reduces the repeatable part by a factor. This factor is the characteristic
    function of the noise at 2 pi / count (Widrow).

    References
    ----------
    B. Widrow, I. Kollar, "Quantization noise", Cambridge University Press, 2008.
    """
    rounding = count / math.sqrt(12.0)
    if rounding == 0.0:
        return 0.0
    before = max(noise**2 - rounding**2, 0.0) / count**2
    return rounding * math.exp(-min(2.0 * math.pi**2 * before, 700.0))
