"""The live page reports missing data and a lost connection."""

from __future__ import annotations

import pytest

from .conftest import wait_for
from .delay import Delay

pytestmark = pytest.mark.real_time

GREY = """() => {
  const colour = getComputedStyle(document.getElementById('stop')).backgroundColor;
  const [red, green, blue] = colour.match(/\\d+/g).map(Number);
  return Math.max(red, green, blue) - Math.min(red, green, blue) < 40;
}"""
"""Whether STOP has no colour."""
IS_STALE = "document.body.classList.contains('is-stale')"


def test_old_values_are_marked_within_half_a_second(trial_feed, serve, open_page):
    feed = trial_feed()
    page = open_page(serve(feed).url(), fake_time=True)
    wait_for(page, "teleop.rows() > 20 && teleop.fresh()")
    page.clock.pause_at(page.evaluate("Date.now()") + 60_000)
    rows = page.evaluate("teleop.rows()")
    wait_for(page, "(rows) => teleop.rows() > rows", rows)  # the newest row is not older than this
    wait_for(page, "(t) => teleop.last('time') === t", feed.stop_sending())
    page.clock.run_for(200)
    assert not page.evaluate(IS_STALE)
    page.clock.run_for(300)
    assert page.evaluate(IS_STALE)
    assert "No new data" in page.locator("#stale").inner_text()
    feed.is_sending = True
    page.clock.resume()
    wait_for(page, f"!{IS_STALE}")
    assert not page.locator("#stale").is_visible()


def test_a_lost_connection_is_reported_and_stop_says_that_it_was_not_sent(
    trial_feed, serve, open_page
):
    feed = trial_feed()
    server = serve(feed)
    page = open_page(server.url())
    wait_for(page, "teleop.fresh()")
    assert not page.evaluate(GREY)
    server.close()
    wait_for(page, IS_STALE)
    assert "no connection" in page.locator("#connection").inner_text()
    page.get_by_role("button", name="STOP").click()
    assert "STOP was NOT sent" in page.locator("#stale").inner_text()
    assert "cannot be sent: no connection" in page.locator("#stop").inner_text()
    assert page.evaluate(GREY)
    assert feed.kinds() == []


def test_an_ended_trial_is_not_reported_as_missing_data(trial_feed, serve, open_page):
    feed = trial_feed()
    page = open_page(serve(feed).url())
    wait_for(page, "teleop.rows() > 20")
    feed.mode, feed.is_sending = "ended", False
    wait_for(page, "teleop.state().mode === 'ended'")
    page.wait_for_timeout(700)
    assert not page.evaluate(IS_STALE)


def test_a_stop_without_effect_is_reported(trial_feed, serve, open_page):
    feed = trial_feed()
    feed.request = feed.requests.append
    page = open_page(serve(feed).url())
    page.keyboard.press("Escape")
    wait_for(page, "document.getElementById('stale').textContent.includes('not confirmed')")
    assert feed.kinds() == ["stop"]


def test_the_end_of_the_session_is_no_alarm(trial_feed, serve, open_page):
    feed = trial_feed()
    server = serve(feed)
    page = open_page(server.url())
    wait_for(page, "teleop.rows() > 20")
    feed.mode, feed.is_sending, feed.is_over = "ended", False, True
    wait_for(page, "teleop.state().loop === 'gone'")
    server.close()
    wait_for(
        page, "document.getElementById('text').textContent.startsWith('The session has ended.')"
    )
    assert not page.evaluate(IS_STALE)


def test_a_loop_that_hangs_is_reported_although_the_server_knows_it(trial_feed, serve, open_page):
    feed = trial_feed()
    page = open_page(serve(feed).url())
    wait_for(page, "teleop.rows() > 20")
    feed.is_sending, feed.is_over = False, True
    wait_for(page, "teleop.state().loop === 'gone'")
    wait_for(page, IS_STALE)


def test_a_page_behind_a_slow_connection_is_grey_and_states_the_age_of_its_data(
    trial_feed, serve, open_page
):
    feed = trial_feed(mode="ready")
    delay = Delay()
    page = open_page(serve(feed, delay).url())
    wait_for(page, "teleop.fresh()")
    delay.seconds = 0.4
    text = "document.getElementById('stale').textContent"
    wait_for(page, f"{IS_STALE} && /slow. The data are up to (0.8|0.9|1..) s old/.test({text})")
    page.get_by_role("button", name="Unlock").click()
    wait_for(page, f"{text}.includes('too slow to arm')")
    page.get_by_role("button", name="STOP").click()
    wait_for(page, "teleop.state().mode === 'fault'")
    assert feed.kinds() == ["stop"]
    delay.seconds = 0.0
    feed.mode = "active"
    wait_for(page, "teleop.fresh()")
