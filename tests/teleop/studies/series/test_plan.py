"""Plans of series."""

from __future__ import annotations

from pathlib import Path

import pytest
import tomlkit
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_backend import DEPTH
from teleop.control.conditions import CONDITIONS
from teleop.errors import InputError
from teleop.studies.series import trials as series_trials
from teleop.studies.series.plan import Plan, checked_plan, plan_document
from teleop.studies.series.trials import acting_factors, cells, chosen_settings, read_series

BOARD = Path(__file__).parents[4] / "rigs" / "serial-board.toml"
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
    """Return a function that writes a plan and returns its trials."""

    def read(text):
        path = tmp_path / "plan.toml"
        path.write_text(text)
        return read_series(path)[1]

    return read


@pytest.fixture
def problems(read, tmp_path):
    """Return a function that writes an invalid plan, and returns the lines of the message."""

    def problems(text):
        with pytest.raises(InputError) as refused:
            read(text)
        prefix = f"{tmp_path / 'plan.toml'}: "
        lines = str(refused.value).splitlines()
        assert all(line.startswith(prefix) for line in lines)
        return [line.removeprefix(prefix) for line in lines]

    return problems


def test_every_combination_is_run_in_each_block_and_repetition(read):
    trials = read(PLAN)
    assert len(trials) == 16
    assert [trial.number for trial in trials] == list(range(1, 17))
    assert {trial.levels["subject"] for trial in trials[:8]} == {"s1"}
    assert len({trial.label for trial in trials}) == 16


def test_factors_and_levels_set_the_settings_of_a_trial(read):
    trials = read(PLAN)
    by_label = {trial.label: trial.settings for trial in trials}
    assert by_label["s1-free-liver-1"].condition == "free"
    assert by_label["s1-mimic-liver-1"].condition == "mimic"
    assert by_label["s2-free-cyst-2"].cube == "hard"
    assert by_label["s2-free-cyst-2"].depth == 0.001
    assert by_label["s2-free-liver-2"].cube == "soft"
    assert len({trial.settings.seed for trial in trials}) == len(trials)


def test_a_level_with_settings_of_its_own_still_names_the_specimen_and_the_condition(read):
    named = PLAN + "[levels.condition.mimic]\nduration_s = 2.0\n"
    by_label = {trial.label: trial.settings for trial in read(named)}
    settings = by_label["s1-mimic-cyst-1"]
    assert (settings.specimen, settings.condition, settings.duration) == ("cyst", "mimic", 2.0)
    assert by_label["s1-free-liver-1"].duration == 1.0


def test_a_level_with_settings_of_its_own_may_have_a_name_that_is_no_condition(read):
    slow = PLAN.replace('"mimic"', '"slow"') + '[levels.condition.slow]\ncondition = "mimic"\n'
    by_label = {trial.label: trial.settings for trial in read(slow)}
    assert by_label["s1-slow-liver-1"].condition == "mimic"


def test_a_problem_of_several_trials_is_reported_once(problems):
    (of_all,) = problems(PLAN.replace("1.0\n", "-1.0\n"))
    assert of_all.startswith("duration -1 s: expected more than 0")
    deep = PLAN.replace("0.001", "0.5").replace('"s1", "s2"', '"s1"')
    (of_some,) = problems(deep)
    assert of_some.startswith("free, cyst; mimic, cyst: depth 500 mm: expected")


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
        (("repetitions = 2", "repetitions = 1001"), "repetitions: "),
        (('["s1", "s2"]', str([f"s{i}" for i in range(1251)])), "10008 trials: expected at most"),
    ],
)
def test_a_plan_that_does_not_fit_together_is_refused(read, change, problem):
    with pytest.raises(InputError, match=problem):
        read(PLAN.replace(*change))


@pytest.mark.parametrize(
    ("change", "trials"),
    [
        (("repetitions = 2", "repetitions = 1000"), 8000),
        (('["s1", "s2"]', str([f"s{i}" for i in range(1250)])), 10_000),
    ],
)
def test_the_largest_numbers_of_repetitions_and_of_trials_are_no_problem(change, trials):
    plan, problems = checked_plan(tomlkit.parse(PLAN.replace(*change)).unwrap())
    assert problems == []
    assert len(cells(plan)) == trials


