"""Define the option --overwrite of every command that writes a file."""

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
