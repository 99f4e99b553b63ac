"""Files that a command is to write, checked before the work that they are to hold."""

from __future__ import annotations

import os
from pathlib import Path

from teleop.errors import InputError

PICTURES = (".png", ".svg", ".pdf")


def check_outputs(
    *outputs: Path | None, picture: Path | None = None, source: Path | None = None
) -> None:
    """Make sure that these files can be written, and that none would overwrite another.

    Parameters
    ----------
    outputs
        Files to be written; None for one that is not wanted.
    picture
        A picture to be written.
    source
        The file that is read, which must survive.

    Raises
    ------
    InputError
        A file cannot be written, would overwrite another, or a picture's ending is unknown.
    """
    if picture and picture.suffix.lower() not in PICTURES:
        raise InputError(f"{picture}: expected a file ending in {', '.join(PICTURES)}")
    taken = [Path(os.path.realpath(source))] if source else []
    for path in (*outputs, picture):
        if path is None:
            continue
        target = Path(os.path.realpath(path))
        if target in taken:
            raise InputError(f"{path}: would overwrite the recording or another output")
        taken.append(target)
        try:
            new = not target.exists()
            target.open("a").close()
            if new:
                target.unlink()
        except OSError as error:
            raise unwritable(path, error) from error


def make_folder(path: Path) -> None:
    """Create the folder of a file that is to be written.

    Raises
    ------
    InputError
        It cannot be created.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise InputError(f"{path.parent}: expected a folder, this is a file") from error
    except OSError as error:
        raise unwritable(path.parent, error) from error


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
        raise unwritable(path, error) from error


def unreadable(path: Path, error: OSError) -> InputError:
    """The one line that says why a file cannot be read."""
    return InputError(f"{path}: {(error.strerror or 'cannot be read').lower()}")


def unwritable(path: Path, error: OSError) -> InputError:
    """The one line that says why a file cannot be written."""
    return InputError(f"{path}: cannot be written: {(error.strerror or str(error)).lower()}")
