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
    """Convert a ValueError that the code in a `with` block raises to an InputError.

    The text of the error stays the same. Usage: `with as_input_error(): ...`

    Raises
    ------
    InputError
        The code in the `with` block raised a ValueError.
    """
    try:
        yield
    except ValueError as error:
        raise InputError(str(error)) from error


def reason(error: OSError) -> str:
    """Return a text that describes an error of the operating system, to be used in a message.

    It is the description that the operating system gives, for example "permission denied". Its
    first letter is in lower case.
    """
    text = error.strerror or str(error) or "unknown error"
    return text[:1].lower() + text[1:]


def invalid_lines(error: ValidationError) -> list[str]:
    """Return one line of text for each invalid value that pydantic found in a document.

    Each line states the key of the value, and the problem.

    Parameters
    ----------
    error
        Error that pydantic raised when it checked the document, for example the content of a file.
    """
    return [
        f"{'.'.join(map(str, part['loc'])) or 'file'}: {value_problem(part)}"
        for part in error.errors()
    ]


def invalid_parts(error: ValidationError) -> str:
    """Return one text that describes all invalid values that pydantic found in a document.

    The text contains the lines of `invalid_lines`, separated by semicolons.

    Parameters
    ----------
    error
        Error that pydantic raised when it checked the document.
    """
    return "; ".join(invalid_lines(error))
