"""Run the points of a sweep in several processes of this machine.

Why `concurrent.futures` and `distributed` are used directly, and not joblib (1.6, 2 processes): 40
short trials take 11.6 s instead of 5.9 s, because joblib starts new interpreters. With artificial
tasks: if a process is killed, joblib ends with the results so far (2 of 40; here 40, one with an
error), so that the bookkeeping below is needed all the same; if the command is killed, processes of
joblib run on for more than 20 s (here they end after 0.2 s, see `workers`).
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from contextlib import suppress
from functools import partial
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
    """Yield the points in groups of `task.chunk`, which are sent to a process together."""
    for start in range(0, len(points), task.chunk):
        yield points[start : start + task.chunk]


def processors() -> int:
    """Return the number of processors that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def in_processes(count: int | None = None) -> Execute:
    """Return a function that runs a task at the points of a sweep in processes of this machine.

    By default, there is one process per processor.
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
                    yield alone(point, partial(in_own_process, task, point), BrokenExecutor)

    return execute


def in_own_process(task: Task, point: Point) -> Computed:
    """Run a task at one point in a new process."""
    with workers(1) as pool:
        return pool.submit(computed, task, [point]).result()


def alone(point: Point, run: Callable[[], Computed], killed: type[Exception]) -> Computed:
    """Return the result of `run`, which runs a single point while no other point is run.

    If the process is killed, `run` raises `killed`, and is called again. After `ATTEMPTS` attempts,
    the result is an error.
    """
    for _ in range(ATTEMPTS):
        with suppress(killed):
            return run()
    problem = "its process was killed, for example for its memory"
    return Computed([{"point": point.number, "error": problem}], None)
