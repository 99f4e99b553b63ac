"""Sizes, themes and texts of the live page."""

from __future__ import annotations

import math
import random
from itertools import pairwise
from statistics import median

import pytest

from estimation.registry import BUILT_IN

from .conftest import wait_for
from .result import summary

TARGET = {"frequency": 1.0, "depth": 0.015, "low": 0.0015, "count_in": 60.0}
NAMES = tuple(BUILT_IN)
SIZES = [(1280, 800), (3840, 2160), (390, 844)]


@pytest.mark.parametrize("view", ["", "operator"])
def test_stop_is_visible_and_nothing_is_cut_off(view, trial_feed, serve, open_page):
    page = open_page(serve(trial_feed(target=TARGET)).url(view), size=SIZES[-1])
    wait_for(page, "teleop.rows() > 50")
    for size in SIZES:
        width, height = size
        page.set_viewport_size({"width": width, "height": height})
        wait_for(page, f"innerWidth === {width}")
        box = page.get_by_role("button", name="STOP").bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= width
        assert box["y"] >= 0
        assert box["y"] + box["height"] <= height
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        if size != (390, 844) or view:
            assert page.evaluate("document.documentElement.scrollHeight") <= height
        note = page.locator("#stop-note").inner_text()
        assert "does not replace the emergency stop of the hardware" in note


WIDTHS = [(390, 844), (1280, 800), (1366, 768), (3840, 2160)]
LARGE = {
    f"{name}_{part}": value
    for name in NAMES
    for part, value in {
        "k": 1234567.8,
        "k_std": 61234.0,
        "b": -123456.7,
        "b_std": 1e9,
        "held": 1.0,
        "misfit": 9.99,
    }.items()
}
SUBSETS = [("rls_conditional",), NAMES, *(random.Random(i).sample(NAMES, 2 + i) for i in (0, 3))]


@pytest.mark.parametrize(
    ("estimators", "view"), [*((subset, "") for subset in SUBSETS), (NAMES, "operator")]
)
def test_the_page_is_never_wider_than_its_window(estimators, view, trial_feed, serve, open_page):
    feed = trial_feed(estimators=estimators, values=LARGE, target=TARGET, specimen=100 * "x")
    feed.text = 90 * "x"
    page = open_page(serve(feed).url(view))
    wait_for(page, "teleop.rows() > 50")
    feed.news.append(summary(estimators, recording={"path": 50 * "folder/", "problem": None}))
    if not view:
        wait_for(page, "document.getElementById('summary').open")
    for width, height in WIDTHS:
        page.set_viewport_size({"width": width, "height": height})
        wait_for(page, f"innerWidth === {width}")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        if width > 760:
            assert page.evaluate("document.documentElement.scrollHeight") <= height
        shown = page.locator("#estimates tbody th").all_inner_texts()
        assert set(shown) <= set(estimators)
        assert bool(shown) is not bool(view)


def test_the_theme_follows_the_system_and_can_be_changed(trial_feed, serve, open_page):
    page = open_page(serve(trial_feed()).url(), scheme="dark")
    is_dark = "Number(getComputedStyle(document.body).backgroundColor.match(/\\d+/)[0]) < 100"
    assert page.evaluate(is_dark)
    page.locator("#theme").click()
    assert not page.evaluate(is_dark)
    page.emulate_media(color_scheme="light")
    page.reload()
    assert not page.evaluate(is_dark)
    page.locator("#theme").click()
    assert page.evaluate(is_dark)


def test_limits_true_values_held_and_misfit_are_shown_as_text(trial_feed, serve, open_page):
    page = open_page(serve(trial_feed()).url())
    wait_for(page, "document.querySelector('.strip-stiffness .level-truth') !== null")
    truth = page.locator(".strip-stiffness .level-truth")
    assert truth.all_inner_texts() == ["true at the surface 2060", "true at full depth 2000"]
    force = page.locator(".strip-force").inner_text()
    assert "soft limit 40" in force
    assert "hard limit 60" in force
    wait_for(page, "document.querySelector('#estimates tbody').textContent.includes('held')")
    row = page.locator("#estimates tbody tr").nth(1)
    assert row.locator(".cell-held").inner_text() == "held"
    assert row.locator(".cell-misfit").inner_text() == "▲ 12 %"


