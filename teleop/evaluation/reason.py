"""Define a message about a record: the reason why its stiffness is not reported, or a remark."""

from __future__ import annotations

from typing import NamedTuple


class Reason(NamedTuple):
    """Reason why the stiffness of a record is not reported, or remark on a reported stiffness."""

    text: str
    """The reason or remark. It names no option and no command of this program, so that it can be
    copied into a paper."""
    hint: str = ""
    """Sentence that names an option or a command with which the user can act on the reason. It is
    empty if there is none."""


INVERT_BOTH = "--invert both reverses the signs of force and position"
"""Hint for a recording in which force and position are negative in compression."""
