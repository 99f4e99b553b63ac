"""Tables that compare several recordings: k and b of each recording, and means over groups."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import chain
from math import isfinite
from pathlib import Path
from string import ascii_lowercase

from estimation.quantities import DAMPING, POSITION, RESULTS, STIFFNESS
from teleop.evaluation.across.comparison import OF_RESULT, RESULT, Compared, values_of
from teleop.evaluation.across.groups import Group, remark_counts, short
from teleop.evaluation.across.means import Mean
from teleop.evaluation.batch.kinds import MEANING
from teleop.evaluation.batch.stiffness_result import StiffnessResult
from teleop.files import RECORDING
from teleop.output.comparison_notes import (
    CAPTION,
    TRACKING_CAPTION,
    UNNAMED,
    correction_note,
    damping_note,
    different_text,
    holding_text,
    missing_text,
    model_notes,
    pooled_text,
    remark_texts,
    unit_note,
)
from teleop.output.console import plain_console, print_table, small
from teleop.output.result_tables import shown_half, with_half
from teleop.output.table_files import TextTable, shortened

OTHER_KIND = "*"
"""Mark of a b that is another physical quantity than the values of b without this mark."""


def group_table(groups: Sequence[Group], by: Sequence[str]) -> TextTable:
    """Return the table of means, with one row for each group of recordings and each method.

    A method is the batch evaluation or an online estimator. A row states the number n of recordings
    that are averaged. If a method has no value for some recordings of a group, n has a mark. A note
    below the table begins with the same mark and states the reasons.
    """
    rows, notes = [], [("", CAPTION)]
    if kinds := {kind for group in groups for kind in group.kinds[RESULT]["b"]}:
        notes.append(("", damping_note(kinds)))
    of_k = [kind for group in groups for one in group.kinds.values() for kind in one.get("k", {})]
    notes += [("", text) for text in model_notes(dict.fromkeys(of_k))]
    lags = {lag for group in groups for lag in group.force_lags}
    lost_motions = {lost for group in groups for lost in group.lost_motions}
    notes.append(("", correction_note(lags, lost_motions)))
    if where := holding_text(groups):
        notes.append(("", where))
    if averaged := dict.fromkeys(group.unit for group in groups if group.unit):
        notes.append(("", unit_note(averaged)))
    if any(group.unnamed for group in groups):
        notes.append(("", UNNAMED))
    for group in groups:
        for method, means in group.means.items():
            count = str(means["k"].recordings)
            if missing := group.missing.get(method):
                count = f"{count} {marked(notes, missing_text(method, missing))}"
            if method == RESULT and group.pooled:
                count = f"{count} {marked(notes, pooled_text(group.pooled))}"
            kinds_of = group.kinds[method]
            values = []
            for symbol, quantity in RESULTS.items():
                value = "-"
                if symbol in means:
                    value = mean_text(scaled(means[symbol], quantity.factor))
                if len(different := kinds_of.get(symbol, {})) > 1:
                    value = f"{value} {marked(notes, different_text(symbol, different))}"
                values.append(value)
            named = (", ".join(kinds_of[symbol]) or "-" for symbol in OF_RESULT)
            rows.append([*group.levels, method, *named, count, *values])
    kind_headings = (f"kind of {symbol}" for symbol in OF_RESULT)
    units = (quantity.heading for quantity in RESULTS.values())
    headings = [*by, "method", *kind_headings, "n", *units]
    return TextTable(headings, rows, len(by) + 1 + len(OF_RESULT), notes)


def published_table(groups: Sequence[Group], by: Sequence[str]) -> TextTable:
    """Return the table of `group_table` for a file, with additional notes: remarks on results."""
    table = group_table(groups, by)
    remarks = [("", text) for text in remark_texts(groups)]
    return replace(table, notes=[*table.notes, *remarks])


def marked(notes: list[tuple[str, str]], text: str) -> str:
    """Return the mark, such as (a), of a note, which is added to `notes` if it is new."""
    known = {note: mark for mark, note in notes}
    if text not in known:
        known[text] = f"({letters(sum(bool(mark) for mark, _ in notes))})"
        notes.append((known[text], text))
    return known[text]


def without_kinds(table: TextTable, by: Sequence[str]) -> TextTable:
    """Return the table of `group_table` without the kinds, which its notes state: 80 columns."""
    start, end = len(by) + 1, len(by) + 1 + len(OF_RESULT)
    headings, *rows = ([*row[:start], *row[end:]] for row in (table.headings, *table.rows))
    return TextTable(headings, rows, table.left - len(OF_RESULT), table.notes)


def tracking_table(groups: Sequence[Group], by: Sequence[str]) -> TextTable | None:
    """Return means of the tracking of the target in `mimic`; None without such a recording."""
    rows = [
        [
            *group.levels,
            str(group.tracking["gain"].recordings),
            *(mean_text(scaled(group.tracking[name], size)) for name, size in TRACKED),
        ]
        for group in groups
        if group.tracking
    ]
    headings = [*by, "n", "gain", "phase [deg]", f"error rms [{POSITION.unit}]", "frequency [Hz]"]
    return TextTable(headings, rows, len(by), [("", TRACKING_CAPTION)]) if rows else None


TRACKED = (("gain", 1.0), ("phase_deg", 1.0), ("rms_m", POSITION.factor), ("frequency_hz", 1.0))
"""Tracking values that are shown, each with the factor that converts it to the unit of its
column."""


def scaled(mean: Mean, size: float) -> Mean:
    """Return a mean and its interval, multiplied by the factor `size` to convert the unit."""
    return mean._replace(value=mean.value * size, half=mean.half * size)


def letters(index: int) -> str:
    """Return a, b, ..., z, aa, ab, ... for the indices 0, 1, ..."""
    text = ""
    while index >= 0:
        index, place = divmod(index, 26)
        text = ascii_lowercase[place] + text
        index -= 1
    return text


def mean_text(mean: Mean) -> str:
    """Return a mean and the half width of its 95 % interval as text; a dash if there is no mean."""
    if not isfinite(mean.value):
        return "-"
    return with_half(mean.value, mean.half)


def print_comparison(rows: Sequence[Compared], groups: Sequence[Group], by: Sequence[str]) -> None:
    """Print k and b of each recording, and the means over groups of recordings."""
    console = plain_console()
    pattern, names = common_part([row.file for row in rows])
    kinds = kinds_of_b(rows)
    has_tip = any(row.result.k_tip for row in rows)
    print_table(
        console,
        f"{pattern}: results, with 95 % intervals" if pattern else "results, with 95 % intervals",
        (
            "recording",
            *([f"k at the tip [{STIFFNESS.unit}]"] if has_tip else []),
            STIFFNESS.heading,
            DAMPING.heading,
            "force [N]",
            f"depth [{POSITION.unit}]",
        ),
        [
            [
                name,
                *([tip_text(row.result)] if has_tip else []),
                result_text(row, "k"),
                damping_text(row, kinds),
                *tangent_texts(row.result),
            ]
            for name, row in zip(names, rows, strict=True)
        ],
    )
    console.print("  k: tangent stiffness at this force and this depth")
    if has_tip:
        console.print("  k and b without 'at the tip': specimen and transmission in series")
    if kinds:
        console.print(f"  b: {MEANING[kinds[0]]}")
    if len(kinds) > 1:
        console.print(f"  {OTHER_KIND} b: {MEANING[kinds[1]]}, a different quantity")
    for name, row in zip(names, rows, strict=True):
        if not row.result.identifiable:
            reasons = "; ".join(row.result.reasons)
            console.print(f"  {name}: no result: {reasons}", style="yellow")
    for text in remark_lines(rows, names):
        console.print(f"  {text}", style="yellow")
    hints = [hint for row in rows if not row.result.identifiable for hint in row.result.hints]
    hints += [hint for hint, _ in shared(row.result.hints for row in rows)]
    for hint in dict.fromkeys(hints):
        console.print(f"  hint: {hint}")
    title = f"by {', '.join(by)}" if by else "all"
    print_text_table(title, without_kinds(group_table(groups, by), by))
    if tracking := tracking_table(groups, by):
        print_text_table("tracking", tracking)


def remark_lines(rows: Sequence[Compared], names: Sequence[str]) -> list[str]:
    """Return the remarks on results: shared ones once and short, the others by recording."""
    results = [(name, row.result) for name, row in zip(names, rows, strict=True)]
    results = [(name, result) for name, result in results if result.identifiable]
    counts = remark_counts(result for _, result in results)
    lines = [f"{text} ({count} recordings)" for text, count in counts.items() if count > 1]
    for name, result in results:
        if own := [text for text in result.reasons if counts[short(text)] == 1]:
            lines.append(f"{name}: {'; '.join(own)}")
    return lines


def kinds_of_b(rows: Iterable[Compared]) -> list[str]:
    """Return the kinds of b (`kind_of_b`) that occur in the results, in the order of `MEANING`."""
    found = {kind_of_b(row) for row in rows}
    return [kind for kind in MEANING if kind in found]


def kind_of_b(row: Compared) -> str | None:
    """Return which quantity b is (a key of `MEANING`); None if it is not determined."""
    value = values_of(row, RESULT).get("b")
    return value.kind if value else None


def damping_text(row: Compared, kinds: Sequence[str]) -> str:
    """Return b and its half width; marked with `OTHER_KIND` if not of the first of `kinds`."""
    text = result_text(row, "b")
    return f"{OTHER_KIND} {text}" if kind_of_b(row) in kinds[1:] else text


def shared(texts: Iterable[Iterable[str]]) -> list[tuple[str, int]]:
    """Return each text that several recordings have, with the number of these recordings."""
    counts = Counter(chain.from_iterable(texts))
    return [(text, count) for text, count in counts.items() if count > 1]


def common_part(files: Sequence[str]) -> tuple[str, list[str]]:
    """Divide the names of files into a common pattern and the part of each that differs.

    For recordings in one folder, the pattern is the folder with `*` and the ending `RECORDING`, and
    the parts are the names without ending. For other files in one folder, it is the folder, and the
    parts are the names. For files in several folders, the pattern is empty, and the parts are the
    names if all differ, and otherwise the paths.
    """
    paths = [Path(file) for file in files]
    folders = {path.parent for path in paths}
    if folders == {Path()}:
        return "", list(files)
    recorded = all(path.suffix == RECORDING for path in paths)
    names = [path.stem if recorded else path.name for path in paths]
    if len(folders) > 1:
        return "", names if len(set(names)) == len(names) else list(files)
    return str(paths[0].parent / f"*{RECORDING}" if recorded else paths[0].parent), names


def print_text_table(title: str, table: TextTable) -> None:
    """Print an empty line, then a table, and below it the notes of the table."""
    console = plain_console()
    console.print()
    rows = shortened(table.rows, table.left)
    print_table(console, title, table.headings, rows, max(table.left, 1))
    for mark, text in table.notes:
        style = "yellow" if mark or text == UNNAMED else None
        console.print("  " + " ".join(filter(None, (mark, text))), style=style)


def tip_text(result: StiffnessResult) -> str:
    """Return the stiffness at the tip and the half width of its interval; a dash if unknown."""
    if result.k_tip is None:
        return "-"
    return shown_half(STIFFNESS, result.k_tip.value, result.k_tip.high - result.k_tip.value)


def result_text(row: Compared, symbol: str) -> str:
    """Return k or b of a recording and its half width; a dash if there is no value."""
    value = values_of(row, RESULT).get(symbol)
    return shown_half(RESULTS[symbol], value.value, value.half) if value else "-"


def tangent_texts(result: StiffnessResult) -> list[str]:
    """Return force and depth at which k is evaluated as texts; dashes without k."""
    if result.force is None or result.depth is None:
        return ["-", "-"]
    return [small(result.force), small(POSITION.shown(result.depth))]
