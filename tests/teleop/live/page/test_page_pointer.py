"""Mouse and keyboard as the hand of the operator."""

from __future__ import annotations

import pytest

from .conftest import wait_for

pytestmark = pytest.mark.real_time

DEEPEST, ABOVE = 0.02, 0.45
"""Depth at the lower edge of the picture [m], and the part above the surface relative to it."""


@pytest.fixture
def feed(trial_feed):
    return trial_feed()


@pytest.fixture
def page(feed, serve, open_page):
    return open_page(serve(feed).url())


def last(feed):
    return next((r for r in reversed(feed.requests) if r["type"] == "pointer"), {})


def wait_until(page, condition):
    for _ in range(500):
        if condition():
            return
        page.wait_for_timeout(20)
    raise AssertionError("never true")


def hold(page, share):
    """Press the mouse at a share of the height of the picture; return its place in the window."""
    wait_for(page, "document.getElementById('health').textContent")  # now the layout rests
    box = page.locator("#tool").bounding_box()
    at = box["x"] + box["width"] / 2, box["y"] + share * box["height"]
    page.mouse.move(*at)
    page.mouse.down()
    return at


def test_press_and_hold_grips_at_the_depth_of_the_mouse(page, feed):
    hold(page, 0.5)
    wait_until(page, lambda: last(feed).get("grip"))
    assert last(feed)["depth"] == pytest.approx((0.5 * (1 + ABOVE) - ABOVE) * DEEPEST, abs=2e-4)
    page.mouse.up()
    wait_until(page, lambda: last(feed)["grip"] is False)


LOSSES = (
    "window.dispatchEvent(new Event('blur'))",
    "window.dispatchEvent(new Event('pagehide'))",
    "document.getElementById('tool').dispatchEvent(new Event('pointercancel'))",
    "(Object.defineProperty(document, 'hidden', {value: true}),"
    " document.dispatchEvent(new Event('visibilitychange')))",
)
"""Events that mean that the page has lost the mouse; the last one cannot be undone."""


def test_the_hand_lets_go_if_the_page_loses_the_mouse(page, feed):
    for event in LOSSES:
        hold(page, 0.5)
        wait_until(page, lambda: last(feed).get("grip"))
        page.evaluate(event)
        wait_until(page, lambda: last(feed)["grip"] is False)
        page.wait_for_timeout(200)
        assert last(feed)["grip"] is False, event
        page.mouse.up()


def test_the_hand_lets_go_when_its_button_is_released_although_another_one_is_held(page, feed):
    hold(page, 0.5)
    page.mouse.down(button="right")
    wait_until(page, lambda: last(feed).get("grip"))
    page.mouse.up(button="left")
    wait_until(page, lambda: last(feed)["grip"] is False)
    page.mouse.up(button="right")


def test_the_hand_lets_go_when_its_key_has_another_name_at_its_release(page, feed):
    page.keyboard.down("g")
    wait_until(page, lambda: last(feed).get("grip"))
    released = "new KeyboardEvent('keyup', {key: '\u014b', code: 'KeyG'})"  # with AltGr
    page.evaluate(f"dispatchEvent({released})")
    wait_until(page, lambda: last(feed)["grip"] is False)
    page.keyboard.up("g")


def test_a_mouse_at_rest_keeps_its_depth_although_the_layout_changes(page, feed):
    place = hold(page, 0.5)
    wait_until(page, lambda: last(feed).get("grip"))
    depth = last(feed)["depth"]
    size = page.viewport_size
    page.set_viewport_size({"width": size["width"], "height": size["height"] - 200})
    wait_for(page, f"innerHeight === {size['height'] - 200}")
    page.mouse.move(*place)  # as the browser does after a change of the layout
    page.wait_for_timeout(100)
    assert last(feed) == {"type": "pointer", "depth": depth, "grip": True}
    page.mouse.up()
    hold(page, 0.5)
    wait_until(page, lambda: last(feed).get("grip"))
    assert last(feed)["depth"] == pytest.approx(depth, abs=2e-4)  # at another place in the window


def test_the_hand_repeats_its_position_while_it_rests(page, feed):
    hold(page, 0.5)
    wait_until(page, lambda: len(feed.requests) > 20)
    assert {r["depth"] for r in feed.requests} == {last(feed)["depth"]}


def test_the_keyboard_alone_takes_control_starts_and_palpates(trial_feed, serve, open_page):
    feed = trial_feed(mode="ready")
    page = open_page(serve(feed).url())
    for name in ("unlock", "start"):
        for _ in range(20):
            page.keyboard.press("Tab")
            if page.evaluate("document.activeElement.id") == name:
                break
        page.keyboard.press("Enter")
        if name == "unlock":
            wait_for(page, "!document.getElementById('start').disabled")
    wait_for(page, "teleop.state().mode === 'active'")
    page.keyboard.down("g")
    wait_until(page, lambda: last(feed).get("grip"))
    first = last(feed)["depth"]
    page.keyboard.down("ArrowDown")
    wait_until(page, lambda: last(feed)["depth"] > first + 3e-3)
    page.keyboard.up("ArrowDown")
    page.keyboard.down("ArrowUp")
    deep = last(feed)["depth"]
    wait_until(page, lambda: last(feed)["depth"] < deep - 1e-3)
    page.keyboard.up("ArrowUp")
    page.keyboard.up("g")
    wait_until(page, lambda: last(feed)["grip"] is False)
    assert page.locator("#tool-help").inner_text().count("hold G")


GAMEPAD = """([axis, pressed]) => {
  const pad = { connected: true, axes: [0, axis], buttons: [{ pressed }] };
  navigator.getGamepads = () => [null, pad];
}"""


def test_a_gamepad_grips_with_its_button_and_moves_with_its_stick(page, feed):
    page.evaluate(GAMEPAD, [0.5, True])
    wait_until(page, lambda: last(feed).get("grip"))
    assert last(feed)["depth"] == pytest.approx(0.009)
    page.evaluate(GAMEPAD, [1.0, True])
    wait_until(page, lambda: last(feed)["depth"] == pytest.approx(0.018))
    page.evaluate(GAMEPAD, [1.0, False])
    wait_until(page, lambda: last(feed)["grip"] is False)


def test_a_page_without_control_does_not_send_the_hand(serve, open_page, feed):
    server = serve(feed)
    first, second = open_page(server.url()), open_page(server.url())
    first.get_by_role("button", name="Take control").click()
    wait_for(second, "teleop.state().control === 'other'")
    hold(second, 0.5)
    second.wait_for_timeout(200)
    assert feed.requests == []
    assert not second.evaluate("teleop.hand().grip")


def test_the_hand_lets_go_at_the_end_of_the_trial(page, feed):
    hold(page, 0.5)
    wait_until(page, lambda: last(feed).get("grip"))
    page.keyboard.press("Escape")
    wait_for(page, "!teleop.hand().grip")
