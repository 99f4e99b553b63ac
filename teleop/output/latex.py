"""Convert plain text to LaTeX source, for the default font encoding of LaTeX (OT1)."""

from __future__ import annotations

import re

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
