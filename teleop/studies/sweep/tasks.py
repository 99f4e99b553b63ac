"""Define the tasks at a point of a sweep: run a simulated trial, or evaluate a recording.

A task can be sent to another process. The result of a task at a point depends only on the plan. It
does not depend on the number of processes or the order in which the points are run.
"""

from __future__ import annotations

import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol

import numpy as np

from estimation.quantities import DAMPING, STIFFNESS
from estimation.summary import summarise
from teleop.errors import InputError, SafetyStop
from teleop.settings.configuration import settings_from
from teleop.settings.trial_settings import TrialSettings
from teleop.studies.series.table import RESULT_COLUMNS
from teleop.studies.sweep.origin import Origin, file, origin_of, plug_ins_in
from teleop.studies.sweep.plan import Range, SweepPlan
from teleop.studies.sweep.points import Point, evenly
from teleop.trial.run import run_trial

if TYPE_CHECKING:
    from teleop.studies.sweep.replay import RecordedTrial

CHECKED = 100
"""Approximate number of points that are checked before a sweep begins; see `evenly`."""
TRUE_COLUMNS = {"k_deepest": f"true {STIFFNESS.column}", "b": f"true {DAMPING.column}"}
"""Headings of the columns with true values of a simulated trial, by the key in its summary."""
SEED, ESTIMATOR = "seed", "estimator"
"""Headings of the columns with the seed of the trial and the name of the estimator."""
Row = dict[str, Any]
"""One row of the table of results: values of one estimator at a point, by heading of the column."""


class Computed(NamedTuple):
    """Results of several points, which one process has computed."""

    results: list[dict[str, Any]]
    """One dictionary for each point, see `results`."""
    origin: Origin | None
    """Software and files with which the results were computed; None if there are no results,
    because the process was killed."""
    place: str = ""
    """The worker that computed the results; empty for a process of this machine."""


class Task(Protocol):
    """Interface of a task, which is run at each point of a sweep."""

    @property
    def files(self) -> Mapping[str, Path]:
        """Path of each file that the task reads, by its name in the plan."""
        ...

    @property
    def plug_ins(self) -> tuple[str, ...]:
        """Names of the estimators of other packages that the task uses."""
        ...

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the settings that vary."""
        ...

    @property
    def chunk(self) -> int:
        """Number of points that are sent to a process together (in a chunk)."""
        ...

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns in each row that the method `rows` returns."""
        ...

    def settings(self, point: Point) -> TrialSettings:
        """Return the settings of the task at a point of the sweep."""
        ...

    def rows(self, point: Point) -> list[Row]:
        """Run the task at a point of the sweep, and return one row of results per estimator."""
        ...


@dataclass(frozen=True)
class TrialTask:
    """Task that runs a trial on the simulated rig in virtual time."""

    keys: tuple[str, ...]
    """Names of the settings that vary."""
    common: Mapping[str, Any]
    """Settings of all trials, with the keys of a configuration file."""
    folder: Path
    """Folder to which paths in the settings are relative."""
    files: Mapping[str, Path]
    """Path of each file that the task reads, by its name in the plan."""
    plug_ins: tuple[str, ...]
    """Names of the estimators of other packages that the task uses."""
    chunk: ClassVar[int] = 1
    columns: ClassVar[tuple[str, ...]] = (
        SEED,
        *TRUE_COLUMNS.values(),
        ESTIMATOR,
        *RESULT_COLUMNS.values(),
    )

    def settings(self, point: Point) -> TrialSettings:
        """Return the settings of the trial at a point of the sweep."""
        document = with_values(self.common, self.keys, point.values)
        for key, expected in (("clock", "virtual"), ("rig", None)):
            if document.get(key, expected) != expected:
                raise InputError(f"{key}: a sweep runs on the simulated rig in virtual time")
        settings = settings_from({**document, "clock": "virtual"}, self.folder)
        return replace(settings, seed=settings.seed + point.repetition)

    def rows(self, point: Point) -> list[Row]:
        """Run the trial at a point of the sweep, and return one row of results per estimator."""
        settings = self.settings(point)
        summary = run_trial(settings).summary()
        if fault := summary["safety"]["fault"]:
            raise SafetyStop(f"stopped for safety: {fault['text']}")
        about: Row = {SEED: settings.seed}
        known = summary["truth"] or {}  # of a rig of another package, nothing is known
        about |= {heading: known.get(key) for key, heading in TRUE_COLUMNS.items()}
        return [
            {
                **about,
                ESTIMATOR: name,
                **{RESULT_COLUMNS[key]: values[key] for key in RESULT_COLUMNS},
            }
            for name, values in summary["estimates"].items()
        ]


