"""Run the points of a sweep that are not done yet, and write the results.

A sweep runs a task, such as a simulated trial, with different settings. A point is one combination
of values of these settings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from teleop.errors import InputError
from teleop.files import make_folder
from teleop.studies.json_lines import LOCK, JsonLines, locked
from teleop.studies.sweep.executors import Execute
from teleop.studies.sweep.plan import SweepPlan
from teleop.studies.sweep.points import Point
from teleop.studies.sweep.tables import Tables
from teleop.studies.sweep.tasks import Task, check

JOURNAL = "journal.jsonl"
"""Name of the journal. It contains the plan, then one line with the result of each point, in the
order in which the results were computed."""


@dataclass
class Progress:
    """Progress of a sweep: how many of its points are done, and how many have failed."""

    total: int
    """Number of points of the sweep."""
    done: int = 0
    """Number of points that have a result. The result can be an error."""
    failed: int = 0
    """Number of points whose result is an error."""
    resumed: int = 0
    """Number of points that were already done when the sweep was resumed."""
    parquet: bool = False
    """Whether results.parquet was written, for which pyarrow is needed."""


def conduct(
    folder: Path,
    plan: SweepPlan,
    task: Task,
    points: Sequence[Point],
    execute: Execute,
    report: Callable[[Progress], None] = lambda progress: None,
) -> Progress:
    """Run the points of a sweep that are not done yet, and write the tables of results.

    Each result is written to the journal as soon as it is computed. The table results.csv contains
    the results in the order of the points. The result of a point is added to this table as soon as
    all points before this point are done.

    Parameters
    ----------
    folder
        Folder of the sweep.
    plan
        The plan.
    task
        Task that is run at each point.
    points
        All points of the plan.
    execute
        Function that runs the task at the points that are not done. It yields the results of groups
        of points (chunks).
    report
        Function that is called with the progress at the start and after each chunk of points.

    Returns
    -------
    The progress at the end: the numbers of points that are done and that have failed.

    Raises
    ------
    InputError
        A file cannot be written, the folder contains other files or a sweep of another plan,
        another series or sweep is running in the folder, or the settings of all checked points are
        invalid (see `check`).
    """
    make_folder(folder / JOURNAL)
    with locked(folder):
        journal = JsonLines(folder / JOURNAL)
        positions: dict[int, int] = {}
        progress = Progress(len(points))
        document = plan.model_dump(mode="json")
        known = journal.read()
        _, first = next(known, (0, None))
        if first is None:
            if any(path.name not in (LOCK, JOURNAL) for path in folder.iterdir()):
                raise InputError(f"{folder}: expected an empty folder, or the folder of a sweep")
            check(task, points)
            journal.append([{"plan": document}])
        elif first.get("plan") != document:
            raise InputError(f"{folder}: contains a sweep of another plan: expected a new folder")
        for position, result in known:
            positions[result["point"]] = position
            progress.failed += "error" in result
        progress.done = progress.resumed = len(positions)
        report(progress)
        tables = Tables(folder, task, points, journal, positions)
        pending = [point for point in points if point.number not in positions]
        for computed in execute(task, pending) if pending else ():
            places = journal.append(computed)
            positions.update(zip((one["point"] for one in computed), places, strict=True))
            progress.done = len(positions)
            progress.failed += sum("error" in result for result in computed)
            tables.extend()
            report(progress)
        progress.parquet = tables.write_parquet()
    return progress
