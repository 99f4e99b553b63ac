"""Define the option --overwrite, which is the same in all commands that can overwrite files."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

Overwrite = Annotated[
    bool,
    Parameter(
        negative="",
        help="Overwrite existing output files. Recordings are never overwritten.",
    ),
]
