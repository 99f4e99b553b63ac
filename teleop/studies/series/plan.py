"""Read the plan of a series: factors with levels, repetitions, and the settings of the trials."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from importlib.resources import as_file, files
from itertools import product
from math import prod
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from sim_backend import CUBES, DEPTH
from teleop.control.conditions import CONDITIONS
from teleop.errors import InputError, invalid_parts
from teleop.studies.series.order import OrderName, ordered
from teleop.trial.arming import check_stated
from teleop.trial.configuration import read_toml, settings_from
from teleop.trial.feedback_checks import check_feedback
from teleop.trial.settings import TrialSettings

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,40}$")]
"""Name of a factor or a level, which is used in file names."""
MOST_TRIALS = 10_000
SETTINGS: dict[str, Collection[str]] = {
    "condition": CONDITIONS,
    "cube": CUBES,
    "specimen": (),
    "operator": (),
}
"""Factors that set the setting of the same name, with the values of this setting; empty for any
name. A level with other settings in `levels` may have a name that is not a value of the setting."""


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


@dataclass(frozen=True)
class PlannedTrial:
    """One trial of a plan."""

    number: int
    """Position of the trial in the series, from 1."""
    levels: dict[str, str]
    """Level of each factor, by the name of the factor."""
    repetition: int
    """Number of the repetition, from 1."""
    settings: TrialSettings

    @property
    def label(self) -> str:
        """Levels of the factors and number of the repetition, joined by hyphens, for file names."""
        return "-".join([*self.levels.values(), str(self.repetition)])


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


def planned_trials(plan: Plan, folder: Path) -> list[PlannedTrial]:
    """Return the trials of a plan in the order in which they are run.

    Parameters
    ----------
    plan
        The plan.
    folder
        Folder to which the paths in the settings of the plan are relative.

    Raises
    ------
    InputError
        The settings of a trial are invalid. The message lists the problems of all trials.
    """
    chosen = chosen_settings(plan, folder)
    blocked = [plan.factors[name] for name in plan.blocks]
    inner = {name: levels for name, levels in plan.factors.items() if name not in plan.blocks}
    cells = [
        (dict(zip(inner, levels, strict=True)), repetition)
        for repetition in range(1, plan.repetitions + 1)
        for levels in product(*inner.values())
    ]
    trials: list[PlannedTrial] = []
    for block, outer in enumerate(product(*blocked)):
        for index in ordered(len(cells), plan.order, plan.seed, block):
            inner_levels, repetition = cells[index]
            by_factor = dict(zip(plan.blocks, outer, strict=True)) | inner_levels
            levels = {name: by_factor[name] for name in plan.factors}
            number = len(trials) + 1
            settings = chosen[tuple(levels.values())]
            settings = replace(settings, seed=settings.seed + number)
            trials.append(PlannedTrial(number, levels, repetition, settings))
    return trials


def chosen_settings(plan: Plan, folder: Path) -> dict[tuple[str, ...], TrialSettings]:
    """Return the settings of the trials, by the combination of levels. See `planned_trials`."""
    settings: dict[tuple[str, ...], TrialSettings] = {}
    problems: dict[str, list[str]] = {}
    for levels in product(*plan.factors.values()):
        document = document_of(plan, dict(zip(plan.factors, levels, strict=True)))
        try:
            settings[levels] = settings_from(document, folder)
            check_stated(settings[levels])
            check_feedback(settings[levels])
        except InputError as error:
            for line in str(error).splitlines():
                problems.setdefault(line, []).append(", ".join(levels))
    if problems:
        every = prod(map(len, plan.factors.values()))
        raise InputError(
            "\n".join(
                line if len(where) == every else f"{'; '.join(where)}: {line}"
                for line, where in problems.items()
            )
        )
    return settings


def document_of(plan: Plan, levels: Mapping[str, str]) -> dict[str, Any]:
    """Return the settings for one combination of levels, with the keys of a configuration file."""
    document = dict(plan.settings)
    for name, level in levels.items():
        own = plan.levels.get(name, {}).get(level)
        if name in SETTINGS and (own is None or level in (SETTINGS[name] or [level])):
            document[name] = level
        document |= own or {}
    if "rig" in document and "cube" in plan.factors and "cube" in document:
        cube = document.pop("cube")
        document.setdefault("specimen", cube)
        depths = DEPTH.get(document.get("condition", "free"), {})
        if cube in depths:
            document.setdefault("depth_m", depths[cube])
    return document
