"""Run the points of a sweep on a Dask cluster, which can consist of several machines."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import pickle
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

from teleop.errors import InputError
from teleop.studies.sweep.executors import Execute, chunks_of, lost
from teleop.studies.sweep.origin import versions
from teleop.studies.sweep.points import Point
from teleop.studies.sweep.tasks import Computed, Task, computed
from teleop.studies.workers import AHEAD, alone, processors
from telepalpation import needs

LOCAL = "local"
"""Address with which a new cluster is started on this machine."""
TIMEOUT = 30.0
"""Time within which the scheduler must answer, and within which it must then have a worker [s]."""


def on_dask(address: str, count: int | None = None) -> Execute:
    """Return a function that runs a task at the points of a sweep on a Dask cluster.

    `address` is that of a scheduler, such as tcp://10.0.0.1:8786, or `LOCAL` for a cluster of
    `count` processes on this machine.

    If a worker is killed, Dask assigns its points to another worker. Points with which several
    workers are killed are abandoned by Dask; at the end, they are run again one by one (`alone`).
    """
    if not address.strip():
        raise InputError(
            "dask: the address is empty: expected the address of a scheduler, such as "
            f"tcp://10.0.0.1:8786, or {LOCAL}"
        )
    try:
        import distributed
    except ImportError as error:
        raise InputError(needs("a Dask cluster", "distributed", "sweep")) from error

    def execute(task: Task, points: Sequence[Point]) -> Iterator[Computed]:
        with cluster(address, count) as client:
            finished: Any = distributed.as_completed()  # type: ignore[no-untyped-call]
            waiting = chunks_of(task, points)
            chunks: dict[str, Sequence[Point]] = {}

            def submit() -> None:
                for chunk in waiting:
                    future = submitted(client, task, chunk)
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
                    run = partial(result_of, client, task, point)
                    yield alone(run, distributed.KilledWorker) or lost(point)
            except (OSError, distributed.CancelledError) as error:
                raise InputError(
                    f"the connection to the Dask scheduler {address} was lost: {error}; to "
                    "resume, enter the same command again"
                ) from error
            except InputError:
                raise
            except Exception as error:  # `results` catches the errors of a point
                check_workers(client, address)
                raise InputError(
                    f"dask {address}: a worker cannot run a point: {type(error).__name__}: {error}"
                ) from error

    return execute


class Call:
    """A call of a function, which is made when the pickled object is loaded.

    Scheduler and workers receive the pickled object as bytes. Without teleop, or with another
    version, a worker therefore reports an error. If the function itself were sent, such a worker
    would not answer at all.
    """

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        self._call = function, arguments

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return self._call


def submitted(client: Any, task: Task, points: Sequence[Point]) -> Any:
    """Send points to the cluster, and return the future of their results."""
    return client.submit(pickle.loads, packed(computed_on_worker, task, points), pure=False)


def result_of(client: Any, task: Task, point: Point) -> Computed:
    """Run a task at one point on the cluster."""
    found: Computed = submitted(client, task, [point]).result()
    return found


def packed(function: Callable[..., Any], *arguments: Any) -> bytes:
    """Return a pickled call of a function, which `pickle.loads` makes."""
    from distributed.protocol.pickle import dumps

    found: bytes = dumps(Call(function, *arguments))  # type: ignore[no-untyped-call]
    return found


def computed_on_worker(task: Task, points: Sequence[Point]) -> Computed:
    """Run a task at points, and return the results with the address of this worker."""
    from distributed import get_worker

    return computed(task, points)._replace(place=f"worker {get_worker().address}")


def check_workers(client: Any, address: str) -> None:
    """Raise InputError if a worker cannot import teleop, or has other versions of the software."""
    others = []
    answers = client.run(pickle.loads, packed(versions), on_error="return")
    for worker, found in answers.items():
        if isinstance(found, BaseException):
            others.append(f"worker {worker} cannot import teleop: {found}")
        elif found != versions():
            packages = ", ".join(f"{name} {version}" for name, version in found.items())
            others.append(f"worker {worker} has {packages}")
    if others:
        expected = ", ".join(f"{name} {version}" for name, version in versions().items())
        raise InputError(f"dask {address}: {'; '.join(others)}: expected {expected}")


@contextlib.contextmanager
def cluster(address: str, count: int | None) -> Iterator[Any]:
    """Context manager that provides a Dask client, which is connected to a Dask cluster.

    A cluster that was started on this machine ends at the end of the `with` block. The parameters
    are the same as for `on_dask`.
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
                asyncio.run(asyncio.wait_for(answer(address), TIMEOUT))
                client = stack.enter_context(Client(address, timeout=TIMEOUT))  # type: ignore[no-untyped-call]
            client.wait_for_workers(1, timeout=TIMEOUT)
        except Exception as error:  # Dask and its connections raise many types
            problem = str(error) or f"no scheduler answers within {TIMEOUT:g} s"
            raise InputError(
                f"dask {address}: {problem}: expected the address of a scheduler with workers, or "
                f"{LOCAL}"
            ) from error
        check_workers(client, address)
        yield client


async def answer(address: str) -> None:
    """Wait until a scheduler answers. `Client` waits without limit for a program that is silent."""
    from distributed.comm.core import connect
    from distributed.security import Security

    security: Any = Security()  # type: ignore[no-untyped-call]
    arguments = security.get_connection_args("client")
    try:
        comm = await connect(address, timeout=TIMEOUT, **arguments)  # type: ignore[no-untyped-call]
    except MemoryError as error:  # Dask takes the first bytes of any answer as a length
        raise ValueError("the program at this address is not a Dask scheduler") from error
    comm.abort()
