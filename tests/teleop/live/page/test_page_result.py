"""The dialog with the result of a trial."""

from __future__ import annotations

import re

import pytest

from .conftest import wait_for
from .result import FILES, USE, VALUES, failed, summary

IS_OPEN = "document.getElementById('summary').open"
OVERLAP = """() => {
  const box = (id) => document.getElementById(id).getBoundingClientRect();
  const [one, other] = [box('summary'), box('strips')];
  const width = Math.min(one.right, other.right) - Math.max(one.left, other.left);
  const height = Math.min(one.bottom, other.bottom) - Math.max(one.top, other.top);
  return Math.max(width, 0) * Math.max(height, 0);
}"""


@pytest.fixture
def shown(trial_feed, serve, open_page):
    """Return a function that shows messages in a page of a size, and returns the page."""

    def show(*messages, size=(1280, 720)):
        feed = trial_feed("ended")
        page = open_page(serve(feed).url(), size=size)
        wait_for(page, "teleop.rows() > 20")
        feed.news.extend(messages)
        wait_for(page, IS_OPEN)
        return page

    return show


def test_the_page_says_that_the_trial_is_evaluated_until_the_result_arrives(
    trial_feed, serve, open_page
):
    feed = trial_feed("ended")
    page = open_page(serve(feed).url())
    text = "document.getElementById('text').textContent"
    feed.news.append({"type": "evaluating"})
    wait_for(page, f"{text}.includes('k and b are computed')")
    assert not page.evaluate(IS_OPEN)
    feed.news.append(summary())
    wait_for(page, IS_OPEN)
    assert "computed" not in page.evaluate(text)


def test_the_result_shows_values_remarks_and_the_recording(shown):
    page = shown(summary())
    wait_for(page, f"document.getElementById('summary-title').textContent === {USE!r}")
    text = page.locator("#summary").inner_text()
    for part in ("2034 N/m", "2013 to 2055", "3.1 N s/m", "a remark", "tangent", "2034 \u00b1 21"):
        assert part in text
    assert "recordings/a.mcap" in text


def test_a_value_that_cannot_be_used_is_grey(shown):
    page = shown(summary())
    colour = "(row) => getComputedStyle(document.querySelectorAll('.result-value')[row]).color"
    cells = page.evaluate(f"[0, 1].map({colour})")
    weak = page.evaluate("getComputedStyle(document.querySelector('tr.unsupported td')).color")
    assert cells[1] == weak
    assert cells[0] != weak


def test_the_title_is_green_only_if_all_values_can_be_used_and_red_without_any(shown):
    style = "getComputedStyle(document.getElementById('summary-title')).color"
    text = "getComputedStyle(document.body).color"
    page = shown(summary())
    assert page.evaluate(style) == page.evaluate(text)
    usable = {**summary()["shown"], "values": VALUES[:1]}
    colours = [shown(one).evaluate(style) for one in (summary(shown=usable), failed("a reason"))]
    assert len({*colours, page.evaluate(text)}) == 3


def test_the_picture_has_samples_fit_and_slope_inside_its_frame(shown):
    page = shown(summary())
    for kind in ("path.measured", "path.fitted", "line.tangent"):
        box = page.locator(f".result-picture {kind}").bounding_box()
        frame = page.locator(".result-picture").bounding_box()
        assert frame["x"] <= box["x"]
        assert box["x"] + box["width"] <= frame["x"] + frame["width"]
        assert frame["y"] <= box["y"]
        assert box["y"] + box["height"] <= frame["y"] + frame["height"]


def test_a_trial_without_a_result_shows_no_number_and_says_why(shown):
    page = shown(failed("the tool did not move"))
    text = page.locator("#summary").inner_text()
    assert "k and b cannot be used, because the tool did not move" in text
    assert not re.search(r"\d", text)
    assert page.locator(".result-picture, #summary table").count() == 0


def test_without_a_recording_the_dialog_says_so_and_has_no_buttons_for_files(shown):
    page = shown(summary(recording={"path": None, "problem": None}, files={}))
    assert "Not recorded" in page.locator("#summary").inner_text()
    assert page.locator("#summary a").count() == 0


