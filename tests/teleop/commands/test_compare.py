"""`teleop compare`."""

from __future__ import annotations

import csv
import hashlib
import json
import pickle
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.summary import EstimatorSummary
from teleop.cli import main
from teleop.evaluation.across.comparison import Compared, tidy_rows
from teleop.evaluation.across.groups import grouped, ranks_of
from teleop.evaluation.batch.stiffness_result import StiffnessResult
from teleop.evaluation.evaluate import evaluate
from teleop.output.comparison_tables import (
    common_part,
    group_table,
    print_comparison,
    published_table,
)
from teleop.software import software

from ...forked_command import start_command

PLAN = """
name = "short"
order = "listed"
repetitions = 2
[factors]
subject = ["s1", "s2"]
cube = ["soft", "medium"]
[settings]
clock = "virtual"
duration_s = 3.0
rate_hz = 125
condition = "autonomous"
estimators = ["rls", "me"]
"""


@pytest.fixture(scope="module")
def series(tmp_path_factory):
    folder = tmp_path_factory.mktemp("series")
    (folder / "plan.toml").write_text(PLAN)
    assert main(["series", str(folder / "plan.toml"), "--out", str(folder / "out")]) == 0
    return folder / "out"


@pytest.fixture(scope="module", autouse=True)
def evaluation_by_file():
    """Evaluate each file once, unless its content or an option differs."""
    stored = {}

    def evaluate_once(samples, settings, most):
        key = hashlib.sha256(pickle.dumps((samples, settings, most))).digest()
        if key not in stored:
            stored[key] = evaluate(samples, settings, most)
        return stored[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("teleop.evaluation.evaluate.evaluate", evaluate_once)
        yield


def document(capsys, *arguments):
    capsys.readouterr()
    assert main(["compare", *map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_series_is_grouped_by_its_factors_and_has_an_analysis_of_variance(series, capsys):
    found = document(capsys, series, "--anova", "e_f")
    assert found["by"] == ["cube"]
    assert len(found["recordings"]) == 8
    assert [group["levels"] for group in found["groups"]] == [["soft"], ["medium"]]
    for group in found["groups"]:
        levels = group["levels"][0]
        k = {
            subject: [
                one["estimates"]["rls"]["k"]
                for one in found["recordings"]
                if (one["factors"]["cube"], one["factors"]["subject"]) == (levels, subject)
            ]
            for subject in ("s1", "s2")
        }
        mean, half, count = group["means"]["rls"]["k"]
        means = [np.mean(each) for each in k.values()]
        assert (mean, count) == (pytest.approx(np.mean(means)), 4)
        assert half == pytest.approx(12.7062 * np.std(means, ddof=1) / 2**0.5, rel=1e-3)
    assert {effect["source"] for effect in found["anova"]} >= {"cube", "estimator"}
    assert {effect["error_degrees"] for effect in found["anova"]} == {1}, "subjects are random"


@pytest.mark.parametrize("has_journal", [True, False])
def test_levels_have_the_order_of_the_plan_or_of_their_first_occurrence(
    series, has_journal, tmp_path, capsys
):
    copied = Path(shutil.copytree(series, tmp_path / "copied"))
    lines = (copied / "trials.csv").read_text().splitlines(keepends=True)
    backwards = "".join([lines[0], *reversed(lines[1:])])  # the last trial is of the medium cube
    (copied / "trials.csv").write_text(backwards)
    if not has_journal:
        (copied / "journal.jsonl").unlink()
    found = document(capsys, copied, "--by", "cube,subject")
    cubes, subjects = ["soft", "medium"], ["s1", "s2"]
    if not has_journal:
        cubes, subjects = cubes[::-1], subjects[::-1]
    expected = [[cube, subject] for cube in cubes for subject in subjects]
    assert [group["levels"] for group in found["groups"]] == expected
    assert main(["compare", str(copied), "--by", "cube", "--out", str(tmp_path / "a.tex")]) == 0
    table = (tmp_path / "a.tex").read_text()
    assert table.index(f"\n{cubes[0]} ") < table.index(f"\n{cubes[1]} ")


def test_the_csv_table_of_a_series_has_all_its_factors_and_the_repetition(series, tmp_path, capsys):
    table = tmp_path / "table.csv"
    assert main(["compare", str(series), "--by", "condition", "--out", str(table)]) == 0
    with table.open(newline="") as file:
        rows = [*csv.DictReader(file)]
    factors = ["subject", "cube", "repetition", "condition"]
    assert [*rows[0]][: len(factors) + 1] == ["file", *factors]
    assert {tuple(row[name] for name in factors) for row in rows} == {
        (subject, cube, repetition, "autonomous")
        for subject in ("s1", "s2")
        for cube in ("soft", "medium")
        for repetition in ("1", "2")
    }


def two_kinds_of_damping():
    """Return recordings of two groups; the second has two kinds of damping."""
    return [
        Compared(f"{i}.mcap", {"cube": cube}, one, {"rls": summarised(900.0, b, 0.1)})
        for i, (cube, b, frequency) in enumerate(
            [("soft", 3.0, 1.0), ("soft", 5.0, 1.0), ("hard", 3.0, 1.0), ("hard", 9.0, None)]
        )
        for one in [
            StiffnessResult(1e3, 990.0, 1010.0, b, b - 1.0, b + 1.0, True, damping_at_hz=frequency)
        ]
    ]


def test_damping_of_two_kinds_has_no_mean_and_a_note(capsys):
    rows = two_kinds_of_damping()
    soft, hard = grouped(rows, ["cube"], {})
    assert soft.means["result"]["b"].value == 4.0
    assert not np.isfinite(hard.means["result"]["b"].value)
    assert hard.means["result"]["k"].value == 1e3
    assert hard.means["rls"]["b"].value == 6.0, "both averages of an estimator are of one kind"
    table = group_table([soft, hard], ["cube"])
    cells = {(row[0], row[1]): dict(zip(table.headings, row, strict=True)) for row in table.rows}
    assert cells["soft", "result"]["kind of b"] == "k''/omega"
    assert cells["hard", "result"]["kind of b"] == "k''/omega, besides relaxation"
    assert cells["hard", "result"]["b [N s/m]"] == "- (a)"
    assert cells["hard", "rls"]["kind of b"] == "average"
    (note,) = [text for mark, text in table.notes if mark == "(a)"]
    assert note.startswith("No mean of b: it is the equivalent viscous damping")
    print_comparison(rows, [soft, hard], ["cube"])
    marked = [line.split()[0] for line in capsys.readouterr().out.splitlines() if " * 9.0" in line]
    assert marked == ["3.mcap"]


def results_of_one_body(b, half, remark, frequency=1.0):
    """Return results of three recordings whose values differ less than their intervals."""
    return [
        StiffnessResult(
            *(1e3, 990.0, 1010.0, value, value - half, value + half, True, (remark,)),
            force=20.0 + i,
            depth=8e-3 + 1e-3 * i,
            damping_at_hz=frequency,
        )
        for i, value in enumerate((b - 0.1, b, b + 0.1))
    ]


UNRESOLVED = "damping is not resolved: its interval contains zero"


def test_a_row_states_from_where_the_depth_of_a_result_is_measured():
    one, other = results_of_one_body(3.0, 1.0, UNRESOLVED)[:2]
    other = replace(other, depth_from="contact point")
    rows = [
        Compared(f"{r.depth_from}.mcap", {}, r, {"rls": summarised(900.0, 2.0, 0.1)})
        for r in (one, other)
    ]
    cells = [(row["method"], row["depth from"]) for row in tidy_rows(rows, [])]
    assert cells == [("result", "lowest position"), ("result", "contact point")]
    assert {row["depth from"] for row in tidy_rows(rows, [], of_estimators=True)} == {None}


def test_values_of_models_with_further_parameters_are_of_another_kind():
    with_k3 = summarised(800.0, 2.0, 0.1)._replace(further={"k3": 1e6})
    one = StiffnessResult(1e3, 990.0, 1010.0, 3.0, 2.0, 4.0, True, damping_at_hz=1.0)
    rows = [
        Compared("0.mcap", {}, one, {"rls": summarised(900.0, 2.0, 0.1)}, force_lag=2.66e-3),
        Compared("1.mcap", {}, one, {"rls": with_k3}),
    ]
    (group,) = grouped(rows, [], {})
    assert not np.isfinite(group.means["rls"]["k"].value)
    table = group_table([group], [])
    texts = [text for _, text in table.notes]
    assert any("No mean of k: it is average" in text for text in texts)
    assert any("k is the stiffness at the datum" in text for text in texts)
    assert "A lag of the force of 0 to 2.66 ms is compensated." in texts
    cells = dict(zip(table.headings, table.rows[1], strict=True))
    assert {*cells["kind of k"].split(", ")} == {"average", "average with k3"}
    tidy = tidy_rows(rows, [], of_estimators=True)
    assert [row["kind of k"] for row in tidy] == ["average", "average with k3"]
    assert [row["compensated force lag [s]"] for row in tidy] == [2.66e-3, 0.0]


NEGATIVE = "damping is negative: the force lags behind the position"


def bodies():
    """Return recordings of two groups: b is not resolved in the first, and negative in the
    second."""
    return [
        Compared(f"{cube}-{i}.mcap", {"cube": cube}, one, {})
        for cube, results in {
            "soft": results_of_one_body(3.9, 6.3, UNRESOLVED),
            "hard": results_of_one_body(-900.0, 20.0, NEGATIVE, None),
        }.items()
        for i, one in enumerate(results)
    ]


def test_a_mean_of_damping_that_is_not_resolved_is_not_resolved():
    soft, hard = grouped(bodies(), ["cube"], {})
    table = group_table([soft, hard], ["cube"])
    cells = [row[table.headings.index("b [N s/m]")] for row in table.rows]
    assert cells == ["3.9 \u00b1 6.3", "-900 \u00b1 20"]
    assert soft.means["result"]["b"].half > soft.means["result"]["b"].value


def test_the_notes_of_a_written_table_state_the_remarks_on_its_results():
    notes = [text for _, text in published_table(grouped(bodies(), ["cube"], {}), ["cube"]).notes]
    assert f"Remark on 3 of 6 results (soft: 3): {UNRESOLVED}." in notes
    assert f"Remark on 3 of 6 results (hard: 3): {NEGATIVE}." in notes
    alone = published_table(grouped(bodies()[:3], [], {}), []).notes
    assert f"Remark on 3 of 3 results: {UNRESOLVED}." in [text for _, text in alone]


def test_a_remark_that_concerns_many_groups_has_their_number():
    rows = [
        Compared(f"{i}.mcap", {"seed": str(i)}, bodies()[0 if i < 9 else 3].result, {})
        for i in range(12)
    ]
    notes = [text for _, text in published_table(grouped(rows, ["seed"], {}), ["seed"]).notes]
    assert f"Remark on 9 of 12 results (in 9 of 12 groups): {UNRESOLVED}." in notes
    assert f"Remark on 3 of 12 results (9: 1; 10: 1; 11: 1): {NEGATIVE}." in notes


def test_the_notes_state_force_depth_and_frequency_at_which_the_results_of_each_group_hold():
    groups = grouped(bodies(), ["cube"], {})
    (note,) = [text for _, text in group_table(groups, ["cube"]).notes if text.startswith("Force")]
    assert note.startswith(
        "Force, depth and frequency at which the results hold: "
        "soft: k at 20.0 to 22.0 N, 8.00 to 10.0 mm from the lowest position, b at 1.00 Hz; "
        "hard: k at 20.0 to 22.0 N, 8.00 to 10.0 mm from the lowest position."
    )
    without = [Compared("1.mcap", {}, StiffnessResult(reasons=("no contact",)), {})]
    notes = group_table(grouped(without, [], {}), []).notes
    assert not any(text.startswith("Force") for _, text in notes)


def test_damping_that_a_recording_does_not_determine_has_no_value_and_no_kind(capsys):
    result = StiffnessResult(1e3, 990.0, 1010.0, identifiable=True)
    rows = [Compared(f"{i}.mcap", {"cube": "soft"}, result, {}) for i in range(2)]
    groups = grouped(rows, ["cube"], {})
    table = group_table(groups, ["cube"])
    cells = dict(zip(table.headings, table.rows[0], strict=True))
    assert (cells["b [N s/m]"], cells["kind of b"], cells["kind of k"]) == ("-", "-", "tangent")
    assert {row["b low [N s/m]"] for row in tidy_rows(rows, [])} == {None}
    print_comparison(rows, groups, ["cube"])
    assert "0.00" not in capsys.readouterr().out


def test_a_tidy_table_states_the_kind_of_damping_and_its_frequency():
    rows = tidy_rows(two_kinds_of_damping(), [])
    found = [(row["kind of b"], row["b at frequency [Hz]"]) for row in rows]
    assert found == 3 * [("k''/omega", 1.0)] + [("besides relaxation", None)]


@given(st.lists(st.text(), unique=True), st.lists(st.text()))
def test_planned_levels_are_first_and_each_level_has_one_rank(planned, occurring):
    ranks = ranks_of(planned, occurring)
    assert set(ranks) == {*planned, *occurring}
    assert sorted(ranks.values()) == list(range(len(ranks)))
    assert [*ranks][: len(planned)] == planned


@given(st.lists(st.integers(-9, 99).map(str)))
def test_numbers_that_no_plan_orders_increase_and_an_unknown_level_is_last(occurring):
    assert [*ranks_of((), ["-", *occurring])] == [*sorted({*occurring}, key=int), "-"]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[]\n", "journal.jsonl, line 1: expected a line of JSON"),
        ('{"entry": "done", "trial": 1}\n', "journal.jsonl, line 1: time: is missing"),
        ('{"time": "", "entry": "plan", "trial": 0, "plan": {}}\n', "not the journal"),
    ],
)
def test_a_journal_without_a_plan_is_refused(series, text, problem, tmp_path, capsys):
    copied = Path(shutil.copytree(series, tmp_path / "copied"))
    (copied / "journal.jsonl").write_text(text)
    assert main(["compare", str(copied)]) == 2
    assert problem in capsys.readouterr().err


def test_recordings_are_grouped_by_their_settings_and_other_files_have_no_level(
    series, tmp_path, capsys
):
    shutil.copy("examples/data/mach1/sinusoid_1Hz.csv", tmp_path / "foreign.csv")
    for path in (series / "recordings").glob("00[1-4]*.mcap"):
        shutil.copy(path, tmp_path)
    found = document(capsys, *sorted(tmp_path.iterdir()), "--by", "cube,condition")
    levels = [group["levels"] for group in found["groups"]]
    assert levels == [["soft", "autonomous"], ["medium", "autonomous"], ["-", "-"]]
    alone = found["groups"][-1]["means"]["result"]["k"]
    result = next(one["result"] for one in found["recordings"] if "foreign" in one["file"])
    assert alone == [result["k"], pytest.approx(0.5 * (result["k_high"] - result["k_low"])), 1]


def test_a_bad_file_is_reported_and_left_out(series, tmp_path, capsys):
    bad = tmp_path / "bad.csv"
    bad.write_text("no data")
    good = next((series / "recordings").glob("*.mcap"))
    assert main(["compare", str(bad), str(good)]) == 0
    captured = capsys.readouterr()
    assert f"{bad}: left out: " in captured.err
    assert good.stem in captured.out
    assert main(["compare", str(bad)]) == 2
    assert "no file can be evaluated" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["--by", "colour"], "factor 'colour': expected one of file, folder, condition"),
        (["--out", "table.pdf"], "table.pdf: expected a file ending in .csv, .tex, .md"),
        (["--plot", "figure.doc"], "figure.doc: expected a file ending in .png"),
    ],
)
def test_bad_options_are_refused(series, arguments, problem, capsys):
    assert main(["compare", str(next((series / "recordings").iterdir())), *arguments]) == 2
    assert problem in capsys.readouterr().err


