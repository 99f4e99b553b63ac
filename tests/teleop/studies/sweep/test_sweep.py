"""Sweeps: points, results, failing points, interruption and resumption."""

from __future__ import annotations

import csv
import json
import os
import random
import signal
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.registry import Offered
from teleop.cli import main
from teleop.control.admittance import AdmittanceParameters
from teleop.errors import InputError
from teleop.settings.trial_settings import TrialSettings
from teleop.studies.sweep.conduct import conduct
from teleop.studies.sweep.executors import in_processes
from teleop.studies.sweep.origin import differences, plug_in, plug_ins_in, versions
from teleop.studies.sweep.plan import SweepPlan, read_plan
from teleop.studies.sweep.points import Point, points_of
from teleop.studies.sweep.tasks import Computed, computed, results, task_of
from teleop.trial.run import run_trial

from ....forked_command import run_command, start_command

PLAN = """
name = "short"
[factors]
cube = ["soft", "hard"]
"admittance.mass" = { low = 1.0, high = 4.0, steps = 3 }
[settings]
condition = "autonomous"
duration_s = 0.3
estimators = ["rls", "ai"]
"""


def in_this_process(task, points):
    for point in points:
        yield computed(task, [point])


def written(path, text=PLAN):
    path.write_text(text)
    return path


def table(folder):
    with (folder / "results.csv").open(newline="", encoding="utf-8") as file:
        return [*csv.DictReader(file)]


def swept(folder, plan_file, execute=in_this_process):
    plan = read_plan(plan_file)
    return conduct(folder, plan, task_of(plan, plan_file.parent), points_of(plan), execute)


