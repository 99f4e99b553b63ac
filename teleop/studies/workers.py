"""Provide worker processes that end when their parent process ends."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor

from teleop.errors import InputError
from teleop.interruption import SIGNALS


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