def test_a_folder_without_recordings_and_a_file_named_twice_are_refused(series, tmp_path, capsys):
    assert main(["compare", str(tmp_path)]) == 2
    assert "contains neither a series nor measurement files" in capsys.readouterr().err
    assert main(["compare", str(series), str(next((series / "recordings").iterdir()))]) == 2
    assert "is named twice" in capsys.readouterr().err


@pytest.mark.parametrize("missing", [["trials.csv"], ["trials.csv", "journal.jsonl"]])
def test_the_recordings_of_a_series_without_its_table_are_found(series, missing, tmp_path, capsys):
    copied = Path(shutil.copytree(series, tmp_path / "copied"))
    for name in missing:
        (copied / name).unlink()
    found = document(capsys, copied, "--by", "cube")
    assert len(found["recordings"]) == 8
    assert [group["levels"] for group in found["groups"]] == [["soft"], ["medium"]]
    if "journal.jsonl" not in missing:
        original = document(capsys, series)
        for one, other in zip(found["groups"], original["groups"], strict=True):
            assert one["means"] == other["means"]
        for one, other in zip(found["recordings"], original["recordings"], strict=True):
            assert one["factors"] == other["factors"] | {"folder": one["factors"]["folder"]}


def test_a_trial_in_the_journal_that_is_not_yet_in_the_table_is_compared(series, tmp_path, capsys):
    copied = Path(shutil.copytree(series, tmp_path / "copied"))
    lines = (copied / "trials.csv").read_text().splitlines(keepends=True)
    (copied / "trials.csv").write_text("".join(lines[:3]))
    with (copied / "journal.jsonl").open("a") as journal:
        journal.write('{"entry": "done", "tri')
    before = (copied / "journal.jsonl").read_bytes()
    assert len(document(capsys, copied)["recordings"]) == 8
    assert (copied / "journal.jsonl").read_bytes() == before, "the series may be running"


