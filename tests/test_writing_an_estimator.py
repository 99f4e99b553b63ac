"""The code of docs/writing-an-estimator.md works as it stands, as a package beside this one."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
RUN = ["run", "--clock", "virtual", "--duration", "0.6", "--condition", "autonomous"]


def python(*arguments, path=None, cwd=None):
    """A Python of its own, with the package or without."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, [path or ROOT, ROOT]))}
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        capture_output=True,
        text=True,
        env=environment,
        cwd=cwd,
        check=False,
    )


def test_its_tests_pass(third_party, estimator_page):
    tests = estimator_page.block("def test_it_keeps")
    names = re.findall(r"def (test_\w+)", tests)
    assert len(names) == 2
    calls = "".join(f"{name}()\n" for name in names)
    done = python("-c", f"{tests}\n{calls}", path=third_party)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def recorded(third_party, tmp_path_factory):
    """What `teleop run` prints with the estimator, and the recording."""
    path = tmp_path_factory.mktemp("trial") / "nlms.mcap"
    options = ["--estimators", "rls,nlms", "--record", path, "--json"]
    done = python("-m", "teleop", *RUN, *options, path=third_party, cwd=path.parent)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), path


def test_it_runs_by_its_name_and_is_recorded(recorded):
    summary, _ = recorded
    assert list(summary["estimates"]) == ["rls", "nlms"]
    assert summary["estimates"]["nlms"]["k"] > 0.0


def test_its_recording_is_estimated_again_to_the_bit(third_party, recorded):
    done = python("-m", "teleop", "estimate", recorded[1], "--json", path=third_party)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["as_online"]
    assert list(summary["estimates"]) == ["rls", "nlms"]


def test_it_is_in_the_report(third_party, recorded):
    done = python("-m", "teleop", "report", recorded[1], path=third_party)
    assert done.returncode == 0, done.stderr
    assert "nlms" in recorded[1].with_suffix(".html").read_text()


def test_all_includes_it(third_party):
    code = "from estimation.registry import named_estimators; print(named_estimators('all')[-1])"
    assert python("-c", code, path=third_party).stdout.strip() == "nlms"


def test_without_the_package_its_recording_loads_and_the_missing_estimator_is_named(recorded):
    done = python("-m", "teleop", "estimate", recorded[1])
    assert done.returncode == 2
    assert "nlms" in done.stderr
    assert "Traceback" not in done.stderr
    other = python("-m", "teleop", "estimate", recorded[1], "--estimators", "rls", "--json")
    assert other.returncode == 0, other.stderr


def test_a_package_that_cannot_be_imported_is_named_in_one_line(tmp_path):
    broken = tmp_path / "site"
    (broken / "broken-1.dist-info").mkdir(parents=True)
    (broken / "broken-1.dist-info" / "METADATA").write_text("Name: broken\nVersion: 1\n")
    points = "[teleop.estimators]\nbroken = no_such_module:make\n"
    (broken / "broken-1.dist-info" / "entry_points.txt").write_text(points)
    done = python("-m", "teleop", *RUN, "--estimators", "broken", path=broken, cwd=tmp_path)
    assert done.returncode == 2
    assert "no_such_module" in done.stderr
    assert "Traceback" not in done.stderr
