"""The marks of k and b, and the grey numbers of estimates that cannot be used."""

from __future__ import annotations

import pytest

from .conftest import wait_for

SIZES = [(1280, 720), (390, 844), (3840, 2160)]
COLOUR = """(cell) => getComputedStyle(cell).color"""
SHOWN = """(reason) => document.getElementById('trust-b-reason').textContent === reason"""
ROOM = """(id) => {
  const { scrollWidth, clientWidth } = document.getElementById(id);
  return [scrollWidth, clientWidth];
}"""


def test_the_marks_state_whether_k_and_b_can_be_used_and_why(trial_feed, serve, open_page):
    feed = trial_feed()
    page = open_page(serve(feed).url())
    wait_for(page, "document.getElementById('trust-k').textContent === '● can be used'")
    assert page.locator("#trust-k-reason").inner_text() == "± 1.0 % (rls)"
    assert page.locator("#trust-b").inner_text() == "○ not yet"
    assert page.locator("#trust-b-reason").inner_text() == "interval ± 65 % (rls)"
    feed.trust = {**feed.trust, "b": {"mark": "cannot", "reason": "misfit 9 %"}}
    wait_for(page, "document.getElementById('trust-b').textContent === '✕ cannot'")
    feed.trust = {"supported": []}
    wait_for(page, "document.getElementById('trust-b').textContent === ''")
    assert page.locator("#trust-b-reason").inner_text() == ""


def test_estimates_that_cannot_be_used_are_grey(trial_feed, serve, open_page):
    feed = trial_feed()
    page = open_page(serve(feed).url())
    wait_for(page, "document.querySelectorAll('#estimates .unsupported').length === 3")
    cells = page.locator("#estimates tbody .cell-k, #estimates tbody .cell-b")
    colours = [cell.evaluate(COLOUR) for cell in cells.all()]
    assert colours[0] not in colours[1:]
    assert len(set(colours[1:])) == 1
    feed.trust = {**feed.trust, "supported": [dict.fromkeys("kb", False)] * 2}
    wait_for(page, "document.querySelectorAll('#estimates .unsupported').length === 4")


@pytest.mark.parametrize("size", SIZES)
def test_every_mark_and_the_usual_reasons_fit_into_their_place(size, trial_feed, serve, open_page):
    feed = trial_feed()
    page = open_page(serve(feed).url(), size=size)
    marks = ("can be used", "not yet", "cannot", "cannot", "cannot")
    reasons = (
        *["lag, lost motion: -15 N s/m (rls)"] * 3,
        "lost motion ≈ 0.15 mm (rls)",
        "lost motion 0.05, not 0.15 mm",
    )
    for mark, reason in zip(marks, reasons, strict=True):
        one = {"mark": mark, "reason": reason}
        feed.trust = {**feed.trust, "k": one, "b": one}
        wait_for(page, "(mark) => document.getElementById('trust-b').dataset.mark === mark", mark)
        wait_for(page, SHOWN, reason)
        for name in ("trust-k", "trust-b", "trust-k-reason", "trust-b-reason"):
            wide, room = page.evaluate(ROOM, name)
            assert wide <= room, (name, mark)


def test_the_meaning_of_the_mark_is_explained(trial_feed, serve, open_page):
    page = open_page(serve(trial_feed()).url())
    page.locator("#trust-b-term").focus()
    assert "force lag and lost motion" in page.locator("#explanation").inner_text()


def test_start_values_of_the_estimators_are_not_shown_before_the_motion_determines_k(
    trial_feed, serve, open_page
):
    start = {"k_bound": 3.0, "rls_k": 0.0, "rls_k_std": 0.0, "me_k": 1500.0, "me_k_std": 4e4}
    feed = trial_feed(values=start)
    page = open_page(serve(feed).url())
    wait_for(page, "teleop.rows() > 50")
    page.wait_for_timeout(300)
    cells = page.locator("#estimates tbody .cell-k b")
    assert cells.all_inner_texts() == ["\u2013", "\u2013"]
    levels = page.locator(".strip-stiffness .level-truth")
    assert len(levels.all_inner_texts()) == 2  # the range without estimates has the true values
    feed.values |= {"k_bound": 0.3, "rls_k": 2050.0, "rls_k_std": 5.0}
    wait_for(page, "document.querySelector('#estimates .cell-k b').textContent === '2050.0'")
    feed.values["k_bound"] = 2.0  # the trial has had an estimate: it remains
    page.wait_for_timeout(400)
    assert cells.all_inner_texts()[0] == "2050.0"
    ticks = page.locator(".strip-stiffness .tick").all_inner_texts()
    assert min(map(float, ticks)) > 1000.0  # the start value 0 is not in the range
