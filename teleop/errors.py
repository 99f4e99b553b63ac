"""Bad input: what a person can put right, told in one line."""

from __future__ import annotations


class InputError(Exception):
    """Bad input from outside; the message names what, where and what was expected."""
