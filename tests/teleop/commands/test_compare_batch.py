"""`teleop compare` with many files, whose factors are in their names."""

from __future__ import annotations

import csv
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from estimation.estimator import LEVEL_95
from estimation.registry import Offered
from teleop.cli import main
from teleop.commands.compare import BY_USUAL_NAMES, result_of
from teleop.studies.stored_results import StoredResults
from teleop.studies.sweep.origin import plug_in

PATTERN = "{subject}/{specimen}_rep{n}.csv"
STIFFNESS = {"fat": 600.0, "liver": 1500.0}
SUBJECTS = ("s01", "s02", "s03")


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """A folder with 12 short recordings: three subjects, two specimens, two repetitions."""
    folder = tmp_path_factory.mktemp("batch") / "data"
    rng = np.random.default_rng(20461401)
    t = np.arange(0.0, 3.0, 0.01)
    for subject in SUBJECTS:
        (folder / subject).mkdir(parents=True)
        offset = rng.normal(0.0, 150.0)
        for specimen, stiffness in STIFFNESS.items():
            k = stiffness + offset + rng.normal(0.0, 40.0)
            for n in (1, 2):
                x = 3e-3 * (1.0 - np.cos(2.0 * np.pi * t))
                v = 3e-3 * 2.0 * np.pi * np.sin(2.0 * np.pi * t)
                f = (k + rng.normal(0.0, 20.0)) * x + 8.0 * v + rng.normal(0.0, 0.02, t.size)
                write(folder / subject / f"{specimen}_rep{n}.csv", t, x, f)
    (folder / "README.md").write_text("Indentation tests\n")
    (folder / ".hidden.csv").write_text("nothing")
    return folder


def write(path, t, x, f):
    rows = zip(t, 1e3 * x, f, strict=True)
    lines = "".join(f"{a:.3f},{b:.6f},{c:.6f}\n" for a, b, c in rows)
    path.write_text("Time [s],Position [mm],Force [N]\n" + lines)


def table_of(path):
    with path.open(newline="") as file:
        return [*csv.DictReader(file)]


def found_in(capsys, *arguments):
    capsys.readouterr()
    assert main(["compare", *map(str, arguments), "--json"]) == 0
    captured = capsys.readouterr()
    return json.loads(captured.out), captured.err


@pytest.fixture(scope="module")
def written(data, tmp_path_factory):
    """A folder with the outputs of one command for table, figures and statistics."""
    folder = tmp_path_factory.mktemp("written")
    options = ["--factors", PATTERN, "--by", "specimen", "--anova", "k", "--repeatability", "k"]
    options += ["--out", str(folder / "table.csv"), "--plot", str(folder / "figure.png")]
    options += ["--plot-agreement", str(folder / "agreement.svg")]
    assert main(["compare", str(data), *options]) == 0
    return folder


def test_the_table_has_a_row_with_the_result_of_each_file_and_its_factors(written):
    rows = table_of(written / "table.csv")
    assert [(row["subject"], row["specimen"], row["n"]) for row in rows] == [
        (subject, specimen, n) for subject in SUBJECTS for specimen in STIFFNESS for n in "12"
    ]
    for row in rows:
        assert float(row["k [N/m]"]) == pytest.approx(STIFFNESS[row["specimen"]], rel=0.4)
        assert float(row["k low [N/m]"]) < float(row["k [N/m]"]) < float(row["k high [N/m]"])
    assert len(table_of(written / "table-estimators.csv")) == 12 * 3
    for name in ("figure.png", "agreement.svg"):
        assert (written / name).stat().st_size > 5000


def test_the_analysis_of_variance_is_that_of_the_results_with_subjects_as_random(written):
    """For a factor with two levels, F is the square of Student's t of the subjects' differences."""
    values = {}
    for row in table_of(written / "table.csv"):
        values.setdefault((row["subject"], row["specimen"]), []).append(float(row["k [N/m]"]))
    means = np.array([[np.mean(values[s, specimen]) for specimen in STIFFNESS] for s in SUBJECTS])
    difference = means[:, 1] - means[:, 0]
    t = difference.mean() / (difference.std(ddof=1) / math.sqrt(len(SUBJECTS)))
    (row,) = table_of(written / "table-anova.csv")
    assert (row["source"], row["error_degrees"]) == ("specimen", "2")
    assert float(row["f"]) == pytest.approx(t**2, rel=0.01), "the intervals are narrow and equal"
    assert "Random: subject" in row["design"]


