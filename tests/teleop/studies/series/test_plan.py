"""Plans of series."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim_backend import DEPTH
from teleop.errors import InputError
from teleop.studies.series import trials as series_trials
from teleop.studies.series.plan import on_rig, read_plan
from teleop.studies.series.trials import planned_trials

PLAN = """
name = "study"
order = "listed"
repetitions = 2
blocks = ["subject"]

[factors]
subject = ["s1", "s2"]
condition = ["free", "mimic"]
specimen = ["liver", "cyst"]

[settings]
clock = "virtual"
duration_s = 1.0

[levels.specimen.cyst]
cube = "hard"
depth_m = 0.001
"""


@pytest.fixture
def read(tmp_path):
    def read(text):
        path = tmp_path / "plan.toml"
        path.write_text(text)
        return read_plan(path)

    return read


def test_every_combination_is_run_in_each_block_and_repetition(read):
    trials = planned_trials(read(PLAN), Path())
    assert len(trials) == 16
    assert [trial.number for trial in trials] == list(range(1, 17))
    assert {trial.levels["subject"] for trial in trials[:8]} == {"s1"}
    assert len({trial.label for trial in trials}) == 16


def test_factors_and_levels_set_the_settings_of_a_trial(read):
    trials = planned_trials(read(PLAN), Path())
    by_label = {trial.label: trial.settings for trial in trials}
    assert by_label["s1-free-liver-1"].condition == "free"
    assert by_label["s1-mimic-liver-1"].condition == "mimic"
    assert by_label["s2-free-cyst-2"].cube == "hard"
    assert by_label["s2-free-cyst-2"].depth == 0.001
    assert by_label["s2-free-liver-2"].cube == "soft"
    assert len({trial.settings.seed for trial in trials}) == len(trials)


def test_a_level_with_settings_of_its_own_still_names_the_specimen_and_the_condition(read):
    named = PLAN + "[levels.condition.mimic]\nduration_s = 2.0\n"
    by_label = {trial.label: trial.settings for trial in planned_trials(read(named), Path())}
    settings = by_label["s1-mimic-cyst-1"]
    assert (settings.specimen, settings.condition, settings.duration) == ("cyst", "mimic", 2.0)
    assert by_label["s1-free-liver-1"].duration == 1.0


def test_a_level_with_settings_of_its_own_may_have_a_name_that_is_no_condition(read):
    slow = PLAN.replace('"mimic"', '"slow"') + '[levels.condition.slow]\ncondition = "mimic"\n'
    by_label = {trial.label: trial.settings for trial in planned_trials(read(slow), Path())}
    assert by_label["s1-slow-liver-1"].condition == "mimic"


def test_a_problem_of_several_trials_is_reported_once(read):
    with pytest.raises(InputError) as of_all:
        planned_trials(read(PLAN.replace("1.0\n", "-1.0\n")), Path())
    assert str(of_all.value).startswith("duration -1 s: expected more than 0")
    deep = PLAN.replace("0.001", "0.5").replace('"s1", "s2"', '"s1"')
    with pytest.raises(InputError) as of_some:
        planned_trials(read(deep), Path())
    assert str(of_some.value).startswith("s1, free, cyst; s1, mimic, cyst: depth 500 mm: expected")


def test_all_problems_of_a_plan_are_reported_at_once(read):
    with pytest.raises(InputError) as refused:
        read('name = "a b"\nrepetitions = 0\nodd = 1\n[factors]\nc = []\n')
    for part in ("name", "repetitions", "odd"):
        assert part in str(refused.value)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (('blocks = ["subject"]', 'blocks = ["person"]'), "blocks: 'person'"),
        (('["s1", "s2"]', '["s1", "s1"]'), "factors.subject: expected distinct levels"),
        (("levels.specimen.cyst", "levels.specimen.stone"), "levels.specimen.stone: expected"),
        (("repetitions = 2", "repetitions = 1000"), None),
        (('["s1", "s2"]', str([f"s{i}" for i in range(3000)])), "24000 trials: expected at most"),
    ],
)
def test_a_plan_that_does_not_fit_together_is_refused(read, change, problem):
    if problem is None:
        assert read(PLAN.replace(*change)).repetitions == 1000
        return
    with pytest.raises(InputError, match=problem):
        read(PLAN.replace(*change))


def test_settings_that_are_refused_are_named_with_the_trial(read):
    with pytest.raises(InputError, match="s1, free, cyst; .*s2, mimic, cyst: depth 1000 mm"):
        planned_trials(read(PLAN.replace("depth_m = 0.001", "depth_m = 1.0")), Path())


def test_a_seed_that_is_no_number_is_refused(read):
    with pytest.raises(InputError, match="^seed: expected a whole number"):
        planned_trials(read(PLAN.replace("duration_s = 1.0", 'seed = "x"')), Path())


def test_the_files_of_a_combination_of_levels_are_read_once(read, monkeypatch):
    documents = []
    original = series_trials.settings_from
    monkeypatch.setattr(
        series_trials, "settings_from", lambda *given: documents.append(given) or original(*given)
    )
    trials = planned_trials(read(PLAN.replace("repetitions = 2", "repetitions = 5")), Path())
    assert len(trials) == 40
    assert len(documents) == 8


def test_the_plan_of_the_paper_has_its_nine_trials():
    trials = planned_trials(read_plan(Path("paper")), Path())
    cells = {(trial.settings.condition, trial.settings.cube) for trial in trials}
    assert len(trials) == len(cells) == 9


def test_a_plan_that_is_not_there_is_refused_in_one_line():
    with pytest.raises(InputError, match="none: no such file"):
        read_plan(Path("none"))


def test_on_a_rig_of_devices_a_cube_is_a_specimen_with_the_depth_of_the_paper():
    board = Path(__file__).parents[4] / "rigs" / "serial-board.toml"
    trials = planned_trials(on_rig(read_plan(Path("paper")), board), Path())
    assert len(trials) == 9
    for trial in trials:
        settings, levels = trial.settings, trial.levels
        assert settings.rig_name == "serial board"
        assert settings.clock == "real"
        assert (settings.condition, settings.specimen) == (levels["condition"], levels["cube"])
        assert settings.depth == DEPTH[levels["condition"]][levels["cube"]]


def test_a_stated_depth_replaces_that_of_the_paper():
    board = Path(__file__).parents[4] / "rigs" / "serial-board.toml"
    paper = read_plan(Path("paper"))
    stated = paper.model_copy(update={"settings": paper.settings | {"depth_m": 0.002}})
    trials = planned_trials(on_rig(stated, board), Path())
    assert {trial.settings.depth for trial in trials} == {0.002}
