"""Sweeps on a Dask cluster."""

from __future__ import annotations

import contextlib
import socket

import pytest

from teleop.cli import main
from teleop.studies.sweep.dask_cluster import cluster

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


def test_a_second_cluster_on_the_same_machine_gives_no_warning(tmp_path, recwarn):
    with socket.socket() as other:
        with contextlib.suppress(OSError):  # another program may have the port already
            other.bind(("", 8787))
            other.listen()
        with cluster("local", 1):
            pass
    assert not [str(one.message) for one in recwarn if "Port" in str(one.message)]


def test_a_scheduler_that_does_not_exist_is_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("teleop.studies.sweep.dask_cluster.TIMEOUT", 0.5)
    plan = tmp_path / "plan.toml"
    plan.write_text(PLAN)
    options = ["--dask", "tcp://127.0.0.1:9", "--out", str(tmp_path / "out")]
    assert main(["sweep", str(plan), *options]) == 2
    assert "tcp://127.0.0.1:9" in capsys.readouterr().err
