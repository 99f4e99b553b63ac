"""The live page shows a recording."""

from __future__ import annotations

import json

import numpy as np
import pytest

from estimation.expected_intervals import LARGEST_EXPECTED
from teleop.cli import main
from teleop.live.replay import Replay
from teleop.recording.recording import load

from .conftest import wait_for

PICTURE = "document.querySelector('.strip-position canvas').toDataURL()"

KEEP = """() => {
  window.pixels = () => [...document.querySelectorAll('.strip canvas')].map((canvas) =>
    canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data);
  window.kept = pixels();
}"""
"""Keep the pixels of the strips."""
COMPARE = """() => pixels().map((drawn, n) => {
  const moved = window.kept[n], reds = new Set();
  let different = 0;
  for (let i = 0; i < moved.length; i += 4) {
    reds.add(moved[i]);
    different += Math.abs(moved[i] - drawn[i]) > 40;
  }
  return [moved.length / 4, drawn.length / 4, different, reds.size];
})"""
"""Number of kept and of present pixels, of those that differ, and of kept shades of red."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "mimic.mcap"
    arguments = ["--clock", "virtual", "--rate", "500", "--condition", "mimic"]
    arguments += ["--duration", "15", "--record"]
    assert main(["run", *arguments, str(path), "--json"]) == 0
    return load(path)


def feed_of(recording):
    target = {"frequency": 1.0, "depth": 0.0155, "low": 0.00155, "count_in": 0.0}
    trial = {
        "type": "trial",
        "number": 1,
        "condition": "mimic",
        "specimen": "<img src=x onerror=alert(1)>",
        "duration": 15.0,
        "rig": "simulated",
        "simulated": True,
        "limits": {"soft_position": [-0.008, 0.023], "soft_force": 66.0, "hard_force": 90.0},
        "truth": None,
        "target": target,
        "series": None,
    }
    units = recording.units.items()
    descriptions = [{"name": name, "unit": unit, "meaning": ""} for name, unit in units]
    events = recording.events
    return Replay(recording.columns, descriptions, recording.estimators, events, trial)


@pytest.fixture
def page(recording, serve, open_page):
    return open_page(serve(feed_of(recording)).url())


def pause(page):
    page.get_by_role("button", name="Pause").click()
    wait_for(page, "document.getElementById('play').textContent === 'Play'")
    rows = -1
    while rows != (rows := page.evaluate("teleop.rows()")):
        page.wait_for_timeout(100)


def test_curves_move(page):
    before = page.evaluate(PICTURE)
    rows = page.evaluate("teleop.rows()")
    wait_for(page, "(rows) => teleop.rows() > rows + 50", rows)
    assert page.evaluate(PICTURE) != before


def test_the_picture_that_moves_equals_one_that_is_drawn_at_once(recording, serve, open_page):
    page = open_page(serve(feed_of(recording)).url(), fake_time=True)
    wait_for(page, "teleop.last('time') > 3")
    pause(page)
    page.clock.run_for(5000)  # until the ranges rest
    page.evaluate(KEEP)
    page.locator("#theme").click()
    page.locator("#theme").click()
    page.wait_for_timeout(200)
    strips = page.evaluate(COMPARE)
    assert strips
    for moved, drawn, different, shades in strips:
        assert moved == drawn > 1000
        assert different / moved < 0.03
        assert shades > 4


def test_a_paused_replay_shows_values_estimates_and_errors_of_the_recording(
    recording, serve, open_page
):
    feed = feed_of(recording)
    feed.request({"type": "seek", "t": 5.0})
    page = open_page(serve(feed).url())
    wait_for(page, "teleop.last('time') > 5.5")
    pause(page)
    page.wait_for_timeout(600)
    assert not page.locator("#stale").is_visible()
    check_values(page, recording)
    check_estimates(page, recording)
    check_errors(page, recording)


def check_values(page, recording):
    shown = np.array(page.evaluate("teleop.series('time')"))
    rows = np.searchsorted(recording["time"], shown)
    assert len(rows) > 200
    for name in ("time", "slave_position", "contact_force", "rls_k", "me_b_std", "k_bound"):
        values = np.array(page.evaluate("(name) => teleop.series(name)", name), float)
        expected = recording[name][rows]
        if name in ("rls_k", "me_b_std"):  # before, these are start values
            informed = recording["k_bound"][rows] <= LARGEST_EXPECTED
            expected = np.where(np.logical_or.accumulate(informed), expected, np.nan)
        np.testing.assert_array_equal(values, expected)


def check_estimates(page, recording):
    """Compare the table with the latest estimates and intervals."""
    row = int(np.searchsorted(recording["time"], page.evaluate("teleop.last('time')")))
    k, half = recording["rls_k"][row], 1.96 * recording["rls_k_std"][row]
    cell = page.locator("#estimates tbody tr").first.locator(".cell-k").inner_text()
    value, interval = cell.replace("±", "").split()
    assert float(value) == pytest.approx(k, abs=0.51)
    assert float(interval) == pytest.approx(half, abs=0.51)


def check_errors(page, recording):
    """Compare the latest error and the RMS of the last 5 s with the target of the recording."""
    t = np.array(page.evaluate("teleop.series('time')"))
    rows = np.searchsorted(recording["time"], t[t >= t[-1] - 5.0])
    error = 1e3 * (recording["slave_position"] - recording["target"])[rows]
    shown = page.locator("#cue-error").inner_text().replace("\u2212", "-").split()[0]
    assert float(shown) == pytest.approx(error[-1], abs=0.051)
    rms = float(page.locator("#cue-rms").inner_text().split()[0])
    assert rms == pytest.approx(np.sqrt(np.nanmean(error**2)), abs=0.051)


def test_the_slider_moves_to_another_time(page):
    pause(page)
    page.evaluate(
        "(() => { const s = document.getElementById('seek'); s.value = 4;"
        " s.dispatchEvent(new Event('input')); })()"
    )
    wait_for(page, "Math.abs(teleop.last('time') - 4) < 0.02")
    wait_for(page, "document.getElementById('replay-time').textContent.startsWith('4.0')")


TIME = "teleop.last('time')"


def test_the_overview_the_steps_the_events_and_the_strips_change_the_time_of_all_pages(
    recording, serve, open_page
):
    server = serve(feed_of(recording))
    page, operator = open_page(server.url()), open_page(server.url("operator"))
    wait_for(page, "teleop.last('time') > 0.5")
    wait_for(page, f"!({TIME} > 14) && document.getElementById('event').options.length === 3")
    pause(page)
    box = page.locator("#overview").bounding_box()
    page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 10)
    middle = page.evaluate(TIME)
    assert middle == pytest.approx(0.5 * (recording["time"][0] + recording["time"][-1]), abs=0.05)
    wait_for(operator, "(t) => teleop.last('time') === t", middle)
    times = recording["time"]
    for press, steps in (("#forward", 1), ("#back", -1), (".", 1), (",", -1)):
        row = int(np.searchsorted(times, page.evaluate(TIME)))
        page.keyboard.press(press) if len(press) == 1 else page.click(press)
        assert page.evaluate(TIME) == times[row + 2 * steps]  # 250 of 500 rows per second
    assert page.evaluate(TIME) == middle
    plot = page.locator(".strip-force .plot").bounding_box()
    page.mouse.move(plot["x"] + 300, plot["y"] + 5)
    page.mouse.down()
    page.mouse.move(plot["x"] + 300 + 0.2 * plot["width"], plot["y"] + 5)
    page.mouse.up()
    view = page.evaluate("teleop.view()")
    assert view["follows"]  # the whole page shows this time
    assert page.evaluate(TIME) == pytest.approx(middle - 0.2 * 11.2, abs=0.05)
    page.select_option("#event", index=2)
    end = next(e["time"] for e in recording.events if e["mode"] == "stopping")
    assert page.locator("#event option").nth(2).inner_text() == "15.0 s: end of the trial"
    assert page.evaluate(TIME) == pytest.approx(end, abs=5e-3)
    wait_for(operator, f"Math.abs({TIME} - {end}) < 0.005")


def test_space_pauses_and_plays_and_there_is_no_stop(page):
    assert not page.get_by_role("button", name="STOP").is_visible()
    page.keyboard.press(",")  # a step also pauses; the replay may have ended before
    wait_for(page, "document.getElementById('play').textContent === 'Play'")
    page.locator("#seek").fill("1")  # near its end, it would play only for a moment
    wait_for(page, "teleop.last('time') < 3")
    page.locator("#strips").focus()
    page.keyboard.press("Space")
    wait_for(page, "document.getElementById('play').textContent === 'Pause'")
    page.keyboard.press("Space")
    wait_for(page, "document.getElementById('play').textContent === 'Play'")


def test_texts_of_a_recording_are_not_read_as_html(page):
    assert "<img src=x" in page.locator("#subject").inner_text()
    assert page.locator("#subject img").count() == 0


def test_the_operator_view_shows_cue_and_force(recording, serve, open_page):
    page = open_page(serve(feed_of(recording)).url("operator"))
    wait_for(page, "teleop.last('time') > 1")
    picture = "document.getElementById('pursuit').toDataURL()"
    before = page.evaluate(picture)
    wait_for(page, "(t) => teleop.last('time') > t", page.evaluate("teleop.last('time') + 0.3"))
    assert page.evaluate(picture) != before
    wait_for(page, "document.getElementById('force-text').textContent.endsWith(' N')")
    wait_for(page, "document.getElementById('cue-error').textContent.endsWith(' mm')")
    assert json.loads(page.evaluate("JSON.stringify(teleop.state())"))["view"] == "operator"
