"""STOP, arming and the other controls of the live page."""

from __future__ import annotations

import pytest

from .conftest import wait_for
from .result import summary

FAULT = "document.getElementById('mode').textContent === 'fault'"


def press_stop(page, how):
    if how == "button":
        page.get_by_role("button", name="STOP").click()
    else:
        page.keyboard.press(how)


def wait_for_request(page, feed, kind):
    for _ in range(500):
        if kind in feed.kinds():
            return
        page.wait_for_timeout(20)
    raise AssertionError(f"no request {kind}: {feed.kinds()}")


def wait_for_count(page, requests, count):
    for _ in range(500):
        if len(requests) >= count:
            return
        page.wait_for_timeout(20)
    raise AssertionError(requests)


def recover(page, feed, mode):
    """Return to the mode before the stop."""
    feed.requests.clear()
    feed.mode, feed.text = mode, "a text"
    wait_for(page, f"!({FAULT})")


@pytest.mark.parametrize("view", ["", "operator"])
def test_stop_is_sent_and_the_fault_is_shown_in_words(view, trial_feed, serve, open_page):
    feed = trial_feed()
    page = open_page(serve(feed).url(view))
    for how in ("button", "Space", "Escape"):
        press_stop(page, how)
        wait_for(page, FAULT)
        assert feed.kinds() == ["stop"], how
        text = page.locator("#text").inner_text()
        assert text == "Emergency stop: STOP was pressed on the page."
        recover(page, feed, "active")


@pytest.mark.parametrize(
    ("is_faulted", "text"), [(True, "ended by a fault"), (False, "ended")], ids=["fault", "end"]
)
def test_a_page_opened_after_a_trial_shows_whether_a_fault_ended_it(
    is_faulted, text, trial_feed, serve, open_page
):
    feed = trial_feed(mode="ended")
    feed.is_faulted = is_faulted
    page = open_page(serve(feed).url())
    wait_for(page, f"document.getElementById('mode').textContent === '{text}'")
    assert (page.locator("#mode").get_attribute("data-mode") == "fault") is is_faulted


def test_stop_says_that_there_is_nothing_to_stop_if_no_trial_runs(trial_feed, serve, open_page):
    feed = trial_feed(mode="ended")
    feed.request = feed.requests.append
    page = open_page(serve(feed).url())
    press_stop(page, "button")
    text = "document.getElementById('stale').textContent"
    wait_for(page, f"{text} === 'No trial is running. There is nothing to stop.'")
    assert feed.kinds() == ["stop"]  # it is sent in any case


def test_space_stops_wherever_the_focus_is_and_presses_nothing(trial_feed, serve, open_page):
    feed = trial_feed(mode="ready")
    page = open_page(serve(feed).url())
    page.locator("#notes-area summary").click()
    for focus in ("#unlock", "#condition", "#tool", "#notes-area summary"):
        page.focus(focus)
        page.keyboard.press("Space")
        wait_for(page, FAULT)
        assert feed.kinds() == ["stop"], focus
        assert not page.evaluate("teleop.state().unlocked"), focus
        assert page.evaluate("document.getElementById('notes-area').open"), focus
        recover(page, feed, "ready")


def test_space_in_the_notes_writes_a_space_and_escape_stops(trial_feed, serve, open_page):
    feed = trial_feed(mode="ended")
    page = open_page(serve(feed, quick=True).url())
    page.locator("#notes-area summary").click()
    page.focus("#notes")
    page.keyboard.type("a b")
    wait_for(page, "!document.getElementById('notes-save').disabled")
    page.locator("#notes-save").press("Enter")
    wait_for_request(page, feed, "notes")
    assert feed.requests == [{"type": "notes", "text": "a b", "prompt": 1}]
    page.focus("#notes")
    page.keyboard.press("Escape")
    wait_for(page, FAULT)


