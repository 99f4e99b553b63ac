"""Print tables that compare recordings: results, means of groups, and analysis of variance."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from string import ascii_lowercase
from typing import Any

from teleop.evaluation.comparison import AVERAGE, KIND_OF_K, RESULT, Compared, Group, Mean
from teleop.evaluation.result import Result
from teleop.files import RECORDING
from teleop.output.console import plain_console, print_table
from teleop.output.result_tables import with_half
from teleop.output.table_files import TextTable, shortened
from teleop.printable import one_line

CAPTION = (
    "result: mean of the results of n recordings, which have no e_f; its k is the tangent "
    "stiffness at half of the force range. Other rows: mean of the averages of an online "
    "estimator over each record, without the count-in of mimic and the ramp at the end of "
    "autonomous; their k is the slope of a line through the datum. The two kinds of k agree only "
    "for a linear specimen. \u00b1: 95 % interval of the mean, from the spread between the "
    "recordings; for n = 1 that of the result of the recording."
)
"""Note below the table of groups that explains the rows of the table."""
TRACKING_CAPTION = (
    "Tracking of the target in mimic: mean of n recordings; \u00b1: 95 % interval of the mean."
)
POOLED = (
    "Recordings of several subjects are pooled: the interval counts the repeats of a subject as "
    "independent, and is too narrow if the subjects differ."
)
"""Note below the table of groups, if a group contains several recordings of several subjects."""
FILES_NAMED = 3
"""Largest number of files that a note lists for one reason."""


def group_table(groups: Sequence[Group], by: Sequence[str]) -> TextTable:
    """Return the table of groups, with notes and with one row for each group and method.

    If some recordings of a group have no value, the number of recordings has a mark. The note with
    this mark states the reasons.
    """
    rows, notes = [], [("", CAPTION)]
    if any(group.subjects for group in groups):
        notes.append(("", POOLED))
    for group in groups:
        for method, means in group.means.items():
            count = str(means["k"].recordings)
            if missing := group.missing.get(method):
                text = missing_text(method, missing)
                known = {note: mark for mark, note in notes}
                mark = known.get(text) or f"({letters(sum(bool(m) for m, _ in notes))})"
                if text not in known:
                    notes.append((mark, text))
                count = f"{count} {mark}"
            symbols = ("k", "b", "e_f")
            values = [mean_text(means[name]) if name in means else "-" for name in symbols]
            rows.append([*group.levels, method, KIND_OF_K.get(method, AVERAGE), count, *values])
    headings = [*by, "method", "k is", "n", "k [N/m]", "b [N s/m]", "e_f [N]"]
    return TextTable(headings, rows, len(by) + 2, notes)


def without_kind(table: TextTable, by: Sequence[str]) -> TextTable:
    """Return the table of groups without the kind of k, which the first note states as well.

    With the usual factors, the table then fits a terminal of 80 columns.
    """
    kind = len(by) + 1
    headings, *rows = ([*row[:kind], *row[kind + 1 :]] for row in (table.headings, *table.rows))
    return TextTable(headings, rows, table.left - 1, table.notes)


def tracking_table(groups: Sequence[Group], by: Sequence[str]) -> TextTable | None:
    """Return the table of tracking in the condition `mimic`, by group; None without such trials."""
    rows = [
        [
            *group.levels,
            str(group.tracking["gain"].recordings),
            *(mean_text(scaled(group.tracking[name], size)) for name, size in TRACKED),
        ]
        for group in groups
        if group.tracking
    ]
    headings = [*by, "n", "gain", "phase [deg]", "error rms [mm]", "frequency [Hz]"]
    return TextTable(headings, rows, len(by), [("", TRACKING_CAPTION)]) if rows else None


TRACKED = (("gain", 1.0), ("phase_deg", 1.0), ("rms_m", 1e3), ("frequency_hz", 1.0))
"""Tracking values that are shown, each with the factor that converts it to the unit of its
column."""


def scaled(mean: Mean, size: float) -> Mean:
    """Return a mean and its interval multiplied by `size`, to convert them to another unit."""
    return mean._replace(value=mean.value * size, half=mean.half * size)


def missing_text(method: str, missing: Mapping[str, str]) -> str:
    """Return the reasons why a method has no value for some files, with the names of the files."""
    files: dict[str, list[str]] = {}
    for file, reason in missing.items():
        files.setdefault(reason, []).append(Path(file).name)
    parts = []
    for reason, names in files.items():
        more = len(names) - FILES_NAMED
        named = ", ".join(names[:FILES_NAMED]) + (f" and {more} more" if more > 0 else "")
        parts.append(f"{reason} ({named})")
    what = "recording" if len(missing) == 1 else "recordings"
    value = RESULT if method == RESULT else "estimate"
    return one_line(f"No {value} for {len(missing)} {what}: {'; '.join(parts)}.")


def letters(index: int) -> str:
    """Return a, b, ..., z, aa, ab, ... for the indices 0, 1, ..."""
    text = ""
    while index >= 0:
        index, place = divmod(index, 26)
        text = ascii_lowercase[place] + text
        index -= 1
    return text


def mean_text(mean: Mean) -> str:
    """Return a mean with the half width of its interval; a dash if the mean is not finite."""
    if not math.isfinite(mean.value):
        return "-"
    if not math.isfinite(mean.half):
        return f"{mean.value:.4g}" if abs(mean.value) < 1e4 else f"{mean.value:.0f}"
    return with_half(mean.value, mean.half)


def print_comparison(rows: Sequence[Compared], groups: Sequence[Group], by: Sequence[str]) -> None:
    """Print the results of the recordings, and the table of groups."""
    console = plain_console()
    pattern, names = common_part([row.file for row in rows])
    print_table(
        console,
        f"{pattern}: results, with 95 % intervals" if pattern else "results, with 95 % intervals",
        ("recording", "k [N/m]", "b [N s/m]", "force [N]", "depth [mm]"),
        [
            [name, result_text(row, "k"), result_text(row, "b"), *tangent_texts(row.result)]
            for name, row in zip(names, rows, strict=True)
        ],
    )
    console.print("  k: tangent stiffness at this force and this depth")
    for name, row in zip(names, rows, strict=True):
        if not row.result.identifiable:
            reasons = "; ".join(row.result.reasons)
            console.print(f"  {name}: no result: {reasons}", style="yellow")
    for text, count in shared(row.result.reasons for row in rows if row.result.identifiable):
        console.print(f"  {text} ({count} recordings)", style="yellow")
    hints = [hint for row in rows if not row.result.identifiable for hint in row.result.hints]
    hints += [hint for hint, _ in shared(row.result.hints for row in rows)]
    for hint in dict.fromkeys(hints):
        console.print(f"  hint: {hint}")
    title = f"by {', '.join(by)}" if by else "all"
    print_text_table(title, without_kind(group_table(groups, by), by))
    if tracking := tracking_table(groups, by):
        print_text_table("tracking", tracking)


def shared(texts: Iterable[Iterable[str]]) -> list[tuple[str, int]]:
    """Return the texts that two or more recordings have, and the number of these recordings."""
    counts = Counter(chain.from_iterable(texts))
    return [(text, count) for text, count in counts.items() if count > 1]


def common_part(files: Sequence[str]) -> tuple[str, list[str]]:
    """Return a pattern of the names of files, and the part that differs.

    If all files are recordings of one folder, the pattern is the folder with `*.mcap`, and the
    parts are the names without ending. If they are other files of one folder, the pattern is the
    folder. Otherwise it is empty.
    """
    paths = [Path(file) for file in files]
    if len({path.parent for path in paths}) > 1 or str(paths[0].parent) == ".":
        return "", list(files)
    if all(path.suffix == RECORDING for path in paths):
        return str(paths[0].parent / f"*{RECORDING}"), [path.stem for path in paths]
    return str(paths[0].parent), [path.name for path in paths]


def print_text_table(title: str, table: TextTable) -> None:
    """Print an empty line, and a table with its notes."""
    console = plain_console()
    console.print()
    rows = shortened(table.rows, table.left)
    print_table(console, title, table.headings, rows, max(table.left, 1))
    for mark, text in table.notes:
        style = "yellow" if mark or text == POOLED else None
        console.print("  " + " ".join(filter(None, (mark, text))), style=style)


def result_text(row: Compared, symbol: str) -> str:
    """Return k or b (`symbol`) and the half width of its 95 % interval; a dash for no result."""
    low, value, high = (getattr(row.result, f"{symbol}{end}") for end in ("_low", "", "_high"))
    if value is None:
        return "-"
    return with_half(value, 0.5 * (high - low))


def tangent_texts(result: Result) -> list[str]:
    """Return force [N] and depth [mm] of the tangent as text; dashes for no result."""
    if result.force is None or result.depth is None:
        return ["-", "-"]
    return [f"{result.force:.3g}", f"{result.depth * 1e3:.3g}"]


def effect_cells(effects: Iterable[Mapping[str, Any]]) -> list[list[str]]:
    """Return the cells of the analysis of variance of one response, one row for each effect."""
    return [
        [
            effect["source"].replace(" x ", " \N{MULTIPLICATION SIGN} "),
            f"{effect['f']:.1f}" if effect["f"] < 1000.0 else f"{effect['f']:.0f}",
            f"{effect['degrees']}, {effect['error_degrees']}",
            "< 0.001" if effect["p"] < 0.001 else f"{effect['p']:.3f}",
            f"{effect['eta_squared']:.3f}",
            f"{effect['partial_eta_squared']:.3f}",
        ]
        for effect in effects
    ]


EFFECT_HEADINGS = ("", "F", "df", "p", "eta^2", "partial eta^2")
"""Headings of the table of an analysis of variance."""
