"""Run the points of a sweep on a Dask cluster."""

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
    """Return a function that runs points on a Dask cluster.

    If several workers to which Dask assigned the same points are killed one after another, Dask
    abandons these points. At the end, the abandoned points are run again one by one. If Dask
    abandons a point `ATTEMPTS` more times, the result of the point is an error.

    Parameters
    ----------
    address
        Address of the scheduler, such as tcp://10.0.0.1:8786, or `local` for a cluster of
        processes on this machine.
    count
        Number of processes of a cluster on this machine; None for one process per processor.

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
    """Run a single point while the cluster has no other work, and return its results.

    If Dask abandons the point `ATTEMPTS` times because its workers are killed, the result is an
    error.
    """
    from distributed import KilledWorker

    for _ in range(ATTEMPTS):
        with contextlib.suppress(KilledWorker):
            found: Results = client.submit(results, task, [point], pure=False).result()
            return found
    return [killed(point)]


@contextlib.contextmanager
def cluster(address: str, count: int | None) -> Iterator[Any]:
    """Provide a Dask client that is connected to a cluster, within the `with` block.

    The parameters are those of `on_dask`.

    Raises
    ------
    InputError
        The scheduler cannot be reached, has no workers, or a worker has another version of this
        package.
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
    """Return the version of this package."""
    return version("teleop")
