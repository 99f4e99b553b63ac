"""Print results to the console: tables for a person, or one JSON document for a program."""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TextIO, cast

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from teleop.json_documents import dumps
from teleop.printable import printable, wrapped

WIDTH, HEIGHT = 10_000, 25
"""Width and height of the console that the library rich assumes [characters]."""
BREAK = re.compile(r" (?=\[)| (?=[^ ]*$)|(/)")
"""Pattern of the places where a heading is divided into two lines: before the unit or the last
word, or after a slash."""
BORDERS = 3
"""Number of characters between the texts of two adjacent columns of a table."""


def terminal_width() -> int:
    """Return the width of the terminal [characters].

    If the output is not a terminal, return `WIDTH`, which is so large that no line is broken.
    """
    return shutil.get_terminal_size((0, 0)).columns or WIDTH


def print_json(document: Mapping[str, Any]) -> None:
    """Print a JSON document, with null instead of each number that is not finite."""
    print(dumps(dict(document), indent=2), flush=True)


class PlainConsole(Console):
    """A console of the library rich that prints text safely and without broken words.

    Control characters are printed as backslash escapes. Long lines are broken only between words.
    """

    def print(self, *objects: Any, **options: Any) -> None:
        """Print objects. Break lines wider than the terminal, unless `soft_wrap` is true."""
        width = WIDTH if options.get("soft_wrap") else terminal_width()
        shown = (wrapped(one, width) if isinstance(one, str) else one for one in objects)
        super().print(*shown, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """Return a text in which backslash escapes replace the control characters.

        The library rich calls this method for each text that it prints.
        """
        return super().render_str(printable(text), **options)

    def on_broken_pipe(self) -> None:
        """Raise the present BrokenPipeError again, so that the program can handle it.

        The library rich calls this method if nothing reads the output any more. The method of rich,
        which this one replaces, would end the program.
        """
        raise


def plain_console(stream: TextIO | None = None) -> Console:
    """Return a console of the library rich that interprets no markup in texts, such as "[bold]".

    The console does not highlight or shorten texts. Width and height are given to the library rich,
    so that rich does not read them from the terminal or from environment variables. For a terminal
    of the type `dumb`, rich would assume 80 columns, even if the variable COLUMNS has another
    value.
    """
    return PlainConsole(
        file=stream, highlight=False, markup=False, soft_wrap=True, width=WIDTH, height=HEIGHT
    )


def number(value: float, digits: int) -> str:
    """Return a number as text with `digits` decimals; a dash for a number that is not finite."""
    if not math.isfinite(value):
        return "-"
    return f"{round(value, digits) + 0.0:.{digits}f}"  # 0 instead of -0


def small(value: float, digits: int = 3) -> str:
    """Return a number as text with `digits` significant digits; a dash if it is not finite.

    Zeros at the end are kept, so that all numbers of a column have the same precision. A large
    number is rounded to an integer, and then has more significant digits. A very small number has
    fewer, because the number of decimals is limited.
    """
    if not math.isfinite(value) or value == 0.0:
        return number(value, digits)
    return number(value, min(max(digits - 1 - math.floor(math.log10(abs(value))), 0), digits + 6))


def print_table(
    console: Console,
    title: str,
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    left: int = 1,
    lines: bool = True,
) -> None:
    """Print a table. A table that is too wide for the terminal is divided.

    The parameters are those of `fitting_tables`.
    """
    for part in fitting_tables(title, headings, rows, left, lines=lines):
        console.print(part)


class TrimmedTable(Table):
    """A table of the library rich that is printed without spaces at the ends of its lines.

    If a line fills the whole width of the terminal, an additional space at its end would cause an
    empty line.
    """

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the parts of the printed table, line by line.

        The library rich calls this method to print the table. A part (segment) is a text in one
        style.
        """
        segments = cast(Iterable[Segment], super().__rich_console__(console, options))
        for line in Segment.split_lines(segments):
            while line and not line[-1].text.rstrip():
                line.pop()
            if line:
                text, style, control = line.pop()
                line.append(Segment(text.rstrip(), style, control))
            yield from line
            yield Segment.line()


def fitting_tables(
    title: str,
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    left: int = 1,
    styles: Sequence[str] = (),
    lines: bool = True,
) -> list[TrimmedTable | str]:
    """Return a table in a form that fits the width of the terminal: tables, and lines below them.

    With `lines`, there is a line below the headings, and an empty line above and below the table.

    If the table is too wide, it is changed in three steps until it fits:

    1. The headings are divided into two lines.
    2. If the columns with text leave no space for a column with numbers, each text in the widest
       column with text is replaced by a number. Lines below the tables explain these numbers. The
       step is repeated with the next column, if necessary.
    3. The columns are divided between several tables.
    """
    cells = [list(row) for row in rows]
    width = terminal_width()
    names = list(headings)
    legend: list[str] = []
    found: list[TrimmedTable | str] = []
    if total(widths(names, cells)) > width:
        names = [BREAK.sub(lambda found: (found[1] or "") + "\n", name, count=1) for name in names]
    texts = set(range(left))
    while texts:
        needed = widths(names, cells)
        if total([*needed[:left], max(needed[left:], default=0)]) <= width:
            break
        widest = max(texts, key=needed.__getitem__)
        texts.discard(widest)
        numbers = numbered(row[widest] for row in cells)
        column = f"{headings[widest]} " if left > 1 else ""
        legend += [f"  {column}{number}: {text}" for text, number in numbers.items()]
        for row in cells:
            row[widest] = numbers.get(row[widest], "")
    for part in parts(widths(names, cells), left, width):
        table = TrimmedTable(
            title=title or None,
            title_justify="left",
            box=box.SIMPLE_HEAD if lines else None,
            title_style="bold",
            padding=(0, 1) if lines else (0, 1, 0, 2),
        )
        for i in part:
            table.add_column(names[i], justify="right" if i >= left else "left", no_wrap=True)
        for row, style in zip(cells, styles or [""] * len(cells), strict=True):
            table.add_row(*(row[i] for i in part), style=style)
        found.append(table)
        title = ""
    return [*found, *legend]


def numbered(texts: Iterable[str]) -> dict[str, str]:
    """Number the distinct texts that are not empty from "1", and return the numbers by text."""
    distinct = dict.fromkeys(text for text in texts if text)
    return {text: str(number) for number, text in enumerate(distinct, start=1)}


def widths(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[int]:
    """Return the width of each column of a table [characters], as its longest text requires."""
    lines = [heading.split("\n") for heading in headings]
    return [
        max(cell_len(printable(text)) for text in (*lines[i], *(row[i] for row in rows)))
        for i in range(len(headings))
    ]


def total(columns: Sequence[int]) -> int:
    """Return the width of a table with its borders [characters] from the widths of its columns."""
    return sum(columns) + BORDERS * len(columns)


def parts(columns: Sequence[int], left: int, width: int) -> list[list[int]]:
    """Return the indices of the columns of each part of a table wider than `width` [characters].

    The first `left` columns are in each part.
    """
    first = list(range(left))
    found = [first[:]]
    for i in range(left, len(columns)):
        if len(found[-1]) > left and total([columns[j] for j in [*found[-1], i]]) > width:
            found.append(first[:])
        found[-1].append(i)
    return found
