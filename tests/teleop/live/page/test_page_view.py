"""Time window, cursor and marks of the strips, and estimators that are highlighted or hidden."""

from __future__ import annotations

import math
import re

import pytest

from .conftest import WATCH, wait_for


def number(text):
    return float(re.search("[\u2212\\d.]+", text)[0].replace("\u2212", "-"))


def depth(t):
    """The position that the feed sends for a time [mm]."""
    return 8.0 - 6.0 * math.cos(2.0 * math.pi * t)


def view(page):
    return page.evaluate("teleop.view()")


@pytest.fixture
def feed(trial_feed):
    """A trial that has run for 8 s."""
    feed = trial_feed(mode="active")
    feed._start -= 8.0
    return feed


@pytest.fixture
def page(feed, serve, open_page):
    page = open_page(serve(feed).url(), size=(1280, 720))
    wait_for(page, "teleop.last('time') > 8")
    return page


def plot(page, name="position"):
    return page.locator(f".strip-{name} .plot").bounding_box()


def hover(page, share):
    box = plot(page)
    page.mouse.move(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])


def rest(feed, page):
    """End the trial, so that the strips rest."""
    end = feed.stop_sending()
    feed.mode = "ended"
    wait_for(page, f"teleop.last('time') > {end - 1e-6} && teleop.state().mode === 'ended'")
    page.wait_for_timeout(100)
    return end


def depth_of_a_press(page, feed):
    """Press in the picture of the tool, and return the depth that the page requests."""
    feed.requests.clear()
    box = page.locator("#tool").bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.7 * box["height"])
    page.mouse.down()
    page.wait_for_timeout(100)
    page.mouse.up()
    (found,) = {one["depth"] for one in feed.requests if one["type"] == "pointer"}
    return found


def test_zoom_and_pan_change_the_strips_only(feed, page):
    page.evaluate(WATCH)
    tool = page.locator("#tool").bounding_box()
    pressed = depth_of_a_press(page, feed)
    hover(page, 0.5)
    page.mouse.wheel(0, -120)
    wait_for(page, "teleop.view().span === 5")
    assert view(page)["follows"]
    assert page.input_value("#window") == "5"
    page.mouse.down()
    hover(page, 0.85)  # 1.75 s back
    page.mouse.up()
    wait_for(page, "!teleop.view().follows")
    past = view(page)["time"]
    assert past == pytest.approx(page.evaluate("teleop.last('time')") - 1.75, abs=0.5)
    page.wait_for_timeout(300)
    assert view(page)["time"] == past
    box = plot(page)
    page.mouse.move(box["x"], box["y"] - 200)  # without the cursor, the number is that of the end
    shown = number(page.locator(".strip-position .strip-value").inner_text())
    assert shown == pytest.approx(depth(past), abs=0.3)
    assert page.locator("#tool").bounding_box() == tool
    assert depth_of_a_press(page, feed) == pressed
    page.locator("#follow").click()
    wait_for(page, "teleop.view().follows")
    page.select_option("#window", "60")
    wait_for(page, "teleop.view().span === 60")
    page.locator("#strips").focus()
    for key in ("ArrowLeft", *4 * "+"):
        page.keyboard.press(key)
        assert view(page)["follows"]  # there is nothing before the oldest row of 60 s
    page.keyboard.press("ArrowLeft")
    assert view(page)["span"] == 5
    assert not view(page)["follows"]
    assert page.evaluate("shifts") == []
    assert page.evaluate("black") == []
    feed.news.append(feed.trial)  # the next trial is shown from its first sample on
    wait_for(page, "teleop.view().follows")


def test_the_cursor_shows_the_values_at_its_time_and_the_event_beside_it(feed, page):
    end = rest(feed, page)
    t = end - 4.0  # 60 % of 10 s
    events = [{"time": t + 0.02, "text": "too much force", "fault": True}]
    feed.news.append({"type": "events", "events": events})
    hover(page, 0.6)
    label = page.locator("#cursor-time")
    label.wait_for(state="visible")
    assert number(label.inner_text()) == pytest.approx(t, abs=0.02)
    wait_for(page, "document.getElementById('cursor-time').textContent.includes('too much force')")
    readout = page.locator(".strip-position .strip-readout").inner_text()
    assert number(readout.split("tool")[1]) == pytest.approx(depth(t), abs=0.5)
    force = number(page.locator(".strip-force .strip-readout").inner_text())
    assert force == pytest.approx(2.0 * depth(t), abs=1.0)
    estimates = page.locator(".strip-stiffness .strip-readout span")
    assert number(estimates.first.inner_text()[3:]) == pytest.approx(2000.0 + t, abs=1.0)
    assert estimates.all_inner_texts()[1] == "me 2100 ± 78"
    assert page.locator(".strip-position .strip-value").is_hidden()
    hover(page, 0.3)
    wait_for(page, "!document.getElementById('cursor-time').textContent.includes('force')")
    page.mouse.wheel(0, -120)  # the time at the mouse keeps its place, because the strips rest
    wait_for(page, "teleop.view().span === 5")
    assert number(label.inner_text()) == pytest.approx(end - 7.0, abs=0.05)
    page.mouse.move(1, 1)
    label.wait_for(state="hidden")
    assert page.locator(".strip-position .strip-value").is_visible()


