"""Worker processes that end with whoever started them."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor

from teleop.errors import InputError
from teleop.interruption import ENDING


@contextlib.contextmanager
def workers() -> Iterator[ProcessPoolExecutor]:
    """Give a pool of processes, one a core, that ends with the block.

    If the block raises, KeyboardInterrupt included, the processes are killed: work that is under
    way is not waited for. If this process is killed, they end by themselves.

    Raises
    ------
    InputError
        The system grants no semaphores, as where /dev/shm cannot be written.
    """
    others = set(multiprocessing.active_children())
    try:
        pool = ProcessPoolExecutor(initializer=end_with_parent)
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
    """Leave signals to the parent process, and end when it has ended.

    A terminal sends its signals to the workers too.
    """
    for name in ENDING:
        if number := getattr(signal, name, None):
            signal.signal(number, signal.SIG_DFL if name == "SIGTERM" else signal.SIG_IGN)
    threading.Thread(target=await_parent, daemon=True).start()


def await_parent() -> None:
    """Wait for the end of the parent process, and end."""
    if parent := multiprocessing.parent_process():
        parent.join()
    os._exit(1)