def test_a_series_without_a_trial_that_is_done_is_refused(series, tmp_path, capsys):
    copied = Path(shutil.copytree(series, tmp_path / "copied"))
    journal = copied / "journal.jsonl"
    journal.write_text(journal.read_text().splitlines(keepends=True)[0])
    assert main(["compare", str(copied)]) == 2
    assert "no trial of this series is done" in capsys.readouterr().err


def test_a_table_is_written_as_csv_latex_and_markdown(series, tmp_path, capsys):
    run = ["run", "--clock", "virtual", "--duration", "0.06", "--condition", "autonomous"]
    run += ["--cube", "medium", "--estimators", "rls,me", "--record", str(tmp_path / "short.mcap")]
    assert main(run) == 0
    two = [min((series / "recordings").iterdir()), tmp_path / "short.mcap"]
    for name in ("table.csv", "table.tex", "table.md"):
        assert main(["compare", *map(str, two), "--by", "cube", "--out", str(tmp_path / name)]) == 0
    with (tmp_path / "table.csv").open(newline="") as file:
        rows = [*csv.DictReader(file)]
    assert [row["method"] for row in rows] == ["result", "result"]
    assert [row["kind of k"] for row in rows] == ["tangent", ""], "the second has no result"
    assert [row["kind of b"] for row in rows] == ["k''/omega", ""]
    with (tmp_path / "table-estimators.csv").open(newline="") as file:
        estimates = [*csv.DictReader(file)]
    assert [row["method"] for row in estimates] == 2 * ["rls", "me"]
    assert {row["kind of k"] for row in estimates} == {"average"}
    assert {row["k low [N/m]"] for row in estimates} == {""}
    assert float(rows[0]["at force [N]"]) > 0.0
    batch = rows[0]
    assert float(batch["k low [N/m]"]) < float(batch["k [N/m]"]) < float(batch["k high [N/m]"])
    latex = (tmp_path / "table.tex").read_text()
    assert latex.count("\\midrule") == 2
    assert "e\\_f [N]" in latex
    assert "$\\pm$" in latex
    assert latex.endswith(f"\n% teleop {software()}\n")
    assert rows[0]["software"] == f"teleop {software()}"
    assert re.search(r"& \$-\$\d", latex)
    assert not re.search(r"-\d", latex.split("tablenotes")[0])
    assert latex.splitlines()[2:4] == ["\\begin{tabular}{llllrrrr}", "\\toprule"]
    markdown = (tmp_path / "table.md").read_text()
    assert markdown.endswith(f"<!-- teleop {software()} -->\n")
    lines = [line for line in markdown.splitlines() if line.startswith("|")]
    assert len({line.count("|") for line in lines}) == 1
    assert len(lines) == 2 + 2 * 3
    assert sum("| tangent |" in line for line in lines) == 1
    assert sum("| average | average |" in line for line in lines) == 4
    assert "\nresult: mean of the results" in markdown


