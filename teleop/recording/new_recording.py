"""Create a new file for a recording, in a folder whose name is the present date."""

from __future__ import annotations

import re
from datetime import datetime
from itertools import count
from pathlib import Path

from teleop.files import unwritable

LONGEST = 60
"""Largest number of characters of condition and specimen together in the file name."""


def new_recording(condition: str, specimen: str) -> Path:
    """Create an empty file with a new name in the folder `recordings/DATE`, and return its path.

    Two trials that start at the same time get different files. The name consists of time, condition
    and specimen, with `-` for characters other than letters, digits, `_`, `.` and `-`.
    """
    name = re.sub(r"[^\w.-]+", "-", f"{condition}-{specimen}").strip("-.")[:LONGEST]
    now = datetime.now()
    folder = Path("recordings") / f"{now:%Y-%m-%d}"
    for number in count(1):
        suffix = f"-{number}" if number > 1 else ""
        path = folder / f"{now:%H%M%S}-{name}{suffix}.mcap"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            path.open("x").close()
        except FileExistsError as error:
            if not path.exists():
                raise unwritable(folder, error) from error
        except OSError as error:
            raise unwritable(path, error) from error
        else:
            return path
    raise AssertionError
