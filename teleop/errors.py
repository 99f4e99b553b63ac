"""What ends a command other than a defect, reported in one line."""

from __future__ import annotations


class SafetyStop(Exception):
    """The rig was stopped for safety; the message names what was wrong, and where."""


class InputError(Exception):
    """Bad input from outside; the message names what, where and what was expected."""


class MissingColumn(InputError, KeyError):
    """A recording has no column of this name."""

    __str__ = Exception.__str__


def reason(error: OSError) -> str:
    """The cause that the system gives, to stand within a line."""
    text = error.strerror or str(error) or "unknown error"
    return text[:1].lower() + text[1:]
