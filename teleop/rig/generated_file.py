"""Text files with a checksum in the first line, which shows whether they were edited."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

from drivers.input_file import read_input


def with_checksum(text: str, writer: str) -> str:
    """Return a text with a first line that names the writer and the checksum of the text."""
    return f"{first_line(text, writer)}\n{text}"


def is_unchanged(path: Path, writer: str) -> bool:
    """Return whether a file exists, is from this writer, and was not edited since."""
    try:
        first, _, text = read_input(path).decode().partition("\n")
    except (OSError, UnicodeDecodeError):
        return False
    return first == first_line(text, writer)


def first_line(text: str, writer: str) -> str:
    """Return the first line: a comment with the writer and the checksum of the text."""
    digest = sha256(text.encode("utf-8", "backslashreplace")).hexdigest()[:16]
    return f"# written by {writer}, which replaces this file unless it was edited: {digest}"
