"""Text as a terminal may have it: control characters are shown, not obeyed."""

from __future__ import annotations

import os
import re
import sys

from teleop.errors import reason

LONGEST = 2000
"""Most characters of a line of complaint."""
CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f"  # but for tab and newline; with CSI, which is one character
    "\u200e\u200f\u2028-\u202e\u2066-\u2069"  # direction of writing, separators of lines
    "\ud800-\udfff]"  # bytes of a file's name that are no text
)


def printable(text: str) -> str:
    r"""The text with a backslash escape, such as \x1b, for each control character."""
    return CONTROL.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def one_line(text: str) -> str:
    """The text on one line of bounded length."""
    line = printable(" ".join(text.split()))
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 4]} ..."


def complain(text: str) -> None:
    """Print one line on standard error."""
    print("teleop:", one_line(text), file=sys.stderr)


def give_up_output(error: OSError) -> str:
    """Write nothing more to standard output, which failed; returns the line that reports it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return f"standard output: {reason(error)}"
