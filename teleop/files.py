"""Files that a command reads and writes: regular ones, and none is overwritten unasked."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from drivers.input_file import check_regular
from teleop.errors import InputError, reason

PICTURES = (".png", ".svg", ".pdf")
RECORDING = ".mcap"
"""Ending of a recording: it is never overwritten."""


def check_outputs(
    *outputs: Path | None,
    picture: Path | None = None,
    sources: tuple[Path | None, ...] = (),
    overwrite: bool = False,
) -> None:
    """Make sure, before the work, that these files can be written and overwrite nothing.

    Parameters
    ----------
    outputs
        Files to be written; None for one that is not wanted.
    picture
        A picture to be written.
    sources
        Files that are read, which must survive.
    overwrite
        Whether an output may replace a file of that name. A recording is never replaced.

    Raises
    ------
    InputError
        A file cannot be written, would overwrite another, or a picture's ending is unknown.
    """
    if picture and picture.suffix.lower() not in PICTURES:
        raise InputError(f"{picture}: expected a file ending in {', '.join(PICTURES)}")
    taken = {resolved(source) for source in sources if source}
    for path in (*outputs, picture):
        if path is None:
            continue
        if resolved(path) in taken:
            raise InputError(f"{path}: would overwrite an input or another output")
        taken.add(resolved(path))
        try:
            check_new(path, overwrite)
            part = beside(path)
            part.open("xb").close()
            part.unlink()
        except OSError as error:
            raise unwritable(path, error) from error


def resolved(path: Path) -> str:
    """The path without links; InputError where the working folder no longer exists."""
    try:
        return os.path.realpath(path)
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


@contextlib.contextmanager
def new_file(path: Path, overwrite: bool = False) -> Iterator[BinaryIO]:
    """Write a file that appears as a whole, or not at all.

    Parameters
    ----------
    path
        The file.
    overwrite
        Whether it may replace a file of that name.

    Yields
    ------
    A binary file that can be written and read.

    Raises
    ------
    InputError
        It cannot be written, or is there already.
    """
    part = None
    try:
        check_new(path, overwrite)
        part, target = beside(path), Path(os.path.realpath(path))
        with part.open("x+b") as file:
            yield file
        if overwrite and target.exists():
            shutil.copymode(target, part)
        elif not overwrite:
            with target.open("xb"):  # of two commands at the same time, one gets the name
                pass
        part.replace(target)
    except FileExistsError as error:
        raise exists(path) from error
    except OSError as error:
        raise unwritable(path, error) from error
    finally:
        if part:
            with contextlib.suppress(OSError):
                part.unlink()


def write_text(path: Path, text: str, overwrite: bool = False) -> None:
    """Write a text file, see `new_file`.

    Raises
    ------
    InputError
        It cannot be written, or is there already.
    """
    with new_file(path, overwrite) as file:
        file.write(text.encode("utf-8", "backslashreplace"))


def check_new(path: Path, overwrite: bool) -> None:
    """Raise OSError or InputError unless a file can be made, or replaced, under this name."""
    try:
        check_regular(path.stat().st_mode)
    except FileNotFoundError:
        if not path.is_symlink():
            return
    if not overwrite or path.suffix.lower() == RECORDING:
        raise exists(path)


def beside(path: Path) -> Path:
    """A new name for what is written, until it is whole."""
    return Path(os.path.realpath(path)).with_name(f".teleop-{secrets.token_hex(6)}.part")


def exists(path: Path) -> InputError:
    """The one line that refuses to overwrite a file."""
    if path.suffix.lower() == RECORDING:
        return InputError(f"{path}: exists already: a recording is never overwritten")
    return InputError(f"{path}: exists already: expected a new file, or --overwrite")


def unreadable(path: Path, error: OSError) -> InputError:
    """The one line that says why a file cannot be read."""
    return InputError(f"{path}: {reason(error)}")


def unwritable(path: Path, error: OSError) -> InputError:
    """The one line that says why a file cannot be written."""
    return InputError(f"{path}: cannot be written: {reason(error)}")