def test_the_feedback_its_channel_and_what_the_hand_feels_are_shown(trial_feed, serve, open_page):
    feedback = {"law": "model-mediated", "prior": 2e4, "delay": 0.05, "jitter": 0.02, "loss": 0.1}
    feed = trial_feed(feedback=feedback)
    feed.values = {"displayed_force": 2.84, "model_stiffness": 2e4, "report_age": 0.062}
    page = open_page(serve(feed).url())
    wait_for(page, "document.getElementById('feedback-felt').textContent.includes('2.8 N')")
    panel = page.locator("#feedback-panel")
    for part in ("model-mediated", "delay 50 ms, jitter 20 ms, loss 10 %", "stiff until"):
        assert part in panel.inner_text()
    feed.values["model_stiffness"] = 2034.4
    wait_for(page, "document.getElementById('feedback-felt').textContent.includes('2034 N/m')")
    feed.news.append(
        {**feed.trial, "feedback": {**feedback, "law": "position-force", "prior": None}}
    )
    wait_for(page, "document.getElementById('feedback-felt').textContent.includes('62 ms ago')")
    feed.news.append({**feed.trial, "feedback": None})
    wait_for(page, "document.getElementById('feedback-panel').hidden")


def test_values_are_spoken_seldom_and_politely(trial_feed, serve, open_page):
    page = open_page(serve(trial_feed()).url(), fake_time=True)
    assert page.locator("#spoken").get_attribute("aria-live") == "polite"
    wait_for(page, "teleop.rows() > 20")
    assert page.locator("#spoken").text_content() == ""
    page.clock.run_for(6500)
    text = page.locator("#spoken").text_content()
    assert "newtons" in text
    assert "rls: k" in text


def test_the_time_of_the_trial_begins_when_the_drives_are_armed(trial_feed, serve, open_page):
    feed = trial_feed(mode="ready", target=TARGET)
    feed.armed_at = None
    page = open_page(serve(feed).url())
    wait_for(page, "teleop.last('time') > 1.5")
    assert page.locator("#clock").inner_text() == ""
    assert page.locator("#count-in").text_content() == ""
    feed.mode, feed.armed_at = "active", page.evaluate("teleop.last('time')")
    wait_for(page, "document.getElementById('clock').textContent.startsWith('0.')")
    assert page.locator("#count-in").inner_text() == "starts in 60 s"


RANGES = """async () => {
  const { Scale } = await import('./scale.js');
  const found = [];
  for (let i = 0; i < 2000; i++) {
    const low = 20 * Math.sin(i), size = 10 ** (3 * Math.sin(7 * i));
    const scale = new Scale(1e-3);
    scale.cover(low, low + size, 1.5 + 6 * Math.abs(Math.sin(3 * i)), 0);
    found.push([low, low + size, scale.low, scale.high, scale.ticks.length]);
  }
  return found;
}"""


def test_every_range_covers_its_values_and_has_at_least_two_labels(trial_feed, serve, open_page):
    page = open_page(serve(trial_feed()).url())
    for low, high, bottom, top, labels in page.evaluate(RANGES):
        assert bottom <= low
        assert high <= top
        assert 2 <= labels <= 12


TOPS = """async ([ys, line, height]) => {
  const { labelTops } = await import('./strips.js');
  return labelTops(ys, line, height);
}"""


