"""A first line by which a text file shows that nobody has changed it since it was written."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

from drivers.input_file import read_input


def stamped(text: str, writer: str) -> str:
    """The text below a comment with its writer and its check sum."""
    return f"{head(text, writer)}\n{text}"


def is_unchanged(path: Path, writer: str) -> bool:
    """Whether a file is there, is of this writer, and stands as it was written."""
    try:
        first, _, text = read_input(path).decode().partition("\n")
    except (OSError, UnicodeDecodeError):
        return False
    return first == head(text, writer)


def head(text: str, writer: str) -> str:
    """The first line."""
    digest = sha256(text.encode("utf-8", "backslashreplace")).hexdigest()[:16]
    return f"# written by {writer}, which replaces this file unless it was edited: {digest}"
