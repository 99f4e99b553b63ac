"""Files that a command is to write, checked before the work that they are to hold."""

from __future__ import annotations

from pathlib import Path

from teleop.errors import InputError

PICTURES = (".png", ".svg", ".pdf")


def check_writable(table: Path | None, picture: Path | None) -> None:
    """Make sure that a table and a picture could be written there.

    Raises
    ------
    InputError
        The folder is missing, the path is a folder, or a picture's ending is unknown.
    """
    for path in (table, picture):
        if path is None:
            continue
        if not path.parent.is_dir():
            raise InputError(f"{path}: expected an existing folder, {path.parent} is none")
        if path.is_dir():
            raise InputError(f"{path}: expected a file, this is a folder")
    if picture and picture.suffix.lower() not in PICTURES:
        raise InputError(f"{picture}: expected a file ending in {', '.join(PICTURES)}")


def write_text(path: Path, text: str) -> None:
    """Write a text file.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: {(error.strerror or 'cannot be written').lower()}") from error
