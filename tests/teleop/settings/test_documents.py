"""Settings of a trial as JSON."""

from __future__ import annotations

import math
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.rig_file import read_rig_file
from estimation import MODELS, paper_preset
from estimation.method_settings import OwnSettings
from sim_backend import (
    RIGID,
    Changing,
    Cube,
    OperatorModel,
    Relaxing,
    Sensors,
    Setup,
    Transmission,
)
from teleop.control.admittance import AdmittanceParameters
from teleop.control.coupling import Coupling
from teleop.control.excitation_signals import Chirp, Multisine, Sine
from teleop.control.tare import Tare
from teleop.errors import InputError
from teleop.json_documents import dumps, loads
from teleop.safety import Limits
from teleop.safety.tightened_limits import NOT_TIGHTENED, TightenedLimits
from teleop.settings.configuration import read_configuration, write_configuration
from teleop.settings.documents import from_document, to_document
from teleop.settings.trial_settings import TrialSettings

RIGS = sorted((Path(__file__).parents[3] / "rigs").glob("*.toml"))


def through_json(settings: TrialSettings) -> TrialSettings:
    return from_document(loads(dumps(to_document(settings))))


positive = st.floats(1e-3, 10.0)
signals = st.one_of(
    st.builds(Sine, st.floats(0.01, 40.0)),
    st.builds(Multisine, st.lists(st.floats(0.01, 40.0), min_size=1, max_size=6).map(tuple)),
    st.builds(Chirp, st.floats(0.01, 1.0), st.floats(1.5, 40.0), positive),
)


NAME_LETTERS = st.characters(categories=["L", "N", "P"])


RELAXING = Relaxing(Relaxing(Cube(2000.0, 1e6, 3.0), 700.0, 0.05), 1500.0, 0.4)


def settings_of(condition, signals):
    """Return valid settings with a condition."""
    return st.builds(
        TrialSettings,
        condition=condition,
        signal=st.none() | signals,
        count_in=st.none() | st.floats(0.0, 60.0),
        cube=st.sampled_from(["soft", "medium", "hard"]),
        duration=st.floats(0.01, 3600.0),
        clock=st.sampled_from(["real", "virtual"]),
        rate=st.floats(900.0, 2000.0),
        seed=st.integers(0, 2**31),
        admittance=st.builds(AdmittanceParameters, positive, positive, st.floats(0.0, 10.0)),
        coupling=st.builds(Coupling, positive, st.floats(0.0, 10.0)),
        bandwidth=st.floats(1.0, 100.0),
        force_lag=st.floats(0.0, 0.4),
        estimators=st.sampled_from([("rls",), ("rls", "kalman", "me")]),
        model=st.sampled_from([MODELS["kelvin-voigt"], MODELS["stiffening"]]),
        preset=st.sampled_from([None, replace(paper_preset("hard"), forgetting=0.95)]),
        sensors=st.builds(Sensors, st.floats(1e-7, 1e-4), st.floats(0.0, 0.1)),
        tare=st.builds(Tare, st.floats(-1.0, 1.0), date=st.text(), rig=st.just("simulated")),
        custom_limits=st.sampled_from([None, Limits(soft_force=30.0, hard_force=40.0)]),
        custom_setup=st.sampled_from(
            [
                None,
                Setup(Cube(2000.0, 1e6, 3.0, False), 1e-3, 5e-3),
                Setup(Cube(2000.0, 1e6, 3.0), 1e-3, 5e-3, Transmission(40e-6, 2e-6)),
                Setup(RELAXING, 1e-3, 5e-3),
                Setup(Changing(RELAXING, Cube(1e4, 0.0, 5.0), delay=0.5), 1e-3, 5e-3),
            ]
        ),
        depth=st.sampled_from([None, 2.5e-3]),
        specimen=st.text(NAME_LETTERS, max_size=20).map(str.strip),
        operator=st.text(NAME_LETTERS, max_size=20).map(str.strip),
        notes=st.text(max_size=50).filter(lambda text: "\0" not in text),
        operator_model=st.builds(
            OperatorModel, st.floats(50.0, 2000.0), withdrawal=st.floats(-0.3, 0.8)
        ),
        tightened_limits=st.sampled_from([NOT_TIGHTENED, TightenedLimits(rest_master_force=4.0)]),
        estimator_parameters=st.sampled_from([{}, {"rls": OwnSettings(0.99, (1.0, 2.0))}]),
    )


ALL_SETTINGS = st.one_of(
    settings_of(st.sampled_from(["free", "autonomous"]), signals),
    settings_of(st.just("mimic"), st.builds(Sine, st.floats(0.01, 40.0))),
)


