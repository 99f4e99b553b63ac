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

UNIT = re.compile(
    r"(?<=\d) (?:N s/m|N/m|mm/s|m/s|[mµ]?m|m?s|min|[mk]?N|[kM]?Hz|g|kg|[mM]?J|[mM]?V|m?A|m?W|"
    r"deg|%|[kMG]B|bytes)(?!\w)"
)
"""Pattern of a unit after a number, with the space between them. No line is broken in it."""
NO_BREAK = "\ue000"
"""Private character that replaces a space between a number and its unit, while lines are broken."""


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
            line = wrapped(line, os.get_terminal_size(sys.stderr.fileno()).columns or 80)
    print(line, file=sys.stderr)


def wrapped(text: str, width: int) -> str:
    """Break each line of a text that is longer than `width` characters into several lines.

    A line is broken only between words, and never between a number and its unit. A single word that
    is longer than `width` is not broken.
    """
    lines = []
    for line in text.split("\n"):
        indent = line[: len(line) - len(line.lstrip(" "))]
        lines += (
            textwrap.wrap(
                UNIT.sub(lambda unit: unit[0].replace(" ", NO_BREAK), line),
                max(width, len(indent) + 1),
                subsequent_indent=f"{indent}  " if indent else "",
                break_long_words=False,
                break_on_hyphens=False,
            )
            if len(line) > width
            else [line]
        )
    return "\n".join(lines).replace(NO_BREAK, " ")


def discard_output(error: OSError) -> str:
    """Discard all further output after a write to standard output has failed; describe the error.

    Otherwise, Python writes the remaining output when it exits, which fails again.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return f"standard output: {reason(error)}"
