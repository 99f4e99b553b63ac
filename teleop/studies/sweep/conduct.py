"""Run the points of a sweep that are not done yet, and write the results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from teleop.errors import InputError
from teleop.files import make_folder
from teleop.studies.json_lines import LOCK, JsonLines, locked
from teleop.studies.sweep.executors import Execute
from teleop.studies.sweep.origin import Origin, differences, origin_of
from teleop.studies.sweep.plan import SweepPlan
from teleop.studies.sweep.points import Point
from teleop.studies.sweep.tables import Tables
from teleop.studies.sweep.tasks import Task, check

JOURNAL = "journal.jsonl"
"""Name of the journal. It contains the plan, then one line with the result of each point, in the
order in which the results were computed."""


@dataclass
class SweepProgress:
    """Progress of a sweep: how many of its points are done, and how many have failed."""

    total: int
    """Number of points of the sweep."""
    done: int = 0
    """Number of points that were run. The result can be a safety stop or an error."""
    stopped: int = 0
    """Number of points whose trial was stopped for safety."""
    failed: int = 0
    """Number of points whose result is an error."""
    resumed: int = 0
    """Number of points that already had a result other than an error when the sweep was resumed."""
    parquet: bool = False
    """Whether results.parquet was written, for which pyarrow is needed."""


def conduct(
    folder: Path,
    plan: SweepPlan,
    task: Task,
    points: Sequence[Point],
    execute: Execute,
    report: Callable[[SweepProgress], None] = lambda progress: None,
) -> SweepProgress:
    """Run the points of a sweep that are not done yet, and write the tables of results.

    A point whose result was an error is run again. Each result is written to the journal as soon as
    it is computed. The table results.csv contains the results in the order of the points. The
    result of a point is added to this table as soon as all points before this point are done.
    """
    make_folder(folder / JOURNAL)
    with locked(folder):
        journal = JsonLines(folder / JOURNAL)
        known = journal.read()
        _, first = next(known, (0, None))
        if first is None:
            first = begin(folder, journal, plan, task, points)
        check_plan(folder, first, plan)
        progress = SweepProgress(len(points))
        positions: dict[int, int] = {}
        for position, result in known:
            if "error" not in result:
                positions[result["point"]] = position
                progress.stopped += "stopped" in result
        progress.done = progress.resumed = len(positions)
        pending = [point for point in points if point.number not in positions]
        origin: Origin = first.get("origin") or {}
        if pending:
            check_origin(folder, origin, task)
        report(progress)
        tables = Tables(folder, task, points, journal, positions)
        for results, used, place in execute(task, pending) if pending else ():
            if used is not None and (other := differences(origin, used)):
                raise InputError(
                    f"{place or folder}: the results are not used, because they were computed with "
                    f"{other}; after this is corrected, enter the same command again"
                )
            places = journal.append(results)
            positions.update(zip((one["point"] for one in results), places, strict=True))
            progress.done = len(positions)
            progress.stopped += sum("stopped" in result for result in results)
            progress.failed += sum("error" in result for result in results)
            tables.extend()
            report(progress)
        progress.parquet = tables.write_parquet()
    return progress


def begin(
    folder: Path, journal: JsonLines, plan: SweepPlan, task: Task, points: Sequence[Point]
) -> dict[str, Any]:
    """Write the first line of the journal of a new sweep, and return its contents."""
    if any(path.name not in (LOCK, JOURNAL) for path in folder.iterdir()):
        raise InputError(f"{folder}: expected an empty folder, or the folder of a sweep")
    check(task, points)
    first = {
        "plan": plan.model_dump(mode="json"),
        "origin": origin_of(task.files, task.plug_ins),
    }
    journal.append([first])
    return first


def check_plan(folder: Path, first: Mapping[str, Any], plan: SweepPlan) -> None:
    """Check that a sweep began with the same plan (`first`: the first line of its journal)."""
    document, known = plan.model_dump(mode="json"), first.get("plan", {})
    if known != document:
        keys = [key for key in document if known.get(key) != document[key]]
        raise InputError(
            f"{folder}: contains a sweep of another plan, which differs in {', '.join(keys)}: "
            "expected another folder (--out)"
        )


def check_origin(folder: Path, origin: Origin, task: Task) -> None:
    """Check that software and files are those with which a sweep began."""
    if not origin:
        raise InputError(
            f"{folder}: contains a sweep of an earlier version: expected another folder (--out)"
        )
    if changed := differences(origin, origin_of(task.files, task.plug_ins)):
        raise InputError(
            f"{folder}: changed since the sweep began: {changed}; to compute all points with the "
            "present state, expected another folder (--out)"
        )
