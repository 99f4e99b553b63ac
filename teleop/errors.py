"""Define the exceptions for bad input and for a safety stop.

They are not errors in the program (bugs). A command that ends with such an exception prints its
message without a traceback.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

from drivers.problems import value_problem

if TYPE_CHECKING:
    from pydantic import ValidationError


class SafetyStop(Exception):
    """The safety supervisor has stopped the rig. The message names the fault and its source."""


class InputError(Exception):
    """The input is not valid. The message states what is wrong, where, and what was expected."""


class MissingColumn(InputError, KeyError):
    """A recording has no column with the requested name."""

    __str__ = Exception.__str__


@contextlib.contextmanager
def as_input_error() -> Iterator[None]:
    """Convert a ValueError within a `with` block to an InputError with the same text.

    Raises
    ------
    InputError
        A ValueError was raised within the `with` block.
    """
    try:
        yield
    except ValueError as error:
        raise InputError(str(error)) from error


def reason(error: OSError) -> str:
    """Return the operating system's description of an error, as a part of a message."""
    text = error.strerror or str(error) or "unknown error"
    return text[:1].lower() + text[1:]


def invalid_lines(error: ValidationError) -> list[str]:
    """Return a line for each invalid item of a document, with its key and its problem.

    Parameters
    ----------
    error
        Error of pydantic, which checked the document.
    """
    return [
        f"{'.'.join(map(str, part['loc'])) or 'file'}: {value_problem(part)}"
        for part in error.errors()
    ]


def invalid_parts(error: ValidationError) -> str:
    """Return the lines of `invalid_lines` as one line."""
    return "; ".join(invalid_lines(error))
