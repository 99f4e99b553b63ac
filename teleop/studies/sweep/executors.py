"""Run the points of a sweep in several processes of this machine."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from itertools import chain
from typing import Any

from teleop.studies.sweep.points import Point
from teleop.studies.sweep.tasks import Task, results
from teleop.studies.workers import workers

Results = list[dict[str, Any]]
Execute = Callable[[Task, Sequence[Point]], Iterator[Results]]
"""Function that runs a task at points, and yields the results in the order of computation."""
AHEAD = 4
"""Number of chunks of points that are sent to a process before the first chunk is finished."""
ATTEMPTS = 2
"""Number of times that a point is run alone. If the process is killed each time, the result of the
point is an error."""


def chunks_of(task: Task, points: Sequence[Point]) -> Iterator[Sequence[Point]]:
    """Divide points into chunks, and yield the chunks. A chunk is sent to a process as a whole."""
    for start in range(0, len(points), task.chunk):
        yield points[start : start + task.chunk]


def processors() -> int:
    """Return the number of processors that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def in_processes(count: int | None = None) -> Execute:
    """Return a function that runs points in processes of this machine.

    If a process is killed, all points that were already sent to the processes but are not finished
    are run again, each in a separate process. If this separate process is killed in `ATTEMPTS`
    attempts, the result of the point is an error.

    Parameters
    ----------
    count
        Number of processes; None for one process per processor.
    """
    size = count or processors()

    def execute(task: Task, points: Sequence[Point]) -> Iterator[Results]:
        waiting = deque(chunks_of(task, points))
        while waiting:
            running: dict[Future[Results], Sequence[Point]] = {}
            try:
                with workers(size) as pool:
                    while waiting or running:
                        while waiting and len(running) < AHEAD * size:
                            chunk = waiting.popleft()
                            running[pool.submit(results, task, chunk)] = chunk
                        for future in wait(running, return_when=FIRST_COMPLETED).done:
                            yield future.result()
                            del running[future]
            except BrokenExecutor:
                for point in chain.from_iterable(running.values()):
                    yield alone(task, point)

    return execute


def alone(task: Task, point: Point) -> Results:
    """Run a single point in a separate process, and return its results.

    If the process is killed in `ATTEMPTS` attempts, the result is an error.
    """
    for _ in range(ATTEMPTS):
        try:
            with workers(1) as pool:
                return pool.submit(results, task, [point]).result()
        except BrokenExecutor:
            continue
    return [killed(point)]


def killed(point: Point) -> dict[str, Any]:
    """Return the result of a point whose process was killed in each attempt."""
    return {"point": point.number, "error": "its process was killed, for example for its memory"}
