"""Write text in LaTeX, for the default font encoding OT1."""

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
"""Characters that have a meaning in LaTeX or print another character, and their replacements."""
TERMS = {"k''/omega": r"$k''/\omega$", "eta^2": r"$\eta^2$"}
"""Terms of mathematics, and their replacements."""
TERM = re.compile(f"(?<!\\w)({'|'.join(map(re.escape, TERMS))})(?!\\w)")
"""Pattern of a term of mathematics."""
MINUS = re.compile(r"(?<![\w-])-(?=\d)")
"""Pattern of the sign of a negative number."""
LIGATURE = re.compile("(?<=-)(?=-)|(?<=')(?=')")
"""Pattern of the place between two characters that LaTeX would print as one."""


def latex(text: str) -> str:
    r"""Return a text in LaTeX.

    If a cell of a table begins with "[" or "*", LaTeX treats the character as an option of the
    command \\ at the end of the previous row. Therefore an empty group {} is added before it.
    """
    parts = TERM.split(MINUS.sub("\u2212", text))
    found = "".join(TERMS[part] if i % 2 else escaped(part) for i, part in enumerate(parts))
    return f"{{}}{found}" if found.startswith(("[", "*")) else found


def escaped(text: str) -> str:
    """Return a text in which the characters in `CHARACTERS` are replaced.

    Empty groups {} prevent that LaTeX prints two characters, such as --, as one character.
    """
    pieces = LIGATURE.split(text)
    return "{}".join("".join(CHARACTERS.get(one, one) for one in piece) for piece in pieces)