@pytest.fixture
def plan_file(tmp_path):
    return written(tmp_path / "plan.toml")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a sweep of `PLAN` that ran in this process without interruption."""
    folder = tmp_path_factory.mktemp("whole")
    swept(folder / "out", written(folder / "plan.toml"))
    return folder / "out"


def test_a_grid_has_all_combinations_in_the_order_of_the_plan(plan_file):
    values = [point.values for point in points_of(read_plan(plan_file))]
    assert values == [(cube, mass) for cube in ("soft", "hard") for mass in (1.0, 2.5, 4.0)]


def test_a_list_combines_the_values_at_the_same_place():
    plan = SweepPlan(name="a", design="list", factors={"a": [1, 2], "b": ["x", "y"]}, seeds=2)
    assert [(p.values, p.repetition) for p in points_of(plan)] == [
        ((1, "x"), 0),
        ((1, "x"), 1),
        ((2, "y"), 0),
        ((2, "y"), 1),
    ]


@settings(deadline=None)
@given(
    low=st.floats(1e-3, 1e3),
    ratio=st.floats(1.01, 1e3),
    count=st.integers(1, 60),
    seed=st.integers(0, 99),
    scale=st.sampled_from(["linear", "log"]),
)
def test_a_latin_hypercube_has_one_value_in_each_equal_part_of_a_range(
    low, ratio, count, seed, scale
):
    high = low * ratio
    plan = SweepPlan(
        name="a",
        design="latin-hypercube",
        points=count,
        seed=seed,
        factors={"a": {"low": low, "high": high, "scale": scale}, "b": [0, 1]},
    )
    values = np.array([point.values[0] for point in points_of(plan)])
    shares = (values - low) / (high - low)
    if scale == "log":
        shares = np.log(values / low) / np.log(ratio)
    parts = np.sort(np.floor(np.clip(shares + 1e-9, 0.0, 1.0) * count))
    assert np.abs(parts - np.arange(count)).max() <= 1.0
    assert np.all((values >= low) & (values <= high))
    assert points_of(plan) == points_of(plan)


def test_the_results_of_a_point_are_those_of_its_trial(whole):
    rows = table(whole)
    assert [row["estimator"] for row in rows[:2]] == ["rls", "ai"]
    assert len(rows) == 12
    settings = TrialSettings(
        condition="autonomous",
        cube="soft",
        duration=0.3,
        clock="virtual",
        estimators=("rls", "ai"),
        admittance=AdmittanceParameters(mass=2.5),
    )
    expected = run_trial(settings).summary()
    for row in rows[2:4]:
        assert (row["cube"], row["admittance.mass"]) == ("soft", "2.5")
        assert float(row["k [N/m]"]) == expected["estimates"][row["estimator"]]["k"]
        assert float(row["true b [N s/m]"]) == expected["truth"]["b"]


def test_each_repetition_has_its_own_seed(tmp_path):
    text = PLAN.replace('name = "short"', 'name = "short"\nseeds = 3').replace("autonomous", "free")
    text = text.replace('["soft", "hard"]', '["soft"]').replace("steps = 3", "steps = 2")
    swept(tmp_path / "out", written(tmp_path / "plan.toml", text))
    rows = table(tmp_path / "out")[:6:2]
    assert [row["seed"] for row in rows] == ["0", "1", "2"]
    assert len({row["k [N/m]"] for row in rows}) == 3


def test_processes_give_the_same_table_to_the_byte_as_one_process(tmp_path, plan_file, whole):
    swept(tmp_path / "two", plan_file, in_processes(2))
    name = "results.csv"
    assert (tmp_path / "two" / name).read_bytes() == (whole / name).read_bytes()


def test_the_parquet_table_has_the_values_of_the_csv_table(whole):
    parquet = pytest.importorskip("pyarrow.parquet")
    columns = parquet.read_table(whole / "results.parquet").to_pydict()
    rows = table(whole)
    for name in ("point", "admittance.mass", "k [N/m]"):
        assert columns[name] == [float(row[name]) for row in rows]
    assert columns["estimator"] == [row["estimator"] for row in rows]


def test_both_tables_have_the_same_text_for_true_and_false(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    text = """
    name = "glued"
    factors = { "feedback.glued" = [true, false] }
    settings = { duration_s = 0.3, feedback = { law = "position-force" } }
    """
    swept(tmp_path / "out", written(tmp_path / "plan.toml", text))
    columns = parquet.read_table(tmp_path / "out" / "results.parquet").to_pydict()
    assert set(columns["feedback.glued"]) == {"True", "False"}
    assert columns["feedback.glued"] == [row["feedback.glued"] for row in table(tmp_path / "out")]


def test_a_point_that_fails_has_its_error_in_the_table_and_the_others_run(tmp_path):
    text = PLAN.replace("low = 1.0", "low = -2.0")
    ended = swept(tmp_path / "out", written(tmp_path / "plan.toml", text))
    rows = table(tmp_path / "out")
    assert ended.failed == 2
    assert [bool(row["error"]) for row in rows] == [True, *[False] * 4, True, *[False] * 4]
    assert "mass" in rows[0]["error"]
    assert rows[0]["k [N/m]"] == ""


def test_a_defect_at_a_point_is_a_row_with_its_error_and_its_traceback_is_kept():
    class Broken:
        def rows(self, point):
            raise RuntimeError("a defect")

    (result,) = results(Broken(), [Point(1, (), 0)])
    assert result["error"] == "RuntimeError: a defect"
    assert "Traceback" in result["traceback"]


def test_a_plug_in_that_exits_at_a_point_does_not_end_the_sweep():
    class Exiting:
        def rows(self, point):
            raise SystemExit(0)

    (result,) = results(Exiting(), [Point(1, (), 0)])
    assert result["error"] == "SystemExit: 0"


def test_a_point_that_failed_is_run_again_and_a_safety_stop_is_a_result(tmp_path, plan_file, whole):
    def failing(task, points):
        for found, origin, place in in_this_process(task, points):
            number = found[0]["point"]
            failed = {2: {"error": "no memory"}, 5: {"stopped": "stopped for safety: too deep"}}
            if number in failed:
                found = [{"point": number, **failed[number]}]
            yield Computed(found, origin, place)

    first = swept(tmp_path / "out", plan_file, failing)
    assert (first.failed, first.stopped, first.done) == (1, 1, 6)
    errors = [row["error"] for row in table(tmp_path / "out") if row["error"]]
    assert errors == ["no memory", "stopped for safety: too deep"]
    ran = []

    def counting(task, points):
        ran.extend(point.number for point in points)
        return in_this_process(task, points)

    second = swept(tmp_path / "out", plan_file, counting)
    assert ran == [2]
    assert (second.failed, second.stopped, second.done, second.resumed) == (0, 1, 6, 5)
    errors = [row["error"] for row in table(tmp_path / "out") if row["error"]]
    assert errors == ["stopped for safety: too deep"]
    rows = [row for row in table(tmp_path / "out") if row["point"] != "5"]
    assert rows == [row for row in table(whole) if row["point"] != "5"]


def test_the_exit_code_is_1_while_points_fail(tmp_path, capsys):
    plan = written(tmp_path / "plan.toml", PLAN.replace("low = 1.0", "low = -2.0"))
    for resumed in (0, 4):
        options = ["--out", str(tmp_path / "out"), "--workers", "1", "--json"]
        assert main(["sweep", str(plan), *options]) == 1
        captured = capsys.readouterr()
        assert json.loads(captured.out)["failed"] == 2
        assert json.loads(captured.out)["resumed"] == resumed
        assert captured.err.startswith("teleop: 2 of 6 points failed")
        assert captured.err.count("\n") == 1


def test_a_trial_that_is_stopped_for_safety_is_a_result_and_no_failure(tmp_path):
    text = PLAN + "tightened_limits = { soft_force = 0.05, hard_force = 0.1 }\n"
    plan = written(tmp_path / "plan.toml", text)
    ended = swept(tmp_path / "out", plan)
    assert (ended.failed, ended.stopped) == (0, 6)
    assert {row["error"][:19] for row in table(tmp_path / "out")} == {"stopped for safety:"}


def test_a_plan_whose_settings_are_wrong_at_every_point_is_refused_before_it_runs(tmp_path):
    plan = written(tmp_path / "plan.toml", PLAN.replace("admittance.mass", "admittance.weight"))
    with pytest.raises(InputError, match=r"admittance\.weight: unknown setting"):
        swept(tmp_path / "out", plan)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((", steps = 3", ""), "expected steps"),
        (("low = 1.0", "low = 5.0"), "expected low < high"),
        (('name = "short"', 'name = "short"\ndesign = "random"'), "expected the number of points"),
        (('name = "short"', 'name = "short"\npoints = 3'), "expected none"),
        (('name = "short"', 'name = "short"\ndesign = "list"'), "same number of values"),
        (('name = "short"', 'name = "short"\nsteps = 3'), "steps: unknown setting"),
        (("steps = 3", 'steps = 3, scale = "log", low = 0.0'), "not a TOML file"),
    ],
)
def test_an_inconsistent_plan_is_refused_with_one_line_and_exit_code_2(
    tmp_path, capsys, change, message
):
    plan = written(tmp_path / "plan.toml", PLAN.replace(*change))
    assert main(["sweep", str(plan), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_folder_with_a_sweep_of_another_plan_is_refused(tmp_path, whole):
    before = (whole / "results.csv").read_bytes()
    other = written(tmp_path / "other.toml", PLAN.replace("0.3", "0.4"))
    with pytest.raises(InputError, match="another plan, which differs in settings: expected"):
        swept(whole, other)
    assert (whole / "results.csv").read_bytes() == before


def test_a_folder_with_other_files_is_refused(tmp_path, plan_file):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.txt").write_text("text")
    with pytest.raises(InputError, match="expected an empty folder"):
        swept(tmp_path / "out", plan_file)


def test_a_resumed_sweep_runs_only_the_points_that_are_not_done(tmp_path, plan_file, whole):
    def stopping(task, points):
        for point in points[:4]:
            yield computed(task, [point])
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        swept(tmp_path / "out", plan_file, stopping)
    ran = []

    def counting(task, points):
        ran.extend(point.number for point in points)
        return in_this_process(task, points)

    ended = swept(tmp_path / "out", plan_file, counting)
    assert ran == [5, 6]
    assert ended.resumed == 4
    for name in ("results.csv", "results.parquet"):
        assert (tmp_path / "out" / name).read_bytes() == (whole / name).read_bytes()


def test_results_that_arrive_in_another_order_give_the_same_table(tmp_path, plan_file, whole):
    def backwards(task, points):
        return in_this_process(task, [*reversed(points)])

    swept(tmp_path / "out", plan_file, backwards)
    name = "results.csv"
    assert (tmp_path / "out" / name).read_bytes() == (whole / name).read_bytes()


class Deadly:
    """A task whose process is killed at one point."""

    chunk = 2
    keys = ()
    columns = ()
    files = {}  # noqa: RUF012
    plug_ins = ()

    def __init__(self, number):
        self.number = number

    def rows(self, point):
        if point.number == self.number:
            os.kill(os.getpid(), signal.SIGKILL)
        return [{"estimator": str(point.number)}]


def test_a_point_that_kills_its_process_has_an_error_and_no_other_point_is_lost():
    points = [Point(number, (), 0) for number in range(1, 9)]
    found = {one["point"]: one for chunk in in_processes(2)(Deadly(3), points) for one in chunk[0]}
    assert sorted(found) == [*range(1, 9)]
    assert [number for number, one in found.items() if "error" in one] == [3]


def test_a_sweep_that_was_killed_in_the_first_line_of_its_journal_starts_again(tmp_path, whole):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "journal.jsonl").write_text('{"plan": {')
    swept(tmp_path / "out", written(tmp_path / "plan.toml"))
    found = (tmp_path / "out" / "results.csv").read_bytes()
    assert found == (whole / "results.csv").read_bytes()


def test_a_sweep_killed_at_random_instants_ends_with_the_results_of_one_that_was_not(tmp_path):
    plan = written(tmp_path / "plan.toml", PLAN.replace("name", "seeds = 2\nname"))
    command = ("sweep", plan, "--workers", "2", "--out", tmp_path / "killed")
    chance = random.Random(1)
    journal = tmp_path / "killed" / "journal.jsonl"
    for _ in range(2):
        known = journal.stat().st_size if journal.exists() else 0
        process = start_command(*command, stderr=subprocess.PIPE)
        while process.poll() is None and not (journal.exists() and journal.stat().st_size > known):
            time.sleep(0.01)
        time.sleep(chance.uniform(0.0, 0.2))  # of about 0.3 s, which the points take
        process.kill()
        process.communicate()
    run_command(*command).check_returncode()
    swept(tmp_path / "whole", plan)
    for name in ("results.csv", "results.parquet"):
        expected = (tmp_path / "whole" / name).read_bytes()
        assert (tmp_path / "killed" / name).read_bytes() == expected


class Wide(Deadly):
    """A task with long rows in the table and short ones in the journal."""

    keys = ("cube", "admittance.mass")
    columns = tuple(f"{number}" for number in range(3000))

    def rows(self, point):
        return [{"1": point.number}]

    def settings(self, point):
        return TrialSettings()


def test_a_full_disk_is_named_with_the_table_that_is_not_complete(tmp_path, plan_file):
    resource = pytest.importorskip("resource", reason="no limit of the size of a file")
    plan, before = read_plan(plan_file), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(InputError, match=r"results\.csv: cannot be written: file too large"):
            conduct(tmp_path / "out", plan, Wide(0), points_of(plan), in_this_process)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_recording_is_estimated_with_the_settings_of_each_point(tmp_path):
    recording = tmp_path / "trial.mcap"
    trial = run_trial(TrialSettings(duration=2.0, clock="virtual"), recording)
    plan = written(
        tmp_path / "plan.toml",
        """
        name = "replayed"
        [estimate]
        recording = "trial.mcap"
        [factors]
        "estimator_parameters.rls.forgetting" = [0.98, 0.999]
        conditioning = ["matched", "difference"]
        """,
    )
    swept(tmp_path / "out", plan)
    rows = [row for row in table(tmp_path / "out") if row["estimator"] == "rls"]
    assert len(rows) == 4
    same = trial.summary()["estimates"]["rls"]
    assert float(rows[0]["k [N/m]"]) == same["k"]
    assert float(rows[0]["b at the end [N s/m]"]) == same["b_end"]
    assert len({row["k [N/m]"] for row in rows}) == 4


REPLAYED = """
name = "replayed"
[estimate]
recording = "trial.mcap"
[factors]
"estimator_parameters.rls.forgetting" = [0.98, 0.99, 0.999]
"""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """The contents of two recordings."""
    paths = [tmp_path_factory.mktemp("recordings") / f"{name}.mcap" for name in ("soft", "hard")]
    for path in paths:
        run_trial(TrialSettings(cube=path.stem, duration=1.0, clock="virtual"), path)
    return [path.read_bytes() for path in paths]


def interrupted_after(count):
    def execute(task, points):
        for point in points[:count]:
            yield computed(task, [point])
        raise KeyboardInterrupt

    return execute


def test_a_sweep_is_not_resumed_after_its_recording_was_replaced(tmp_path, recordings):
    plan, recording = written(tmp_path / "plan.toml", REPLAYED), tmp_path / "trial.mcap"
    recording.write_bytes(recordings[0])
    with pytest.raises(KeyboardInterrupt):
        swept(tmp_path / "out", plan, interrupted_after(1))
    recording.write_bytes(recordings[1])
    for problem in (f"trial.mcap: {len(recordings[1])} bytes of", "trial.mcap: no such file"):
        with pytest.raises(InputError, match=f"changed since the sweep began: {problem}") as error:
            swept(tmp_path / "out", plan)
        assert f"expected {len(recordings[0])} bytes of" in str(error.value)
        recording.unlink(missing_ok=True)
    recording.write_bytes(recordings[0])
    os.utime(recording, (0, 0))  # the same content, for example of a copy
    ended = swept(tmp_path / "out", plan)
    assert (ended.resumed, ended.done, ended.failed) == (1, 3, 0)
    recording.unlink()
    assert swept(tmp_path / "out", plan).resumed == 3  # all points are done


def test_results_of_a_recording_that_is_replaced_while_the_sweep_runs_are_not_used(
    tmp_path, recordings
):
    plan, recording = written(tmp_path / "plan.toml", REPLAYED), tmp_path / "trial.mcap"
    recording.write_bytes(recordings[0])

    def replacing(task, points):
        yield computed(task, points[:1])
        recording.write_bytes(recordings[1])
        yield computed(task, points[1:])

    with pytest.raises(InputError, match="the results are not used.*trial.mcap"):
        swept(tmp_path / "out", plan, replacing)
    recording.write_bytes(recordings[0])
    assert swept(tmp_path / "out", plan).resumed == 1


def test_a_process_reads_a_recording_again_after_it_was_replaced(tmp_path, recordings):
    plan, recording = written(tmp_path / "plan.toml", REPLAYED), tmp_path / "trial.mcap"
    found = []
    for content in recordings:
        recording.write_bytes(content)
        swept(tmp_path / f"out{len(found)}", plan)
        found.append(table(tmp_path / f"out{len(found)}")[0]["k [N/m]"])
    assert found[0] != found[1]


def test_a_sweep_is_not_resumed_with_another_version_of_the_software(
    tmp_path, plan_file, monkeypatch
):
    with pytest.raises(KeyboardInterrupt):
        swept(tmp_path / "out", plan_file, interrupted_after(1))
    other = {**versions(), "teleop": "0.0.1"}
    monkeypatch.setattr("teleop.studies.sweep.origin.versions", lambda: other)
    with pytest.raises(InputError, match=r"sweep began: teleop: 0\.0\.1, expected"):
        swept(tmp_path / "out", plan_file)


def test_a_sweep_is_not_resumed_after_a_tare_file_in_the_plan_was_changed(tmp_path):
    tare = tmp_path / "tare.json"
    assert main(["rig", "tare", "--out", str(tare)]) == 0
    plan = written(tmp_path / "plan.toml", PLAN + 'tare = "tare.json"\n')
    with pytest.raises(KeyboardInterrupt):
        swept(tmp_path / "out", plan, interrupted_after(1))
    tare.write_text(tare.read_text() + "\n")
    with pytest.raises(InputError, match="sweep began: tare.json: "):
        swept(tmp_path / "out", plan)


class FakePoint:
    """An entry point of an estimator in another package."""

    def __init__(self, module):
        self.module = module
        self.dist = SimpleNamespace(name="spring-fits", version="1.0")


def test_the_origin_of_a_plug_in_changes_with_its_code(tmp_path, monkeypatch):
    package = tmp_path / "spring_fits"
    (package / "inner").mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "inner" / "rls.py").write_text("gain = 1")
    monkeypatch.syspath_prepend(tmp_path)
    points = Offered({"springs": FakePoint("spring_fits.inner.rls")}, {})
    monkeypatch.setattr("teleop.studies.sweep.origin.offered", lambda: points)
    assert plug_ins_in({"estimators": ["rls"]}) == ()
    assert plug_ins_in({"estimators": ["rls", "springs"]}) == ("estimator springs",)
    before = plug_in.__wrapped__("estimator springs")
    assert plug_in.__wrapped__("estimator springs") == before
    (package / "inner" / "rls.py").write_text("gain = 2")
    text = differences(
        {"estimator springs": before}, {"estimator springs": plug_in("estimator springs")}
    )
    assert text.startswith("estimator springs: spring-fits 1.0, sha256 ")
    assert differences({"springs": before}, {}).startswith("springs: not installed, expected")
    plug_in.cache_clear()


def test_the_command_prints_a_document_and_draws_both_figures(tmp_path, plan_file, capsys):
    out = tmp_path / "out"
    figures = [tmp_path / "effects.svg", tmp_path / "map.svg"]
    options = ["--plot", str(figures[0]), "--plot-map", str(figures[1]), "--workers", "1"]
    assert main(["sweep", str(plan_file), "--out", str(out), "--json", *options]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["points"] == 6
    assert document["failed"] == document["resumed"] == 0
    assert Path(document["files"][0]).exists()
    for figure in figures:
        text = figure.read_text()
        assert "admittance.mass" in text
        assert "k [N/m]" in text
        assert "rls" in text


def test_a_map_of_an_unknown_factor_is_refused(tmp_path, plan_file, capsys):
    options = ["--plot-map", str(tmp_path / "map.svg"), "--map-factors", "cube,colour"]
    assert main(["sweep", str(plan_file), "--out", str(tmp_path / "out"), *options]) == 2
    assert "expected two of the factors cube, admittance.mass" in capsys.readouterr().err


def test_the_packaged_plan_has_the_nine_trials_of_the_paper():
    plan = read_plan(Path("paper"), seeds=2)
    assert plan.size == len(points_of(plan)) == 18