def test_a_page_without_control_can_stop_but_not_arm(trial_feed, serve, open_page):
    feed = trial_feed(mode="ready")
    server = serve(feed)
    first, second = open_page(server.url()), open_page(server.url())
    first.get_by_role("button", name="Take control").click()
    wait_for(second, "teleop.state().control === 'other'")
    assert second.get_by_role("button", name="Unlock").is_disabled()
    assert second.get_by_role("button", name="Start").is_disabled()
    assert second.get_by_role("button", name="Take control").is_disabled()
    press_stop(second, "button")
    wait_for(first, FAULT)
    wait_for(second, FAULT)
    assert feed.kinds() == ["stop"]


@pytest.mark.real_time
def test_start_is_possible_only_after_unlock_and_for_a_limited_time(
    trial_feed, serve, open_page, monkeypatch
):
    monkeypatch.setattr("teleop.live.clients.UNLOCKED", 1.0)
    feed = trial_feed(mode="ready")
    page = open_page(serve(feed).url())
    start = page.get_by_role("button", name="Start")
    assert start.is_disabled()
    page.get_by_role("button", name="Unlock").click()
    wait_for(page, "!document.getElementById('start').disabled")
    wait_for(page, "document.getElementById('start').disabled")  # it was not pressed
    page.get_by_role("button", name="Unlock").click()
    start.click()
    wait_for(page, "teleop.state().mode === 'active'")
    assert feed.kinds() == ["start"]
    assert start.is_disabled()


def test_stop_is_first_in_the_order_of_the_tab_key(trial_feed, serve, open_page):
    page = open_page(serve(trial_feed()).url())
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.id") == "stop"


def test_choices_are_sent_as_the_server_listed_them(trial_feed, serve, open_page):
    feed = trial_feed(mode="ready")
    page = open_page(serve(feed).url())
    page.select_option("#duration", index=1)
    wait_for_request(page, feed, "choose")
    expected = {"condition": "free", "specimen": "soft", "duration": 20.0, "feedback": "none"}
    expected = {"type": "choose", **expected, "estimators": ["rls", "me"]}
    assert feed.requests == [expected]
    page.click("#more-area summary")
    page.select_option("#feedback", "model-mediated")
    expected["feedback"] = "model-mediated"
    wait_for_count(page, feed.requests, 2)
    assert feed.requests[1] == expected
    boxes = page.locator("#estimators-list input")
    boxes.nth(2).check()
    boxes.nth(1).uncheck()
    assert len(feed.requests) == 2  # the choice is not complete yet
    page.click("#estimators-use")
    expected["estimators"] = ["rls", "kalman"]
    wait_for_count(page, feed.requests, 3)
    assert feed.requests[2] == expected
    boxes.nth(2).uncheck()
    boxes.nth(0).uncheck()
    assert page.locator("#estimators-use").is_disabled()  # no estimator


def test_the_trials_of_the_session_are_listed_with_k_and_b(trial_feed, serve, open_page):
    feed = trial_feed(mode="ended")
    page = open_page(serve(feed).url())
    summary = page.locator("#trials-area summary")
    assert summary.inner_text() == "Trials (0)"
    about = {"condition": "free", "specimen": "soft cube", "feedback": "none", "stopped": ""}
    k = {"symbol": "k", "value": "2034.2", "unit": "N/m", "low": "2030.1", "high": "2038.3"}
    b = {"symbol": "b", "value": "", "unit": "N s/m", "low": "", "high": ""}
    other = {"feedback": "position-force", "stopped": "stopped", "values": []}
    trials = [{"number": 1, **about, "values": [k, b]}, {"number": 2, **about, **other}]
    feed.news.append({"type": "trials", "trials": trials})
    wait_for(page, "document.querySelector('#trials-area summary').textContent === 'Trials (2)'")
    summary.click()
    rows = page.locator("#trials tr")
    cells = [rows.nth(i).locator("th, td").all_inner_texts()[1:] for i in range(3)]
    assert cells == [
        ["trial", "k", "b"],
        ["free, soft cube, position-force, stopped", "\u2013", "\u2013"],
        ["free, soft cube", "2034.2 N/m\n2030.1 to 2038.3", "\u2013"],
    ]


