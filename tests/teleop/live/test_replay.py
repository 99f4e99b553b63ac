"""The replay of a recording: the rows of the page are those of the recording."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from teleop.live.replay import Replay
from teleop.live.requests import BadRequest
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.live_documents import column_documents, recorded_document
from teleop.trial.run import run_trial

from .live_client import page, served


@pytest.fixture(scope="module")
def recording():
    settings = TrialSettings(condition="mimic", clock="virtual", duration=3.0)
    return run_trial(settings).recording


class Time:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def make_replay(recording, now):
    return Replay(
        recording.columns,
        column_documents(recording.units),
        recording.estimators,
        recording.events,
        recorded_document(recording),
        now,
    )


def rows_of(replay):
    history = replay.history
    return history._rows[np.arange(history.start, history.end) % len(history._rows)]


def names(replay):
    return [column["name"] for column in replay.documents()[0]["columns"]]


def test_the_rows_are_exactly_those_of_the_recording(recording):
    replay = make_replay(recording, Time())
    rows = rows_of(replay)
    assert 0.2 * len(recording) <= len(rows) <= 0.25 * len(recording)
    at = np.searchsorted(recording["time"], rows[:, 0])
    for name, shown in zip(names(replay), rows.T, strict=True):
        assert np.array_equal(shown, recording[name][at], equal_nan=True), name
    assert rows[-1, 0] == recording["time"][-1]


def test_a_long_recording_has_fewer_rows_from_its_start_to_its_end(recording, monkeypatch):
    monkeypatch.setattr("teleop.live.replay.MOST_REPLAYED", 100)
    t = rows_of(make_replay(recording, Time()))[:, 0]
    assert 50 < len(t) <= 100
    assert t[0] < recording["time"][0] + 0.1
    assert t[-1] == recording["time"][-1]
    assert np.ptp(np.diff(t)) < 2e-3


def test_play_continues_from_the_time_that_was_chosen(recording):
    now = Time()
    replay = make_replay(recording, now)
    replay.request({"type": "seek", "t": 1.0})
    replay.request({"type": "play", "rate": 0.5})
    now.now += 1.0
    assert replay.advance()[-1]["t"] == pytest.approx(1.5)
    replay.request({"type": "play", "rate": 0})
    now.now += 10.0
    replay.advance()
    assert replay.documents()[-1]["t"] == pytest.approx(1.5)
    replay.request({"type": "seek", "t": 1e9})
    assert replay.documents()[-1]["t"] == recording["time"][-1]
    replay.request({"type": "play", "rate": 1.0})
    assert replay.documents()[-1]["t"] == rows_of(replay)[0, 0]
    while replay.documents()[-1]["playing"]:
        now.now += 0.1
        replay.advance()
    assert replay.documents()[-1]["t"] == recording["time"][-1]


def test_the_marks_of_k_and_b_are_those_of_the_shown_time(recording):
    replay = make_replay(recording, Time())
    marks = []
    for t in (-1e9, 2.0, -1e9):
        replay.request({"type": "seek", "t": t})
        replay.advance()
        marks.append(replay.state()["trust"]["k"])
    assert marks[0] == marks[2]
    assert marks[0]["mark"] == "not yet"
    assert marks[1]["mark"] == "cannot"
    assert "misfit" in marks[1]["reason"]


def test_armings_stops_and_faults_are_marked(recording):
    modes = ["idle", "ready", "active", "stopping", "idle"]
    events = [
        {"time": float(i), "mode": mode, "text": mode, "fault": None}
        for i, mode in enumerate(modes)
    ]
    events.append({"time": 9.0, "mode": "idle", "text": "too much force", "fault": "force limit"})
    _, _, marks, _ = make_replay(replace(recording, events=events), Time()).documents()
    assert marks["events"] == [
        {"time": 2.0, "text": "active", "fault": False},
        {"time": 3.0, "text": "stopping", "fault": False},
        {"time": 9.0, "text": "too much force", "fault": True},
    ]


@pytest.mark.parametrize(
    "request_",
    [{"type": "play", "rate": -1}, {"type": "play", "rate": 1e9}, {"type": "start"}],
)
def test_a_recording_cannot_be_driven(recording, request_):
    with pytest.raises(BadRequest):
        make_replay(recording, Time()).request(request_)


def test_the_welcome_describes_the_columns_and_the_trial(recording):
    replay = make_replay(recording, Time())
    welcome, trial, _, position = replay.documents()
    known = [column["name"] for column in welcome["columns"]]
    (rls,) = [one for one in welcome["estimators"] if one["name"] == "rls"]
    assert known[rls["k"]] == "rls_k"
    assert known[rls["b_std"]] == "rls_b_std"
    assert all(column["unit"] and column["meaning"] for column in welcome["columns"])
    assert trial["target"]["depth"] == trial["depth"]
    assert trial["truth"]["k"] > 0.0
    assert position["start"] == rows_of(replay)[0, 0]


def test_the_time_of_arming_is_that_of_the_recording(recording):
    events = [{"time": 4.25, "mode": "active", "text": "armed", "fault": None}]
    replay = make_replay(replace(recording, events=events), Time())
    assert replay.state()["armed_at"] == 4.25


def test_the_fault_of_a_recording_is_shown_from_its_time_on(recording):
    event = {"time": 1.0, "text": "force limit: too much", "fault": "force limit", "mode": "fault"}
    replay = make_replay(replace(recording, events=[event]), Time())
    replay.request({"type": "seek", "t": 0.5})
    assert replay.state()["text"] == ""
    replay.request({"type": "seek", "t": 1.5})
    assert replay.state()["text"] == "force limit: too much"


def test_a_page_receives_the_rows_and_seeks(recording):
    async def scenario():
        replay = make_replay(recording, Time())
        async with served(replay) as (_, address), page(address) as client:
            await client.until(lambda: "state" in client.latest)
            assert client.latest["state"]["mode"] == "replay"
            await client.send("seek", t=2.0)
            await client.until(lambda: client.latest["replay"]["t"] == 2.0)
            await client.until(lambda: len(client.rows) == replay.history.end)
            np.testing.assert_array_equal(client.rows, rows_of(replay))
            await client.send("stop")
            await client.until(lambda: client.errors)

    asyncio.run(scenario())
