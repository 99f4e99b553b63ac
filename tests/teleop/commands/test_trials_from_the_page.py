"""The session of a live page goes on if a trial cannot begin."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from drivers import RigError
from teleop.commands.live_options import FIRM_ARM
from teleop.commands.live_trials import run_from_page
from teleop.errors import InputError
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.rehearsal import TooSlowError

BUSY = TooSlowError("rate 1000 Hz: a tick takes 924 us")


class Session:
    """A link to a page that presses NEXT, and a runner of trials with given outcomes.

    An outcome is an exit code, an exception of a trial that has run, or, in a tuple, an exception
    before the trial.
    """

    interrupted = False

    def __init__(self, *outcomes):
        self.outcomes = [*outcomes]
        self.trials = self.refused = 0
        self.trial = None
        self.texts = []
        self.requests = []

    def run(self, settings):
        self.settings = settings
        outcome = self.outcomes.pop(0)
        if isinstance(outcome, tuple):
            raise outcome[0]
        self.trials += 1
        self.trial = SimpleNamespace(armed=True)
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    def refuse(self):
        self.refused += 1

    def ask(self, text, answers, advice):
        self.texts.append(text)

    @property
    def is_running(self):
        return bool(self.outcomes)

    def wait_for_request(self, timeout):
        return self.requests.pop(0) if self.requests else {"type": "next"}


def run(session, once=False, settings=None):
    return run_from_page(session, settings or TrialSettings(), session, once)


@pytest.mark.parametrize("error", [BUSY, RigError("a device does not answer")])
def test_a_start_that_is_refused_is_a_message_and_the_next_one_succeeds(error, capsys):
    session = Session(0, (error,), 0)
    assert run(session) == 0
    assert session.trials == 2
    assert session.refused == 1
    assert session.texts[1:] == [str(error), ""]
    assert str(error) in capsys.readouterr().err


def test_a_busy_machine_does_not_end_the_session_before_the_first_trial():
    session = Session((BUSY,), 0)
    assert run(session, once=True) == 0
    assert session.texts == [str(BUSY)]


def test_a_recording_that_is_not_complete_does_not_end_the_session():
    session = Session(InputError("a.mcap: no space left"), 0)
    assert run(session) == 0
    assert session.refused == 0
    assert "no space left" in session.texts[0]


def test_the_session_ends_if_no_trial_can_begin_with_the_settings():
    with pytest.raises(InputError, match="no such file"):
        run(Session((InputError("no such file"),), 0))


def test_an_incomplete_recording_ends_a_command_of_one_trial():
    with pytest.raises(InputError, match="no space left"):
        run(Session(InputError("no space left")), once=True)


def test_settings_that_do_not_fit_together_are_a_message_and_the_ones_before_remain():
    session = Session(0, 0)
    law = {"type": "choose", "feedback": "model-mediated"}
    session.requests = [law, law | {"condition": "autonomous"}]
    assert run(session) == 0
    assert "nobody holds the handle" in session.texts[1]
    assert session.refused == 1
    assert session.settings.condition == "free"
    assert session.settings.feedback.law == "model-mediated"


def test_the_hand_of_the_pointer_is_as_firm_as_the_chosen_feedback_law_needs():
    usual = TrialSettings(operator="pointer")
    stiffness = []
    for laws in (["model-mediated"], ["model-mediated", "none"]):
        session = Session(0, 0)
        session.requests = [{"type": "choose", "feedback": law} for law in laws]
        run(session, settings=usual)
        stiffness.append(session.settings.operator_model.arm_stiffness)
    assert stiffness == [FIRM_ARM, usual.operator_model.arm_stiffness]
