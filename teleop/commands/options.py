"""Groups of options in the help of the commands, and options that several commands share.

Options that belong together are the fields of a dataclass, such as `TrialOptions`. The text under a
field is its help. A command has one parameter for the dataclass, whose type is annotated with
`Parameter(name="*", group=...)`: cyclopts then makes an option of each field.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Group, Parameter

from teleop.names import WidthName

TITLES = (
    "Trial",
    "Live page",
    "Control",
    "Columns of a file",
    "Estimation",
    "Elastic modulus",
    "Groups",
    "Output",
)
TRIAL, LIVE, CONTROL, COLUMNS, ESTIMATION, MODULUS, FACTORS, OUTPUT = (
    Group(title, sort_key=place) for place, title in enumerate(TITLES, start=1)
)

IN_OUTPUT = Parameter(group=OUTPUT)
OutputFile = Annotated[Path | None, IN_OUTPUT]
Width = Annotated[
    WidthName,
    Parameter(
        group=OUTPUT,
        help="Width of the figures: for a screen (screen), one column (single) or two columns "
        "(double) of an IEEE paper, or an A4 page (a4).",
    ),
]
Overwrite = Annotated[
    bool,
    Parameter(
        group=OUTPUT, help="Overwrite existing output files. Recordings are never overwritten."
    ),
]
Json = Annotated[bool, Parameter(group=OUTPUT, help="Print one JSON document instead of text.")]
