"""A device and an estimator, each in a package of its own, work in every command.

The packages are that of `teleop rig new-driver` and that of docs/writing-an-estimator.md.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import signal
import subprocess
import sys
import tomllib

import pytest

from teleop.cli import main

from .forked_command import start_command

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="there are no pseudo-terminals on this system"
)
ATTEMPTS = 4
"""A command in real time is repeated where the machine was taken away meanwhile."""


@contextlib.contextmanager
def emulated(third_party, rig, folder):
    """Run `teleop rig emulate` within the block, and yield the rig file to run against it."""
    path = [str(third_party), os.environ.get("PYTHONPATH", "")]
    out = folder / "run.toml"
    options = ["--condition", "autonomous", "--out", out, "--json"]
    process = start_command(
        *("rig", "emulate", rig, *options),
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, path))},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    try:
        document = ""
        for line in process.stdout:
            document += line
            if line.rstrip() == "}":
                break
        assert document, process.stderr.read()
        assert json.loads(document)["ports"].keys() == {"usb", "tip"}
        yield out
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=10)
    assert process.returncode == 0


def on_the_rig(*arguments):
    """Run a command in real time on the emulated rig, and return the document that it prints."""
    for _ in range(ATTEMPTS):
        with contextlib.redirect_stdout(io.StringIO()) as out:
            code = main([*map(str, arguments), "--json"])
        if not code:
            break
    assert code == 0
    return json.loads(out.getvalue())


TRIAL = "--condition autonomous --duration 1 --estimators rls,nlms"
RUN = f"--specimen soft --depth 10mm --yes {TRIAL}"


@pytest.fixture(scope="module")
def printed(installed, third_party, third_party_rig, tmp_path_factory):
    """What check, tare and run print on the emulated rig, by command, and the recording.

    The emulator uses the processor as long as it runs, so it ends before the other commands.
    """
    folder = tmp_path_factory.mktemp("emulated")
    with (
        emulated(third_party, third_party_rig, folder) as rig,
        installed(third_party),
        contextlib.chdir(folder),
    ):
        found = {
            "check": on_the_rig("rig", "check", rig, "--seconds", 0.3, "--duration", 0.3),
            "tare": on_the_rig("rig", "tare", "--rig", rig),
            "run": on_the_rig("run", "--rig", rig, *RUN.split()),
        }
    return found, folder / found["run"]["recording"]["path"]


@pytest.fixture(scope="module")
def recorded(printed):
    """What `teleop run` prints with the sensor and the estimator, and the recording."""
    found, path = printed
    return found["run"], path


@pytest.fixture(scope="module")
def simulated(installed, third_party, tmp_path_factory):
    """A recording of a simulated trial with the estimator."""
    path = tmp_path_factory.mktemp("simulated") / "trial.mcap"
    trial = ["--clock", "virtual", "--rate", "250", *TRIAL.split(), "--record", str(path)]
    with installed(third_party):
        assert main(["run", *trial]) == 0
    return path


@pytest.fixture
def command(installed, third_party, capsys):
    """Runs a command in this process, which finds the packages, and gives what it prints."""

    def run(*arguments):
        assert main([*map(str, arguments)]) == 0, capsys.readouterr().err
        out = capsys.readouterr().out
        return json.loads(out) if "--json" in arguments else out

    with installed(third_party):
        yield run


def test_the_ports_are_listed(command):
    assert isinstance(command("rig", "list", "--json")["ports"], list)


@pytest.mark.real_time
def test_the_check_shows_the_sensors_channel(printed):
    report = printed[0]["check"]
    channels = {channel["name"]: channel for channel in report["channels"]}
    assert channels["contact_force"]["noise"] > 0.0
    assert all(drive["watchdog_s"] > 0.0 for drive in report["drives"])


@pytest.mark.real_time
def test_its_zero_is_found(printed):
    assert abs(printed[0]["tare"]["contact_force"]) < 0.1


@pytest.mark.real_time
def test_a_trial_estimates_from_the_sensors_force(recorded, third_party_rig):
    summary, path = recorded
    assert list(summary["estimates"]) == ["rls", "nlms"]
    name = tomllib.loads(third_party_rig.read_text())["name"]
    assert (summary["rig"], summary["truth"]) == (name, None)
    assert summary["estimates"]["nlms"]["k"] > 100.0
    assert path.is_file()


@pytest.mark.real_time
def test_the_recording_is_estimated_again(command, recorded):
    summary = command("estimate", recorded[1], "--json")
    assert summary["as_online"], (summary["missing_ticks"], summary["missing_estimates"])
    estimates = summary["estimates"]["nlms"], recorded[0]["estimates"]["nlms"]
    assert estimates[0]["k"] == estimates[1]["k"]
    other = command("estimate", recorded[1], "--estimators", "nlms,kalman", "--json")
    assert list(other["estimates"]) == ["nlms", "kalman"]


@pytest.mark.real_time
def test_without_the_packages_the_recording_loads_and_the_missing_estimator_is_named(
    recorded, capsys
):
    assert main(["estimate", str(recorded[1])]) == 2
    out, error = capsys.readouterr()
    assert (out, error.count("\n")) == ("", 1)
    assert "nlms" in error
    assert main(["estimate", str(recorded[1]), "--estimators", "rls"]) == 0


def test_the_report_shows_the_estimator(command, simulated, tmp_path):
    command("report", simulated, "--out", tmp_path / "report.html")
    assert "nlms" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize("ending", [".csv", ".mat", ".h5", ".parquet"])
def test_the_recording_is_exported_with_the_estimates(command, simulated, tmp_path, ending):
    document = command("export", simulated, "--out", tmp_path / f"run{ending}", "--json")
    assert {"contact_force", "nlms_k", "nlms_k_std"} <= set(document["columns"])


def test_an_exported_file_is_estimated_and_gives_the_lag(command, simulated, tmp_path):
    path = tmp_path / "run.csv"
    command("export", simulated, "--out", path)
    estimated = command("estimate", path, "--estimators", "nlms", "--json")
    assert list(estimated["estimates"]) == ["nlms"]
    assert abs(command("lag", path, "--json")["lag_s"]) < 0.1


@pytest.mark.real_time
def test_a_recording_that_was_cut_off_is_recovered(command, recorded, tmp_path):
    cut = tmp_path / "cut.mcap"
    content = recorded[1].read_bytes()
    cut.write_bytes(content[: len(content) * 2 // 3])
    recovery = command("recover", cut, "--json")
    assert recovery["ticks"] > 100
    estimates = command("estimate", recovery["out"], "--json")["estimates"]
    assert list(estimates) == ["rls", "nlms"]


def test_the_paper_is_reproduced_with_the_estimator_beside_its_own(command, monkeypatch, tmp_path):
    for name, smaller in {
        "trials.DURATION": 2.0,
        "reproduction.SLOW_FREQUENCIES": (1.0,),
        "reproduction.CAPTIONS": {"figure5": "Figure 5."},
    }.items():
        monkeypatch.setattr(f"teleop.studies.paper.{name}", smaller)
    options = ["--estimators", "nlms", "--out", tmp_path / "paper", "--json"]
    document = command("reproduce", *options)
    assert list(document["methods"]) == ["nlms"]
    assert "nlms" in (tmp_path / "paper" / "index.html").read_text()