def test_a_label_is_at_its_own_line_and_covers_no_other_line_or_label(trial_feed, serve, open_page):
    page = open_page(serve(trial_feed()).url())
    assert page.evaluate(TOPS, [[50, 61], 14, 100]) == [36, 61]  # the picture of the defect
    assert page.evaluate(TOPS, [[5, 60], 14, 100]) == [5, 46]
    assert page.evaluate(TOPS, [[5, 12], 14, 100]) == [None, 12]
    assert page.evaluate(TOPS, [[50, 53, 56], 14, 100]) == [36, None, 56]
    rng = random.Random(0)
    for _ in range(50):
        height, line = rng.uniform(10, 120), rng.uniform(10, 20)
        ys = sorted(rng.uniform(0, height) for _ in range(rng.randint(1, 4)))
        boxes = []
        for i, top in enumerate(page.evaluate(TOPS, [ys, line, height])):
            if top is not None:
                assert min(abs(ys[i] - top), abs(ys[i] - top - line)) < 1e-9
                assert not any(top < other < top + line for other in ys[:i] + ys[i + 1 :])
                boxes.append(top)
        assert all(second - first >= line - 1e-9 for first, second in pairwise(boxes))


def test_limits_that_are_close_are_both_named_with_a_decimal(trial_feed, serve, open_page):
    limits = {"soft_position": [-0.00045, 0.0127], "soft_force": 8.0, "hard_force": 9.0}
    page = open_page(serve(trial_feed(limits={**limits, "max_velocity": 0.2})).url())
    for text in ("soft limit 8.0", "hard limit 9.0"):
        shown = "(text) => document.querySelector('.strip-force').innerText.includes(text)"
        wait_for(page, shown, text)
    for text in ("soft limit \u22120.5", "soft limit 13"):
        shown = "(text) => document.querySelector('.strip-position').innerText.includes(text)"
        wait_for(page, shown, text)


TICKS = """() => [...document.querySelectorAll('.strip')].map((strip) => {
  const boxes = [...strip.querySelectorAll('.tick')].map((one) => one.getBoundingClientRect());
  return boxes.map(({ top, height }) => [top, height]).sort((one, other) => one[0] - other[0]);
})"""
LABELS = """() => [...document.querySelectorAll('.level')].map((label) => {
  const plot = label.closest('.plot').getBoundingClientRect();
  return (label.getBoundingClientRect().right - plot.left) / plot.width;
})"""


BELOW_THE_TOOL = """() => {
  const canvas = document.getElementById('tool');
  const depth = teleop.last('slave_position');
  const y = ((depth / 0.02 + 0.45) / 1.45) * canvas.height + 4; // soft limit 20 mm
  const found = [...canvas.getContext('2d').getImageData(canvas.width / 2, y, 1, 1).data];
  const style = getComputedStyle(document.documentElement);
  const isLike = (name) => {
    const digits = style.getPropertyValue(name).trim().slice(1).match(/../g);
    return digits.every((part, i) => Math.abs(parseInt(part, 16) - found[i]) < 3);
  };
  return ['--tissue', '--ground'].filter(isLike);
}"""


def test_a_specimen_that_pulls_is_drawn_at_the_tool(trial_feed, serve, open_page):
    pulling = {"slave_position": -0.006, "contact_force": -12.0, "target": math.nan}
    feed = trial_feed(values=pulling)
    page = open_page(serve(feed).url())
    for glued, force, below in (
        (True, -12.0, "--tissue"),
        (False, 0.0, "--ground"),
        (None, -12.0, "--tissue"),
        (None, 0.0, "--ground"),
    ):
        feed.values["contact_force"] = force
        feed.news.append({**feed.trial, "glued": glued})
        page.wait_for_timeout(100)  # the message removes the earlier rows
        wait_for(page, f"teleop.rows() > 20 && teleop.last('contact_force') === {force}")
        page.wait_for_timeout(100)
        assert page.evaluate(BELOW_THE_TOOL) == [below], (glued, force)


APART = """async ([ticks, height, line]) => {
  const { apart } = await import('./strips.js');
  return apart(ticks, (tick) => height * (1 - tick), line);
}"""


