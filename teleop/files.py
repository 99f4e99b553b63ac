"""Check output files before a command starts its work, and write them complete or not at all."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import BinaryIO

from drivers.input_file import check_regular
from teleop.errors import InputError, reason
from telepalpation import needs

PICTURES = (".png", ".svg", ".pdf")
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
    """Raise InputError if an output cannot be written or would overwrite another file.

    `sources` are files that the command reads. None stands for a file that is not used. Existing
    files are replaced only with `overwrite`, and recordings never.
    """
    if any(pictures):
        check_drawing("a figure")
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


def check_drawing(what: str) -> None:
    """Raise InputError if matplotlib, which draws the figures, is not installed."""
    if find_spec("matplotlib") is None:
        raise InputError(needs(what, "matplotlib", "plot"))


def check_ending(path: Path, ending: str) -> None:
    """Raise InputError if the name of a file does not have the given ending."""
    if path.suffix.lower() != ending:
        raise InputError(f"{path}: expected a file ending in {ending}")


def resolved(path: Path) -> str:
    """The absolute path of a file, without symbolic links."""
    try:
        return os.path.realpath(path)
    except OSError as error:  # a relative path, and the working folder no longer exists
        raise unwritable(path, error) from error


def make_folder(path: Path) -> None:
    """Create the folder in which a file is to be written, unless the folder exists."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise InputError(f"{path.parent}: is a file: expected a folder") from error
    except OSError as error:
        raise unwritable(path.parent, error) from error


@contextlib.contextmanager
def new_file(path: Path, overwrite: bool = False) -> Iterator[BinaryIO]:
    """Write a file that appears at its path only when the `with` block has ended without error.

    The yielded file is a temporary one in the same folder. It can be written and read in binary
    mode. An existing file is replaced only with `overwrite`, and a recording never.
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
    """Write a text file in UTF-8, see `new_file`."""
    with new_file(path, overwrite) as file:
        file.write(encoded(text))


def encoded(text: str) -> bytes:
    """Encode a text in UTF-8. Characters that cannot be encoded become backslash escapes."""
    return text.encode("utf-8", "backslashreplace")


def check_new(path: Path, overwrite: bool) -> None:
    """Raise InputError if a file exists and may not be replaced, or OSError if it is no file."""
    try:
        check_regular(path.stat().st_mode)
    except FileNotFoundError:
        if not path.is_symlink():
            return
    if not overwrite or path.suffix.lower() == RECORDING:
        raise exists(path)


def temporary_path(path: Path) -> Path:
    """A new path for a temporary file, in the folder of `path`."""
    return Path(os.path.realpath(path)).with_name(f".teleop-{secrets.token_hex(6)}.part")


def exists(path: Path) -> InputError:
    """The error that a file exists and may not be overwritten."""
    if path.suffix.lower() == RECORDING:
        return InputError(f"{path}: exists already: a recording is never overwritten")
    return InputError(f"{path}: exists already: expected a new file, or --overwrite")


def unreadable(path: Path, error: OSError) -> InputError:
    """The error that a file cannot be read, with the reason of the operating system."""
    return InputError(f"{path}: {reason(error)}")


def unwritable(path: Path, error: OSError) -> InputError:
    """The error that a file cannot be written, with the reason of the operating system."""
    return InputError(f"{path}: cannot be written: {reason(error)}")
