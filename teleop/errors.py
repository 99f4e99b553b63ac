"""Define the exceptions for invalid input and for a safety stop.

These exceptions do not mean that the program has a defect. If a command ends with one of them, only
the message of the exception is printed, without a traceback.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

from drivers.problems import value_problem

if TYPE_CHECKING:
    from pydantic import ValidationError


class SafetyStop(Exception):
    """The safety supervisor has stopped the drives.

    The message describes the fault, for example which measured value exceeded its limit.
    """


class InputError(Exception):
    """An input of the user, for example an option or a file, is not valid.

    The message states what is wrong, in which input, and what was expected.
    """


class MissingColumn(InputError, KeyError):
    """A recording has no column (recorded quantity) with the requested name."""

    __str__ = Exception.__str__


@contextlib.contextmanager
def as_input_error() -> Iterator[None]:
    """Convert a ValueError in the `with` block to an InputError with the same text."""
    try:
        yield
    except ValueError as error:
        raise InputError(str(error)) from error


def reason(error: OSError) -> str:
    """The description of the operating system for a message, such as "permission denied"."""
    text = error.strerror or str(error) or "unknown error"
    return text[:1].lower() + text[1:]


def invalid_lines(error: ValidationError) -> list[str]:
    """One line for each invalid value that pydantic found in a document: its key, the problem."""
    return [
        f"{'.'.join(map(str, part['loc'])) or 'file'}: {value_problem(part)}"
        for part in error.errors()
    ]


def invalid_parts(error: ValidationError) -> str:
    """The lines of `invalid_lines` as one line."""
    return "; ".join(invalid_lines(error))
