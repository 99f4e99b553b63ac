"""The schema of recordings: what their columns, settings and events mean."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from teleop.errors import InputError
from telepalpation import NAME

SCHEMA = 1
"""Number that a change increases after which an earlier version would misread a new recording.

A further column, setting or kind of event does not increase it, because all are read by name.
"""
KEY = "schema"
"""Key of the number in the metadata `session`. Recordings of teleop 0.1 do not have it."""


def check_schema(where: Path | str, session: Mapping[str, Any]) -> None:
    """Raise InputError if a later version of teleop wrote a recording with another schema."""
    stated = str(session.get(KEY, SCHEMA))
    if not (stated.isdecimal() and int(stated) <= SCHEMA):
        raise InputError(
            f"{where}: schema {stated[:20]} of {session.get('software', 'unknown software')}: "
            f"expected at most {SCHEMA}: pip install --upgrade {NAME}"
        )
