"""Write tables to files: CSV, LaTeX with booktabs, and Markdown."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from teleop.errors import InputError
from teleop.files import write_text

ENDINGS = (".csv", ".tex", ".md")
"""Extensions of the file formats for tables."""
LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "\u00b1": r"$\pm$",
    "\u00d7": r"$\times$",
    "\u2212": "$-$",
}
"""Characters with a meaning in LaTeX, and their replacements."""


def check_table_ending(path: Path) -> None:
    """Check that the extension of a file is that of a format for tables.

    Raises
    ------
    InputError
        The extension is not one of `ENDINGS`.
    """
    if path.suffix.lower() not in ENDINGS:
        raise InputError(f"{path}: expected a file ending in {', '.join(ENDINGS)}")


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return rows as CSV. The headings are the keys of the first row; None is an empty cell."""
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, fieldnames=[*rows[0]] if rows else [])
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def latex_text(headings: Sequence[str], rows: Sequence[Sequence[str]], left: int) -> str:
    """Return a table as a LaTeX tabular, with rules of the package booktabs.

    Parameters
    ----------
    headings, rows
        Text of the cells.
    left
        Number of columns, from the first, that are aligned to the left. In these columns, except
        the last of them, text that is the same as in the row above is left out. A rule separates
        rows that differ in the first column.
    """
    lines = [
        "% \\usepackage{booktabs}",
        f"\\begin{{tabular}}{{{'l' * left}{'r' * (len(headings) - left)}}}",
        "\\toprule",
        " & ".join(map(latex, headings)) + r" \\",
        "\\midrule",
    ]
    first = [row[0] for row in rows]
    for i, row in enumerate(shortened(rows, left)):
        if i and left > 1 and first[i] != first[i - 1]:
            lines.append("\\midrule")
        lines.append(" & ".join(map(latex, row)) + r" \\")
    return "\n".join([*lines, "\\bottomrule", "\\end{tabular}", ""])


def markdown_text(headings: Sequence[str], rows: Sequence[Sequence[str]], left: int) -> str:
    """Return a table of Markdown; for the parameters see `latex_text`."""
    cells = [[cell.replace("|", "\\|") for cell in row] for row in (headings, *rows)]
    rule = [":--" if i < left else "--:" for i in range(len(headings))]
    lines = [cells[0], rule, *cells[1:]]
    return "".join(f"| {' | '.join(row)} |\n" for row in lines)


def shortened(rows: Sequence[Sequence[str]], left: int) -> list[list[str]]:
    """Return rows in which repeated cells at the left are empty.

    A cell is left out if it and all cells to its left are the same as in the row above. The last
    of the `left` columns, and the columns after it, are not changed.
    """
    found = []
    for i, row in enumerate(rows):
        same = 0
        while i and same < left - 1 and row[same] == rows[i - 1][same]:
            same += 1
        found.append([""] * same + [*row[same:]])
    return found


def latex(text: str) -> str:
    """Return a text with replacements for the characters that have a special meaning in LaTeX."""
    return "".join(LATEX.get(character, character) for character in text)


def write_table_file(
    path: Path,
    tidy: Sequence[Mapping[str, Any]],
    headings: Sequence[str],
    rows: Sequence[Sequence[str]],
    left: int,
    overwrite: bool = False,
) -> None:
    """Write a table to a file, in the format that the extension of the file selects.

    Parameters
    ----------
    path
        The file, whose extension is one of `ENDINGS`.
    tidy
        Rows that are written to a CSV file: values by column.
    headings, rows, left
        Table that is written to a LaTeX or Markdown file; see `latex_text`.
    overwrite
        Whether to overwrite an existing file.

    Raises
    ------
    InputError
        The file cannot be written, or exists and may not be overwritten.
    """
    if path.suffix.lower() == ".csv":
        text = csv_text(tidy)
    elif path.suffix.lower() == ".tex":
        text = latex_text(headings, rows, left)
    else:
        text = markdown_text(headings, rows, left)
    write_text(path, text, overwrite)
