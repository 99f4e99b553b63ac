"""Run the points of a sweep on a Dask cluster, which can consist of several machines.

A point is one combination of values of the settings. A worker is a process of the cluster. The
scheduler is the process that assigns points to the workers.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from typing import Any

from teleop.errors import InputError
from teleop.studies.sweep.executors import (
    AHEAD,
    ATTEMPTS,
    Execute,
    Results,
    chunks_of,
    killed,
    processors,
)
from teleop.studies.sweep.points import Point
from teleop.studies.sweep.tasks import Task, results

LOCAL = "local"
"""Address with which a new cluster is started on this machine."""
TIMEOUT = 30.0
"""Time within which the cluster must have a worker [s]."""


def on_dask(address: str, count: int | None = None) -> Execute:
    """Return a function that runs a task at the points of a sweep on a Dask cluster.

    If a worker (process of the cluster) is killed, Dask assigns the points of this worker to
    another worker. If several workers are killed with the same points, Dask abandons these points.
    At the end, the abandoned points are run again one by one. If Dask abandons a point `ATTEMPTS`
    more times, the result of the point is an error.

    Parameters
    ----------
    address
        Address of the scheduler, such as tcp://10.0.0.1:8786, or `local` for a cluster of
        processes on this machine.
    count
        Number of processes if `address` is `local`; None for one process per processor. Not used
        for another address.

    Raises
    ------
    InputError
        dask.distributed is not installed.
    """
    try:
        import distributed
    except ImportError as error:
        raise InputError("a Dask cluster needs distributed: pip install '.[sweep]'") from error

    def execute(task: Task, points: Sequence[Point]) -> Iterator[Results]:
        with cluster(address, count) as client:
            finished: Any = distributed.as_completed()  # type: ignore[no-untyped-call]
            waiting = chunks_of(task, points)
            chunks: dict[str, Sequence[Point]] = {}

            def submit() -> None:
                for chunk in waiting:
                    future = client.submit(results, task, chunk, pure=False)
                    chunks[future.key] = chunk
                    finished.add(future)
                    return

            for _ in range(AHEAD * max(1, len(client.scheduler_info()["workers"]))):
                submit()
            suspects: list[Point] = []
            try:
                for future in finished:
                    chunk = chunks.pop(future.key)
                    try:
                        yield future.result()
                    except distributed.KilledWorker:
                        suspects.extend(chunk)
                    submit()
                for point in suspects:
                    yield alone(client, task, point)
            except (OSError, distributed.CancelledError) as error:
                raise InputError(
                    f"the connection to the Dask scheduler {address} was lost: {error}; to "
                    "resume, enter the same command again"
                ) from error

    return execute


def alone(client: Any, task: Task, point: Point) -> Results:
    """Run a single point of a sweep while the cluster has no other work, and return its result.

    If Dask abandons the point because its workers are killed, the point is run again. After
    `ATTEMPTS` attempts, the result is an error.

    Parameters
    ----------
    client
        Dask client that is connected to the cluster.
    task
        Task that is run at the point.
    point
        The point.

    Returns
    -------
    A list with the result of this point.
    """
    from distributed import KilledWorker

    for _ in range(ATTEMPTS):
        with contextlib.suppress(KilledWorker):
            found: Results = client.submit(results, task, [point], pure=False).result()
            return found
    return [killed(point)]


@contextlib.contextmanager
def cluster(address: str, count: int | None) -> Iterator[Any]:
    """Context manager that provides a Dask client, which is connected to a Dask cluster.

    A cluster that was started on this machine ends at the end of the `with` block. The parameters
    are the same as for `on_dask`.

    Raises
    ------
    InputError
        The scheduler cannot be reached, the scheduler has no workers, or a worker has another
        version of teleop.
    """
    from distributed import Client, LocalCluster

    with contextlib.ExitStack() as stack:
        try:
            if address == LOCAL:
                logging.getLogger("distributed").setLevel(logging.ERROR)
                number = count or processors()
                local: Any = LocalCluster(
                    n_workers=number, threads_per_worker=1, dashboard_address=":0"
                )  # type: ignore[no-untyped-call]
                stack.enter_context(local)
                local.adapt(minimum=number, maximum=number)  # replaces workers that have ended
                client = stack.enter_context(Client(local))  # type: ignore[no-untyped-call]
            else:
                client = stack.enter_context(Client(address, timeout=TIMEOUT))  # type: ignore[no-untyped-call]
            client.wait_for_workers(1, timeout=TIMEOUT)
            others = set(client.run(installed_version).values()) - {installed_version()}
        except (OSError, ValueError) as error:
            raise InputError(
                f"dask {address}: {error}: expected the address of a scheduler with workers, or "
                f"{LOCAL}"
            ) from error
        if others:
            raise InputError(
                f"dask {address}: workers have version {', '.join(sorted(others))} of teleop: "
                f"expected {installed_version()}"
            )
        yield client


def installed_version() -> str:
    """Return the version of teleop that is installed on the machine that calls this function."""
    return version("teleop")
