"""`teleop machine check` measures the loop, and says what other programs use."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from teleop.cli import main
from teleop.recording.recording import load
from teleop.trial.other_programs import ticks_per_second

REASONS = {"yes": 0, "with delays": 0, "no": 2}
"""Exit code of each verdict."""


@pytest.mark.real_time
def test_a_measurement_has_a_verdict_and_its_figures(capsys):
    code = main(["machine", "check", "--rate", "500", "--duration", "0.5", "--json"])
    found = json.loads(capsys.readouterr().out)
    assert code == REASONS[found["verdict"]]
    assert found["rate_hz"] == 500.0
    assert found["duration_s"] == pytest.approx(0.5, abs=0.2)
    assert found["ticks"] + found["skipped"] == pytest.approx(250, abs=100)
    late, tick = found["lateness_us"], found["tick_us"]["busy"]
    assert 0.0 <= late["p50"] <= late["p99"] <= late["p99_9"] <= late["max"]
    assert 5.0 < tick["p50"] <= tick["max"]
    assert found["margin_s"] == pytest.approx(0.08 - found["longest_gap_s"])
    assert set(found["realtime"]) >= {"SCHED_FIFO", "locked memory"}


@pytest.mark.real_time
@pytest.mark.skipif(not ticks_per_second(), reason="the use of the processors is not known")
def test_a_busy_program_beside_the_loop_is_named(capsys, monkeypatch):
    monkeypatch.setattr("teleop.trial.other_programs.NAMED", 100)  # also beside other tests
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        main(["machine", "check", "--rate", "200", "--duration", "1"])
    finally:
        busy.kill()
        busy.wait()
    out = capsys.readouterr().out
    assert f"(process {busy.pid})" in out
    assert "end " in out
    used = float(out.partition("other programs used ")[2].split()[0])
    assert used > 0.2


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--rate", "1"), "rate 1 Hz: expected 50 to 100000 Hz"),
        (("--rate", "fast"), "expected a frequency with its unit"),
        (("--duration", "0"), "duration 0 s: expected 0.1 to 3600 s"),
        (("--duration", "nan"), "expected a time with its unit"),
    ],
)
def test_an_impossible_measurement_is_refused(refused, arguments, expected):
    assert expected in refused("machine", "check", *arguments)


@pytest.mark.real_time
def test_a_trial_says_before_its_start_whether_the_rate_is_possible_and_records_it(
    tmp_path, capsys
):
    path = tmp_path / "trial.mcap"
    options = ["--rate", "1200", "--duration", "0.5", "--record", str(path)]
    assert main(["run", "--condition", "autonomous", *options]) == 0
    (said,) = [line for line in capsys.readouterr().err.splitlines() if "this computer" in line]
    assert "teleop: 1200 Hz: this computer can run the loop" in said
    assert load(path).session["machine_check"] == said.removeprefix("teleop: ")


def test_a_rate_that_no_computer_can_run_is_refused_before_the_start(tmp_path, refused):
    path = tmp_path / "trial.mcap"
    error = refused("run", "--rate", "100000", "--record", path)
    assert "rate 100000 Hz: " in error
    assert "or --clock virtual" in error
    assert not path.exists()