def test_the_tables_of_the_paper_are_not_divided_in_80_columns(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    result = StiffnessResult(
        49057.0, 45870.0, 52244.0, -10.85, -11.69, -10.01, True, force=25.4, depth=8e-4
    )
    estimates = {"rls": summarised(27024.7, -398.2, 0.5857)}
    rows = [
        Compared(f"P/recordings/00{i}-s01-autonomous-{cube}-1-1.mcap", levels, one, estimates)
        for i, cube in enumerate(("soft", "medium", "hard"))
        for levels in [{"condition": "autonomous", "cube": cube}]
        for one in [StiffnessResult(reasons=("no contact",)) if cube == "hard" else result]
    ]
    by = ["condition", "cube"]
    print_comparison(rows, grouped(rows, by, {}), by)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    rules = [line for line in lines if "\u2500" in line]
    assert len(rules) == 2, "one table of the results, one of the groups"
    (heading,) = [line for line in lines if "method" in line]
    assert heading.split()[-2:] == ["e_f", "[N]"]


def test_shared_remarks_are_printed_once_with_their_hint_and_others_with_the_file(
    monkeypatch, capsys
):
    monkeypatch.setenv("COLUMNS", "80")
    remarks = [("negative", "one is 1"), ("negative", "one is 2"), ("negative",)]
    results = [
        StiffnessResult(1.0, 0.9, 1.1, -1.0, -1.1, -0.9, True, one, ("lag",)) for one in remarks
    ]
    results.append(StiffnessResult(reasons=("no contact",), hints=("touch",)))
    rows = [Compared(f"{i}.mcap", {"cube": "soft"}, one, {}) for i, one in enumerate(results)]
    print_comparison(rows, grouped(rows, ["cube"], {}), ["cube"])
    lines = capsys.readouterr().out.splitlines()
    start = lines.index("  3.mcap: no result: no contact")
    assert lines[start + 1 : start + 6] == [
        "  negative (3 recordings)",
        "  0.mcap: one is 1",
        "  1.mcap: one is 2",
        "  hint: touch",
        "  hint: lag",
    ]


def test_the_comparison_of_one_recording_prints_its_remarks_with_their_numbers(capsys):
    remark = "bad fit: 12% of the force variance in contact is not explained"
    result = StiffnessResult(1.0, 0.9, 1.1, -1.0, -1.1, -0.9, True, (remark,))
    row = Compared("1.mcap", {"cube": "soft"}, result, {})
    print_comparison([row], grouped([row], ["cube"], {}), ["cube"])
    assert f"1.mcap: {remark}" in " ".join(capsys.readouterr().out.split())


def summarised(k, b, e_f):
    numbers = dict.fromkeys(EstimatorSummary._fields, 0.0)
    return EstimatorSummary(**numbers | {"k": k, "b": b, "e_f": e_f, "further": {}})


def test_table_and_figure_are_written_even_if_the_reader_of_the_output_ends(series, tmp_path):
    files = [tmp_path / "table.tex", tmp_path / "figure.svg"]
    recording = min((series / "recordings").iterdir())
    command = ("compare", recording, "--out", files[0], "--plot", files[1])
    process = start_command(*command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    process.stdout.close()
    process.wait(timeout=120)
    assert all(path.stat().st_size > 0 for path in files)


def test_the_folder_of_all_recordings_is_printed_once(series, tmp_path, capsys):
    assert main(["compare", str(series)]) == 0
    folder = str(series / "recordings")
    out = capsys.readouterr().out
    assert out.splitlines()[0] == f"{folder}/*.mcap: results, with 95 % intervals"
    assert out.count(folder) == 1
    first = min((series / "recordings").iterdir())
    assert f"  {first.stem}  " in out
    copied = shutil.copy(first, tmp_path / first.name)
    assert main(["compare", str(first), str(copied)]) == 0
    out = capsys.readouterr().out
    assert out.splitlines()[0] == "results, with 95 % intervals"
    assert str(copied) in out


@pytest.mark.parametrize(
    ("files", "pattern", "names"),
    [
        (["day/free.mcap", "day/mimic.mcap"], "day/*.mcap", ["free", "mimic"]),
        (["free.mcap", "day/mimic.mcap"], "", ["free", "mimic"]),
        (["one/free.mcap", "two/mimic.csv"], "", ["free.mcap", "mimic.csv"]),
        (["one/free.mcap", "two/free.mcap"], "", ["one/free.mcap", "two/free.mcap"]),
        (["free.mcap", "mimic.mcap"], "", ["free.mcap", "mimic.mcap"]),
    ],
)
def test_recordings_in_several_folders_have_short_names_if_all_names_differ(files, pattern, names):
    assert common_part(files) == (pattern, names)


def test_a_series_names_the_command_for_its_table_and_figure(series, capsys):
    assert main(["series", str(series.parent / "plan.toml"), "--out", str(series)]) == 0
    line = capsys.readouterr().out.splitlines()[-1]
    assert line.startswith(f"table and figure: teleop compare {series} --out")
    assert main(line.split()[4:]) == 0
    assert (series / "table.tex").exists()
    assert (series / "figure.pdf").stat().st_size > 5000
    for name in ("table.tex", "figure.pdf"):
        (Path(series) / name).unlink()


@pytest.fixture(scope="module")
def free_motion(tmp_path_factory):
    """A file of a motion without contact, with a name that LaTeX would take for commands."""
    path = tmp_path_factory.mktemp("free") / "a_b%c.csv"
    t = np.arange(0.0, 6.0, 4e-3)
    f = np.random.default_rng(0).normal(0.0, 0.02, t.size)
    rows = zip(t, 3.0 - 3.0 * np.cos(6.0 * t), f, strict=True)
    lines = "".join(f"{a},{x},{y}\n" for a, x, y in rows)
    path.write_text("Time [s],Position [mm],Force [N]\n" + lines)
    return path


def test_a_table_names_the_reason_of_each_value_that_is_missing(
    series, free_motion, tmp_path, capsys
):
    good = sorted((series / "recordings").iterdir())[0]
    for name in ("table.tex", "table.md"):
        options = ["--by", "folder", "--out", str(tmp_path / name)]
        assert main(["compare", str(good), str(free_motion), *options]) == 0
    reason = "the force does not follow the displacement: no contact"
    out = " ".join(capsys.readouterr().out.split())
    assert f"(a) No result for 1 recording: {reason} (a_b%c.csv)." in out
    latex = (tmp_path / "table.tex").read_text()
    assert "\\usepackage{booktabs,threeparttable}" in latex
    assert " & - & - & 0 (a) & - & - & - \\\\" in latex
    assert f"\\item[(a)] No result for 1 recording: {reason} (a\\_b\\%c.csv)." in latex
    assert "\\item[(b)] No estimate for 1 recording: the estimator was never updated" in latex
    assert latex.count("\\begin{") == latex.count("\\end{") == 3
    assert f"\n(a) No result for 1 recording: {reason} (a\\_b%c.csv).\n" in (
        (tmp_path / "table.md").read_text()
    )
    dashes = [row.count("-") for row in latex.splitlines() if " & - " in row]
    assert dashes


def test_repeats_of_a_subject_are_averaged_first_and_this_is_stated(series, tmp_path, capsys):
    text = "The recordings of the same subject are averaged first"
    table = tmp_path / "table.tex"
    assert main(["compare", str(series), "--out", str(table)]) == 0
    assert text in capsys.readouterr().out
    assert text in table.read_text()
    assert main(["compare", str(series), "--by", "subject,cube"]) == 0
    assert text not in capsys.readouterr().out


def test_the_tracking_of_mimic_is_compared(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    for seed in ("1", "2"):
        run = ["run", "--clock", "virtual", "--rate", "250", "--duration", "4"]
        run += ["--condition", "mimic"]
        assert main([*run, "--seed", seed, "--record", f"{seed}.mcap", "--json"]) == 0
    expected = json.loads("{" + capsys.readouterr().out.split("\n{")[-1])["tracking"]
    files = ["1.mcap", "2.mcap"]
    found = document(capsys, *files, "--by", "condition")
    assert found["recordings"][1]["tracking"] == expected
    gain = [one["tracking"]["gain"] for one in found["recordings"]]
    assert found["groups"][0]["tracking"]["gain"][0] == pytest.approx(np.mean(gain))
    for name in ("table.csv", "table.tex"):
        assert main(["compare", *files, "--by", "condition", "--out", name]) == 0
    out = capsys.readouterr().out
    assert "phase [deg]" in " ".join(out.split())
    assert max(map(len, out.splitlines())) <= 80
    with Path("table.csv").open(newline="") as file:
        rows = [*csv.DictReader(file)]
    assert {float(row["tracking gain"]) for row in rows} == set(gain)
    assert "error rms [mm]" in Path("table.tex").read_text()


def test_only_mimic_has_a_table_of_the_tracking(series, capsys):
    found = document(capsys, series)
    assert {one["tracking"] for one in found["recordings"]} == {None}
    assert main(["compare", str(series)]) == 0
    assert "tracking" not in capsys.readouterr().out


def test_the_design_of_the_analysis_of_variance_is_stated_and_its_table_is_written(
    series, tmp_path, capsys
):
    for name in ("table.csv", "table.tex"):
        options = ["--anova", "e_f", "--out", str(tmp_path / name)]
        assert main(["compare", str(series), *options]) == 0
    out = " ".join(capsys.readouterr().out.split())
    design = (
        "Design: repeated measures. subject is the random factor; cube, estimator vary within each "
        "subject. The trials of a subject with the same levels, which differ in repetition, are "
        "averaged."
    )
    assert design in out
    with (tmp_path / "table-anova.csv").open(newline="") as file:
        rows = [*csv.DictReader(file)]
    assert [row["source"] for row in rows] == ["cube", "estimator", "cube x estimator"]
    assert {row["response"] for row in rows} == {"e_f"}
    assert all(row["design"].startswith(design) for row in rows)
    latex = (tmp_path / "table.tex").read_text()
    assert design in latex
    assert "\ncube $\\times$ estimator & " in latex


def test_a_mean_over_different_specimens_is_not_called_a_mean_over_repeats(series, capsys):
    assert main(["compare", str(series), "--by", "subject"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "(a) Recordings that differ in cube are pooled" in out
    assert "4 (a)" in out, "the row of the group has the mark"
    assert "repeats" not in out
