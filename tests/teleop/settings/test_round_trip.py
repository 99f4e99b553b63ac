"""A recorded trial, written to a configuration file and run again, is the same to the bit."""

from __future__ import annotations

import tempfile
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from estimation import MODELS
from estimation.method_settings import OwnSettings
from sim_backend import ForceMaster, ForceSlave, OperatorModel, Sensors
from teleop.control.admittance import AdmittanceParameters
from teleop.control.channel import ChannelSettings
from teleop.control.coupling import Coupling
from teleop.control.excitation_signals import Chirp, Designed, Multisine, Sine
from teleop.control.feedback.settings import FeedbackSettings
from teleop.control.tare import Tare
from teleop.control.wanted_precision import WantedPrecision
from teleop.recording.recording import load
from teleop.safety.tightened_limits import TightenedLimits
from teleop.settings.configuration import read_configuration, write_configuration
from teleop.settings.provenance import Provenance
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

VARIED = {
    "cube": st.sampled_from(["soft", "medium", "hard"]),
    "specimen": st.sampled_from(["", "liver"]),
    "operator": st.sampled_from(["", "s01"]),
    "notes": st.text(max_size=10).filter(lambda text: "\0" not in text),
    "about": st.builds(
        Provenance,
        authors=st.sampled_from([(), ("Ada Lee", "Bo Kim")]),
        licence=st.sampled_from(["", "CC-BY-4.0"]),
    ),
    "duration": st.floats(0.02, 0.2),
    "until": st.sampled_from([None, WantedPrecision(0.02, 0.1), WantedPrecision(b=0.3)]),
    "rate": st.sampled_from([500.0, 1000.0, 1234.5]),
    "seed": st.integers(0, 2**31),
    "signal": st.none() | st.builds(Sine, st.floats(0.1, 10.0)),
    "count_in": st.none() | st.floats(0.0, 0.1),
    "admittance": st.builds(AdmittanceParameters, st.floats(0.5, 3.0), st.floats(1.0, 20.0)),
    "coupling": st.builds(Coupling, st.floats(0.5, 2.0), st.floats(0.0, 5.0)),
    "conditioning": st.sampled_from(["matched", "svf", "foaw", "difference"]),
    "bandwidth": st.floats(5.0, 50.0),
    "force_lag": st.sampled_from([None, 0.0, 0.00266]),
    "lost_motion": st.sampled_from([None, 0.0, 50e-6]),
    "estimators": st.sampled_from([("rls",), ("rls", "kalman", "me"), ("ai", "segments")]),
    "model": st.sampled_from([MODELS["kelvin-voigt"], MODELS["stiffening"]]),
    "estimator_parameters": st.sampled_from([{}, {"rls": OwnSettings(0.99, (1.0, 2.0))}]),
    "tightened_limits": st.builds(TightenedLimits, rest_master_force=st.none() | st.just(4.0)),
    "sensors": st.builds(Sensors, st.floats(1e-7, 1e-5), st.floats(0.0, 0.05)),
    "tare": st.builds(Tare, st.floats(-0.1, 0.1), rig=st.just("simulated")),
    "depth": st.none() | st.floats(1e-3, 1e-2),
    "operator_model": st.builds(
        OperatorModel, st.floats(150.0, 1500.0), st.none() | st.just(5.0), st.floats(-0.3, 0.8)
    ),
    "feedback": st.builds(
        FeedbackSettings,
        st.sampled_from(["none", "model-mediated"]),
        st.just(0.5),
        st.sampled_from([None, True, False]),
    ),
    "live": st.booleans(),
    "force_master": st.none()
    | st.builds(ForceMaster, st.floats(200.0, 600.0), max_force=st.floats(130.0, 300.0)),
    "force_slave": st.none()
    | st.builds(ForceSlave, st.floats(2.5, 3.5), st.integers(0, 2), st.floats(2e3, 3e3)),
    "channel": st.none() | st.builds(ChannelSettings, st.floats(0.0, 0.1), st.floats(0.0, 0.01)),
}
"""Values of the settings; `condition` besides, whose values depend on the signal."""
OTHER = {
    "condition",
    "clock",
    "preset",
    "custom_setup",
    "custom_limits",
    "custom_condition",
    "custom_link",
    "custom_rig",
    "custom_signal",
    "protocol",
    "station",
    "rig",
}
"""Settings that are not varied here: see `test_documents.py` for those of other objects."""
SIGNALS = st.sampled_from([None, Multisine((1.0, 2.0)), Chirp(1.0, 4.0, 1.0), Designed(3.0)])


@st.composite
def trials(draw):
    values = {name: draw(strategy) for name, strategy in VARIED.items()}
    values["condition"] = draw(st.sampled_from(["free", "mimic", "autonomous"]))
    if values["condition"] == "autonomous":
        values["signal"] = draw(SIGNALS)
        values["feedback"] = FeedbackSettings()
    if values["condition"] != "free":
        values["operator_model"] = OperatorModel(values["operator_model"].arm_stiffness)
    if values["force_master"] is not None:  # a small gain: the motor has to exert the soft force
        values["feedback"] = replace(values["feedback"], gain=0.05)
    if values["conditioning"] != "matched":
        values |= {"model": MODELS["kelvin-voigt"], "force_lag": 0.0}
    return TrialSettings(clock="virtual", **values)


def test_every_setting_is_varied_or_named_as_an_object_of_its_own():
    assert {field.name for field in fields(TrialSettings)} == VARIED.keys() | OTHER


@pytest.mark.usefixtures("undrawn")
@settings(
    max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(trials())
def test_recording_to_file_to_run_gives_the_same_recording_to_the_bit(first):
    with tempfile.TemporaryDirectory() as folder:
        recorded, again = Path(folder) / "first.mcap", Path(folder) / "again.mcap"
        run_trial(first, recorded)
        written = Path(folder) / "trial.toml"
        written.write_text(write_configuration(read_configuration(recorded)), encoding="utf-8")
        restored = read_configuration(written)
        assert restored == first
        run_trial(restored, again)
        one, other = load(recorded), load(again)
    assert one.columns.keys() == other.columns.keys()
    for name, column in one.columns.items():
        if not name.endswith(("_time", "lateness")):  # of the machine
            np.testing.assert_array_equal(column, other[name], err_msg=name)
    assert one.settings == other.settings
    assert [event["text"] for event in one.events] == [event["text"] for event in other.events]


def test_a_setting_that_is_lost_is_noticed():
    first = TrialSettings(clock="virtual", duration=0.1, seed=1)
    other = replace(first, seed=2)
    one, two = run_trial(first).recording, run_trial(other).recording
    assert not np.array_equal(one["contact_force"], two["contact_force"])