def test_the_buttons_lead_to_the_files_of_the_trial(shown):
    page = shown(summary())
    links = page.locator("#summary a").evaluate_all("all => all.map((a) => a.getAttribute('href'))")
    assert links == list(FILES.values())


def test_a_file_that_cannot_be_written_is_reported_and_the_page_stays(shown):
    page = shown(summary())
    page.route("**/a.csv", lambda route: route.fulfill(body="the disk is full"))
    page.locator("#summary a", has_text="CSV").click()
    wait_for(page, "document.getElementById('summary-files').textContent.includes('disk is full')")
    assert page.evaluate(IS_OPEN)


@pytest.mark.parametrize("size", [(1024, 768), (1920, 1080)])
def test_a_short_result_covers_the_whole_right_column(shown, size):
    page = shown(failed("a reason"), size=size)
    column, result = (page.locator(name).bounding_box() for name in (".side", "#summary"))
    assert result == pytest.approx(column, abs=1.0)


@pytest.mark.parametrize("size", [(1024, 768), (1280, 720), (390, 844)])
def test_the_result_needs_no_horizontal_scroll_beside_a_scroll_bar(shown, size):
    row = ["rls_conditional", "2204.3 \u00b1 16.3", "\u221210.4 \u00b1 8.1", "100%", "11%"]
    values = [{**one, "value": "2230.4", "low": "2229.3", "high": "2231.5"} for one in VALUES]
    texts = {**summary()["shown"], "values": values, "estimates": [row]}
    page = shown(summary(shown=texts), size=size)
    wide, room = page.evaluate("""() => {
      const body = document.getElementById('summary-body');
      body.style.paddingRight = '11px';  // the width of a thin scroll bar
      return [body.scrollWidth, body.clientWidth];
    }""")
    assert wide <= room


def test_a_closed_result_can_be_shown_again_until_the_next_trial(trial_feed, serve, open_page):
    feed = trial_feed("ended")
    page = open_page(serve(feed).url())
    feed.news.append(summary())
    wait_for(page, IS_OPEN)
    page.locator("#summary-close").click()
    page.locator("#trials-area summary").click()
    page.locator("#result-again").click()
    wait_for(page, IS_OPEN)
    feed.news.append(feed.trial)
    wait_for(page, "document.getElementById('result-again').hidden")
    assert not page.evaluate(IS_OPEN)


def test_the_files_are_not_offered_after_the_session(trial_feed, serve, open_page):
    feed = trial_feed("ended")
    server = serve(feed)
    page = open_page(server.url())
    feed.news.append(summary())
    wait_for(page, IS_OPEN)
    assert page.locator("#summary-files a").first.is_visible()
    server.close()
    wait_for(page, "!document.body.classList.contains('is-connected')")
    assert not page.locator("#summary-files a").first.is_visible()


@pytest.mark.parametrize("size", [(1024, 768), (1280, 720), (1920, 1080)])
def test_the_result_covers_neither_strips_nor_stop_and_its_buttons_are_visible(shown, size):
    page = shown(summary(estimates=[f"estimator_{i}" for i in range(21)]), size=size)
    assert page.evaluate(OVERLAP) == 0
    check_reachable(page)


def test_on_a_phone_the_result_leaves_stop_and_the_controls_visible(shown):
    page = shown(summary(), size=(390, 844))
    check_reachable(page)
    next_button = page.locator("#next").bounding_box()
    assert next_button["y"] + next_button["height"] <= page.locator("#summary").bounding_box()["y"]


def check_reachable(page):
    """Check that STOP and the buttons of the dialog are where a click reaches them."""
    reached = """(id) => {
      const one = document.querySelector(id);
      const { left, top, width, height } = one.getBoundingClientRect();
      return one.contains(document.elementFromPoint(left + width / 2, top + height / 2));
    }"""
    for button in ("#stop", "#summary-close", "#summary-files a:last-child"):
        assert page.evaluate(reached, button), button
