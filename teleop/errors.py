"""Errors other than defects: they end a command and are reported in one line."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic import ValidationError


class SafetyStop(Exception):
    """The safety supervisor stopped the rig; the message names the fault and its source."""


class InputError(Exception):
    """Bad input; the message names the problem, its place, and what was expected."""


class MissingColumn(InputError, KeyError):
    """A recording has no column of the requested name."""

    __str__ = Exception.__str__


@contextlib.contextmanager
def as_input_error() -> Iterator[None]:
    """Convert a ValueError within the block to an InputError with the same text.

    Raises
    ------
    InputError
        A ValueError was raised within the block.
    """
    try:
        yield
    except ValueError as error:
        raise InputError(str(error)) from error


def reason(error: OSError) -> str:
    """Return the operating system's text for an error, for use within a message."""
    text = error.strerror or str(error) or "unknown error"
    return text[:1].lower() + text[1:]


def invalid_parts(error: ValidationError) -> str:
    """Return a line that lists each invalid item of a document with its path and the problem."""
    return "; ".join(
        f"{'.'.join(map(str, e['loc'])) or 'file'}: {e['msg'].lower()}" for e in error.errors()
    )
