"""Check and write output files, which are overwritten only on request.

The files are checked before a command starts its work. A new file appears at its path only when it
is complete.
"""

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
"""Endings of the names of picture files."""
RECORDING = ".mcap"
"""Ending of the names of recordings, which are never overwritten."""
FAULT_REPORT = ".fault"
"""Ending of the folder with the report on a safety stop."""


def check_outputs(
    *outputs: Path | None,
    pictures: tuple[Path | None, ...] = (),
    sources: tuple[Path | None, ...] = (),
    overwrite: bool = False,
) -> None:
    """Check, before a command starts its work, that its output files can be written.

    Parameters
    ----------
    outputs
        Files to be written; None for an output that was not requested.
    pictures
        Picture files to be written; None for a picture that was not requested.
    sources
        Files that the command reads. No output may overwrite them. None for an input that is not
        used.
    overwrite
        Whether an output may replace an existing file. A recording is never replaced.

    Raises
    ------
    InputError
        A file cannot be written or would overwrite another file. The ending of a picture is
        unknown.
    """
    for picture in pictures:
        if picture and picture.suffix.lower() not in PICTURES:
            raise InputError(f"{picture}: expected a file ending in {', '.join(PICTURES)}")
    try:
        taken = {os.path.realpath(source) for source in sources if source}
    except OSError as error:  # the working folder no longer exists
        raise InputError(f"the working folder: {reason(error)}") from error
    for path in (*outputs, *pictures):
        if path is None:
            continue
        if resolved(path) in taken:
            raise InputError(f"{path}: would overwrite an input or another output")
        taken.add(resolved(path))
        try:
            check_new(path, overwrite)
            part = temporary_path(path)
            part.open("xb").close()
            part.unlink()
        except OSError as error:
            raise unwritable(path, error) from error


def check_ending(path: Path, ending: str) -> None:
    """Raise InputError if the name of a file does not have the given ending."""
    if path.suffix.lower() != ending:
        raise InputError(f"{path}: expected a file ending in {ending}")


def resolved(path: Path) -> str:
    """Return the absolute path of a file, without symbolic links.

    Raises
    ------
    InputError
        The path is relative, and the working folder no longer exists.
    """
    try:
        return os.path.realpath(path)
    except OSError as error:
        raise unwritable(path, error) from error


def make_folder(path: Path) -> None:
    """Create the folder in which a file is to be written, unless the folder exists.

    Parameters
    ----------
    path
        Path of the file.

    Raises
    ------
    InputError
        The folder cannot be created.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise InputError(f"{path.parent}: is a file: expected a folder") from error
    except OSError as error:
        raise unwritable(path.parent, error) from error


@contextlib.contextmanager
def new_file(path: Path, overwrite: bool = False) -> Iterator[BinaryIO]:
    """Write a file that appears at its path only when it is complete.

    Until the end of the `with` block, the data are in a temporary file in the same folder. After an
    exception in the block, the temporary file is removed, and no file appears.

    Parameters
    ----------
    path
        The file.
    overwrite
        Whether to replace an existing file. A recording is never replaced.

    Yields
    ------
    The temporary file, which can be written and read in binary mode.

    Raises
    ------
    InputError
        The file cannot be written, or exists and may not be overwritten.
    """
    part = None
    try:
        check_new(path, overwrite)
        part, target = temporary_path(path), Path(os.path.realpath(path))
        with part.open("x+b") as file:
            yield file
        if overwrite and target.exists():
            shutil.copymode(target, part)
        elif not overwrite:
            with target.open("xb"):  # fails if another command has created the file in between
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
    """Write a text file in UTF-8, which appears at its path only when it is complete.

    Parameters
    ----------
    path
        Path of the file.
    text
        Content of the file.
    overwrite
        Whether to replace an existing file. A recording is never replaced.

    Raises
    ------
    InputError
        The file cannot be written, or exists and may not be overwritten.
    """
    with new_file(path, overwrite) as file:
        file.write(encoded(text))


def encoded(text: str) -> bytes:
    """Encode a text in UTF-8. Characters that cannot be encoded become backslash escapes."""
    return text.encode("utf-8", "backslashreplace")


def check_new(path: Path, overwrite: bool) -> None:
    """Raise an error if a file exists at a path and may not be replaced.

    Raises
    ------
    InputError
        The file exists, and `overwrite` is False or the file is a recording.
    OSError
        The path exists but is not a regular file, or cannot be accessed.
    """
    try:
        check_regular(path.stat().st_mode)
    except FileNotFoundError:
        if not path.is_symlink():
            return
    if not overwrite or path.suffix.lower() == RECORDING:
        raise exists(path)


def temporary_path(path: Path) -> Path:
    """Return a new path for a temporary file, in the folder of `path`."""
    return Path(os.path.realpath(path)).with_name(f".teleop-{secrets.token_hex(6)}.part")


def exists(path: Path) -> InputError:
    """Return the error with the message that a file exists already and may not be overwritten."""
    if path.suffix.lower() == RECORDING:
        return InputError(f"{path}: exists already: a recording is never overwritten")
    return InputError(f"{path}: exists already: expected a new file, or --overwrite")


def unreadable(path: Path, error: OSError) -> InputError:
    """Return an error with the message why a file cannot be read.

    Parameters
    ----------
    path
        Path of the file.
    error
        Exception of the operating system, which contains the reason.
    """
    return InputError(f"{path}: {reason(error)}")


def unwritable(path: Path, error: OSError) -> InputError:
    """Return an error with the message that a file cannot be written, and why.

    Parameters
    ----------
    path
        Path of the file.
    error
        Exception of the operating system, which contains the reason.
    """
    return InputError(f"{path}: cannot be written: {reason(error)}")
