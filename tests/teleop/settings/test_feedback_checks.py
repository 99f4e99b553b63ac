"""Force feedback in the settings, the configuration file, the command line and the summary."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from drivers import Command
from sim_backend import CUBES, OperatorModel
from sim_backend.plant import Plant, PlantParameters
from teleop.cli import main
from teleop.control.admittance import AdmittanceParameters
from teleop.control.channel import ChannelSettings
from teleop.control.feedback.law import STIFF_PRIOR
from teleop.control.feedback.settings import FeedbackSettings
from teleop.errors import InputError
from teleop.names import FeedbackName
from teleop.settings.configuration import read_configuration, write_configuration
from teleop.settings.documents import from_document
from teleop.settings.feedback_checks import (
    arm_damping,
    check_feedback,
    delayed_loop,
    lag,
)
from teleop.settings.rig_loading import load_rig_file
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.assembly import make_link
from teleop.trial.rehearsal import rehearse
from teleop.trial.run import run_trial

ROOT = Path(__file__).parents[3]
RUN = ("run", "--clock", "virtual", "--no-record", "--duration", "1.5")


def settings(law, channel=None, damping=15.0, **changes):
    return TrialSettings(
        feedback=FeedbackSettings(law),
        channel=channel,
        admittance=AdmittanceParameters(damping=damping),
        operator_model=OperatorModel(aim_force=10.0),
        **changes,
    )


def test_feedback_is_refused_where_nobody_holds_the_handle(refused):
    line = refused(*RUN, "--condition", "autonomous", "--feedback", "model-mediated")
    assert "nobody holds the handle" in line
    assert "expected free or mimic" in line


def test_feedback_is_refused_on_a_rig_whose_master_has_no_drive(tmp_path):
    text = (ROOT / "rigs" / "serial-board.toml").read_text()
    start = text.index("[drives.master]")
    end = text.index("\n[", start + 1)
    file = tmp_path / "passive.toml"
    file.write_text(text[:start] + text[end + 1 :])
    rig = load_rig_file(file)
    with pytest.raises(InputError, match=r"handle of the rig .* is passive"):
        TrialSettings(rig=rig, feedback=FeedbackSettings("position-force"))
    assert TrialSettings(rig=rig, channel=ChannelSettings(0.01)).has_link


def test_position_force_is_refused_over_a_delay_that_makes_it_unstable(refused):
    line = refused(*RUN, "--feedback", "position-force", "--channel", "delay=50ms")
    assert "100.0 ms are the round trip" in line
    assert "model-mediated" in line


def test_position_force_is_permitted_below_the_predicted_delay():
    stable = settings("position-force", damping=50.0)
    assert check_feedback(stable) == ""
    loop = delayed_loop(stable)
    with pytest.raises(InputError, match="unstable"):
        check_feedback(replace(stable, channel=ChannelSettings(0.5 * loop.safe_delay)))


def test_the_lag_of_the_handle_reduces_the_delay_that_a_stiff_arm_permits():
    """With 3 ms, this loop oscillates at 18 Hz with 8 N from peak to peak."""
    stiff = replace(
        settings("position-force", ChannelSettings(1.5e-3), cube="medium"),
        operator_model=OperatorModel(1500.0, aim_force=10.0),
    )
    with pytest.raises(InputError, match="unstable"):
        check_feedback(stiff)


def damping_of_the_plant(arm, frequency):
    """Return -Re{F / V} of the simulated plant: measured force F of the hand, commanded velocity V.

    The hand intends to stay at rest, and the command is a sine [Hz].
    """
    plant = Plant(CUBES["soft"], PlantParameters(), arm)
    t = np.arange(4000) * 1e-3
    command = 1e-3 * np.sin(2.0 * np.pi * frequency * t)
    force = []
    for u in command:
        force.append(plant.master_force.y)
        plant.advance(1e-3, Command(u, 0.0))
    phasor = np.exp(-2j * np.pi * frequency * t)[2000:]
    return -(np.dot(force[2000:], phasor) / np.dot(command[2000:], phasor)).real


@pytest.mark.parametrize("stiffness", [150.0, 400.0, 1500.0])
@pytest.mark.parametrize("frequency", [5.0, 10.0, 20.0, 30.0])
def test_the_damping_of_the_arm_is_between_that_with_and_without_the_delay_of_the_loop(
    stiffness, frequency
):
    arm = OperatorModel(stiffness).arm
    measured = damping_of_the_plant(arm, frequency)
    trial = replace(settings("position-force"), operator_model=OperatorModel(stiffness))
    (assumed,) = arm_damping(trial, np.array([frequency]))
    (new,) = arm_damping(replace(trial, rate=1e5), np.array([frequency]))
    assert assumed < measured < new


def with_slave(rig, **entries):
    """The rig with further entries of drives.slave."""
    drives = rig.sections.drives
    slave = drives.slave.model_copy(update=entries)
    drives = drives.model_copy(update={"slave": slave})
    return replace(rig, sections=rig.sections.model_copy(update={"drives": drives}))


def test_on_a_rig_the_stiffness_is_stated_or_there_is_a_warning():
    rig = with_slave(load_rig_file(ROOT / "rigs" / "serial-board.toml"), lag_ms=0.0)
    unknown = settings("position-force", rig=rig, depth=2e-3, force_lag=1e-3)
    assert "feedback.stiffness" in check_feedback(replace(unknown, operator_model=OperatorModel()))
    stated = replace(unknown, feedback=FeedbackSettings("position-force", stiffness=500.0))
    assert check_feedback(stated) == ""
    stiff = replace(stated, feedback=FeedbackSettings("position-force", stiffness=50e3))
    with pytest.raises(InputError, match="k = 50000 N/m"):
        check_feedback(stiff)


def test_on_a_rig_the_delay_has_the_stated_lag_of_its_force_channel():
    rig = load_rig_file(ROOT / "rigs" / "serial-board.toml")
    known = FeedbackSettings("position-force", stiffness=3000.0)
    slow = settings("position-force", rig=rig, depth=2e-3, force_lag=10e-3)
    with pytest.raises(InputError, match=r"a delay of 11\.5 ms"):
        check_feedback(replace(slow, feedback=known))
    sections = rig.sections
    channel = sections.channels.contact_force.model_copy(update={"lag_ms": 2.0})
    channels = sections.channels.model_copy(update={"contact_force": channel})
    late = replace(rig, sections=sections.model_copy(update={"channels": channels}))
    assert lag(replace(slow, rig=late)) == pytest.approx(13.5e-3)


def test_on_a_rig_a_lag_that_is_not_stated_is_a_warning():
    rig = load_rig_file(ROOT / "rigs" / "serial-board.toml")
    stated = FeedbackSettings("position-force", stiffness=500.0)
    unknown = replace(settings("position-force", rig=rig, depth=2e-3), feedback=stated)
    assert "lag_ms in the rig file" in check_feedback(unknown)
    assert "feedback.stiffness" not in check_feedback(unknown)
    warning = check_feedback(replace(unknown, force_lag=1e-3))
    assert warning.endswith(
        "expected the lag of the slave's drive, lag_ms of drives.slave in the rig file"
    )
    known = replace(unknown, force_lag=1e-3, rig=with_slave(rig, lag_ms=2.0))
    assert check_feedback(known) == ""


def test_on_a_rig_the_arm_is_not_assumed_to_damp():
    rig = with_slave(load_rig_file(ROOT / "rigs" / "serial-board.toml"), lag_ms=0.0)
    for stiffness, refused in ((1e3, False), (1.5e3, True)):  # d / (1 kN/m) = 15 ms
        known = FeedbackSettings("position-force", stiffness=stiffness)
        stated = {"force_lag": 10e-3, "lost_motion": 0.0}
        trial = settings("position-force", rig=rig, depth=2e-3, **stated)
        trial = replace(trial, feedback=known)
        assert delayed_loop(trial).safe_delay == pytest.approx(15.0 / stiffness)
        if refused:
            with pytest.raises(InputError, match="unstable"):
                check_feedback(trial)
        else:
            assert check_feedback(trial) == ""


def test_the_loss_of_the_channel_is_a_delay():
    assert check_feedback(settings("position-force", ChannelSettings(1e-3))) == ""
    with pytest.raises(InputError, match="unstable"):
        check_feedback(settings("position-force", ChannelSettings(1e-3, loss=0.3)))


def test_a_lost_motion_that_the_slave_cannot_cross_is_refused():
    trial = settings("model-mediated", lost_motion=2e-3)
    with pytest.raises(InputError, match="lost motion of 2000 um.*expected at most"):
        check_feedback(trial)


def test_a_stated_lost_motion_is_checked_with_its_possible_error():
    stated = settings("position-force", lost_motion=1e-3)
    with pytest.raises(InputError, match="lost motion of 1000 um.*would oscillate by"):
        check_feedback(stated)


@pytest.mark.parametrize("law", ["none", "position-force"])
def test_a_law_without_a_model_approaches_by_the_expected_stiffness_of_the_specimen(law):
    simulated = settings(law, ChannelSettings(0.05))
    at_aim = simulated.setup.cube.k1 + 3.0 * simulated.setup.cube.k3 * (4.6e-3) ** 2
    assert make_link(simulated).stiffness(0.0) == pytest.approx(at_aim, rel=0.02)
    stated = replace(simulated, feedback=FeedbackSettings(law, stiffness=900.0))
    assert make_link(stated).stiffness(0.0) == 900.0
    rig = load_rig_file(ROOT / "rigs" / "serial-board.toml")
    unknown = TrialSettings(
        rig=rig, depth=2e-3, feedback=FeedbackSettings(law), channel=ChannelSettings(0.05)
    )
    assert make_link(unknown).stiffness(0.0) == STIFF_PRIOR


def test_the_rehearsal_does_not_refuse_a_delay_that_is_stable_on_the_specimen():
    rig = with_slave(load_rig_file(ROOT / "rigs" / "serial-board.toml"), lag_ms=0.0)
    soft = FeedbackSettings("position-force", stiffness=100.0)
    delayed = TrialSettings(
        rig=rig, depth=2e-3, feedback=soft, channel=ChannelSettings(0.05), force_lag=1e-3
    )
    assert check_feedback(delayed) == ""
    assert rehearse(delayed, 0.1).fault == ""


def test_a_configuration_with_unstable_feedback_is_refused(tmp_path, refused):
    file = tmp_path / "trial.toml"
    file.write_text(write_configuration(settings("position-force", ChannelSettings(0.05))))
    assert "unstable" in refused("config", "check", file)


def test_a_removed_law_is_refused_but_its_recordings_are_evaluated(tmp_path, refused):
    of_before = settings("passivity", ChannelSettings(0.05), duration=0.5)
    with pytest.raises(InputError, match="feedback passivity: is not in this version"):
        run_trial(of_before)
    file = tmp_path / "trial.toml"
    file.write_text(write_configuration(of_before))
    assert f"expected one of {', '.join(get_args(FeedbackName))}" in refused(
        "run", "--config", file
    )
    present = replace(of_before, feedback=FeedbackSettings("position-force"))
    document = run_trial(present).recording.settings
    document["feedback"]["law"] = "passivity"
    assert from_document(document) == of_before


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--channel", "delay=50"), "delay of the channel must be 0 to 2 s, got 50 s"),
        (("--channel", "banana"), "expected a text such as delay=100ms"),
        (("--feedback", "magic"), "magic"),
    ],
)
def test_a_bad_option_is_refused_in_one_line(refused, arguments, named):
    assert named in refused(*RUN, *arguments)


def test_feedback_and_channel_are_part_of_a_configuration_file(tmp_path):
    first = settings("model-mediated", ChannelSettings(0.05, 0.02, 0.05))
    first = replace(first, feedback=replace(first.feedback, gain=0.5, glued=False))
    file = tmp_path / "trial.toml"
    file.write_text(write_configuration(first))
    assert read_configuration(file) == first


def test_an_unknown_law_in_a_file_is_refused_with_the_known_ones(tmp_path):
    file = tmp_path / "trial.toml"
    file.write_text('[feedback]\nlaw = "magic"\n')
    with pytest.raises(InputError, match=r"feedback\.law.*model-mediated"):
        read_configuration(file)


def test_the_summary_reports_what_the_hand_felt(capsys):
    options = ("--feedback", "model-mediated", "--channel", "delay=10ms", "--estimators", "rls")
    assert main([*RUN, *options, "--json"]) == 0
    feedback = json.loads(capsys.readouterr().out)["feedback"]
    assert set(feedback) == {
        "law",
        "channel",
        "rendered_k",
        "rendered_k_error",
        "rendered_b",
        "tissue_b",
        "felt_force_error",
        "contact_force_error",
        "bandwidth_hz",
        "evaluated_hz",
        "energy_min_j",
        "outcome",
        "stable",
        "oscillation_m",
        "oscillation_hz",
        "detectable_m",
        "tremor_m",
        "coupling_k",
        "force_source",
        "remarks",
    }
    assert (feedback["law"], feedback["channel"]) == ("model-mediated", "delay=10ms")
    assert main([*RUN, *options]) == 0
    assert "feedback: model-mediated, channel delay=10ms" in capsys.readouterr().out


def test_a_hand_that_felt_only_the_stiff_prior_is_reported(capsys):
    options = ("--cube=hard", "--condition=mimic", "--feedback=model-mediated")
    command = ("run", "--clock=virtual", "--no-record", "--duration=5", "--seed=41")
    assert main([*command, *options, "--estimators=rls", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["feedback"]
    assert (found["rendered_k"], found["stable"]) == (None, None)
    few, prior = found["remarks"]
    assert few.startswith("no felt stiffness: after 2.5 s, the contact force")
    assert prior.startswith("at 100% of the ticks the hand felt the stiff first model of 20000 N/m")
    assert "noise prevents an estimate" in prior
    assert main([*command, *options, "--estimators=rls"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert few in shown
    assert prior in shown


def test_a_channel_that_delays_the_estimates_is_named_as_the_cause_of_the_stiff_prior():
    settings = TrialSettings(
        clock="virtual",
        duration=5.0,
        feedback=FeedbackSettings("model-mediated"),
        channel=ChannelSettings(delay=2.0),
        estimators=("rls",),
    )
    (remark,) = run_trial(settings).feedback()["remarks"]
    assert remark.endswith("the estimates of the slave were up to 2 s old")


def test_a_hand_that_felt_the_specimen_has_no_remark():
    settings = TrialSettings(
        cube="soft", clock="virtual", feedback=FeedbackSettings("model-mediated"), seed=41
    )
    found = run_trial(settings).feedback()
    assert (found["remarks"], found["stable"]) == ((), True)


def test_without_feedback_the_summary_has_none(capsys):
    assert main([*RUN, "--estimators", "rls", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["feedback"] is None


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_a_gain_or_stiffness_that_is_not_positive_is_refused(value):
    with pytest.raises(ValueError, match="gain of the feedback"):
        FeedbackSettings("none", gain=value)
    with pytest.raises(ValueError, match="stiffness of the feedback"):
        FeedbackSettings("none", stiffness=value)
