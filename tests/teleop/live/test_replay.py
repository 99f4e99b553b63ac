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
    now = Time()
    replay = make_replay(recording, now)
    while replay.documents()[-1]["playing"]:
        replay.advance()
        now.now += 1 / 60
    rows = rows_of(replay)
    assert 0.2 * len(recording) <= len(rows) <= 0.25 * len(recording)
    at = np.searchsorted(recording["time"], rows[:, 0])
    for name, shown in zip(names(replay), rows.T, strict=True):
        assert np.array_equal(shown, recording[name][at], equal_nan=True), name
    assert rows[-1, 0] == recording["time"][-1]


def test_seek_shows_the_time_before_and_play_continues_from_there(recording):
    now = Time()
    replay = make_replay(recording, now)
    replay.request({"type": "seek", "t": 1.0})
    assert rows_of(replay)[-1, 0] == pytest.approx(1.0, abs=1.1e-3)
    assert rows_of(replay)[0, 0] < 0.0
    replay.request({"type": "play", "rate": 0.5})
    now.now += 1.0
    news = replay.advance()
    assert news[-1]["t"] == pytest.approx(1.5)
    assert rows_of(replay)[-1, 0] == pytest.approx(1.5, abs=5e-3)
    replay.request({"type": "play", "rate": 0})
    now.now += 10.0
    replay.advance()
    assert replay.documents()[-1]["t"] == pytest.approx(1.5)
    replay.request({"type": "seek", "t": 1e9})
    assert rows_of(replay)[-1, 0] == recording["time"][-1]


@pytest.mark.parametrize(
    "request_",
    [{"type": "play", "rate": -1}, {"type": "play", "rate": 1e9}, {"type": "start"}],
)
def test_a_recording_cannot_be_driven(recording, request_):
    with pytest.raises(BadRequest):
        make_replay(recording, Time()).request(request_)


def test_the_welcome_describes_the_columns_and_the_trial(recording):
    welcome, trial, position = make_replay(recording, Time()).documents()
    known = [column["name"] for column in welcome["columns"]]
    (rls,) = [one for one in welcome["estimators"] if one["name"] == "rls"]
    assert known[rls["k"]] == "rls_k"
    assert known[rls["b_std"]] == "rls_b_std"
    assert all(column["unit"] and column["meaning"] for column in welcome["columns"])
    assert trial["target"]["depth"] == trial["depth"]
    assert trial["truth"]["k"] > 0.0
    assert position["start"] == recording["time"][0]


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
            await client.until(
                lambda: (
                    client.rows is not None
                    and len(client.rows)
                    and abs(client.rows[-1, 0] - 2.0) < 2e-3
                )
            )
            assert client.column("time")[0] < 0.0
            await client.send("stop")
            await client.until(lambda: client.errors)

    asyncio.run(scenario())
