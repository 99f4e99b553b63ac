"""Measured time, position and force, from a table of any format."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from estimation.compiled import Floats
from teleop.errors import InputError
from teleop.evaluation.formats.columns import Wanted, find_columns, listed, picker
from teleop.evaluation.formats.registry import read_tables
from teleop.evaluation.formats.table import Table
from teleop.evaluation.sampling_gaps import long_periods
from teleop.evaluation.units import LARGEST

SHORTEST = 1e-9
"""Shortest sample period [s]."""
FEWEST = 3
"""Fewest samples of a table."""
COARSE = 0.1
"""Share of repeated times above which the clock of the file is called too coarse."""
BLOCKS_SHOWN = 12


class Signals(NamedTuple):
    """Measured time [s], position [m] and force [N], arrays of shape (n,)."""

    t: Floats
    x: Floats
    f: Floats
    dt: Floats
    """Time since the sample before [s]."""
    position_name: str
    """Name of the position's column, without its unit."""
    gaps: tuple[int, ...] = ()
    """Numbers of the samples before which samples are missing."""
    force_filter: str = ""
    """What the file states of a filter of the force; empty for nothing."""
    notes: tuple[str, ...] = ()
    """What was done to the samples when they were read."""


def periods(t: Floats) -> Floats:
    """Time since the sample before [s]; for the first sample the median of the others."""
    steps = np.diff(t)
    return np.concatenate(([np.median(steps)], steps))


def read_signals(
    path: Path,
    position: str | None = None,
    force: str | None = None,
    time: str | None = None,
    wanted: Wanted | None = None,
) -> Signals:
    """Read time, position and force from a measurement file, in SI units.

    Parameters
    ----------
    path
        The file, in a format of `formats/registry.py`.
    position, force, time
        Column to take, as NAME or, where the header has no unit, NAME=UNIT; by default the
        one that has a usual name.
    wanted
        Everything else that the user asks.

    Raises
    ------
    InputError
        The file, a column, a unit or a value is not as expected; names file and place.
    """
    wanted = (wanted or Wanted())._replace(position=position, force=force, time=time)
    return signals_of(chosen_table(path, wanted), wanted)


def chosen_table(path: Path, wanted: Wanted, whole: Collection[str] = ()) -> Table:
    """The table of a file that has the columns, or the block that is wanted.

    Parameters
    ----------
    path
        The file.
    wanted
        What the user asks.
    whole
        Names of columns; a table that has all of them is loaded with every column.

    Raises
    ------
    InputError
        The file cannot be read, or the table is not clear.
    """
    tables = read_tables(path, picker(wanted, whole), wanted)
    if wanted.block is not None:
        if not 1 <= wanted.block <= len(tables):
            raise InputError(f"{path}: no block {wanted.block}: {blocks(tables)}")
        return tables[wanted.block - 1]
    usable = [table for table in tables if table.columns]
    if len(usable) > 1:
        raise InputError(f"{path}: {len(usable)} tables, expected --block N: {blocks(tables)}")
    return usable[0] if usable else max(tables, key=lambda table: table.samples)


def blocks(tables: Sequence[Table]) -> str:
    """The tables of a file with their numbers, for messages."""
    shown = [
        f"{i} {table.title!r}, {table.samples} samples of {listed(table.headings)}"
        if table.title
        else f"{i} with {table.samples} samples of {listed(table.headings)}"
        for i, table in enumerate(tables[:BLOCKS_SHOWN], 1)
    ]
    more = f"; and {len(tables) - BLOCKS_SHOWN} more" if len(tables) > BLOCKS_SHOWN else ""
    return f"expected one of: {'; '.join(shown)}{more}"


def signals_of(table: Table, wanted: Wanted) -> Signals:
    """Time, position and force of a table in SI units.

    Samples that repeat the time of the sample before are left out, which `notes` reports.

    Raises
    ------
    InputError
        A column, a unit or a value is not as expected.
    """
    columns = find_columns(table.where, table.headings, wanted)
    if table.problem:
        raise table.problem
    if table.samples < FEWEST:
        raise InputError(f"{table.where}: {table.samples} samples: expected at least {FEWEST}")
    channels = {kind: table.columns[c.place] * c.scale for kind, c in columns.items()}
    for kind, channel in channels.items():
        finite = np.isfinite(channel)
        if not finite.all():
            i, place = int(np.argmin(finite)), columns[kind].place
            raise InputError(
                f"{table.sample(i)}: {table.headings[place].title!r} is "
                f"{table.columns[place][i]}, expected a finite number"
            )
        if not np.abs(channel).max() < LARGEST:
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
            coarse = count > COARSE * len(t)
            notes.append(
                f"{count} of {len(t)} samples left out, which repeat the time of the sample before"
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
    """Which samples have a later time than the one before.

    Raises
    ------
    InputError
        Times run backwards, are too close, or too few are left.
    """
    steps = np.diff(t)
    kept = np.concatenate(([True], steps > 0.0))
    backwards = steps < 0.0
    if backwards.any() or kept.sum() < FEWEST:
        i = int(np.argmax(backwards) if backwards.any() else np.argmin(kept[1:]))
        what = "runs backwards" if backwards.any() else "repeats"
        raise InputError(
            f"{table.sample(i + 1)}: time {what}, from {t[i]:g} s to {t[i + 1]:g} s: "
            "expected times that rise, or --rate HZ for samples at equal times"
        )
    if (smallest := steps[steps > 0.0].min()) < SHORTEST:
        raise InputError(
            f"{table.where}: times {smallest:g} s apart: expected {SHORTEST:g} s or more"
        )
    return kept
