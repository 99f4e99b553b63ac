"""Write figures to files, and prepare texts of users, such as file names, for figures."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import IO, Any

import matplotlib as mpl
from matplotlib.figure import Figure

from estimation.figure_style import WIDTHS
from teleop.files import new_file
from teleop.printable import printable

LONGEST_TITLE = 120
"""Largest number of characters of a figure's title, so that enough room remains for the figure."""
FILES: Any = {"pdf.fonttype": 42, "svg.fonttype": "none"}
"""Settings of matplotlib: Type 42 fonts in PDF files, and text stored as text in SVG files."""


def plain(text: str) -> str:
    """Return a text, such as a file name, in a form that can be drawn in a figure.

    The result is one line. A line longer than `LONGEST_TITLE` characters is shortened. Each control
    character and each `$` is replaced by a backslash escape.
    """
    shown = printable(" ".join(text.split()))
    shown = shown if len(shown) <= LONGEST_TITLE else f"{shown[: LONGEST_TITLE - 4]} ..."
    return shown.replace("$", r"\$")


def save(figure: Figure, path: Path, overwrite: bool = False) -> None:
    """Write a figure to a file, in the format that the ending of the file name states."""
    with new_file(path, overwrite) as file:
        render(figure, file, dpi=300 if is_small(figure) else 150, format=path.suffix[1:].lower())


def is_small(figure: Figure) -> bool:
    """Return whether a figure is narrower than a figure for the screen (see `WIDTHS`).

    Narrower figures are meant for print, and are therefore saved with more pixels per inch.
    """
    return bool(figure.get_figwidth() < WIDTHS["screen"])


def render(figure: Figure, file: IO[Any], **options: Any) -> None:
    """Write a figure to an open file.

    No warning is printed if the font does not contain a character of the figure.
    """
    with warnings.catch_warnings(), mpl.rc_context(FILES):
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        figure.savefig(file, **options)
