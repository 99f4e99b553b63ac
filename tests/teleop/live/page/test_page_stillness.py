"""The layout of the page does not change during a trial, and no canvas is black."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.registry import BUILT_IN

from .conftest import WATCH, wait_for
from .result import summary

pytestmark = pytest.mark.real_time

SIZES = [(1024, 768), (1366, 768), (1920, 1080), (390, 844)]
TARGET = {"frequency": 1.0, "depth": 0.016, "low": 0.0016, "count_in": 3.0}
FEEDBACK = {"law": "model-mediated", "prior": 2e4, "delay": 0.05, "jitter": 0.02, "loss": 0.05}
CASES = [
    ("free", "", SIZES[::3]),
    ("mimic", "", SIZES),
    ("autonomous", "", SIZES[::3]),
    ("mimic", "operator", SIZES[::3]),
]
"""Condition of the trial, view of the page, and sizes of the window."""


def varied(feed):
    """Let all numbers and texts of a feed change from row to row, by many orders of magnitude."""
    rng, row = np.random.default_rng(0), feed.row
    ends = ("_k", "_b", "_std", "_stiffness", "_age")
    numbers = [i for i, name in enumerate(feed.names) if name.endswith(ends)]
    shares = [i for i, name in enumerate(feed.names) if name.endswith("_misfit")]
    held = [i for i, name in enumerate(feed.names) if name.endswith("_held")]
    forces = [feed.names.index(name) for name in ("contact_force", "slave_velocity", "k_bound")]
    of_the_period = {}

    def vary(t):
        values = row(t)
        period = int(5.0 * t)  # the numbers are legible: they change five times per second
        if period not in of_the_period:
            of_the_period[period] = rng.normal(0.0, 1.0, len(values)) * 10 ** rng.uniform(-2, 7)
            feed.lateness = 10 ** rng.uniform(-6, -2)
            feed.text = period % 3 * "a text of the supervisor, "
            mark = ("can be used", "not yet", "cannot")[period % 3]
            parts = {part: {"mark": mark, "reason": period % 5 * "a reason, "} for part in "kb"}
            supported = [dict.fromkeys("kb", period % 2 == 0)] * len(feed.estimators)
            feed.trust = {**parts, "supported": supported}
        for i in numbers:
            values[i] = of_the_period[period][i]
        for i in shares:
            values[i] = abs(values[i - 1] * 1e-3)
        for i in held:
            values[i] = float(period % 2)
        for i in forces:
            values[i] = 1e-2 * of_the_period[period][i] * math.sin(t)
        return values

    feed.row = vary


def run_trial(page, feed):
    """Go through the modes of a trial, in which the mouse rests with its button pressed."""
    feed.mode, feed.requests = "ready", []
    page.evaluate("document.getElementById('summary')?.close()")  # it covers the tool
    wait_for(page, "teleop.state().mode === 'ready'")
    page.wait_for_timeout(100)
    page.evaluate("shifts.length = 0")
    feed.mode = "active"
    wait_for(page, "teleop.state().mode === 'active'")
    box = page.locator("#tool, #pursuit").bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.6 * box["height"])
    page.mouse.down()
    page.wait_for_timeout(400)
    page.mouse.up()
    feed.news.extend([{"type": "evaluating"}, summary()])
    for feed.mode in ("stopping", "ended"):
        wait_for(page, f"teleop.state().mode === '{feed.mode}'")
    page.wait_for_timeout(50)


@pytest.mark.parametrize(("condition", "view", "sizes"), CASES)
def test_nothing_moves_and_nothing_is_black_from_arming_to_the_end(
    condition, view, sizes, trial_feed, serve, open_page
):
    target = TARGET if condition == "mimic" else None
    feedback = FEEDBACK if condition == "mimic" else None
    options = {"target": target, "condition": condition, "feedback": feedback}
    feed = trial_feed("ready", tuple(BUILT_IN), **options)
    feed.welcome["pointer"] = condition != "autonomous"
    varied(feed)
    page = open_page(serve(feed).url(view), size=sizes[0])
    wait_for(page, "teleop.rows() > 50")
    page.evaluate(WATCH)
    for width, height in sizes:
        page.set_viewport_size({"width": width, "height": height})
        wait_for(page, f"innerWidth === {width}")
        run_trial(page, feed)
        assert page.evaluate("shifts") == [], (width, height)
        assert page.evaluate("black") == [], (width, height)
        depths = [one["depth"] for one in feed.requests if one["type"] == "pointer"]
        assert len(depths) > 3 or condition == "autonomous" or view
        assert np.ptp(depths or [0.0]) <= 1e-4
    assert page.evaluate("frames") > 20 * len(sizes)
