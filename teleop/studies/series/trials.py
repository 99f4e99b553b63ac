"""List the trials of a plan in their order, with the settings of each trial."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from sim_backend import CUBES, DEPTH
from teleop.control.conditions import CONDITIONS
from teleop.errors import InputError
from teleop.studies.series.order import ordered
from teleop.studies.series.plan import Plan
from teleop.trial.arming import check_stated
from teleop.trial.configuration import settings_from
from teleop.trial.feedback_checks import check_feedback
from teleop.trial.settings import TrialSettings

SETTINGS: dict[str, Collection[str]] = {
    "condition": CONDITIONS,
    "cube": CUBES,
    "specimen": (),
    "operator": (),
}
"""Factors that set the setting of the same name, with the values of this setting; empty for any
name. A level with other settings in `levels` may have a name that is not a value of the setting."""


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
    trials = []
    for number, (levels, repetition) in enumerate(cells(plan), start=1):
        settings = chosen[tuple(levels.values())]
        settings = replace(settings, seed=settings.seed + number)
        trials.append(PlannedTrial(number, levels, repetition, settings))
    return trials


def cells(plan: Plan) -> list[tuple[dict[str, str], int]]:
    """Return levels and repetition of each trial of a plan, in the order of the trials."""
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