def test_a_tick_that_would_overprint_the_tick_before_is_left_out(trial_feed, serve, open_page):
    page = open_page(serve(trial_feed()).url())
    ticks = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    assert page.evaluate(APART, [ticks, 100, 12]) == ticks
    assert page.evaluate(APART, [ticks, 24, 12]) == [0.0, 0.6]
    assert page.evaluate(APART, [ticks, 8, 12]) == [0.0]


def test_ticks_do_not_overprint_and_labels_leave_the_newest_data_free(trial_feed, serve, open_page):
    page = open_page(serve(trial_feed(values={"k_bound": 0.6})).url())
    wait_for(page, "teleop.rows() > 200")
    for width, height in ((1024, 768), (1280, 720), (390, 844)):
        page.set_viewport_size({"width": width, "height": height})
        wait_for(page, f"innerWidth === {width}")
        page.wait_for_timeout(200)
        for ticks in page.evaluate(TICKS):
            assert len(ticks) >= 2
            for (top, tall), (below, _) in pairwise(ticks):
                assert below - top >= 0.75 * tall  # the digits are smaller than the box
        labels = page.evaluate(LABELS)
        assert labels
        assert max(labels) < 0.9


def test_the_number_of_a_strip_is_that_of_the_picture_in_every_frame(trial_feed, serve, open_page):
    page = open_page(serve(trial_feed()).url())
    wait_for(page, "teleop.rows() > 50")
    differences = page.evaluate(DIFFERENCES)
    assert len(differences) == 20
    assert median(differences) < 0.7  # mm; in 200 ms, the tool moves by 6 mm


DIFFERENCES = """() => new Promise((resolve) => {
  const found = [];
  const channel = new MessageChannel();
  channel.port1.onmessage = () => {
    const shown = document.querySelector('.strip-position .strip-value').textContent;
    const drawn = 1e3 * teleop.last('slave_position');
    found.push(Math.abs(Number(shown.replace('\u2212', '-')) - drawn));
    if (found.length === 20) resolve(found);
    else requestAnimationFrame(() => channel.port2.postMessage(0));
  };
  channel.port2.postMessage(0);
})"""


CUT = """() => [...document.querySelectorAll('.strip-title, .strip-notes')].flatMap((line) => {
  const box = line.getBoundingClientRect();
  return [...line.children].filter((one) => {
    const { left, right, top } = one.getBoundingClientRect();
    return top < box.bottom - 1 && (left < box.left - 1 || right > box.right + 1);
  }).map((one) => one.textContent);
})"""
SHOWN = """() => [...document.querySelectorAll('.strip-title *, .strip-notes *')].filter((one) =>
  one.getBoundingClientRect().top < one.parentElement.getBoundingClientRect().bottom - 1
).map((one) => one.textContent)"""


@pytest.mark.parametrize("size", [(390, 844), (1024, 768), (1920, 1080)])
def test_names_beside_the_titles_of_the_strips_are_shown_completely_or_not_at_all(
    size, trial_feed, serve, open_page
):
    names = ("rls_conditional", "rls_directional", "kalman", "me_switching", "ai")
    feed = trial_feed(estimators=names, target=TARGET, values={"k_bound": 2.0})
    page = open_page(serve(feed).url(), size=size)
    wait_for(page, "document.querySelector('.strip-force .strip-notes').textContent")
    assert page.evaluate(CUT) == []
    shown = page.evaluate(SHOWN)
    assert {"[mm]", "target"} <= set(shown)
    assert ("ai" in shown) is (size == (1920, 1080))


def explained(page, text):
    """Wait until the box shows a text; None until it is hidden."""
    shown = "document.getElementById('explanation')"
    if text is None:
        wait_for(page, f"{shown}.hidden")
    else:
        wait_for(page, "(text) => explanation.innerText === text && !explanation.hidden", text)


