"""Write and check generated text files, whose checksum shows whether a person has edited them."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

from drivers.input_file import read_input


def with_checksum(text: str, writer: str) -> str:
    """Return the text with an additional first line: a comment that states writer and checksum.

    Parameters
    ----------
    text
        Text of the file.
    writer
        Command that generates the file.
    """
    return f"{first_line(text, writer)}\n{text}"


def is_unchanged(path: Path, writer: str) -> bool:
    """Return whether a file exists that `writer` has generated and nobody has edited."""
    try:
        first, _, text = read_input(path).decode().partition("\n")
    except (OSError, UnicodeDecodeError):
        return False
    return first == first_line(text, writer)


def first_line(text: str, writer: str) -> str:
    """Return the first line of a generated file: a comment that states writer and checksum."""
    digest = sha256(text.encode("utf-8", "backslashreplace")).hexdigest()[:16]
    return f"# written by {writer}, which replaces this file unless it was edited: {digest}"
