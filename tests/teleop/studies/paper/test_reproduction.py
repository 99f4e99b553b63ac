from __future__ import annotations

import csv
import errno
import itertools
import json

import pytest

from sim_backend import CUBES
from teleop.cli import main
from teleop.studies.paper.claims import check_claims
from teleop.studies.paper.page import reproduction_page
from teleop.studies.paper.reproduction import reproduce
from teleop.studies.paper.table1 import CONDITIONS, is_calibrated, table1
from teleop.studies.paper.tables import print_claims
from teleop.studies.paper.trials import Damping, PaperTrial, paper_trial

from ...html_page import Page


def test_table_1_is_the_papers():
    table = table1()
    assert len(table) == 27
    assert table["free", "soft", "rls"] == (-12.5, 2229.2, 0.34)
    assert table["mimic", "hard", "ai"] == (608.0, 31099.0, 2.34)
    assert table["autonomous", "hard", "me"] == (-284.0, 19850.0, 0.77)


def test_calibrated_are_the_rls_cells_of_free_and_autonomous():
    marked = [key for key in table1() if is_calibrated(key[0], key[2])]
    assert len(marked) == 6
    assert {estimator for _, _, estimator in marked} == {"rls"}
    assert {condition for condition, _, _ in marked} == {"free", "autonomous"}


def test_force_channel_and_slave_are_the_same_in_all_nine_trials():
    setups = [paper_trial(condition, cube).setup for condition in CONDITIONS for cube in CUBES]
    assert len({(setup.force_lag, setup.transmission) for setup in setups}) == 1


def test_a_trial_has_the_papers_settings():
    settings = paper_trial("mimic", "hard")
    assert (settings.duration, settings.loop_rate) == (10.0, 1000.0)
    parameters = settings.estimation_preset.bank()["ai"].parameters
    assert (parameters.rk4, parameters.Gamma) == (True, (50_000.0, 1e7))


def outcomes(change=None):
    """Return nine trials with the paper's numbers, of which one cell is changed."""
    made = []
    for condition in ("free", "mimic", "autonomous"):
        for cube in ("soft", "medium", "hard"):
            estimates = {
                e: {**table1()[condition, cube, e]._asdict(), "rise_time_s": 0.3, "note": None}
                for e in ("rls", "ai", "me")
            }
            if change and change[:2] == (condition, cube):
                estimates[change[2]][change[3]] = change[4]
            rls = estimates["rls"]["b"]
            damping = Damping(10.0, table1()[condition, cube, "rls"].b, rls, 5.0, 8.0, 10.0)
            made.append(PaperTrial(condition, cube, 0, estimates, damping, *([None] * 4), {}))
    return made


def test_every_claim_holds_for_the_papers_own_numbers():
    claims = check_claims(outcomes())
    assert len(claims) == 10
    assert [claim.claim for claim in claims if not claim.holds] == []


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (("free", "soft", "me", "k", 1500.0), "within 10 %"),
        (("free", "hard", "me", "e_f", 4.99), "largest force error"),
        (("mimic", "soft", "ai", "rise_time_s", 0.7), "rise time"),
        (("mimic", "soft", "ai", "rise_time_s", float("nan")), "rise time"),
        (("autonomous", "soft", "rls", "k", 2230.0), "decreases from free"),
        (("mimic", "medium", "rls", "k", 2000.0), "increases from soft"),
        (("mimic", "medium", "rls", "b", 3.0), "negative"),
    ],
)
def test_a_claim_fails_when_its_numbers_differ(change, word):
    failed = [claim.claim for claim in check_claims(outcomes(change)) if not claim.holds]
    assert any(word in claim for claim in failed)


@pytest.mark.parametrize(
    ("name", "far", "word"), [("b", 2.1, "damping cells"), ("e_f", 0.4, "force errors")]
)
def test_cells_beyond_a_factor_of_two_are_counted(name, far, word):
    changed = outcomes()
    for outcome in changed:
        for summary in outcome.estimates.values():
            summary[name] *= far
    (claim,) = [claim for claim in check_claims(changed) if word in claim.claim]
    assert not claim.holds
    assert claim.evidence.startswith("0 of 27")


