"""Trials with a condition or a rig of the user: what is recorded, and what runs again."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_backend import SimulatedRig
from teleop.control.conditions import Condition
from teleop.errors import InputError
from teleop.recording.recording import load
from teleop.settings.configuration import read_configuration
from teleop.settings.documents import from_document, to_document
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.assembly import make_simulated_rig
from teleop.trial.recorded_trial import recorded_truth
from teleop.trial.result import Trial
from teleop.trial.run import run_trial

SETTINGS = TrialSettings(
    condition="autonomous", clock="virtual", duration=0.4, rate=250.0, estimators=("rls",), seed=7
)
LAB = '''
import os
from dataclasses import InitVar, dataclass, field
from teleop.control.conditions import Condition

@dataclass
class Step(Condition):
    """A step of the force."""

    amplitude: float = 1.0
    start: float = 0.2

    def drive_force(self, t, measurement):
        return self.amplitude if t > self.start else 0.0

class Hidden(Condition):
    def __init__(self, amplitude):
        self.twice = 2.0 * amplitude

    def drive_force(self, t, measurement):
        return self.twice

class Leave(Hidden):
    def __init__(self, **parameters):
        raise SystemExit(0)

@dataclass
class NoCondition:
    amplitude: float = 1.0

@dataclass
class Doubling(Step):
    def __post_init__(self):
        self.amplitude *= 2.0

@dataclass
class Counting(Step):
    steps: int = field(default=0, init=False)

    def drive_force(self, t, measurement):
        self.steps += 1
        return super().drive_force(t, measurement)

@dataclass
class Scaled(Step):
    scale: InitVar[float] = 1.0

    def __post_init__(self, scale):
        self._scale = scale
'''


class Push(Condition):
    """A constant force, from a module that is not installed."""

    def drive_force(self, t, measurement):
        return 2.0


class LabRig(SimulatedRig):
    """A rig whose body is not that of the settings."""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder with a distribution `mylab` 1.2, which the search for packages finds once."""
    folder = tmp_path_factory.mktemp("site")
    about = folder / "mylab-1.2.dist-info"
    about.mkdir()
    (folder / "mylab_steps.py").write_text(LAB)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: mylab\nVersion: 1.2\n")
    (about / "top_level.txt").write_text("mylab_steps\n")
    return folder


@pytest.fixture
def lab(site, monkeypatch):
    """The installed distribution `mylab` 1.2 with conditions; its folder."""
    monkeypatch.syspath_prepend(site)
    yield site
    sys.modules.pop("mylab_steps", None)


def make_lab_rig(now):
    rig = make_simulated_rig(replace(SETTINGS, cube="hard"), now)
    rig.__class__ = LabRig
    return rig


def recorded(path: Path, **options) -> Trial:
    return run_trial(SETTINGS, path, **options)


def test_the_class_of_a_condition_is_recorded_with_its_distribution_and_parameters(lab, tmp_path):
    from mylab_steps import Step

    trial = recorded(tmp_path / "step.mcap", condition=Step(3.0))
    assert load(tmp_path / "step.mcap").settings["custom_condition"] == {
        "name": "Step",
        "module": "mylab_steps",
        "distribution": "mylab",
        "version": "1.2",
        "parameters": {"amplitude": 3.0, "start": 0.2},
        "state": {},
        "complete": True,
        "plug_in": False,
        "properties": {"moved_by": "hand", "left_out": ""},
    }
    assert trial.summary()["condition"] == "Step"
    assert trial.about == "Step, soft cube, 0.4 s"
    assert trial.summary()["left_out"] == "", "a step does not end like the excitation"


def test_an_installed_condition_runs_again_to_the_bit(lab, tmp_path):
    from mylab_steps import Step

    first = recorded(tmp_path / "step.mcap", condition=Step(3.0, start=0.1)).recording
    again = run_trial(read_configuration(tmp_path / "step.mcap")).recording
    sine = run_trial(SETTINGS).recording
    for name, column in first.columns.items():
        np.testing.assert_array_equal(again[name], column)
    assert not np.array_equal(sine["drive_force"], first["drive_force"])


def test_a_condition_that_is_not_installed_is_not_run_again(tmp_path):
    recorded(tmp_path / "push.mcap", condition=Push())
    settings = read_configuration(tmp_path / "push.mcap")
    with pytest.raises(InputError, match=r"condition Push of .*expected a class of an installed"):
        run_trial(settings)
    again = run_trial(settings, condition=Push())
    assert again.settings.custom_condition == settings.custom_condition


