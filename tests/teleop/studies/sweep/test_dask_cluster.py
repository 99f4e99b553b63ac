"""Sweeps on a Dask cluster."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import warnings
from threading import Thread

import pytest

from teleop.cli import main
from teleop.errors import InputError
from teleop.studies.sweep.dask_cluster import cluster, on_dask
from teleop.studies.sweep.points import Point

dask = pytest.importorskip("dask", reason="needs the `sweep` extra")
LocalCluster = pytest.importorskip("distributed", reason="needs the `sweep` extra").LocalCluster

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
        chunk, files, plug_ins = 1, {}, ()

        def rows(self, point):
            if point.number == 2:
                os.kill(os.getpid(), signal.SIGKILL)
            return [{"estimator": str(point.number)}]

    points = [Point(number, (), 0) for number in range(5)]
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        found = {
            one["point"]: one for chunk in on_dask("local", 1)(Deadly(), points) for one in chunk[0]
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


WORKER = """
import sys, telepalpation
{change}
from distributed.cli.dask_worker import main
main()
"""
OTHER_VERSION = "telepalpation.__version__ = '0.0.1'"
NOT_INSTALLED = "sys.modules['teleop'] = None"


@pytest.fixture
def changed_worker(request):
    """The address of a scheduler whose only worker runs on a machine with other software."""
    with LocalCluster(n_workers=0, dashboard_address=":0") as scheduler:
        address = scheduler.scheduler_address
        code = WORKER.format(change=request.param)
        options = ("--no-nanny", "--no-dashboard", "--nthreads", "1")
        command = [sys.executable, "-c", code, address, *options]
        worker = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        yield address
        worker.kill()
        worker.wait()


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("changed_worker", "at_start", "later"),
    [
        (OTHER_VERSION, "has teleop 0.0.1", r"not used.*teleop: 0\.0\.1\b.*, expected"),
        (NOT_INSTALLED, "cannot import teleop", "cannot run a point: ModuleNotFoundError"),
    ],
    indirect=["changed_worker"],
)
def test_a_worker_with_other_software_is_refused_also_if_it_joins_while_the_sweep_runs(
    changed_worker, at_start, later, tmp_path, capsys, monkeypatch
):
    plan = tmp_path / "plan.toml"
    plan.write_text(PLAN)
    options = ["--dask", changed_worker, "--out", str(tmp_path / "out")]
    for message in (at_start, later):
        assert main(["sweep", str(plan), *options]) == 2
        error = capsys.readouterr().err
        assert re.search(message, error)
        assert error.count("\n") == 1
        monkeypatch.setattr("teleop.studies.sweep.dask_cluster.check_workers", lambda *_: None)
    assert (tmp_path / "out" / "journal.jsonl").read_text().count("\n") == 1


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("reply", "problem"),
    [
        (b"", "no scheduler answers within 1 s"),
        (
            b"HTTP/1.0 400 Bad Request\r\n\r\n",
            "the program at this address is not a Dask scheduler",
        ),
    ],
)
def test_a_port_without_a_scheduler_is_refused_after_the_time_limit(reply, problem, monkeypatch):
    monkeypatch.setattr("teleop.studies.sweep.dask_cluster.TIMEOUT", 1.0)
    with socket.socket() as server, contextlib.ExitStack() as stack:
        server.bind(("127.0.0.1", 0))
        server.listen()
        Thread(target=lambda: stack.push(server.accept()[0]).sendall(reply), daemon=True).start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(InputError, match=problem):
            next(on_dask(address)(None, [Point(1, (), 0)]))


def test_tls_without_certificates_is_refused_with_one_line():
    with pytest.raises(InputError, match="dask tls://127.0.0.1:9: TLS expects"):
        next(on_dask("tls://127.0.0.1:9")(None, [Point(1, (), 0)]))


def test_an_empty_address_is_refused(tmp_path, refused):
    plan = tmp_path / "plan.toml"
    plan.write_text(PLAN)
    out = tmp_path / "out"
    assert "dask: the address is empty" in refused("sweep", plan, "--dask", "", "--out", out)
    assert not out.exists()


def test_a_scheduler_that_does_not_exist_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("teleop.studies.sweep.dask_cluster.TIMEOUT", 0.5)
    plan = tmp_path / "plan.toml"
    plan.write_text(PLAN)
    options = ["--dask", "tcp://127.0.0.1:9", "--out", str(tmp_path / "out")]
    assert main(["sweep", str(plan), *options]) == 2
    assert "tcp://127.0.0.1:9" in capsys.readouterr().err
