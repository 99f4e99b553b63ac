"""Foxglove's protocol, with the client of another project: ticks to view, nothing to call."""

from __future__ import annotations

import asyncio
import json
import time
from pathlib import Path

import numpy as np
import pytest
from robo_ws_bridge import WebSocketBridgeClient
from robo_ws_bridge.client import FetchAssetError, ServiceCallError

from teleop.live.foxglove_process import FoxgloveBridge
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.columns import Layout
from teleop.streams.message import definition_of, messages_of
from teleop.trial.run import run_trial

from ..streams.filled import FilledStream
from .live_client import until

LAYOUT = Path(__file__).parents[3] / "docs/_static/foxglove-layout.json"


@pytest.fixture(scope="module")
def trial():
    """The layout of a trial, and the rows of its ticks."""
    settings = TrialSettings(clock="virtual", duration=0.5)
    layout = Layout(settings.estimation_preset.bank())
    recording = run_trial(settings).recording
    rows = np.column_stack([recording[column.name] for column in layout.schema.columns])
    return layout, rows


class Viewer:
    """A client that is subscribed to every topic."""

    def __init__(self, url):
        self.client = WebSocketBridgeClient(url, subprotocol="foxglove.sdk.v1")
        self.received = {}
        self.client.on_message(self._receive)

    async def _receive(self, channel, timestamp, payload):
        self.received.setdefault(channel["topic"], []).append((timestamp, bytes(payload)))

    async def __aenter__(self):
        await self.client.connect()
        for topic in ("/tick", "/tick_60hz"):
            await self.client.subscribe(topic)
        return self

    async def __aexit__(self, *_):
        await self.client.disconnect()


def test_a_viewer_receives_every_tick_and_the_newest_ones_at_a_lower_rate(trial):
    layout, rows = trial
    stream, messages = FilledStream(layout, 1000), messages_of(rows)
    definition = definition_of(layout.schema.columns)
    bridge = FoxgloveBridge(0)

    async def scenario():
        bridge.begin(stream.reader())
        async with Viewer(bridge.url) as viewer:
            await until(lambda: len(viewer.client.channels) == 2)
            assert viewer.client.server_info["capabilities"] == []
            assert viewer.client.services == {}
            assert {c["schema"] for c in viewer.client.channels.values()} == {definition}
            await asyncio.sleep(0.5)  # the subscriptions have no answer
            for row in rows:
                stream.fill(row)
                if stream.newest % 20 == 0:
                    bridge.advance()
            bridge.advance()
            await until(lambda: len(viewer.received.get("/tick", ())) == len(messages))
            return viewer.received

    try:
        received = asyncio.run(scenario())
    finally:
        bridge.close()
    assert [payload for _, payload in received["/tick"]] == messages
    times = [timestamp for timestamp, _ in received["/tick"]]
    assert times == sorted(times)
    assert abs(times[-1] * 1e-9 - time.time()) < 60.0
    assert len(received["/tick_60hz"]) == -(-len(messages) // 20)
    assert received["/tick_60hz"][-1][1] == messages[-1]


def test_nothing_can_be_called_changed_or_fetched():
    bridge = FoxgloveBridge(0)

    async def scenario():
        async with Viewer(bridge.url) as viewer:
            client = viewer.client
            await until(lambda: client.server_info is not None)
            attempts = (
                client.call_service(1, b"{}", encoding="json", timeout=1.0),
                client.set_parameters([{"name": "limit", "value": 1.0}], timeout=1.0),
                client.fetch_asset("file:///etc/passwd", timeout=1.0),
            )
            return await asyncio.gather(*attempts, return_exceptions=True)

    try:
        answers = asyncio.run(scenario())
    finally:
        bridge.close()
    assert len(answers) == 3
    for answer in answers:
        assert isinstance(answer, TimeoutError | ServiceCallError | FetchAssetError)


def test_the_columns_of_the_layout_exist(trial):
    layout, _ = trial
    names = {column.name for column in layout.schema.columns}
    document = json.loads(LAYOUT.read_text(encoding="utf-8"))
    paths = [path["value"] for panel in document["configById"].values() for path in panel["paths"]]
    assert len(paths) > 5
    for path in paths:
        topic, _, name = path.partition(".")
        assert topic == "/tick_60hz"
        assert name in names