@dataclass(frozen=True)
class EstimateTask:
    """Task that computes estimates from a recorded trial with different settings.

    At each point of the sweep, the settings are those of the recording, in which the values of the
    point replace the recorded values.
    """

    keys: tuple[str, ...]
    """Names of the settings that vary."""
    path: Path
    """Path of the recording."""
    files: Mapping[str, Path]
    """Path of each file that the task reads, by its name in the plan."""
    own_plug_ins: tuple[str, ...]
    """Names of the estimators of other packages that the plan contains."""
    chunk: ClassVar[int] = 50
    columns: ClassVar[tuple[str, ...]] = (SEED, ESTIMATOR, *RESULT_COLUMNS.values())

    @property
    def recorded(self) -> RecordedTrial:
        """The recorded trial. Each process reads the recording only once."""
        from teleop.studies.sweep.replay import recorded_trial  # imports scipy, which takes long

        return recorded_trial(self.path, file(self.path).get("sha256", ""))

    @property
    def plug_ins(self) -> tuple[str, ...]:
        """Names of the estimators of other packages that the task uses.

        The plan or the recording contains them. A recording that cannot be read contains none: the
        problem is stated among the `files`.
        """
        recorded: tuple[str, ...] = ()
        with suppress(InputError):
            recorded = plug_ins_in(self.recorded.document)
        return (*dict.fromkeys((*self.own_plug_ins, *recorded)),)

    def settings(self, point: Point) -> TrialSettings:
        """Return the settings with which the estimates are computed at a point of the sweep."""
        document = with_values(self.recorded.document, self.keys, point.values)
        return settings_from(document, self.path.parent)

    def rows(self, point: Point) -> list[Row]:
        """Compute the estimates at a point of the sweep, and return one row per estimator."""
        settings = self.settings(point)
        t, regression, *_ = self.recorded.conditioned(settings)
        bank = settings.estimation_preset.bank()
        unknown = np.array([np.nan])
        part = self.recorded.averaged.contains(t)
        summaries = {
            name: summarise(t[part], regression.part(part), series.part(part), bank[name], unknown)
            for name, series in bank.run(*regression).items()
        }
        return [
            {
                SEED: settings.seed,
                ESTIMATOR: name,
                **{RESULT_COLUMNS[key]: getattr(values, key) for key in RESULT_COLUMNS},
            }
            for name, values in summaries.items()
        ]


def task_of(plan: SweepPlan, folder: Path) -> Task:
    """Return the task of a sweep: to run a trial at each point, or to evaluate a recording."""
    keys, root = tuple(plan.factors), folder.absolute()
    values = {key: [] if isinstance(one, Range) else one for key, one in plan.factors.items()}
    tares = [plan.settings.get("tare"), *values.get("tare", ())]
    names = [name for name in tares if isinstance(name, str)]
    plug_ins = plug_ins_in([plan.settings, values])
    if plan.estimate:
        path = root / plan.estimate.recording
        files = {plan.estimate.recording: path, **{name: path.parent / name for name in names}}
        return EstimateTask(keys, path, files, plug_ins)
    files = {name: root / name for name in names}
    return TrialTask(keys, plan.settings, root, files, plug_ins)


def check(task: Task, points: Sequence[Point]) -> None:
    """Check, before a sweep begins, that its points do not all have invalid settings.

    About `CHECKED` points, evenly distributed over the sweep, are checked. One point with valid
    settings is sufficient. The sweep then runs, and the result of each point with invalid settings
    is an error.
    """
    first: InputError | None = None
    for point in evenly(points, CHECKED):
        try:
            task.settings(point)
            return
        except InputError as error:
            first = first or error
    if first:
        raise first


def computed(task: Task, points: Sequence[Point]) -> Computed:
    """Run a task at points, and return the results, and the software and files that were used."""
    found = results(task, points)
    return Computed(found, origin_of(task.files, task.plug_ins))  # as they are after the last read


def results(task: Task, points: Sequence[Point]) -> list[dict[str, Any]]:
    """Run a task at points, and return a dictionary with the result of each point.

    The dictionary contains the number of the point, and its rows of results, the reason of a safety
    stop (`stopped`), or an error message (`error`). A safety stop is a result of the trial. After
    an error, there is no result, and the point must be run again. An exception other than
    InputError is an error in the program. The dictionary then also contains the traceback.
    """
    found = []
    for point in points:
        result: dict[str, Any] = {"point": point.number}
        try:
            result["rows"] = task.rows(point)
        except SafetyStop as stop:
            result["stopped"] = str(stop)
        except InputError as error:
            result["error"] = "; ".join(str(error).splitlines())
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # an estimator of another package can raise SystemExit
            result["error"] = f"{type(error).__name__}: {error}"
            result["traceback"] = traceback.format_exc()
        found.append(result)
    return found


def with_values(
    document: Mapping[str, Any], keys: Sequence[str], values: Sequence[Any]
) -> dict[str, Any]:
    """Return a copy of a document with settings, in which some settings have new values."""
    changed: dict[str, Any] = deepcopy(dict(document))
    for key, value in zip(keys, values, strict=True):
        *outer, last = key.split(".")
        inner = changed
        for name in outer:
            inner = inner.setdefault(name, {})
            if not isinstance(inner, dict):
                raise InputError(f"{key}: {name} is not a table of settings")
        inner[last] = value
    return changed
