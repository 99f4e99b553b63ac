"""Sweeps on a Dask cluster."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import warnings

import pytest

from teleop.cli import main
from teleop.studies.sweep.dask_cluster import cluster, on_dask
from teleop.studies.sweep.points import Point

dask = pytest.importorskip("dask", reason="needs the `sweep` extra")
pytest.importorskip("distributed", reason="needs the `sweep` extra")

PLAN = """
name = "short"
[factors]
cube = ["soft", "medium", "hard"]
condition = ["free", "autonomous"]
[settings]
duration_s = 0.3
"""


def test_a_local_cluster_gives_the_same_table_to_the_byte_as_processes(tmp_path):
    plan = tmp_path / "plan.toml"
    plan.write_text(PLAN)
    for name, options in {"dask": ["--dask", "local"], "pool": []}.items():
        options = [*options, "--workers", "2", "--out", str(tmp_path / name)]
        assert main(["sweep", str(plan), *options]) == 0
    for name in ("results.csv", "results.parquet"):
        assert (tmp_path / "dask" / name).read_bytes() == (tmp_path / "pool" / name).read_bytes()


def test_a_point_that_kills_its_worker_has_an_error_and_no_other_point_is_lost():
    class Deadly:  # a local class: Dask sends it by value
        chunk = 1

        def rows(self, point):
            if point.number == 2:
                os.kill(os.getpid(), signal.SIGKILL)
            return [{"estimator": str(point.number)}]

    points = [Point(number, (), 0) for number in range(5)]
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        found = {
            one["point"]: one for chunk in on_dask("local", 1)(Deadly(), points) for one in chunk
        }
    assert sorted(found) == [*range(5)]
    assert [number for number, one in found.items() if "error" in one] == [2]


@pytest.fixture(scope="module")
def second():
    """The client of a cluster on a machine with another one, and the warnings of its start."""
    with (
        contextlib.ExitStack() as stack,
        socket.socket() as other,
        dask.config.set({"distributed.deploy.lost-worker-timeout": "100ms"}),
    ):
        with contextlib.suppress(OSError):  # another program may have the port already
            other.bind(("", 8787))
            other.listen()
        with warnings.catch_warnings(record=True) as given:
            warnings.simplefilter("always")
            client = stack.enter_context(cluster("local", 1))
        yield client, given
        stack.close()


def test_a_second_cluster_on_the_same_machine_gives_no_warning(second):
    _, given = second
    assert not [str(one.message) for one in given if "Port" in str(one.message)]


def test_a_worker_that_ended_is_replaced(second):
    client, _ = second
    (nanny,) = client.cluster.workers.values()
    client.cluster.sync(nanny.close)
    assert client.submit(os.getpid, pure=False).result(timeout=60) != os.getpid()


def test_a_scheduler_that_does_not_exist_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("teleop.studies.sweep.dask_cluster.TIMEOUT", 0.5)
    plan = tmp_path / "plan.toml"
    plan.write_text(PLAN)
    options = ["--dask", "tcp://127.0.0.1:9", "--out", str(tmp_path / "out")]
    assert main(["sweep", str(plan), *options]) == 2
    assert "tcp://127.0.0.1:9" in capsys.readouterr().err
