"""Run the points of a sweep in several processes of this machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

from teleop.studies.sweep.points import Point
from teleop.studies.sweep.tasks import Computed, Task, computed
from teleop.studies.workers import in_parallel

Execute = Callable[[Task, Sequence[Point]], Iterator[Computed]]
"""Function that runs a task at points, and yields the results in the order of computation."""


def chunks_of(task: Task, points: Sequence[Point]) -> Iterator[Sequence[Point]]:
    """Yield the points in groups of `task.chunk`, which are sent to a process together."""
    for start in range(0, len(points), task.chunk):
        yield points[start : start + task.chunk]


def in_processes(count: int | None = None) -> Execute:
    """Return a function that runs a task at the points of a sweep in processes of this machine.

    By default, there is one process per processor. If the process of a point is killed each time
    that the point is run (see `in_parallel`), the result of this point is an error.
    """

    def execute(task: Task, points: Sequence[Point]) -> Iterator[Computed]:
        return in_parallel(partial(computed, task), chunks_of(task, points), lost, count)

    return execute


def lost(point: Point) -> Computed:
    """Return the result of a point whose process is killed each time: an error."""
    problem = "its process was killed, for example for its memory"
    return Computed([{"point": point.number, "error": problem}], None)
