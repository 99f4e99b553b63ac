"""Reason why a record gives no stiffness, or remark on its stiffness."""

from __future__ import annotations

from typing import NamedTuple


class Reason(NamedTuple):
    """Reason or remark, and what a person at a terminal can do about it."""

    text: str
    """The reason. It names no option and no command of this program, so that a paper can state
    it."""
    hint: str = ""
    """Sentence that names an option or a command; empty for none."""


INVERT_BOTH = "--invert both reverses the signs of force and position"
"""Hint for a recording that is negative in compression."""
