"""A person with the pointer of the live page who feels the specimen."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_backend import PointerOperator
from sim_backend.operator_model import OperatorModel
from teleop.commands.live_options import FIRM_ARM, for_pointer
from teleop.control.channel import ChannelSettings
from teleop.control.feedback.law import STIFF_PRIOR
from teleop.control.feedback.settings import FeedbackSettings
from teleop.recording.recording import from_columns
from teleop.settings.ranges import COUNT_IN
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.stream import Stream
from teleop.trial.assembly import make_clock, make_controller, make_layout, make_simulated_rig
from teleop.trial.live_documents import trial_document
from teleop.trial.loop import Loop
from teleop.trial.metadata import session_metadata
from teleop.trial.readers import Readers
from teleop.trial.stop_switch import StopSwitch

MEDIATED = FeedbackSettings("model-mediated")
CHANNEL = ChannelSettings(delay=0.05, jitter=0.02, loss=0.05)


def palpated(settings, depth):
    """Record a trial in which the pointer moves down to a depth and up again."""
    clock, bank = make_clock(settings), settings.estimation_preset.bank()

    def pointer():
        angle = 2.0 * math.pi * 0.7 * clock.now()
        return 0.5 * depth * (1.0 - math.cos(angle)), True

    operator = PointerOperator(pointer)
    ticks = round(2.0 * settings.duration * settings.loop_rate)
    stream = Stream(make_layout(settings, bank, operator), ticks)
    with make_simulated_rig(settings, clock.now, pointer=operator) as rig:
        controller = make_controller(settings, rig, clock)
        Loop(controller, clock, stream, Readers(), StopSwitch(), settings.duration).run()
    columns = stream.reader().columns(1, stream.newest + 1)
    return from_columns(stream.schema, columns, stream.events, session_metadata(settings))


@pytest.mark.parametrize("cube", ["soft", "medium", "hard"])
@pytest.mark.parametrize("channel", [None, CHANNEL])
def test_a_pointer_that_presses_4_mm_deep_feels_the_specimen_within_a_second(cube, channel):
    settings = for_pointer(
        TrialSettings(
            operator="pointer",
            cube=cube,
            feedback=MEDIATED,
            channel=channel,
            clock="virtual",
            duration=1.2,
            estimators=("rls",),
        )
    )
    recording = palpated(settings, 4e-3)
    assert not any(event["fault"] for event in recording.events)
    assert np.nanmin(recording["model_stiffness"]) < 0.95 * STIFF_PRIOR
    assert recording["slave_position"].max() > 0.4e-3
    assert recording["contact_force"].max() > 1.0


def test_the_hand_of_the_pointer_is_firm_only_if_the_law_begins_with_a_stiff_spring():
    usual = OperatorModel()
    for law, arm in (("none", usual), ("position-force", usual), ("model-mediated", None)):
        settings = for_pointer(TrialSettings(operator="pointer", feedback=FeedbackSettings(law)))
        assert settings.operator_model == (arm or OperatorModel(FIRM_ARM))
    chosen = TrialSettings(
        operator="pointer", feedback=MEDIATED, operator_model=OperatorModel(800.0), count_in=1.0
    )
    assert for_pointer(chosen) == chosen
    simulated = TrialSettings(feedback=MEDIATED)
    assert for_pointer(simulated) == simulated


def test_a_person_with_the_pointer_has_a_count_in():
    settings = for_pointer(TrialSettings(operator="pointer", condition="mimic"))
    assert settings.target.count_in == COUNT_IN


def test_the_page_receives_the_law_and_the_channel():
    assert trial_document(TrialSettings())["feedback"] is None
    settings = TrialSettings(feedback=MEDIATED, channel=CHANNEL)
    expected = {
        "law": "model-mediated",
        "prior": STIFF_PRIOR,
        "delay": 0.05,
        "jitter": 0.02,
        "loss": 0.05,
    }
    assert trial_document(settings)["feedback"] == expected
    assert trial_document(TrialSettings(channel=CHANNEL))["feedback"]["prior"] is None


def test_the_page_knows_whether_the_specimen_is_glued_to_the_tool():
    settings = TrialSettings()
    assert trial_document(settings)["glued"] is True
    loose = replace(settings.setup, cube=replace(settings.setup.cube, glued=False))
    assert trial_document(replace(settings, custom_setup=loose))["glued"] is False
