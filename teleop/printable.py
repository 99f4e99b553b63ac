"""Print text safely on a terminal, with control characters replaced by escapes."""

from __future__ import annotations

import os
import re
import sys

from teleop.errors import reason

LONGEST = 2000
"""Largest number of characters of a message that is printed as one line."""
CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f"  # all except tab and newline; \x9b is CSI
    "\u200e\u200f\u2028-\u202e\u2066-\u2069"  # writing direction, line separators
    "\ud800-\udfff]"  # bytes in a file name that are not valid text
)
"""Pattern of one control character, except tab and newline."""


def printable(text: str) -> str:
    r"""Return a text in which control characters are replaced by escapes, for example \x1b.

    Tabs and line breaks (\n) are not replaced. Characters that change the writing direction are
    replaced, too.
    """
    return CONTROL.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def is_unicode(text: str) -> bool:
    """Return whether a text can be written to a file as UTF-8.

    A text from the command line that is not UTF-8 contains surrogates, and cannot be written.
    """
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def one_line(text: str) -> str:
    """Return a text as one line, with control characters replaced by escapes.

    Line breaks become spaces. A line longer than `LONGEST` characters is shortened.
    """
    line = printable(" ".join(text.split()))
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 4]} ..."


def print_error(text: str) -> None:
    """Print a text as one line on standard error, after the name of the program, `teleop:`."""
    print("teleop:", one_line(text), file=sys.stderr)


def discard_output(error: OSError) -> str:
    """Discard all further standard output, and return a message that describes an error.

    Call this function after a write to standard output has failed. Otherwise, Python writes the
    remaining output when it exits, which fails again.

    Parameters
    ----------
    error
        The error that the write to standard output raised.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return f"standard output: {reason(error)}"