def test_a_condition_of_another_version_is_not_run_again(lab, tmp_path):
    from mylab_steps import Step

    recorded(tmp_path / "step.mcap", condition=Step())
    about = lab / "mylab-1.2.dist-info" / "METADATA"
    metadata = about.read_text()
    about.write_text(metadata.replace("1.2", "1.3"))
    try:
        with pytest.raises(InputError, match=r"mylab 1\.2: expected this version, but 1\.3"):
            run_trial(read_configuration(tmp_path / "step.mcap"))
    finally:
        about.write_text(metadata)


def test_a_condition_whose_constructor_is_not_known_is_not_run_again(lab, tmp_path):
    from mylab_steps import Hidden

    trial = recorded(tmp_path / "hidden.mcap", condition=Hidden(1.0))
    assert trial.settings.custom_condition.parameters == {"twice": 2.0}
    with pytest.raises(InputError, match="its parameters are not recorded"):
        run_trial(read_configuration(tmp_path / "hidden.mcap"))


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"distribution": "nolab"}, "is not installed"),
        ({"module": "antigravity"}, "module antigravity is not in this distribution"),
        ({"module": "mylab_steps.absent"}, "cannot be created: ModuleNotFoundError"),
        ({"name": "Absent"}, "cannot be created: AttributeError"),
        ({"name": "Leave"}, "cannot be used: SystemExit: 0"),
        ({"name": "NoCondition", "parameters": {}}, "expected a class derived from Condition"),
        ({"parameters": {"speed": 1.0}}, "unexpected keyword argument"),
        (
            {"name": "os.makedirs", "parameters": {"name": "made"}},
            "expected a class derived from Condition",
        ),
    ],
)
def test_a_recording_that_states_anything_else_is_refused_in_one_line(
    lab, changes, problem, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    from mylab_steps import Step

    document = to_document(run_trial(SETTINGS, condition=Step()).settings)
    document["custom_condition"] |= changes
    with pytest.raises(InputError, match=problem) as caught:
        run_trial(from_document(document))
    assert "\n" not in str(caught.value)
    assert "antigravity" not in sys.modules
    assert not Path("made").exists(), "a recording calls no function"


@pytest.mark.parametrize(
    ("expression", "problem"),
    [
        ("Doubling(2.0)", "amplitude: a new object has another value"),
        ("Scaled(scale=2.0)", "its parameters are not recorded"),
        ("Step(float('nan'))", "its parameters are not recorded"),
        ("Step(float('inf'))", "its parameters are not recorded"),
        ("Step('\\ud800')", "its parameters are not recorded"),
        ("Step(10**5000)", "its parameters are not recorded"),
    ],
)
def test_a_condition_that_cannot_be_created_as_it_was_is_not_run_again(
    lab, expression, problem, tmp_path, monkeypatch
):
    import mylab_steps

    monkeypatch.setattr(mylab_steps.Step, "drive_force", lambda self, t, measurement: 1.0)
    recorded(tmp_path / "own.mcap", condition=eval(expression, vars(mylab_steps)))
    with pytest.raises(InputError, match=problem):
        run_trial(read_configuration(tmp_path / "own.mcap"))


def test_a_condition_that_has_run_before_is_recorded_with_its_state(lab, tmp_path):
    from mylab_steps import Counting

    condition = Counting()
    first = recorded(tmp_path / "first.mcap", condition=condition)
    assert first.settings.custom_condition.state == {"steps": 0}
    recorded(tmp_path / "second.mcap", condition=condition)
    run_trial(read_configuration(tmp_path / "first.mcap"))
    with pytest.raises(InputError, match="steps: a new object has another value"):
        run_trial(read_configuration(tmp_path / "second.mcap"))


def test_a_condition_does_not_have_the_name_of_one_of_this_package():
    with pytest.raises(InputError, match="class mimic of the condition: expected another name"):
        run_trial(SETTINGS, condition=type("mimic", (Push,), {})())


def test_a_rig_of_the_user_is_recorded_by_its_class_and_has_no_true_values(tmp_path):
    trial = recorded(tmp_path / "lab.mcap", rig_maker=make_lab_rig, arm=True)
    summary, recording = trial.summary(), load(tmp_path / "lab.mcap")
    assert (summary["rig"], summary["specimen"]) == ("LabRig", "LabRig")
    assert (summary["cube"], summary["truth"]) == (None, None)
    assert recording.session["rig"] == "LabRig"
    assert recording.settings["custom_rig"]["module"] == __name__
    assert not {"cube", "setup"} & recording.settings.keys()
    assert recorded_truth(recording) is None
    with pytest.raises(InputError, match=r"rig LabRig of .*: a recording cannot create it"):
        run_trial(read_configuration(tmp_path / "lab.mcap"))