def test_the_repeatability_is_that_of_the_two_repetitions(written):
    rows = table_of(written / "table.csv")
    k = np.array([float(row["k [N/m]"]) for row in rows]).reshape(6, 2)
    found = {
        row["quantity"]: [float(row[end]) for end in ("value", "low", "high")]
        for row in table_of(written / "table-repeatability.csv")
    }
    within = math.sqrt(np.mean(k.var(axis=1, ddof=1)))
    assert found["standard deviation within objects"][0] == pytest.approx(within)
    difference = k[:, 1] - k[:, 0]
    assert found["bias (2 - 1)"][0] == pytest.approx(difference.mean())
    limit = difference.mean() + LEVEL_95 * difference.std(ddof=1)
    assert found["upper limit of agreement"][0] == pytest.approx(limit)
    assert found["ICC(1,1)"][0] > 0.98


def test_only_new_and_changed_files_are_evaluated_again(data, written, tmp_path, capsys):
    copied = Path(shutil.copytree(data, tmp_path / "copied"))
    shutil.copytree(written / ".teleop-compare", tmp_path / ".teleop-compare")
    out = tmp_path / "table.csv"
    options = ["--factors", PATTERN, "--out", out, "--overwrite"]
    first, errors = found_in(capsys, copied, *options)
    assert first["reused"] == 12, "the place of a file has no influence"
    assert "README.md: left out: no measurement file" in errors
    assert {one["problem"] for one in first["left_out"]} == {"no measurement file"}
    changed = copied / "s01" / "fat_rep1.csv"
    changed.write_text(changed.read_text() + "3.000,0.000000,0.010000\n")
    for _ in range(2):
        second, _ = found_in(capsys, copied, *options)
        assert second["reused"] == 11
        assert second["recordings"][0] != first["recordings"][0]
        assert second["recordings"][1:] == first["recordings"][1:]
        entries = (tmp_path / ".teleop-compare").iterdir()
        newest = max(entries, key=lambda path: path.stat().st_mtime_ns)
        newest.write_text('{"file": ')  # that of the changed file
    third, _ = found_in(capsys, copied, *options, "--estimators", "rls")
    assert third["reused"] == 0
    assert [*third["recordings"][0]["estimates"]] == ["rls"]


def test_results_in_several_processes_are_the_same_to_the_bit(data, capsys):
    one, _ = found_in(capsys, data / "s01", "--workers", "1")
    several, _ = found_in(capsys, data / "s01", "--workers", "2")
    assert several == one


def test_a_stored_result_is_read_as_it_was_and_not_for_other_software(data, tmp_path, monkeypatch):
    file = data / "s01" / "fat_rep1.csv"
    row = result_of(BY_USUAL_NAMES, {}, file)
    row = replace(row, tracking=None, force_lag=math.inf)  # infinite numbers are kept too
    store = StoredResults(tmp_path / "store", ["options"])
    assert store.read(file) is None
    store.write(file, row)
    read = store.read(file)
    assert repr(read) == repr(row)
    assert StoredResults(tmp_path / "store", ["other"]).read(file) is None
    with monkeypatch.context() as patch:
        patch.setattr("teleop.studies.stored_results.code_hash", lambda name: "other code")
        assert StoredResults(tmp_path / "store", ["options"]).read(file) is None
    point = EntryPoint("springs", "colorsys:Springs", "teleop.estimators")
    patched = Offered({"springs": point}, {})
    monkeypatch.setattr("teleop.studies.sweep.origin.offered", lambda: patched)
    monkeypatch.setattr("teleop.studies.sweep.origin.package", lambda point: "springs 1.0")
    assert StoredResults(tmp_path / "store", ["options"]).read(file) is None
    plug_in.cache_clear()


@pytest.mark.real_time
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="needs process groups")
def test_a_killed_command_continues_where_it_was(data, tmp_path, capsys):
    options = [str(data), "--factors", PATTERN, "--out", str(tmp_path / "table.csv")]
    command = [sys.executable, "-m", "teleop", "compare", *options, "--workers", "2"]
    store = tmp_path / ".teleop-compare"
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    ) as process:
        while process.poll() is None and len([*store.glob("*.json")]) < 2:
            time.sleep(0.01)
        os.killpg(process.pid, signal.SIGKILL)
    stored = len([*store.glob("*.json")])
    assert stored >= 2
    (tmp_path / "table.csv").unlink(missing_ok=True)
    (tmp_path / "table-estimators.csv").unlink(missing_ok=True)
    found, _ = found_in(capsys, *options)
    assert found["reused"] == stored
    assert len(found["recordings"]) == 12