def test_reproduce_writes_table_figures_and_a_page_that_needs_nothing_else(tmp_path, capsys):
    out = tmp_path / "paper"
    assert main(["reproduce", "--out", str(out), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    trials = document["trials"]
    assert len(trials) == 27
    assert {"condition", "cube", "estimator", "b", "k", "e_f", "rise_time_s"} <= trials[0].keys()
    assert trials[0]["paper"] == {"b": -12.5, "k": 2229.2, "e_f": 0.34}
    assert sum(row["calibrated"] for row in trials) == 6
    assert document["study"] == {}
    assert all({"claim", "holds", "evidence"} <= claim.keys() for claim in document["claims"])

    within = [abs(row["k"] / row["paper"]["k"] - 1.0) for row in trials]
    assert max(within) <= 0.1
    for name, least in (("b", 16), ("e_f", 22)):
        ratios = [row[name] / row["paper"][name] for row in trials]
        assert sum(0.5 <= ratio <= 2.0 for ratio in ratios) >= least, name
    errors = {(row["condition"], row["cube"], row["estimator"]): row["e_f"] for row in trials}
    for condition, cube, estimator in errors:
        assert errors[condition, cube, "ai"] >= errors[condition, cube, estimator]
    assert all(row["b"] < 0.0 for row in trials if row["estimator"] == "rls")
    for step in document["damping"]:
        assert step["stiffening"] == pytest.approx(step["true"], rel=0.1)

    with (out / "table1.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["k"]) for row in rows] == [row["k"] for row in trials]
    for figure in ("figure3", "figure4", "figure5"):
        assert (out / f"{figure}.png").read_bytes().startswith(b"\x89PNG")
        assert (out / f"{figure}.svg").read_text().startswith("<svg")
    page = Page((out / "index.html").read_text())
    assert page.tags.count("figure") == 3
    assert page.tags.count("table") == 4
    assert all(link.startswith("#") for link in page.links)


def test_the_lines_of_a_claim_after_the_first_are_indented(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "40")
    words = " ".join(["word"] * 12)
    print_claims(
        [{"claim": words, "holds": holds, "evidence": "9 of 9"} for holds in (True, False)]
    )
    lines = capsys.readouterr().out.splitlines()
    first, second = lines[: len(lines) // 2], lines[len(lines) // 2 :]
    for mark, text in (("holds:  ", first), ("fails:  ", second)):
        assert text[0].startswith(f"{mark}word")
        assert all(line.startswith(" " * len(mark)) for line in text[1:])
        assert max(map(len, text)) <= 40
        assert text[-1].strip() == "9 of 9"


def test_several_seeds_have_an_analysis_of_variance(monkeypatch):
    monkeypatch.setattr("teleop.studies.paper.trials.DURATION", 1.2)  # for a shorter test
    monkeypatch.setattr("teleop.studies.paper.reproduction.SLOW_FREQUENCIES", (0.4,))
    found = reproduce(seeds=2)
    assert set(found.summary()["study"]) == {"e_f", "rise_time_s"}
    page = reproduction_page(found.first, found.claims, {}, found.slow, found.study, 2, {})
    assert page.count("<table") == 6
    for before, table in itertools.pairwise(page.split("<table")):
        many = table.split("</tr>")[0].count("<th") > 4
        assert not many or before.endswith('<div class="wide">'), (
            "scrolls in its own box on a phone"
        )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--seeds", "0"], "seeds 0"),
        (["--seeds", "many"], "--seeds"),
        (["--out", __file__], "expected a folder"),
    ],
)
def test_invalid_arguments_are_reported(capsys, arguments, words):
    assert main(["reproduce", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert words in err
    assert err.count("\n") == 1


def test_without_shared_memory_it_is_refused_in_one_line(monkeypatch, tmp_path, capsys):
    def no_semaphores(*_, **__):
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr("multiprocessing.synchronize._multiprocessing.SemLock", no_semaphores)
    assert main(["reproduce", "--out", str(tmp_path / "r")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "shared memory" in error
