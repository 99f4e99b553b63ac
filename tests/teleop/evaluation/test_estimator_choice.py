"""Estimators and models that a person chooses, from the command line to the recording."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from estimation import METHODS
from estimation.registry import PAPER
from teleop.cli import main

MEASURED = Path(__file__).parents[3] / "examples" / "data" / "mach1"
RUN = ["run", "--clock", "virtual", "--duration", "0.6", "--condition", "autonomous"]


def run_json(capsys, *arguments):
    """The document that a command prints."""
    assert main([*map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def write_table(path, frequency, b, k, seed=0, noise=1e-3):
    """Twelve periods of a sine on a Kelvin-Voigt body, with noise."""
    t = np.arange(0.0, 12.0 / frequency, 0.01 / frequency)
    w = 2.0 * np.pi * frequency
    x = 2e-3 * np.sin(w * t)
    f = k * x + b * 2e-3 * w * np.cos(w * t)
    f += np.random.default_rng(seed).normal(0.0, noise * np.abs(f).max(), t.size)
    rows = "".join(f"{a:.6f},{p:.9f},{q:.9f}\n" for a, p, q in zip(t, x * 1e3, f, strict=True))
    path.write_text("Time [s],Displacement [mm],Force [N]\n" + rows)
    return path


def test_every_estimator_runs_live_is_recorded_and_estimates_again_to_the_bit(capsys, tmp_path):
    path = tmp_path / "all.mcap"
    live = run_json(capsys, *RUN, "--estimators", "all", "--model", "stiffening", "--record", path)
    assert [*live["estimates"]] == [*METHODS]
    again = run_json(capsys, "estimate", path)
    assert again["as_online"]
    assert again["estimates"]["rls"]["further"] == live["estimates"]["rls"]["further"]
    assert again["estimates"]["hc_log"]["further"].keys() == {"K", "B", "n"}
    assert {"me", "hc_log", "segments"} < {*again["own_model"]}
    assert "rls" not in again["own_model"]
    fewer = run_json(capsys, "estimate", path, "--estimators", "rls,ai", "--model", "kelvin-voigt")
    assert [*fewer["estimates"]] == ["rls", "ai"]
    assert not fewer["as_online"]
    assert fewer["own_model"] == []


@pytest.mark.usefixtures("without_drawings")
def test_a_report_needs_none_of_the_papers_estimators(capsys, tmp_path):
    path = tmp_path / "kalman.mcap"
    chosen = ["--estimators", "kalman,segments", "--model", "stiffening"]
    assert main([*RUN, *chosen, "--record", str(path)]) == 0
    assert main(["report", str(path)]) == 0
    page = path.with_suffix(".html").read_text()
    assert "kalman" in page
    assert "at the end" in page


def test_the_papers_three_are_the_default(capsys):
    document = run_json(capsys, *RUN, "--no-record")
    assert tuple(document["estimates"]) == PAPER
    assert "one_step_ratio" not in document["estimates"]["rls"]


def test_estimates_of_one_file_are_the_same_in_every_call(capsys, tmp_path):
    table = write_table(tmp_path / "sine.csv", 1.0, 20.0, 2100.0)
    command = ("estimate", str(table), "--estimators", "rls,kalman,window", "--json")
    printed = []
    for _ in range(2):
        assert main([*command]) == 0
        printed.append(capsys.readouterr().out)
    assert printed[0] == printed[1]


def test_cost_is_measured_on_request(capsys, tmp_path):
    table = write_table(tmp_path / "sine.csv", 1.0, 20.0, 2100.0)
    rows = run_json(capsys, "estimate", table, "--estimators", "rls,kalman", "--cost")["estimates"]
    assert all(row["cost_us"] > 0.0 for row in rows.values())
    assert main(["estimate", str(table), "--cost"]) == 0
    assert "cost [us]" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("extra", "names"),
    [
        (("--estimators", "rls,hc_log,hc_double"), ["hc_log", "hc_double"]),
        (("--estimators", "rls,me", "--model", "stiffening"), ["rls"]),
        (("--estimators", "rls,me"), []),
    ],
)
def test_estimators_whose_model_is_not_linear_in_x_need_the_contact(capsys, tmp_path, extra, names):
    table = write_table(tmp_path / "sine.csv", 1.0, 20.0, 2100.0)
    command = ("estimate", table, *extra, "--datum", "mean")
    assert run_json(capsys, *command)["from_contact"] == names
    assert main([str(word) for word in command]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert (f"{', '.join(names)}: position must be measured from the contact" in out) is bool(names)


def test_more_estimators_are_compared(capsys, tmp_path):
    table = write_table(tmp_path / "sine.csv", 1.0, 20.0, 2100.0)
    assert main(["estimate", str(table), "--estimators", "rls,kalman,window", "--details"]) == 0
    out = capsys.readouterr().out
    for word in ("rms/window", "k within", "kalman", "window", "least squares"):
        assert word in out
    assert "cost" not in out
    rows = run_json(capsys, "estimate", table, "--estimators", "rls,kalman,window")["estimates"]
    for row in rows.values():
        assert row["k_end"] == pytest.approx(2100.0, abs=3.0 * row["k_interval"])
        assert row["k_coverage"] > 0.5


@pytest.mark.parametrize(
    ("option", "value", "expected"),
    [
        ("--estimators", "rls,magic", "estimator 'magic': expected all, or some of rls, ai, me"),
        ("--estimators", "rls,rls", "estimator 'rls' is given twice"),
        ("--estimators", ",", "no estimator is given"),
        ("--model", "jelly", "--model"),
    ],
)
@pytest.mark.parametrize("command", ["run", "estimate"])
def test_a_choice_that_is_none_is_one_line(capsys, tmp_path, command, option, value, expected):
    table = write_table(tmp_path / "sine.csv", 1.0, 20.0, 2100.0)
    arguments = [*RUN, "--no-record"] if command == "run" else ["estimate", str(table)]
    assert main([*arguments, option, value]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert "Traceback" not in error


def test_a_model_that_needs_matched_signals_says_so(capsys):
    assert main([*RUN, "--no-record", "--model", "sls", "--conditioning", "foaw"]) == 2
    assert "model sls: expected conditioning matched, not foaw" in capsys.readouterr().err


def test_recordings_of_one_body_agree(capsys, tmp_path):
    files = [
        write_table(tmp_path / f"{f}.csv", f, 20.0, 2100.0, seed=i)
        for i, f in enumerate((0.5, 2.0))
    ]
    document = run_json(capsys, "estimate", *files)
    assert [file["file"] for file in document["files"]] == [*map(str, files)]
    assert document["together"]["misfit"] == {}
    assert document["together"]["b"] == pytest.approx(20.0, rel=0.1)
    picture = tmp_path / "stiffness.png"
    assert main(["estimate", *map(str, files), "--plot-fit", str(picture)]) == 0
    assert picture.stat().st_size > 10_000
    out = " ".join(capsys.readouterr().out.split())
    for row, frequency in zip(document["together"]["complex_stiffness"], (0.5, 2.0), strict=True):
        loss = 20.0 * 2.0 * np.pi * frequency
        assert row["storage_n_per_m"] == pytest.approx(2100.0, rel=0.01)
        assert row["loss_n_per_m"] == pytest.approx(loss, abs=2.0 * row["loss_interval_n_per_m"])
    assert "one Kelvin-Voigt body is consistent with all 2 files; a difference of k by" in out


def test_a_body_whose_damping_falls_with_frequency_is_distinguished_from_a_kelvin_voigt_one(
    capsys, tmp_path
):
    files = [
        write_table(tmp_path / "slow.csv", 0.5, 60.0, 2100.0),
        write_table(tmp_path / "fast.csv", 2.0, 15.0, 2100.0),
    ]
    together = run_json(capsys, "estimate", *files)["together"]
    assert together["misfit"]["b"] == pytest.approx(4.0, rel=0.1)
    assert together["ratios"]["b"]["low"] < 4.0 < together["ratios"]["b"]["high"]
    assert "k" not in together["misfit"]
    assert together["rms"] > 3.0 * together["rms_alone"]
    assert main(["estimate", *map(str, files)]) == 0
    assert "Kelvin-Voigt does not fit" in capsys.readouterr().out


def test_files_for_one_recording_are_refused_for_several(capsys, tmp_path):
    files = [str(write_table(tmp_path / f"{i}.csv", 1.0, 20.0, 2100.0)) for i in range(2)]
    for option in ("--out", "--plot"):
        assert main(["estimate", *files, option, str(tmp_path / "x.png")]) == 2
        assert "--out, --plot and --plot-force need exactly one file" in capsys.readouterr().err


@pytest.mark.usefixtures("interpreted")
def test_on_measured_tissue_the_best_beats_batch_and_the_set_is_distinguished(capsys):
    files = sorted(MEASURED.glob("*.csv"))
    assert len(files) == 3
    document = run_json(capsys, "estimate", *files, "--estimators", "rls,observer,window")
    for file in document["files"]:
        ratios = {name: row["one_step_ratio"] for name, row in file["estimates"].items()}
        assert min(ratios.values()) <= 1.0, file["file"]
    assert "b" in document["together"]["misfit"]


def test_what_a_comparison_of_short_files_would_find_is_reported(capsys, tmp_path):
    files = [write_table(tmp_path / f"{i}.csv", 1.0, 20.0, 2100.0) for i in range(2)]
    for file in files:
        lines = file.read_text().splitlines(keepends=True)
        file.write_text("".join(lines[:40]))
    assert main(["estimate", *map(str, files), "--estimators", "all"]) == 0
    assert "is detected in 80 % of such tests" in " ".join(capsys.readouterr().out.split())


def test_a_model_that_no_estimator_takes_is_refused_before_anything_moves(capsys, tmp_path):
    table = write_table(tmp_path / "sine.csv", 1.0, 20.0, 2100.0)
    for command in ([*RUN, "--no-record"], ["estimate", str(table)]):
        assert main([*command, "--estimators", "me,segments", "--model", "datum"]) == 2
        assert "model datum: none of me, segments supports it" in capsys.readouterr().err


def test_a_file_named_twice_is_refused(capsys, tmp_path):
    table = str(write_table(tmp_path / "sine.csv", 1.0, 20.0, 2100.0))
    assert main(["estimate", table, table]) == 2
    assert "is given twice" in capsys.readouterr().err


def test_of_several_files_the_bad_one_is_named(capsys, tmp_path):
    good = write_table(tmp_path / "good.csv", 1.0, 20.0, 2100.0)
    still = tmp_path / "still.csv"
    still.write_text(
        "Time [s],Position [mm],Force [N]\n" + "".join(f"{i},{i},1\n" for i in range(50))
    )
    assert main(["estimate", str(good), str(still)]) == 2
    assert f"{still}: nothing to estimate from" in capsys.readouterr().err


def test_two_bodies_are_distinguished_however_unlike_the_noise(capsys, tmp_path):
    files = [
        write_table(tmp_path / "quiet.csv", 1.0, 20.0, 2000.0),
        write_table(tmp_path / "loud.csv", 1.0, 20.0, 4000.0, noise=0.03),
    ]
    assert "k" in run_json(capsys, "estimate", *files)["together"]["misfit"]
