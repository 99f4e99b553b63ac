"""The texts that the live page shows about a trial."""

from __future__ import annotations

import mmap

import pytest

from teleop.live.cells import SIZE, CellWriter
from teleop.live.requests import BadRequest
from teleop.live.trial_feed import TrialFeed
from teleop.safety import Event, Fault
from teleop.safety.events import ACTIVE, FAULT, READY
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.columns import Layout
from teleop.streams.stream import Stream
from teleop.trial.live_documents import trial_document

CHOICES = {"feedback": ["none", "position-force"], "estimators": ["rls", "ai", "me"]}
SESSION = {"may_arm": True, "pointer": True, "choices": CHOICES}


@pytest.fixture
def trial():
    """A feed in which a trial has begun, and a function that reports an event of the supervisor."""
    feed = TrialFeed(
        CellWriter(mmap.mmap(-1, SIZE)),
        SESSION,
        lambda request: None,
        lambda recording: {"report": str(recording)},
    )
    stream = Stream(Layout({}), 10, shared=True)
    feed.receive(
        {
            "type": "begin",
            "stream": stream.document,
            "rate": 1000.0,
            "trial": trial_document(TrialSettings(operator="pointer")),
            "by_page": True,
        }
    )
    stream.unlink()

    def report(mode, text, fault=None, source=""):
        stream.event(Event(1.0, mode, text, fault, source))
        feed._mode = mode
        feed.advance()
        return feed.state()

    return feed, report


def test_the_page_asks_to_press_and_hold_only_while_nobody_holds(trial):
    feed, report = trial
    state = report(READY, "ready")
    assert state["text"].startswith("you press the tool on the simulated soft cube, while rls,")
    assert state["advice"].startswith("UNLOCK")
    state = report(ACTIVE, "active")
    assert state["text"] == "palpate freely"
    assert state["advice"].startswith("press and hold")
    feed.request({"type": "pointer", "depth": 0.0, "grip": True})
    assert feed.state()["advice"] == ""
    feed.lost()
    assert feed.state()["advice"].startswith("press and hold")


@pytest.mark.parametrize(
    ("source", "text"),
    [
        ("live page", "stopped with STOP in the page"),
        ("key", "stopped at the terminal"),
        ("input", "emergency stop: input"),
    ],
)
def test_an_emergency_stop_by_a_person_is_named_so(trial, source, text):
    _, report = trial
    state = report(FAULT, f"emergency stop: {source}", Fault.EMERGENCY_STOP, source)
    assert (state["text"], state["by_person"]) == (text, True)


def test_a_fault_before_the_stop_of_a_person_is_a_fault(trial):
    _, report = trial
    report(FAULT, "force limit: 70 N", Fault.FORCE_LIMIT, "contact_force")
    state = report(FAULT, "emergency stop: key", Fault.EMERGENCY_STOP, "key")
    assert (state["text"], state["by_person"]) == ("force limit: 70 N", False)


def test_the_latest_note_is_a_text_and_neither_an_arming_nor_a_mark_in_the_plots(trial):
    feed, report = trial
    report(ACTIVE, "armed")
    armed_at = feed.state()["armed_at"]
    report(ACTIVE, "b ± 20 %: about 3 s more", source="precision")
    state = report(ACTIVE, "b ± 12 %: about 1 s more", source="precision")
    assert state["text"] == "palpate freely; b ± 12 %: about 1 s more"
    assert state["armed_at"] == armed_at
    marks = next(document for document in feed.documents() if document["type"] == "events")
    assert [mark["text"] for mark in marks["events"]] == ["armed"]


def test_a_question_has_its_advice_apart(trial):
    feed, _ = trial
    feed.receive({"type": "end", "text": ""})
    prompt = {"number": 1, "answers": ["next"], "text": "trial 1 of 3", "advice": "NEXT runs it"}
    feed.receive({"type": "prompt", **prompt})
    state = feed.state()
    assert (state["text"], state["advice"]) == ("trial 1 of 3", "NEXT runs it")


def test_a_new_page_gets_the_result_or_that_the_trial_is_evaluated(trial):
    feed, _ = trial
    kinds = lambda: {document["type"] for document in feed.documents()}  # noqa: E731
    feed.receive({"type": "evaluating"})
    assert "evaluating" in kinds()
    recording = {"path": "a.mcap", "problem": None}
    shown = {"values": []}
    feed.receive({"type": "summary", "recording": recording, "picture": {}, "shown": shown})
    assert "summary" in kinds()
    assert "evaluating" not in kinds()


def test_the_trials_of_the_session_are_listed_with_their_results(trial):
    feed, report = trial
    k = {"symbol": "k", "value": "2034", "unit": "N/m", "low": "2030", "high": "2038"}
    report(FAULT, "force limit: 70 N", Fault.FORCE_LIMIT, "contact_force")
    for values in ([k], []):
        recording = {"path": None, "problem": None}
        shown = {"values": values}
        feed.receive({"type": "summary", "recording": recording, "picture": None, "shown": shown})
    (found,) = (one for one in feed.documents() if one["type"] == "trials")
    about = {"condition": "free", "specimen": "soft cube", "feedback": "none"}
    about["stopped"] = "ended by a fault"
    first, second = {"number": 1, **about, "values": [k]}, {"number": 2, **about, "values": []}
    assert found["trials"] == [first, second]


def test_a_trial_that_a_person_stopped_is_listed_as_stopped_and_its_mark_is_no_fault(trial):
    feed, report = trial
    report(FAULT, "emergency stop: key", Fault.EMERGENCY_STOP, "key")
    recording = {"path": None, "problem": None}
    shown = {"values": []}
    feed.receive({"type": "summary", "recording": recording, "picture": None, "shown": shown})
    latest = {document["type"]: document for document in feed.documents()}
    assert latest["trials"]["trials"][0]["stopped"] == "stopped"
    (mark,) = latest["events"]["events"]
    assert (mark["text"], mark["fault"]) == ("stopped at the terminal", False)


def test_a_chosen_setting_is_one_of_the_choices_and_estimators_are_some_of_them(trial):
    feed, _ = trial
    for wrong in (
        {"feedback": "strong"},
        {"estimators": []},
        {"estimators": ["rls", "rls"]},
        {"estimators": [["rls"]]},
        {"estimators": ["rls", "unknown"]},
    ):
        with pytest.raises(BadRequest, match="expected one of"):
            feed.request({"type": "choose", **wrong})
    feed.request({"type": "choose", "feedback": "none", "estimators": ["rls", "me"]})


@pytest.mark.parametrize(
    ("recording", "picture", "files"),
    [
        ({"path": "a.mcap", "problem": None}, {"depth": []}, {"report": "a.mcap"}),
        ({"path": "a.mcap", "problem": None}, None, {}),
        ({"path": "a.mcap", "problem": "the disk is full"}, {"depth": []}, {}),
        ({"path": None, "problem": None}, {"depth": []}, {}),
    ],
)
def test_files_are_offered_for_a_complete_recording_and_a_report_for_an_evaluation(
    trial, recording, picture, files
):
    feed, _ = trial
    shown = {"values": []}
    feed.receive({"type": "summary", "recording": recording, "picture": picture, "shown": shown})
    (found,) = (one for one in feed.documents() if one["type"] == "summary")
    assert found["files"] == files