@pytest.mark.parametrize("size", [(390, 844), (1024, 768)])
def test_the_list_of_trials_needs_no_horizontal_scroll(size, trial_feed, serve, open_page):
    feed = trial_feed(mode="ended")
    page = open_page(serve(feed).url(), size=size)
    about = {"condition": "autonomous", "specimen": "medium cube", "stopped": "ended by a fault"}
    k = {"symbol": "k", "value": "12034.2", "unit": "N/m", "low": "12030.1", "high": "12038.3"}
    b = {"symbol": "b", "value": "13.037", "unit": "N s/m", "low": "13.008", "high": "13.065"}
    trial = {"number": 10, **about, "feedback": "model-mediated", "values": [k, b]}
    feed.news.append({"type": "trials", "trials": [trial]})
    wait_for(page, "document.querySelectorAll('#trials tr').length === 2")
    page.locator("#trials-area summary").click()
    wide, room = page.locator(".trials-box").evaluate("(one) => [one.scrollWidth, one.clientWidth]")
    assert wide <= room


def test_a_series_has_next_repeat_and_skip(trial_feed, serve, open_page):
    feed = trial_feed(mode="ended", series={"position": 2, "of": 5})
    page = open_page(serve(feed, quick=True).url())
    assert page.locator("#series-text").inner_text() == "trial 2 of 5"
    for name in ("Next", "Repeat", "Skip"):
        page.get_by_role("button", name=name).click()
        wait_for_request(page, feed, name.lower())
    assert feed.kinds() == ["next", "repeat", "skip"]


@pytest.mark.real_time
def test_a_double_click_answers_one_question_only(trial_feed, serve, open_page):
    feed = trial_feed(mode="ended", series={"position": 2, "of": 5})
    answer = feed.request

    def ask_again(request):
        answer(request)
        feed.prompt = feed.prompt | {"number": feed.prompt["number"] + 1}

    feed.request = ask_again
    page = open_page(serve(feed).url())
    for number in (1, 2):
        page.get_by_role("button", name="Skip").dblclick(delay=20)
        wait_for(page, f"teleop.state().prompt.number === {number + 1}")
        assert page.get_by_role("button", name="Skip").is_disabled()
        assert feed.requests[-1] == {"type": "skip", "prompt": number}
        assert len(feed.requests) == number


def test_only_the_possible_answers_to_a_question_can_be_pressed(trial_feed, serve, open_page):
    feed = trial_feed(mode="ended", series={"position": 2, "of": 5})
    feed.prompt = {"number": 4, "answers": ["next", "notes"]}
    page = open_page(serve(feed, quick=True).url())
    wait_for(page, "!document.getElementById('next').disabled")
    assert page.get_by_role("button", name="Skip").is_disabled()
    assert page.get_by_role("button", name="Repeat").is_disabled()
    feed.prompt = None
    wait_for(page, "document.getElementById('next').disabled")


def test_the_result_shows_the_tracking(trial_feed, serve, open_page):
    feed = trial_feed()
    page = open_page(serve(feed).url())
    tracking = {"gain": 0.91, "phase_deg": -98.9, "delay_s": 0.275, "rms_m": 0.0074}
    feed.news.append(summary(tracking=tracking))
    page.locator("#summary").wait_for(state="visible")
    text = page.locator("#summary").inner_text()
    for part in ("0.91", "\u221299°", "275 ms", "7.4 mm"):
        assert part in text


def test_the_health_of_the_loop_is_shown(trial_feed, serve, open_page):
    feed = trial_feed()
    page = open_page(serve(feed).url())
    wait_for(page, "document.getElementById('health').textContent.includes('lateness 55')")
    text = page.locator("#health").inner_text()
    assert "overruns 2, skipped periods 1, dropped ticks 0" in text
    feed.lateness = None  # no tick in the last second
    wait_for(page, "document.getElementById('health').textContent.includes('lateness \u2013 µs')")


