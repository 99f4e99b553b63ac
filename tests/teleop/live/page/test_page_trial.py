"""A trial that is palpated with the mouse in the page of `teleop run --live`."""

from __future__ import annotations

import json
import math
import re
import subprocess
import time

import numpy as np
import pytest

from teleop.output.result_tables import result_values

from .conftest import WATCH, wait_for

pytestmark = pytest.mark.real_time

LATEST = "[teleop.last('rls_k'), teleop.last('contact_force'), teleop.last('slave_position')]"


@pytest.fixture
def trial(tmp_path, start_command):
    """Start a trial for the pointer; return its process and the URL of its page."""
    options = ["--duration", "3", "--rate", "250", "--record", str(tmp_path / "trial.mcap")]
    process = start_command(
        *("run", "--live", "--operator", "pointer", *options, "--json"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    lines = []
    try:
        for line in process.stderr:
            lines.append(line)
            if "http" in line:
                break
        assert "http" in lines[-1], lines
        yield process, lines[-1].split()[-1]
    finally:
        process.terminate()
        process.communicate()


def test_palpation_with_the_mouse_estimates_the_stiffness(trial, open_page):
    process, url = trial
    page = open_page(url)
    wait_for(page, "teleop.state().mode === 'ready'")
    page.get_by_role("button", name="Unlock").click()
    page.get_by_role("button", name="Start").click()
    wait_for(page, "teleop.state().mode === 'active'")
    page.evaluate(WATCH)
    box = page.locator("#tool").bounding_box()
    x = box["x"] + box["width"] / 2
    page.mouse.move(x, box["y"] + 0.4 * box["height"])
    page.mouse.down()
    found, begun = [], time.monotonic()
    while (t := time.monotonic() - begun) < 2.2:
        page.mouse.move(x, box["y"] + (0.66 - 0.14 * math.cos(6.0 * t)) * box["height"])
        page.wait_for_timeout(20)
        if t > 0.8:
            found.append(page.evaluate(LATEST))
    page.mouse.up()
    k, force, depth = np.array(found, float).T
    labels = page.locator(".strip-stiffness").inner_text()
    true = float(re.search(r"true at full depth (\d+)", labels)[1])
    assert depth.max() - depth.min() > 2e-3
    assert np.median(k) == pytest.approx(true, rel=0.1)
    assert np.median(k) == pytest.approx(np.median(force / depth), rel=0.1)
    wait_for(page, "document.querySelector('.result-value') !== null", timeout=30.0)
    shown = page.locator("#summary").inner_text()
    assert page.evaluate("[shifts, black]") == [[], []]
    process.terminate()
    out, _ = process.communicate()
    result = json.loads(out)
    values = result_values(result["result"])
    assert [one.symbol for one in values] == ["k", "k at the tip", "b"]
    for one in values:
        assert f"{one.value} {one.unit}" in shown
        assert f"{one.low} to {one.high}" in shown
    assert result["recording"]["complete"]


EXTREMES = (1e308, -1e308, math.inf, -math.inf, math.nan, 1e17, 5e-324)


@pytest.mark.parametrize("view", ["", "operator"])
def test_a_page_that_receives_extreme_numbers_does_not_hang(trial_feed, serve, open_page, view):
    limits = {"soft_position": [-1e300, 1e300], "soft_force": 1e300, "hard_force": None}
    target = {"frequency": 1e300, "depth": 1e300, "low": -1e300, "count_in": 1e300}
    feed = trial_feed(limits=limits, target=target, truth={"k": 1e308, "b": -1e308}, duration=1e308)
    page = open_page(serve(feed).url(view))
    for value in EXTREMES:
        extreme = dict.fromkeys(feed.names, value) | {"mode": 3.0}
        usual_time = {name: number for name, number in extreme.items() if name != "time"}
        for feed.values in (usual_time, extreme):
            page.locator("#mode").inner_text(timeout=10_000)  # fails if the page hangs
            rows = page.evaluate("teleop.rows()")
            wait_for(page, "(rows) => Math.abs(teleop.rows() - rows) > 20", rows)


def test_a_station_shows_what_the_other_one_does(trial_feed, serve, open_page):
    values = {
        "other_mode": 5.0,
        "round_trip": 0.0415,
        "offset_low": 3.0,
        "offset_high": 3.0005,
        "lost_datagrams": 12.0,
    }
    page = open_page(serve(trial_feed(values=values, station="slave")).url())
    text = "other station: fault, round trip 41.5 ms, clock ± 0.25 ms, datagrams: 12 lost"
    wait_for(page, "(text) => document.body.innerText.includes(text)", text)
    assert page.locator(".strip-force").count() == 1
    assert page.locator(".strip-felt-force").count() == 0
    alone = open_page(serve(trial_feed()).url())
    wait_for(alone, "teleop.rows() > 5")
    assert alone.locator("#station").is_hidden()


def test_the_master_station_shows_what_the_hand_feels_and_no_specimen(trial_feed, serve, open_page):
    values = {"displayed_force": 4.5, "model_stiffness": 2062.0}
    feed = trial_feed(values=values, station="master")
    page = open_page(serve(feed).url())
    for place, text in ((".strip-felt-force", "4.5"), (".strip-felt-stiffness", "2062")):
        wait_for(page, f"document.querySelector('{place}')?.innerText.includes('{text}')")
    for place in (".strip-force", ".strip-stiffness"):
        assert page.locator(place).count() == 0
    for place in (".trust-panel", ".table-panel", ".tool-panel", ".xy-panel"):
        assert page.locator(place).is_hidden()
    operator = open_page(serve(feed).url("operator"))
    wait_for(operator, "document.getElementById('force-text').innerText === '4.5 N'")
