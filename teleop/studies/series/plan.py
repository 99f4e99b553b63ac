"""Read the plan of a series: factors with levels, repetitions, and the settings of the trials."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from teleop.errors import InputError, invalid_parts
from teleop.studies.series.order import OrderName
from teleop.trial.configuration import read_toml

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,40}$")]
"""Name of a factor or a level, which is used in file names."""
MOST_TRIALS = 10_000


class Plan(BaseModel):
    """Plan of a series of trials.

    Every combination of the levels of the factors is one trial, repeated `repetitions` times.
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
    """Return a copy of a plan whose trials run on a hardware rig.

    Parameters
    ----------
    plan
        The plan.
    rig
        The rig file.
    tare
        File with the zero offsets of the channels; None for the zero offsets that the plan states.
    """
    settings = plan.settings | {"rig": str(rig.resolve()), "clock": "real"}
    if tare:
        settings["tare"] = str(tare.resolve())
    return plan.model_copy(update={"settings": settings})


def read_plan(path: Path) -> Plan:
    """Read the plan of a series from a file, and check it.

    Parameters
    ----------
    path
        A TOML file, or the name of a plan that is part of this package, such as `paper`.

    Raises
    ------
    InputError
        The file cannot be read, or is not a valid plan. The message lists all problems.
    """
    packaged = files(__package__).joinpath("plans", f"{path}.toml")
    if not path.suffix and packaged.is_file():
        with as_file(packaged) as source:
            document = read_toml(source)
    else:
        document = read_toml(path)
    try:
        plan = Plan.model_validate(document)
    except ValidationError as error:
        raise InputError(f"{path}: {invalid_parts(error)}") from error
    problems = [*inconsistencies(plan)]
    if problems:
        raise InputError("\n".join(f"{path}: {problem}" for problem in problems))
    return plan


def inconsistencies(plan: Plan) -> Iterator[str]:
    """Yield a message for each inconsistency of a plan."""
    for name in plan.blocks:
        if name not in plan.factors:
            yield f"blocks: {name!r}: expected one of the factors {', '.join(plan.factors)}"
    for name, levels in plan.factors.items():
        if not levels or len(set(levels)) < len(levels):
            yield f"factors.{name}: expected distinct levels"
    for name, settings in plan.levels.items():
        if name not in plan.factors:
            yield f"levels.{name}: expected one of the factors {', '.join(plan.factors)}"
            continue
        for level in settings.keys() - set(plan.factors[name]):
            yield f"levels.{name}.{level}: expected one of {', '.join(plan.factors[name])}"
    trials = plan.repetitions
    for levels in plan.factors.values():
        trials *= len(levels)
    if trials > MOST_TRIALS:
        yield f"{trials} trials: expected at most {MOST_TRIALS}"
