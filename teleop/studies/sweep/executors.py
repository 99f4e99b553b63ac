"""Run the points of a sweep in several processes of this machine.

Points are sent to a process in groups, which are called chunks.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from itertools import chain

from teleop.studies.sweep.points import Point
from teleop.studies.sweep.tasks import Computed, Task, computed
from teleop.studies.workers import workers

Execute = Callable[[Task, Sequence[Point]], Iterator[Computed]]
"""Function that runs a task at points, and yields the results in the order of computation."""
AHEAD = 4
"""Largest number of chunks of points per process that are sent and not yet finished."""
ATTEMPTS = 2
"""Largest number of times that a point is run alone. If the process is killed each time, the result
of the point is an error."""


def chunks_of(task: Task, points: Sequence[Point]) -> Iterator[Sequence[Point]]:
    """Divide points into chunks, and yield the chunks.

    The task states how many points are in a chunk.
    """
    for start in range(0, len(points), task.chunk):
        yield points[start : start + task.chunk]


def processors() -> int:
    """Return the number of processors that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def in_processes(count: int | None = None) -> Execute:
    """Return a function that runs a task at the points of a sweep in processes of this machine.

    `count`: None for one process per processor.

    If one of the processes is killed, all processes end. The points that were already sent to the
    processes and have no result are then run again one by one, each in a separate process. If the
    separate process of a point is killed in each of `ATTEMPTS` attempts, the result of this point
    is an error. The remaining points are run in new processes.
    """
    size = count or processors()

    def execute(task: Task, points: Sequence[Point]) -> Iterator[Computed]:
        waiting = deque(chunks_of(task, points))
        while waiting:
            running: dict[Future[Computed], Sequence[Point]] = {}
            try:
                with workers(size) as pool:
                    while waiting or running:
                        while waiting and len(running) < AHEAD * size:
                            chunk = waiting.popleft()
                            running[pool.submit(computed, task, chunk)] = chunk
                        for future in wait(running, return_when=FIRST_COMPLETED).done:
                            yield future.result()
                            del running[future]
            except BrokenExecutor:
                for point in chain.from_iterable(running.values()):
                    yield alone(task, point)

    return execute


def alone(task: Task, point: Point) -> Computed:
    """Run a single point of a sweep in a separate process, and return its result.

    If the process is killed, the point is run again in a new process. If the process is killed in
    each of `ATTEMPTS` attempts, the result is an error.
    """
    for _ in range(ATTEMPTS):
        try:
            with workers(1) as pool:
                return pool.submit(computed, task, [point]).result()
        except BrokenExecutor:
            continue
    return killed(point)


def killed(point: Point) -> Computed:
    """Return the result of a point that could not be run because its process was always killed.

    The result contains the number of the point and an error message.
    """
    problem = "its process was killed, for example for its memory"
    return Computed([{"point": point.number, "error": problem}], None)
