"""Print a command that a person can copy, in lines that fit the terminal."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from teleop.output.console import plain_console, terminal_width


def print_command(text: str, words: Sequence[str]) -> None:
    """Print a text and a command, on one line if the terminal is wide enough.

    Otherwise the command begins on the next line, and a backslash at the end of a line continues
    it. A shell then reads the copied lines as one command. An option and its value are on the same
    line.

    Parameters
    ----------
    text
        Text before the command. Its indentation is also that of the command.
    words
        The command, its options and their values. Words with special characters are quoted.
    """
    console, width = plain_console(), terminal_width()
    line = f"{text}: {shlex.join(words)}"
    if len(line) <= width:
        console.print(line, soft_wrap=True)
        return
    indent = " " * (len(text) - len(text.lstrip(" ")) + 2)
    console.print(f"{text}:")
    console.print(" \\\n".join(broken(words, indent, width - len(" \\"))), soft_wrap=True)


def broken(words: Sequence[str], indent: str, width: int) -> list[str]:
    """Return the lines of a command, each with an indent and at most `width` characters.

    A line is longer if a word, or an option with its value, does not fit.
    """
    parts: list[list[str]] = []
    for word in words:
        if parts and parts[-1][0].startswith("-") and not word.startswith("-"):
            parts[-1].append(word)
        else:
            parts.append([word])
    lines: list[str] = []
    for part in map(shlex.join, parts):
        if lines and len(lines[-1]) + 1 + len(part) <= width:
            lines[-1] += f" {part}"
        else:
            lines.append(f"{indent}{part}")
    return lines
