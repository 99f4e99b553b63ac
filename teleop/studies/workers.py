"""Provide worker processes that end when their parent process ends.

Why `concurrent.futures` and `distributed` are used directly, and not joblib (1.6, 2 processes): 40
short trials take 11.6 s instead of 5.9 s, because joblib starts new interpreters. With artificial
tasks: if a process is killed, joblib ends with the results so far (2 of 40; here 40, one with an
error), so that the bookkeeping below is needed all the same; if the command is killed, processes of
joblib run on for more than 20 s (here they end after 0.2 s, see `workers`).
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from functools import partial
from itertools import chain
from typing import TypeVar

from teleop.errors import InputError
from teleop.interruption import SIGNALS

AHEAD = 4
"""Largest number of chunks per process that are sent and not yet finished."""
ATTEMPTS = 2
"""Largest number of times that an item is processed alone, if its process is killed each time."""
One = TypeVar("One")
Result = TypeVar("Result")


@contextlib.contextmanager
def workers(count: int | None = None) -> Iterator[ProcessPoolExecutor]:
    """Context manager that provides a pool of worker processes, by default one per processor.

    If the block of the `with` statement raises an exception, including KeyboardInterrupt, the
    worker processes are killed, even if their tasks are not finished. If the process that created
    the pool is killed, the worker processes end by themselves.
    """
    others = set(multiprocessing.active_children())
    try:
        pool = ProcessPoolExecutor(count, initializer=end_with_parent)
    except (OSError, ImportError) as error:
        raise InputError(
            f"trials run in several processes, which need semaphores in shared memory: {error}"
        ) from error
    try:
        yield pool
    except BaseException:
        for process in set(multiprocessing.active_children()) - others:
            process.kill()
        pool.shutdown(cancel_futures=True)
        raise
    pool.shutdown()


def processors() -> int:
    """Return the number of processors that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def in_parallel(
    function: Callable[[Sequence[One]], Result],
    chunks: Iterable[Sequence[One]],
    lost: Callable[[One], Result],
    count: int | None = None,
) -> Iterator[Result]:
    """Call a function with each chunk of items in `count` processes, and yield the results.

    The results are in the order of computation. By default, there is one process per processor. If
    one of the processes is killed, all processes end. The items that were already sent to the
    processes and have no result are then processed one by one, each in a separate process. If the
    separate process of an item is killed in each of `ATTEMPTS` attempts, the result is
    `lost(item)`. The remaining chunks are processed in new processes.
    """
    size = count or processors()
    waiting = deque(chunks)
    while waiting:
        running: dict[Future[Result], Sequence[One]] = {}
        try:
            with workers(size) as pool:
                while waiting or running:
                    while waiting and len(running) < AHEAD * size:
                        chunk = waiting.popleft()
                        running[pool.submit(function, chunk)] = chunk
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        yield future.result()
                        del running[future]
        except BrokenExecutor:
            for item in chain.from_iterable(running.values()):
                yield alone(partial(in_own_process, function, item), BrokenExecutor) or lost(item)


def in_own_process(function: Callable[[Sequence[One]], Result], item: One) -> Result:
    """Call a function with a chunk of one item in a new process."""
    with workers(1) as pool:
        return pool.submit(function, [item]).result()


def alone(run: Callable[[], Result], killed: type[Exception]) -> Result | None:
    """Return the result of `run`, which processes a single item while no other one is processed.

    If the process is killed, `run` raises `killed`, and is called again. After `ATTEMPTS` attempts,
    the result is None.
    """
    for _ in range(ATTEMPTS):
        with contextlib.suppress(killed):
            return run()
    return None


def end_with_parent() -> None:
    """Prepare a worker process to end with its parent process, and to ignore Ctrl-C.

    This function is called at the start of each worker process. A terminal sends a signal such as
    Ctrl-C to the parent process and to the worker processes. Only the parent process reacts to the
    signal, and then ends the worker processes. Of the signals in `SIGNALS`, a worker process
    ignores all except SIGTERM.
    """
    for name in SIGNALS:
        if number := getattr(signal, name, None):
            signal.signal(number, signal.SIG_DFL if name == "SIGTERM" else signal.SIG_IGN)
    threading.Thread(target=await_parent, daemon=True).start()


def await_parent() -> None:
    """Wait until the parent process has ended, then end this process."""
    if parent := multiprocessing.parent_process():
        parent.join()
    os._exit(1)
