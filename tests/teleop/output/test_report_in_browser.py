"""A report page in a headless browser: first screen, phone, dark mode, length."""

from __future__ import annotations

import shutil

import pytest

from teleop.cli import main

pytestmark = pytest.mark.real_time

BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "hard.mcap"
    options = ["--clock", "virtual", "--cube", "hard", "--duration", "2.9"]  # interpreted
    assert main(["run", *options, "--record", str(path)]) == 0
    assert main(["report", str(path), "--estimators", "rls,rls_conditional,me_switching"]) == 0
    return path.with_suffix(".html").as_uri()


@pytest.fixture(scope="module")
def tab():
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    path = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if path is None:
        pytest.skip(f"needs a browser: one of {', '.join(BROWSERS)}")
    with playwright.sync_playwright() as run:
        started = run.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield started.new_page()
        started.close()


def show(tab, address, size, scheme="light"):
    tab.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
    tab.emulate_media(color_scheme=scheme)
    tab.goto(address)
    return tab


@pytest.mark.parametrize("size", [(1280, 720), (1024, 768)])
def test_the_first_screen_has_k_b_their_marks_and_the_force_over_depth(tab, address, size):
    page = show(tab, address, size)
    for found in (*page.locator(".value").all(), page.locator(".result figure svg")):
        box = found.bounding_box()
        assert box["y"] >= 0.0
        assert box["y"] + box["height"] <= size[1]
    assert page.locator(".mark").count() == 3


@pytest.mark.parametrize("size", [(390, 844), (320, 640), (768, 1024), (1280, 720)])
def test_the_page_does_not_scroll_sideways_also_with_all_details_open(tab, address, size):
    page = show(tab, address, size)
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    page.evaluate("document.querySelectorAll('details').forEach((one) => (one.open = true))")
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]


def test_the_first_remark_states_that_k_and_b_contain_the_transmission(tab, address):
    remarks = show(tab, address, (1280, 720)).locator(".remarks li")
    assert remarks.nth(0).inner_text() == "k and b are those of specimen and transmission in series"
    assert remarks.nth(1).inner_text() == (
        "k and b are corrected for a lag of 2.66 ms and lost motion of 122 um"
    )


def test_the_page_is_at_most_three_screens_long(tab, address):
    assert show(tab, address, (1280, 720)).evaluate("document.body.scrollHeight") <= 3 * 720


@pytest.mark.parametrize(
    ("scheme", "ground", "text"),
    [
        ("light", "rgb(238, 240, 243)", "rgb(22, 25, 29)"),
        ("dark", "rgb(15, 18, 21)", "rgb(240, 242, 244)"),
    ],
)
def test_page_and_figures_follow_the_colour_scheme_of_the_system(
    tab, address, scheme, ground, text
):
    page = show(tab, address, (1280, 720), scheme)
    colour = "(selector, name) => getComputedStyle(document.querySelector(selector))[name]"
    assert page.evaluate(f"({colour})('body', 'backgroundColor')") == ground
    assert page.evaluate(f"({colour})('body', 'color')") == text
    assert page.evaluate(f"({colour})('figure svg text', 'fill')") == text


def test_a_printed_page_is_bright(tab, address):
    page = show(tab, address, (1280, 720), "dark")
    page.emulate_media(media="print", color_scheme="dark")
    fill = "getComputedStyle(document.querySelector('figure svg text')).fill"
    try:
        assert page.evaluate(fill) == "rgb(22, 25, 29)"
    finally:
        page.emulate_media(media="screen")
