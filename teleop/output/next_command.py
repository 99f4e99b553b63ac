"""Print a shell command that the user can copy, in lines that fit the terminal."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from teleop.output.console import plain_console, terminal_width


def print_command(text: str, words: Sequence[str]) -> None:
    """Print a text and, after it, a shell command that the user can copy.

    Text and command are on one line if the terminal is wide enough. Otherwise, the command begins
    on the next line, and may be divided into several lines. Each line of the command except the
    last then ends with a backslash, so that a shell reads the copied lines as one command. An
    option and its value are on the same line.
    """
    console, width = plain_console(), terminal_width()
    line = f"{text}: {shlex.join(words)}"
    if len(line) <= width:
        console.print(line, soft_wrap=True)
        return
    indent = " " * (len(text) - len(text.lstrip(" ")) + 2)
    console.print(f"{text}:")
    lines = broken(words, indent, width)
    if len(lines) > 1:
        lines = broken(words, indent, width - len(" \\"))
    console.print(" \\\n".join(lines), soft_wrap=True)


def broken(words: Sequence[str], indent: str, width: int) -> list[str]:
    """Divide a shell command into lines with at most `width` characters, and return the lines.

    An option and its value are on the same line. A line is longer than `width` only if a single
    word, or an option with its value, is too long.
    """
    parts: list[list[str]] = []
    for word in words:
        if parts and parts[-1][0].startswith("--") and not word.startswith("--"):
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