@given(ALL_SETTINGS)
def test_the_round_trip_through_a_document_is_exact(trial):
    assert through_json(trial) == trial


@settings(max_examples=25)
@given(ALL_SETTINGS)
def test_a_configuration_file_gives_the_same_settings_again(trial):
    """Fewer examples, because they are slow, and the document is tested with more."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trial.toml"
        path.write_text(write_configuration(trial), encoding="utf-8")
        assert read_configuration(path) == trial


@pytest.mark.parametrize("path", RIGS, ids=lambda path: path.stem)
def test_a_rig_file_is_restored_from_its_text(path):
    settings = TrialSettings(rig=read_rig_file(path))
    restored = through_json(settings)
    assert restored == settings
    assert restored.limits == settings.limits


def test_an_infinite_limit_stays_infinite():
    settings = TrialSettings(custom_limits=TrialSettings().limits)
    channels = through_json(settings).limits.channels
    assert any(math.isinf(limits.frozen_travel) for limits in channels.values())


def test_all_invalid_settings_are_reported_at_once():
    document = to_document(TrialSettings()) | {"rate_hz": "fast", "seed": [], "signal": {}}
    with pytest.raises(InputError) as refused:
        from_document(document)
    for name in ("rate", "seed", "signal"):
        assert name in str(refused.value)


def test_a_setting_out_of_its_range_is_refused_as_on_the_command_line():
    with pytest.raises(InputError, match="rate 10 Hz: expected 50 to 100000 Hz"):
        from_document(to_document(TrialSettings()) | {"rate_hz": 10.0})


def test_a_recording_made_before_there_was_a_transmission_has_a_rigid_one():
    setup = Setup(Cube(2000.0, 1e6, 3.0), 1e-3, 5e-3, Transmission(40e-6, 2e-6))
    document = to_document(TrialSettings(custom_setup=setup))
    del document["custom_setup"]["transmission"]
    assert from_document(document).setup.transmission == RIGID


def test_an_operator_who_aims_for_a_force_round_trips():
    settings = TrialSettings(operator_model=OperatorModel(1500.0, 10.0, -0.2))
    assert through_json(settings) == settings


CUBE = {"k1": 2000.0, "k3": 0.0, "b": 3.0}


@pytest.mark.parametrize(
    ("cube", "problem"),
    [
        (CUBE | {"b": -1.0}, "custom_setup.cube: a cube needs k1 > 0, k3 >= 0 and b > 0, got"),
        (CUBE | {"x": 1.0}, "custom_setup.cube.x: unknown setting"),
        ({"body": CUBE, "k": 1e3}, "custom_setup.cube.tau: is missing"),
        ({"body": CUBE, "k": 1e3, "tau": 0.0}, "custom_setup.cube: a relaxing body needs tau >="),
        (
            {"body": CUBE | {"k1": 0.0}, "k": 1e3, "tau": 1.0},
            "custom_setup.cube.body: a cube needs k1 > 0",
        ),
        ({"before": CUBE, "delay": 1.0}, "custom_setup.cube.after: is missing"),
        (
            {"before": CUBE, "after": CUBE, "contact": 2},
            "custom_setup.cube: a glued body has one contact, got contact 2",
        ),
        (3, "custom_setup.cube: expected a table with keys such as k1, k3, b, got 3"),
    ],
)
def test_an_impossible_body_is_refused_in_one_line_with_its_key(cube, problem):
    with pytest.raises(InputError) as refused:
        from_document({"custom_setup": {"cube": cube, "force_lag": 1e-3, "depth": 5e-3}})
    assert str(refused.value).startswith(problem)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("model", "problem"),
    [
        ({"arm_stiffness": 1.0}, "operator_model: arm_stiffness 1 N/m: expected 50 to 2000 N/m"),
        ({"aim_force": -1.0}, "operator_model: aim_force -1 N: expected more than 0"),
        (
            {"stiffness": 1.0},
            "operator_model.stiffness: unknown setting: expected one of arm_stiffness, aim_force, "
            "withdrawal",
        ),
    ],
)
def test_an_impossible_operator_is_refused_in_one_line_with_its_key(model, problem):
    with pytest.raises(InputError) as refused:
        from_document({"operator_model": model})
    assert str(refused.value) == problem


def test_an_intended_force_is_refused_where_the_operator_follows_a_target():
    with pytest.raises(InputError, match="aim_force: not in mimic: expected condition free"):
        TrialSettings(condition="mimic", operator_model=OperatorModel(aim_force=10.0))
