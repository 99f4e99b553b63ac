"""Read the plan of a series: factors with levels, repetitions, and the settings of the trials."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Collection, Iterator, Sequence
from copy import deepcopy
from importlib.resources import as_file, files
from math import prod
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from sim_backend import CUBES
from teleop.control.conditions import CONDITIONS
from teleop.errors import invalid_lines
from teleop.settings.plug_ins import is_rig_file
from teleop.settings.toml_files import read_toml
from teleop.studies.series.order import OrderName

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,40}$")]
"""Name of a series, a factor or a level. Names of levels are parts of file names."""
MOST_TRIALS = 10_000
"""Largest permitted number of trials of a plan."""
PLACEHOLDER = re.compile(r"\{([^{}]*)\}")
"""Pattern of a placeholder in a prompt."""
SETTINGS: dict[str, Collection[str]] = {
    "condition": CONDITIONS,
    "cube": CUBES,
    "specimen": (),
    "operator": (),
}
"""Factors that set the setting of the same name, each with the permitted values of this setting. If
no values are listed, any name is permitted. If a plan states settings for a level in `levels`, the
level can also be a value that is not permitted. A level that is not permitted does not set the
setting of the same name."""


COLUMNS = (
    *("trial", "repetition", "attempt", "time", "file", "note", "seed", "software", "estimator"),
    "held",
)
"""Names of the columns of the table of results that a factor may not have."""


class Plan(BaseModel):
    """Plan of a series of trials.

    Each combination of the levels of all factors is run in `repetitions` trials.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Name
    """Name of the series."""
    description: str = ""
    factors: dict[Name, list[Name]] = Field(min_length=1)
    """Levels of each factor. The factors condition, cube, specimen and operator set the setting of
    the same name. On a hardware rig, the factor cube sets the specimen. If the settings contain no
    depth, the factor cube also sets the depth to that of the paper for this cube and condition."""
    blocks: list[Name] = []
    """Factors whose levels are run one after the other, such as subject: all trials of one level
    are run before the trials of the next level."""
    repetitions: Annotated[int, Field(ge=1, le=1000)] = 1
    """Number of repetitions of each combination of levels."""
    order: OrderName = "random"
    """Order of the trials within each block."""
    seed: int = 0
    """Seed of the random order. The seed of a simulated trial is the seed in the settings plus the
    number of the trial."""
    rest_s: Annotated[float, Field(ge=0.0, le=3600.0)] = 0.0
    """Shortest pause between two trials [s]."""
    prompt: str = "Next: {trial}."
    """Text that is shown before each trial. {trial} is replaced by the name of the trial, and a
    factor in braces by its level."""
    settings: dict[str, Any] = {}
    """Settings of all trials, as in a configuration file."""
    levels: dict[Name, dict[Name, dict[str, Any]]] = {}
    """Further settings of the trials in which a factor has a certain level, by factor and level."""


def on_rig(plan: Plan, rig: Path, tare: Path | None = None) -> Plan:
    """Return a copy of a plan for a hardware rig; without `tare`, with the plan's zero offsets."""
    if is_rig_file(rig):
        settings = plan.settings | {"rig": str(rig.resolve()), "clock": "real"}
    else:
        settings = plan.settings | {"custom_rig": {"name": str(rig)}, "clock": "real"}
    if tare:
        settings["tare"] = str(tare.resolve())
    return plan.model_copy(update={"settings": settings})


def plan_document(path: Path) -> dict[str, Any]:
    """Return the contents of the file of a plan, without checking whether the plan is valid."""
    packaged = files(__package__).joinpath("plans", f"{path}.toml")
    if not path.suffix and packaged.is_file():
        with as_file(packaged) as source:
            return read_toml(source)
    return read_toml(path)


def checked_plan(document: dict[str, Any]) -> tuple[Plan, list[str]]:
    """Return the valid part of a plan, and a message for each problem."""
    try:
        plan = Plan.model_validate(document)
    except ValidationError as error:
        problems = invalid_lines(error)
        kept = deepcopy(document)
        for part in reversed(error.errors()):  # the last item of a list first
            remove(kept, [key for key in part["loc"] if key != "[key]"])
        plan = Plan.model_construct(**{"name": "", "factors": {}} | kept)
    else:
        problems = []
    return plan, [*problems, *inconsistencies(plan, document.get("factors"))]


def remove(document: Any, place: Sequence[str | int]) -> None:
    """Remove an item from a document, which consists of nested dictionaries and lists.

    If the item does not exist, the document is not changed.
    """
    *outer, last = place
    with contextlib.suppress(KeyError, IndexError, TypeError):
        for key in outer:
            document = document[key]
        del document[last]


def inconsistencies(plan: Plan, stated: object) -> Iterator[str]:
    """Yield a message for each inconsistency of a plan, such as a block that is not a factor."""
    trials = plan.repetitions * prod(map(len, plan.factors.values()))
    if trials > MOST_TRIALS:
        yield f"{trials} trials: expected at most {MOST_TRIALS}"
    if not isinstance(stated, dict):
        return
    for name, levels in plan.factors.items():
        if name in COLUMNS:
            yield f"factors.{name}: expected another name than a column of the table of results"
        if not stated[name] or len(set(levels)) < len(levels):
            yield f"factors.{name}: expected distinct levels"
    factors = f"expected one of the factors {', '.join(stated)}"
    for name in plan.blocks:
        if name not in stated:
            yield f"blocks: {name!r}: {factors}"
    for name, settings in plan.levels.items():
        if name not in stated:
            yield f"levels.{name}: {factors}"
        elif isinstance(stated[name], list):
            for level in settings:
                if level not in stated[name]:
                    expected = ", ".join(map(str, stated[name]))
                    yield f"levels.{name}.{level}: expected one of {expected}"
    for name in SETTINGS:
        if name in stated and name in plan.settings:
            yield f"settings.{name}: is also a factor: expected it in one of the two places"
    for name in dict.fromkeys(PLACEHOLDER.findall(plan.prompt)):
        if name not in ("trial", *stated):
            known = ", ".join(f"{{{factor}}}" for factor in stated)
            yield f"prompt: {{{name}}}: expected {{trial}} or a factor, {known}"
