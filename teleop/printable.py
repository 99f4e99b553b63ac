"""Print text safely on a terminal, with control characters replaced by escapes."""

from __future__ import annotations

import contextlib
import os
import re
import sys
import textwrap

from teleop.errors import reason

LONGEST = 2000
"""Largest number of characters of a message that is printed as one line."""
CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f"  # all except tab and newline; \x9b is CSI
    "\u200e\u200f\u2028-\u202e\u2066-\u2069"  # writing direction, line separators
    "\ud800-\udfff]"  # bytes in a file name that are not valid text
)


def printable(text: str) -> str:
    r"""The text with control characters other than \t and \n as escapes, for example \x1b."""
    return CONTROL.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def is_unicode(text: str) -> bool:
    """Whether a text can be written as UTF-8.

    A text from the command line that is not UTF-8 contains surrogates, and cannot be written.
    """
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def one_line(text: str) -> str:
    """The text as one line of at most `LONGEST` characters, with escapes for control characters."""
    line = printable(" ".join(text.split()))
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 4]} ..."


def print_error(text: str) -> None:
    """Print a text as one line on standard error, after the name of the program, `teleop:`.

    On a terminal, the line is broken at spaces.
    """
    line = f"teleop: {one_line(text)}"
    if sys.stderr.isatty():
        with contextlib.suppress(OSError):
            line = wrapped(line, os.get_terminal_size(sys.stderr.fileno()).columns)
    print(line, file=sys.stderr)


def wrapped(text: str, width: int) -> str:
    """Break a text at spaces for a terminal of a width; 0 for an unknown width.

    Long words such as paths are not broken, so that they can be copied.
    """
    return textwrap.fill(text, width or 80, break_long_words=False, break_on_hyphens=False)


def discard_output(error: OSError) -> str:
    """Discard all further output after a write to standard output has failed; describe the error.

    Otherwise, Python writes the remaining output when it exits, which fails again.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return f"standard output: {reason(error)}"