def test_a_stop_by_a_person_is_no_fault(trial_feed, serve, open_page):
    feed = trial_feed(mode="fault")
    state = feed.state
    feed.state = lambda: {**state(), "by_person": True}
    feed.is_faulted, feed.text = True, "stopped with STOP in the page"
    page = open_page(serve(feed).url())
    for feed.mode in ("fault", "ended"):
        wait_for(page, f"teleop.state().mode === '{feed.mode}'")
        assert page.locator("#mode").inner_text() == "stopped"
        assert page.locator("#mode").get_attribute("data-mode") == "stopped"
        assert page.locator("#text").inner_text() == "Stopped with STOP in the page."


@pytest.mark.real_time
def test_the_time_of_the_trial_ends_at_the_stop(trial_feed, serve, open_page):
    feed = trial_feed()
    page = open_page(serve(feed).url())
    wait_for(page, "teleop.last('time') > 0.5")
    feed.values["mode"] = 5.0
    feed.mode = "fault"
    wait_for(page, "teleop.last('mode') === 5")
    times = "[...teleop.series('mode')].map((mode, i) => mode === 3 ? teleop.series('time')[i] : 0)"
    end = page.evaluate(f"Math.max(...{times})")
    wait_for(page, "(end) => teleop.last('time') > end + 0.6", end)
    expected = f"{end:.1f} of 10 s"
    assert page.locator("#clock").inner_text() == expected
    feed.mode, feed.is_sending = "ended", False
    wait_for(page, "teleop.state().mode === 'ended'")
    page.wait_for_timeout(300)
    assert page.locator("#clock").inner_text() == expected


def test_only_a_page_that_can_press_the_buttons_names_them(trial_feed, serve, open_page):
    feed = trial_feed(mode="ready")
    state = feed.state
    feed.state = lambda: {**state(), "advice": "UNLOCK, then START"}
    server = serve(feed)
    first, second = open_page(server.url()), open_page(server.url())
    text = "document.getElementById('text').textContent"
    wait_for(first, f"{text} === 'A text. UNLOCK, then START.'")
    first.get_by_role("button", name="Take control").click()
    wait_for(second, f"{text} === 'A text. Another page has control.'")
    assert first.evaluate(text) == "A text. UNLOCK, then START."
    hint = "document.getElementById('tool-hint').textContent"
    wait_for(second, f"{hint} === 'Another page has control.'")
    assert first.evaluate(hint).startswith("Press Unlock")
    second.goto(server.url("operator"))
    wait_for(second, f"{text} === 'A text. Continue in the main view.'")


@pytest.mark.real_time
def test_the_focus_goes_to_the_next_button_after_next_and_start(
    trial_feed, serve, open_page, monkeypatch
):
    monkeypatch.setattr("teleop.live.clients.UNLOCKED", 1.0)
    feed = trial_feed(mode="ended")
    request = feed.request

    def carry_out(one):
        request(one)
        if one["type"] == "next":
            feed.mode, feed.prompt = "ready", None

    feed.request = carry_out
    page = open_page(serve(feed, quick=True).url())
    wait_for(page, "!document.getElementById('next').disabled")
    page.focus("#next")
    page.keyboard.press("Enter")
    wait_for(page, "document.activeElement.id === 'unlock'")
    page.keyboard.press("Enter")
    wait_for(page, "!document.getElementById('start').disabled")
    page.focus("#start")
    wait_for(page, "document.activeElement.id === 'unlock'")  # the time for START is over
    page.keyboard.press("Enter")
    wait_for(page, "!document.getElementById('start').disabled")
    page.focus("#start")
    page.keyboard.press("Enter")
    wait_for(page, "document.activeElement.id === 'tool'")
    page.focus("#end")
    page.keyboard.press("Enter")
    feed.prompt = {"number": 2, "answers": ["next"]}
    wait_for(page, "document.activeElement.id === 'next'")
