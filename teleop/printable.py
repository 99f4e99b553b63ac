"""Safe text for a terminal: control characters are printed as escapes."""

from __future__ import annotations

import os
import re
import sys

from teleop.errors import reason

LONGEST = 2000
"""Largest number of characters of a message."""
CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f"  # all except tab and newline; \x9b is CSI
    "\u200e\u200f\u2028-\u202e\u2066-\u2069"  # writing direction, line separators
    "\ud800-\udfff]"  # bytes of a file name that are not valid text
)
"""Control characters."""


def printable(text: str) -> str:
    r"""Return a text with a backslash escape, such as \x1b, for each control character."""
    return CONTROL.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def one_line(text: str) -> str:
    """Return a text on one line of at most `LONGEST` characters."""
    line = printable(" ".join(text.split()))
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 4]} ..."


def print_error(text: str) -> None:
    """Print one line, which begins with `teleop:`, on standard error."""
    print("teleop:", one_line(text), file=sys.stderr)


def discard_output(error: OSError) -> str:
    """Discard all further standard output, and return the message that reports its error.

    Called after a write to standard output failed.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return f"standard output: {reason(error)}"