STROKES = """(of) => new Promise((resolve) => {
  const made = CanvasRenderingContext2D.prototype, found = new Set(), stroke = made.stroke;
  made.stroke = function () {
    if (this.canvas.closest(of)) found.add(`${this.strokeStyle} ${this.globalAlpha.toFixed(2)}`);
    stroke.call(this);
  };
  document.getElementById('theme').click();
  document.getElementById('theme').click();
  setTimeout(() => { made.stroke = stroke; resolve([...found].sort()); }, 300);
})"""
"""Colours and opacities of all lines in a part of the page."""


def test_an_estimator_is_highlighted_hidden_and_shown_again(page):
    rls, me = (
        page.evaluate(f"getComputedStyle(document.documentElement).getPropertyValue('--e{i}')")
        for i in range(2)
    )
    in_strip = page.locator(".strip-damping button.legend").first
    in_table = page.locator("#estimates .line-style").first
    for button, state, opacities in (
        (in_strip, "highlighted", {rls: "1.00", me: "0.25"}),
        (in_table, "hidden", {me: "1.00"}),
        (in_strip, "shown", {rls: "1.00", me: "1.00"}),
    ):
        button.click()
        for one in (in_strip, in_table):
            assert one.get_attribute("data-emphasis") == state
        for part in (".strip-stiffness", "#xy-panel"):
            drawn = [line.split() for line in page.evaluate(STROKES, part)]
            of = {colour: opacity for colour, opacity in drawn if colour in (rls, me)}
            assert of == opacities, (state, part)


LINES = """([strip, colour]) => {
  const canvas = document.querySelector(`.strip-${strip} canvas`);
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  const style = getComputedStyle(document.documentElement).getPropertyValue(`--${colour}`);
  const wanted = style.trim().slice(1).match(/../g).map((part) => parseInt(part, 16));
  const rows = new Map(), columns = new Map();
  for (let i = 0; i < data.length; i += 4) {
    if (wanted.some((part, n) => Math.abs(data[i + n] - part) > 8)) continue;
    const x = (i / 4) % canvas.width, y = Math.floor(i / 4 / canvas.width);
    rows.set(y, (rows.get(y) || 0) + 1);
    columns.set(x, (columns.get(x) || 0) + 1);
  }
  const most = (counts) => Math.max(0, ...counts.values());
  return [most(rows) / canvas.width, most(columns) / canvas.height];
}"""
"""Largest part of a row and of a column of pixels that has a colour."""


def test_the_largest_expected_interval_and_the_events_are_lines_in_the_strips(feed, page):
    feed.values["b_bound"] = 1.5
    wait_for(page, "teleop.last('b_bound') === 1.5")
    end = rest(feed, page)
    assert "most for estimates 100" in page.locator(".strip-expected").inner_text()
    across, _ = page.evaluate(LINES, ["expected", "truth"])
    assert across > 0.25  # the line is dotted
    _, before = page.evaluate(LINES, ["velocity", "limit"])
    events = [{"time": end - 2.0, "text": "a fault", "fault": True}]
    feed.news.append({"type": "events", "events": events})
    page.wait_for_timeout(300)
    _, along = page.evaluate(LINES, ["velocity", "limit"])
    assert before < 0.1
    assert along > 0.4  # the line is dashed


NUMBERS = """(name) => [...document.querySelectorAll(`.strip-${name} .tick`)].map((tick) =>
  Number(tick.textContent.replace('\u2212', '-'))).sort((one, other) => one - other)"""
"""The numbers beside a strip."""


def span(page, name):
    numbers = page.evaluate(NUMBERS, name)
    return numbers[-1] - numbers[0]


def test_the_wheel_and_a_drag_beside_a_strip_change_its_values_until_a_double_click(feed, page):
    rest(feed, page)
    box = page.locator(".strip-position .ticks").bounding_box()
    # a range that is too large becomes smaller only after 4 s: begin with that of the resting data
    page.mouse.dblclick(box["x"] + 5, box["y"] + 10)
    page.wait_for_timeout(100)
    automatic, force = page.evaluate(NUMBERS, "position"), page.evaluate(NUMBERS, "force")
    page.mouse.move(box["x"] + 5, box["y"] + 0.5 * box["height"])
    for _ in range(6):
        page.mouse.wheel(0, -60)
    wait_for(page, f"({NUMBERS})('position').at(-1) < {automatic[-1]}")
    zoomed = page.evaluate(NUMBERS, "position")
    assert 0.0 < zoomed[-1] - zoomed[0] < 0.6 * (automatic[-1] - automatic[0])
    page.mouse.down()
    page.mouse.move(box["x"] + 5, box["y"] + box["height"])  # half of the range further up
    page.mouse.up()
    moved = page.evaluate(NUMBERS, "position")
    assert moved[0] > zoomed[0]
    page.wait_for_timeout(300)
    assert page.evaluate(NUMBERS, "position") == moved  # the data do not change it
    assert page.evaluate(NUMBERS, "force") == force
    assert view(page) == {**view(page), "follows": True, "span": 10}
    page.mouse.dblclick(box["x"] + 5, box["y"] + 10)
    wait_for(page, f"String(({NUMBERS})('position')) === '{','.join(f'{x:g}' for x in automatic)}'")