def test_the_factors_that_name_the_body_group_the_files_if_nothing_is_stated(data, capsys):
    found, _ = found_in(capsys, data, "--factors", PATTERN)
    assert found["by"] == ["specimen"]
    assert [group["levels"] for group in found["groups"]] == [["fat"], ["liver"]]
    assert {group["unit"] for group in found["groups"]} == {"subject"}


def test_specimens_that_are_averaged_and_bodies_that_are_not_known_are_remarked(data, capsys):
    options = [str(data), "--factors", PATTERN, "--by", "subject"]
    assert main(["compare", *options]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "(a) Recordings that differ in specimen are pooled" in out
    assert main(["compare", str(data / "s01")]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "No factor names the specimen of each recording" in out


def test_a_table_states_the_factors_and_other_files_are_reported(data, tmp_path, capsys):
    table = tmp_path / "factors.csv"
    lines = [f"s01/{specimen}_rep{n}.csv,{specimen}" for specimen in STIFFNESS for n in (1, 2)]
    table.write_text("\n".join(["file name,specimen", *lines, "s09/fat_rep1.csv,fat"]))
    found, errors = found_in(capsys, data, "--factors", table)
    assert [one["factors"]["specimen"] for one in found["recordings"]] == 2 * ["fat"] + 2 * [
        "liver"
    ]
    problems = [one["problem"] for one in found["left_out"]]
    assert problems.count("not stated by --factors") == 8
    assert f"s09/fat_rep1.csv: left out: {table}, line 6: no such file is compared" in errors
    assert " and 5 more: left out: not stated by --factors" in errors


def test_no_measurement_is_overwritten_by_a_table(data, capsys):
    file = data / "s01" / "fat_rep1.csv"
    before = file.read_bytes()
    for pattern in (PATTERN, "{subject}/{specimen}_rep2.csv"):
        options = ["--factors", pattern, "--out", str(file), "--overwrite"]
        assert main(["compare", str(data), *options]) == 2
        assert "would overwrite an input" in capsys.readouterr().err
    assert file.read_bytes() == before


def test_ratios_are_stated_with_the_logarithm(data, capsys):
    found, _ = found_in(
        capsys, data, "--factors", PATTERN, "--repeatability", "k", "--log", "--anova", "k"
    )
    measures = {one["quantity"]: one for one in found["repeatability"]["measures"]}
    k = np.array([one["result"]["k"] for one in found["recordings"]]).reshape(6, 2)
    ratio = math.exp(np.mean(np.log(k[:, 1] / k[:, 0])))
    assert measures["bias (2 / 1)"]["value"] == pytest.approx(ratio)
    assert 0.0 < measures["coefficient of variation within objects"]["value"] < 0.1
    assert "logarithms of k" in found["anova_design"]


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (["--factors", "{a}.mat"], "states the factors of none of the 12 measurement files, such"),
        (["--over", "n"], "--over: expected with --repeatability"),
        (["--random", "x"], "--random: expected with --anova k, k_tip or b"),
        (["--log"], "--log: expected with --anova or --repeatability"),
        (["--plot-agreement", "a.png"], "--plot-agreement: expected with --repeatability"),
        (["--workers", "0"], "workers 0: expected at least 1"),
    ],
)
def test_options_without_effect_are_refused_before_files_are_evaluated(
    data, options, problem, capsys, monkeypatch
):
    monkeypatch.setattr("teleop.commands.compare.result_of", None)
    assert main(["compare", str(data), *options]) == 2
    assert problem in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (["--anova", "k", "--by", "folder,file"], "too few recordings to test folder, file"),
        (["--anova", "k", "--random", "day"], "factor 'day': expected one of"),
        (["--repeatability", "k", "--over", "n=1,3"], "n has no level '3'"),
        (["--repeatability", "k", "--over", "day"], "factor 'day': expected one of"),
    ],
)
def test_statistics_that_are_not_possible_are_refused(data, written, options, problem, capsys):
    # the stored results beside the output are used
    out = ["--out", str(written / "other.csv")]
    assert main(["compare", str(data), "--factors", PATTERN, *options, *out]) == 2
    assert problem in capsys.readouterr().err
    assert not (written / "other.csv").exists()