def test_the_names_of_the_estimators_are_explained_on_hover_focus_and_tap(
    trial_feed, serve, open_page
):
    page = open_page(serve(trial_feed()).url(), size=(390, 844))
    name = page.get_by_role("button", name="me", exact=True)
    name.hover()
    explained(page, "what me is")
    page.mouse.move(0, 0)
    explained(page, None)
    name.focus()
    explained(page, "what me is")
    page.focus("#misfit-term")
    explained(page, MISFIT)
    box = page.locator("#explanation").bounding_box()
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= 390
    page.focus("#stop")
    explained(page, None)
    name.dispatch_event("click")
    explained(page, "what me is")


MISFIT = "Part of the force that neither the estimate nor noise explains, divided by the force."


def test_an_estimator_without_an_explanation_is_a_plain_name(trial_feed, serve, open_page):
    page = open_page(serve(trial_feed(explanations={})).url())
    wait_for(page, "document.querySelectorAll('#estimates tbody tr').length === 2")
    assert page.locator("#estimates tbody button.term").count() == 0
    assert page.locator("#estimates tbody th").all_inner_texts() == ["rls", "me"]


FEEDBACK = {"law": "model-mediated", "prior": 2e4, "delay": 0.05, "jitter": 0.02, "loss": 0.1}


def test_three_estimators_and_the_feedback_fit_into_a_small_window(trial_feed, serve, open_page):
    feel = {"displayed_force": 12.84, "model_stiffness": 2e4}
    names = ("rls", "kalman", "window")
    feed = trial_feed(estimators=names, target=TARGET, feedback=FEEDBACK, values=feel)
    page = open_page(serve(feed).url(), size=(1280, 720))
    wait_for(page, "document.getElementById('feedback-felt').textContent.includes('12.8 N')")
    for panel in (".table-panel", "#feedback-felt", "#feedback-settings"):
        room = page.locator(panel).evaluate(
            "(one) => [one.scrollWidth - one.clientWidth, one.scrollHeight - one.clientHeight]"
        )
        assert max(room) <= 0, panel
    for row in page.locator("#estimates tbody tr").all():  # a name stands beside its line style
        line, name = (row.locator(part).bounding_box() for part in (".line-style", ".term"))
        assert line["y"] < name["y"] + name["height"] / 2 < line["y"] + line["height"]


@pytest.mark.parametrize("size", [(390, 844), (1024, 768), (1280, 720)])
def test_the_buttons_the_lists_and_the_menus_each_stand_in_one_line(
    size, trial_feed, serve, open_page
):
    feed = trial_feed("ready", condition="autonomous")
    feed.welcome["choices"] |= {"condition": ["free", "mimic", "autonomous"]}
    page = open_page(serve(feed).url(), size=size)
    groups = (
        ("#unlock", "#start", "#end", "#next", "#repeat"),
        ("#condition", "#specimen", "#duration"),
        ("#more-area", "#notes-area", "#trials-area"),
    )
    lines = []
    for group in groups:
        boxes = [page.locator(name).bounding_box() for name in group]
        middles = [box["y"] + box["height"] / 2 for box in boxes]
        assert max(middles) - min(middles) < 8.0, group
        lines.append(median(middles))
    assert abs(lines[2] - lines[1]) < 8.0 or size == (390, 844)
    assert abs(lines[1] - lines[0]) < 8.0 or size != (1280, 720)


@pytest.mark.parametrize("size", [(390, 844), (1280, 720)])
def test_the_count_in_is_completely_visible_in_the_operator_view(
    size, trial_feed, serve, open_page
):
    page = open_page(serve(trial_feed(target=TARGET)).url("operator"), size=size)
    wait_for(page, "document.getElementById('count-in').textContent.includes('starts in')")
    text, panel = (page.locator(one).bounding_box() for one in ("#count-in", ".pursuit-panel"))
    assert panel["x"] <= text["x"]
    assert text["x"] + text["width"] <= panel["x"] + panel["width"]
