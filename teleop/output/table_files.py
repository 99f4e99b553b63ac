"""Write tables to files: CSV, LaTeX with the package booktabs, and Markdown."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from teleop.errors import InputError
from teleop.files import write_text
from teleop.software import software

ENDINGS = (".csv", ".tex", ".md")
"""Endings of the names of table files."""
MARKDOWN = re.compile(r"[\\`*_\[\]<>|#~]")
"""Pattern of one character with a meaning in Markdown."""


@dataclass(frozen=True)
class TextTable:
    """A table whose cells contain text, with headings and notes."""

    headings: Sequence[str]
    """Headings of the columns."""
    rows: Sequence[Sequence[str]]
    """Text of the cells."""
    left: int
    """Number of columns that are aligned to the left; they are the first columns of the table. In a
    LaTeX table, repeated texts in these columns are omitted (see `shortened`)."""
    notes: Sequence[tuple[str, str]] = ()
    """Mark and text of each note below the table. The cell to which a note refers contains the same
    mark. The mark is empty if the note refers to the whole table."""


def check_table_ending(path: Path) -> None:
    """Check that a file name ends with one of the endings of table files, `ENDINGS`."""
    if path.suffix.lower() not in ENDINGS:
        raise InputError(f"{path}: expected a file ending in {', '.join(ENDINGS)}")


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return rows as CSV text, with the keys of the first row as headings."""
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, fieldnames=[*rows[0]] if rows else [])
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def latex_text(table: TextTable) -> str:
    """Return a table as LaTeX source: the environment `tabular` with lines of the package booktabs.

    The notes are written with the package threeparttable. If more than one column is aligned to the
    left, a horizontal line separates successive rows with different texts in the first column.
    """
    left, columns = table.left, len(table.headings)
    lines = [
        f"\\begin{{tabular}}{{{'l' * left}{'r' * (columns - left)}}}",
        "\\toprule",
        " & ".join(map(latex, table.headings)) + r" \\",
        "\\midrule",
    ]
    first = [row[0] for row in table.rows]
    for i, row in enumerate(shortened(table.rows, left)):
        if i and left > 1 and first[i] != first[i - 1]:
            lines.append("\\midrule")
        lines.append(" & ".join(map(latex, row)) + r" \\")
    lines += ["\\bottomrule", "\\end{tabular}"]
    if not table.notes:
        return "\n".join(["% \\usepackage{booktabs}", *lines, ""])
    notes = ["\\begin{tablenotes}\\footnotesize"]
    for mark, text in table.notes:
        notes.append(f"\\item[{mark}] {latex(text)}" if mark else f"\\item {latex(text)}")
    return "\n".join(
        [
            "% \\usepackage{booktabs,threeparttable}",
            "\\begin{threeparttable}",
            *lines,
            *notes,
            "\\end{tablenotes}",
            "\\end{threeparttable}",
            "",
        ]
    )


def markdown_text(table: TextTable) -> str:
    """Return a table as Markdown text. Its notes are paragraphs below the table."""
    headings, columns = table.headings, len(table.headings)
    cells = [[markdown(cell) for cell in row] for row in (headings, *table.rows)]
    rule = [":--" if i < table.left else "--:" for i in range(columns)]
    rows = [f"| {' | '.join(row)} |\n" for row in (cells[0], rule, *cells[1:])]
    notes = [f"\n{markdown(' '.join(filter(None, note)))}\n" for note in table.notes]
    return "".join([*rows, *notes])


def markdown(text: str) -> str:
    """Return a text with a backslash before each character that has a meaning in Markdown."""
    return MARKDOWN.sub(r"\\\g<0>", text)


def shortened(rows: Sequence[Sequence[str]], left: int) -> list[list[str]]:
    """Return rows with empty cells instead of texts that repeat those of the row above.

    This concerns the first `left` columns, except the last of them. A cell is emptied only if all
    cells to its left are also repeated.
    """
    found = []
    for i, row in enumerate(rows):
        same = 0
        while i and same < left - 1 and row[same] == rows[i - 1][same]:
            same += 1
        found.append([""] * same + [*row[same:]])
    return found


def write_table_file(
    path: Path,
    tidy: Sequence[Mapping[str, Any]],
    tables: Sequence[TextTable],
    overwrite: bool = False,
) -> None:
    """Write results to a CSV file (`tidy` rows), or to LaTeX or Markdown (`tables`).

    The file states the software: CSV in the last column, the others in a comment.
    """
    by = f"teleop {software()}"
    if path.suffix.lower() == ".csv":
        text = csv_text([{**row, "software": by} for row in tidy])
    elif path.suffix.lower() == ".tex":
        text = "\n".join([*map(latex_text, tables), f"% {by}\n"])
    else:
        text = "\n".join([*map(markdown_text, tables), f"<!-- {by} -->\n"])
    write_text(path, text, overwrite)


CHARACTERS = {
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
    "`": r"\`{}",
    '"': "{''}",
    "|": "$|$",
    "<": "$<$",
    ">": "$>$",
    "\u00b1": r"$\pm$",
    "\u00d7": r"$\times$",
    "\u2212": "$-$",
}
"""Replacements of characters that LaTeX treats as commands or prints as other characters."""
TERMS = {"k''/omega": r"$k''/\omega$", "eta^2": r"$\eta^2$"}
"""Terms of mathematics, and their replacements."""
TERM = re.compile(f"(?<!\\w)({'|'.join(map(re.escape, TERMS))})(?!\\w)")
"""Pattern of a term of mathematics."""
MINUS = re.compile(r"(?<![\w-])-(?=\d)")
"""Pattern of the sign of a negative number."""
LIGATURE = re.compile("(?<=-)(?=-)|(?<=')(?=')")
"""Pattern of the place between two characters that LaTeX would print as one, for example --."""


def latex(text: str) -> str:
    r"""Return a plain text as LaTeX source.

    The text may be a cell of a table. If the first cell of a row begins with "[" or "*", LaTeX
    treats this character as an option of the command \\ that ends the previous row. To prevent
    this, an empty group {} is added before the character.
    """
    parts = TERM.split(MINUS.sub("\u2212", text))
    found = "".join(TERMS[part] if i % 2 else escaped(part) for i, part in enumerate(parts))
    return f"{{}}{found}" if found.startswith(("[", "*")) else found


def escaped(text: str) -> str:
    """Replace the characters of a plain text that LaTeX would not print as they are.

    `CHARACTERS` contains these characters and their replacements. In addition, LaTeX prints some
    pairs of characters, for example --, as one character (a ligature). An empty group {} between
    the two characters prevents this.
    """
    pieces = LIGATURE.split(text)
    return "{}".join("".join(CHARACTERS.get(one, one) for one in piece) for piece in pieces)