def test_settings_that_are_refused_are_named_with_the_trial(read):
    with pytest.raises(InputError, match="free, cyst; mimic, cyst: depth 1000 mm"):
        read(PLAN.replace("depth_m = 0.001", "depth_m = 1.0"))


def test_a_seed_that_is_no_number_is_refused(read):
    with pytest.raises(InputError, match="plan.toml: seed: expected a whole number"):
        read(PLAN.replace("duration_s = 1.0", 'seed = "x"'))


def test_the_files_of_a_combination_of_levels_are_read_once(read, monkeypatch):
    documents = []
    original = series_trials.complete_settings
    monkeypatch.setattr(
        series_trials,
        "complete_settings",
        lambda *given: documents.append(given) or original(*given),
    )
    trials = read(PLAN.replace("repetitions = 2", "repetitions = 5"))
    assert len(trials) == 40
    assert len(documents) == 4, "no setting depends on the subject"


def test_the_plan_of_the_paper_has_its_nine_trials():
    trials = read_series(Path("paper"))[1]
    cells = {(trial.settings.condition, trial.settings.cube) for trial in trials}
    assert len(trials) == len(cells) == 9


def test_a_plan_that_is_not_there_is_refused_in_one_line():
    with pytest.raises(InputError, match="none: no such file"):
        read_series(Path("none"))


def test_on_a_rig_of_devices_a_cube_is_a_specimen_with_the_depth_of_the_paper():
    board = Path(__file__).parents[4] / "rigs" / "serial-board.toml"
    trials = read_series(Path("paper"), board)[1]
    assert len(trials) == 9
    for trial in trials:
        settings, levels = trial.settings, trial.levels
        assert settings.rig_name == "serial board"
        assert settings.clock == "real"
        assert (settings.condition, settings.specimen) == (levels["condition"], levels["cube"])
        assert settings.depth == DEPTH[CONDITIONS[levels["condition"]].moved_by][levels["cube"]]


def test_a_stated_depth_replaces_that_of_the_paper(tmp_path):
    board = BOARD
    document = plan_document(Path("paper"))
    document["settings"]["depth_m"] = 0.002
    path = tmp_path / "plan.toml"
    path.write_text(tomlkit.dumps(document))
    _, trials = read_series(path, board)
    assert {trial.settings.depth for trial in trials} == {0.002}


WRONG = """
name = "liver"
order = "rnd"
repetitions = 0
prompt = "Place {specimenn}, {specimen}, {trial}."
blocks = ["person"]
rest = 3

[factors]
condition = ["free", "mimic", "odd"]
specimen = ["liver", 5, "cyst"]

[settings]
rig = "none.toml"
specimen = "phantom"
duration_s = -1.0
estimators = ["rls", "kalmann"]
bandwith_hz = 30.0

[levels.specimen.stone]
depth_m = 0.003
"""


def test_all_problems_of_a_plan_and_its_trials_are_reported_at_once(problems):
    lines = problems(WRONG)
    expected = [
        "order: expected one of listed, random, latin-square",
        "repetitions: ",
        "rest: unknown setting",
        "factors.specimen.1: expected text in quotes, got 5",
        "blocks: 'person': expected one of the factors condition, specimen",
        "levels.specimen.stone: expected one of liver, 5, cyst",
        "settings.specimen: is also a factor: expected it in one of the two places",
        "prompt: {specimenn}: expected {trial} or a factor, {condition}, {specimen}",
        "depth_m: is missing: expected the depth of palpation [m] in [settings] or [levels]",
        "none.toml: no such file",
        "bandwith_hz: unknown setting: expected bandwidth_hz",
        "duration -1 s: expected more than 0",
        "odd, liver; odd, cyst: condition: expected one of free, mimic, autonomous",
    ]
    for part in expected:
        assert sum(part in line for line in lines) == 1, (part, lines)
    assert sum("kalmann" in line for line in lines) == 1
    assert len(lines) == len(expected) + 1


