"""Errors that end a command and are reported in one line; defects are not among them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic import ValidationError


class SafetyStop(Exception):
    """The rig was stopped for safety; the message names the cause and its source."""


class InputError(Exception):
    """Bad input; the message names what, where and what was expected."""


class MissingColumn(InputError, KeyError):
    """A recording has no column of this name."""

    __str__ = Exception.__str__


@contextlib.contextmanager
def as_input_error() -> Iterator[None]:
    """Turn a ValueError within the block into an InputError of the same text."""
    try:
        yield
    except ValueError as error:
        raise InputError(str(error)) from error


def reason(error: OSError) -> str:
    """Return the cause that the operating system gives, as a part of a line."""
    text = error.strerror or str(error) or "unknown error"
    return text[:1].lower() + text[1:]


def invalid_parts(error: ValidationError) -> str:
    """Return all invalid parts of a document on one line, each with its path."""
    return "; ".join(
        f"{'.'.join(map(str, e['loc'])) or 'file'}: {e['msg'].lower()}" for e in error.errors()
    )
