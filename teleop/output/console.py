"""The console: tables for a person, or one JSON document for a program."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TextIO

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from teleop.json_documents import dumps
from teleop.printable import printable

WIDTH, HEIGHT = 10_000, 25
"""Size of the console [characters]; a narrower terminal wraps the lines of a table."""


def print_json(document: Mapping[str, Any]) -> None:
    """Print a JSON document with null for each number that is not finite."""
    print(dumps(dict(document), indent=2), flush=True)


class PlainConsole(Console):
    """A console that shows control characters instead of sending them to the terminal."""

    def render_str(self, text: str, **options: Any) -> Text:
        """Return the text with escapes for its control characters."""
        return super().render_str(printable(text), **options)

    def on_broken_pipe(self) -> None:
        """Raise the BrokenPipeError. rich would exit before the rest is reported."""
        raise


def plain_console(stream: TextIO | None = None) -> Console:
    """Return a console without markup, highlighting and truncation.

    Given both width and height, rich asks neither the terminal nor the environment: it takes 80
    columns for a terminal of the type `dumb`, whatever its width is set to.
    """
    return PlainConsole(
        file=stream, highlight=False, markup=False, soft_wrap=True, width=WIDTH, height=HEIGHT
    )


def number(value: float, digits: int) -> str:
    """Return a number with separated thousands, or a dash if it is not finite."""
    return f"{value:,.{digits}f}".replace(",", " ") if math.isfinite(value) else "-"


def small(value: float) -> str:
    """Return a number of any size with three significant digits."""
    if not math.isfinite(value) or value == 0.0:
        return number(value, 3)
    return number(value, min(max(2 - math.floor(math.log10(abs(value))), 0), 9))


def print_table(
    console: Console, title: str, headings: Sequence[str], rows: Iterable[Sequence[str]]
) -> None:
    """Print a table whose first column is text and whose other columns are numbers."""
    table = Table(
        title=title or None, title_justify="left", box=box.SIMPLE_HEAD, title_style="bold"
    )
    for i, heading in enumerate(headings):
        table.add_column(heading, justify="right" if i else "left", no_wrap=True)
    for cells in rows:
        table.add_row(*cells)
    console.print(table)