def test_each_problem_that_is_mended_leaves_the_others(problems):
    lines = problems(WRONG)
    mended = problems(WRONG.replace('"rnd"', '"listed"').replace("rest = 3", ""))
    assert mended == [line for line in lines if not line.startswith(("order:", "rest:"))]


def test_a_depth_and_a_duration_that_a_rig_needs_are_both_reported(problems):
    text = PLAN.replace('clock = "virtual"', f'rig = "{BOARD}"')
    lines = problems(text[: text.index("[levels")])
    assert len(lines) == 2
    assert lines[0].startswith("depth_m: is missing: expected the depth of palpation [m] in [set")
    assert lines[1].startswith("mimic, liver; mimic, cyst: duration 1 s: expected count-in and")
    assert not any("--" in line for line in lines), "teleop series has no such options"


def test_levels_that_are_numbers_are_the_only_problem(problems):
    text = PLAN.replace('clock = "virtual"', f'rig = "{BOARD}"\ndepth_m = 0.003')
    text = text[: text.index("[levels")].replace("= 1.0", "= 9.0")
    lines = problems(text.replace('["liver", "cyst"]', "[1, 2]"))
    assert lines == [
        f"factors.specimen.{i}: expected text in quotes, got {i + 1}" for i in range(2)
    ]


@pytest.mark.parametrize("key", ["factors", "name"])
def test_a_plan_without_a_needed_key_is_still_checked(problems, key):
    kept = tomlkit.parse(PLAN.replace("1.0\n", "-1.0\n"))
    del kept[key]
    lines = problems(tomlkit.dumps(kept))
    assert lines[0] == f"{key}: is missing"
    assert any("duration -1 s" in line for line in lines)


@given(
    st.dictionaries(
        st.sampled_from(["name", "factors", "blocks", "order", "prompt", "settings", "levels"]),
        st.recursive(
            st.integers() | st.text(max_size=5),
            lambda inner: (
                st.lists(inner, max_size=3)
                | st.dictionaries(st.sampled_from(["cube", "soft", "a b", ""]), inner, max_size=3)
            ),
            max_leaves=8,
        ),
    )
)
def test_any_document_gives_a_plan_or_problems(document):
    try:
        Plan.model_validate(document)
        valid = True
    except ValidationError:
        valid = False
    plan, problems = checked_plan(document)
    assert valid or problems
    chosen_settings(plan, acting_factors(plan), Path())


NESTED = """
name = "nested"
order = "listed"
[factors]
mass = ["light", "heavy"]
damping = ["low"]
[settings]
admittance = {mass = 3.0, stiffness = 5.0}
signal = {kind = "sine", frequency = 1.0}
[levels.mass.heavy.admittance]
mass = 6.0
[levels.mass.heavy.signal]
kind = "chirp"
low = 0.5
high = 2.0
[levels.damping.low.admittance]
damping = 9.0
"""


def test_a_level_changes_only_its_own_settings_of_a_table(tmp_path):
    (tmp_path / "plan.toml").write_text(NESTED)
    light, heavy = (trial.settings for trial in read_series(tmp_path / "plan.toml")[1])
    found = [
        (s.admittance.mass, s.admittance.stiffness, s.admittance.damping) for s in (light, heavy)
    ]
    assert found == [(3.0, 5.0, 9.0), (6.0, 5.0, 9.0)]
    assert (light.signal.kind, heavy.signal.kind) == ("sine", "chirp")


def test_two_levels_that_assign_different_values_are_refused(tmp_path):
    (tmp_path / "plan.toml").write_text(NESTED + "mass = 2.0\n")
    with pytest.raises(
        InputError, match="admittance.mass: levels.mass.heavy and levels.damping.low"
    ):
        read_series(tmp_path / "plan.toml")


@pytest.mark.parametrize("name", ["estimator", "repetition", "trial", "seed"])
def test_a_factor_with_the_name_of_a_column_of_the_results_is_refused(tmp_path, name):
    (tmp_path / "plan.toml").write_text(f'name = "n"\n[factors]\n{name} = ["1", "2"]\n')
    with pytest.raises(InputError, match=f"factors.{name}: expected another name"):
        read_series(tmp_path / "plan.toml")
