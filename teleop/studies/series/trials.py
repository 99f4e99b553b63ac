"""List the trials of the plan of a series in their order, with the settings of each trial.

The plan states factors, such as the cube, and the levels of each factor, such as soft and hard. A
trial is run for each combination of levels, and can be repeated.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product
from pathlib import Path
from typing import Any

from sim_backend import DEPTH
from teleop.control.conditions import CONDITIONS
from teleop.errors import InputError
from teleop.settings.configuration import complete_settings
from teleop.settings.plug_ins import entry_point
from teleop.settings.trial_settings import TrialSettings
from teleop.studies.series.order import ordered
from teleop.studies.series.plan import (
    MOST_TRIALS,
    SETTINGS,
    Plan,
    checked_plan,
    on_rig,
    plan_document,
)

PLACES = "[settings] or [levels]"
"""Parts of a plan in which a setting can be stated; used in error messages."""


@dataclass(frozen=True)
class PlannedTrial:
    """One trial of a plan: its number, the levels of its factors, and its settings."""

    number: int
    """Position of the trial in the series, from 1."""
    levels: dict[str, str]
    """Level of each factor, by the name of the factor."""
    repetition: int
    """Number of the repetition, from 1."""
    settings: TrialSettings

    @property
    def label(self) -> str:
        """Name of the trial for file names: levels and repetition, joined by hyphens."""
        return "-".join([*self.levels.values(), str(self.repetition)])


def read_series(
    path: Path, rig: Path | None = None, tare: Path | None = None
) -> tuple[Plan, list[PlannedTrial]]:
    """Read the plan of a series, check it, and list its trials in the order in which they are run.

    `path` may also be the name of a plan of this package, such as `paper`. `rig` and `tare` replace
    those of the plan. The InputError has one line for each problem of the plan and of its trials.
    """
    plan, problems = checked_plan(plan_document(path))
    if rig:
        plan = on_rig(plan, rig, tare)
    acting = acting_factors(plan)
    settings, problems_of_trials = chosen_settings(plan, acting, path.parent)
    problems += problems_of_trials
    if problems:
        raise InputError("\n".join(f"{path}: {problem}" for problem in problems))
    trials = []
    for number, (levels, repetition) in enumerate(cells(plan), start=1):
        one = settings[tuple(levels[name] for name in acting)]
        trials.append(
            PlannedTrial(number, levels, repetition, replace(one, seed=one.seed + number))
        )
    return plan, trials


def acting_factors(plan: Plan) -> dict[str, list[str]]:
    """Return the levels of the factors that change the settings, unlike the name of a subject."""
    return {
        name: levels
        for name, levels in plan.factors.items()
        if levels and (name in SETTINGS or name in plan.levels)
    }


def cells(plan: Plan) -> list[tuple[dict[str, str], int]]:
    """Return levels and repetition of each trial, in the order in which they are run."""
    blocked = [plan.factors[name] for name in plan.blocks]
    inner = {name: levels for name, levels in plan.factors.items() if name not in plan.blocks}
    of_block = [
        (dict(zip(inner, levels, strict=True)), repetition)
        for repetition in range(1, plan.repetitions + 1)
        for levels in product(*inner.values())
    ]
    found = []
    for block, outer in enumerate(product(*blocked)):
        for index in ordered(len(of_block), plan.order, plan.seed, block):
            inner_levels, repetition = of_block[index]
            by_factor = dict(zip(plan.blocks, outer, strict=True)) | inner_levels
            found.append(({name: by_factor[name] for name in plan.factors}, repetition))
    return found


def chosen_settings(
    plan: Plan, acting: Mapping[str, Sequence[str]], folder: Path
) -> tuple[dict[tuple[str, ...], TrialSettings], list[str]]:
    """Return the settings for each combination of levels, and a message for each invalid one."""
    settings: dict[tuple[str, ...], TrialSettings] = {}
    problems: dict[str, list[str]] = {}
    unknown = [name for name in SETTINGS if not plan.factors or plan.factors.get(name) == []]
    combinations = [*islice(product(*acting.values()), MOST_TRIALS)]
    for levels in combinations:
        document = document_of(plan, dict(zip(acting, levels, strict=True)))
        try:
            settings[levels] = complete_settings(document, folder, PLACES)
        except InputError as error:
            for line in str(error).splitlines():
                if any(line.startswith(f"{name}: is missing") for name in unknown):
                    continue  # the levels of this factor are invalid: another message states this
                problems.setdefault(line, []).append(", ".join(levels))
    return settings, [
        line if len(where) == len(combinations) else f"{'; '.join(where)}: {line}"
        for line, where in problems.items()
    ]


def document_of(plan: Plan, levels: Mapping[str, str]) -> dict[str, Any]:
    """Return the settings for one combination of levels, with the keys of a configuration file.

    On a hardware rig, the factor cube sets the name of the specimen and, unless the plan states it,
    the depth.
    """
    document = dict(plan.settings)
    assigned: dict[str, tuple[object, str]] = {}
    for name, level in levels.items():
        own = plan.levels.get(name, {}).get(level)
        parts = [(own or {}, f"levels.{name}.{level}")]
        if name == "condition" and own is None and entry_point("condition", level):
            parts.insert(0, ({"custom_condition": {"name": level}}, f"the factor {name}"))
        elif name in SETTINGS and (own is None or level in (SETTINGS[name] or [level])):
            parts.insert(0, ({name: level}, f"the factor {name}"))
        for part, place in parts:
            for key, value in single_settings(part):
                other, by = assigned.setdefault(key, (value, place))
                if other != value:
                    raise InputError(
                        f"{key}: {by} and {place} assign different values: expected one of them"
                    )
            document = merged(document, part)
    if document.keys() & {"rig", "custom_rig"} and "cube" in plan.factors and "cube" in document:
        cube = document.pop("cube")
        document.setdefault("specimen", cube)
        condition = CONDITIONS[document.get("condition", "free")]
        depths = DEPTH[condition.moved_by]
        if cube in depths:
            document.setdefault("depth_m", depths[cube])
    return document


def single_settings(
    document: Mapping[str, Any], outer: tuple[str, ...] = ()
) -> Iterator[tuple[str, Any]]:
    """Yield each setting that is not a table, as its keys separated by dots, and its value."""
    for key, value in document.items():
        if isinstance(value, Mapping):
            yield from single_settings(value, (*outer, key))
        else:
            yield ".".join((*outer, key)), value


def merged(document: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of a document with changes, also within its tables.

    A table of another kind, such as another excitation signal, replaces the whole table.
    """
    found = dict(document)
    for key, value in changes.items():
        old = found.get(key)
        if isinstance(old, Mapping) and isinstance(value, Mapping):
            same = value.get("kind", old.get("kind")) == old.get("kind")
            found[key] = merged(old, value) if same else value
        else:
            found[key] = value
    return found
