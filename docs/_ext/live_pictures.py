"""Make the pictures and the animation of the live page in `docs/images`.

    python docs/_ext/live_pictures.py

A headless Chromium opens the page of `teleop run --live --operator pointer`, starts a trial,
palpates the simulated cube with the mouse, and waits for the result. This gives `live.png` and the
animation `live.webp`. `live-mimic.png` shows a recording of the condition `mimic`.

The script needs playwright, Pillow, the extra `live`, and a Chromium of the system.
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import io
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

ROOT = Path(__file__).parents[2]
IMAGES = ROOT / "docs" / "images"
BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
SIZE = {"width": 1280, "height": 720}
MODEL = ("--model", "stiffening", "--estimators", "rls,kalman")
"""Options of the palpation: the estimators have the model of the cube."""
DURATION = 15
"""Duration of the palpation [s]."""
STILL = 10.5
"""Time of the picture in the trial [s]."""
HOLD = 2.5
"""Time for which the animation shows the result [s]."""
PERIOD = 0.1
"""Period of the frames of the animation [s]."""
STANDSTILL = 8
"""Largest number of equal frames, so that the animation does not wait for the evaluation."""
WIDTH = 960
"""Width of the animation [pixels]."""
LARGEST = 1_500_000
"""Largest size of the animation [bytes]."""
RESULT = """document.getElementById('summary').open
  && document.getElementById('summary-title').textContent.includes('can be used')"""
"""Whether the page shows the result."""
MIMIC_TIME = 14.0
"""Time of the picture in the recording of the condition `mimic` [s]."""


def wait_for(page: Page, expression: str, seconds: float = 20.0) -> None:
    """Wait until a JavaScript expression is true.

    `wait_for_function` of Playwright does not work under the content security policy of the page.
    """
    end = time.monotonic() + seconds
    while not page.evaluate(expression):
        if time.monotonic() > end:
            raise TimeoutError(expression)
        page.wait_for_timeout(20)


@contextlib.contextmanager
def served(*arguments: str) -> Iterator[str]:
    """Run a command that serves the live page; give the address of the page."""
    process = subprocess.Popen(
        [sys.executable, "-m", "teleop", *arguments],
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stderr is not None
        yield next(line for line in process.stderr if "http" in line).split()[-1]
    finally:
        process.terminate()
        process.wait()


def opened(browser: Browser, url: str, scheme: Any) -> Page:
    """Open the live page."""
    page = browser.new_page(viewport=SIZE, color_scheme=scheme)
    page.goto(url)
    wait_for(page, "Boolean(window.teleop && teleop.state().mode)")
    return page


class Screencast:
    """The frames that the browser shows, with their times [s]."""

    def __init__(self, page: Page) -> None:
        self.frames: list[tuple[float, bytes]] = []
        self._session = page.context.new_cdp_session(page)
        self._session.on("Page.screencastFrame", self._add)
        self._session.send(
            "Page.startScreencast", {"format": "jpeg", "quality": 92, "everyNthFrame": 4}
        )

    def _add(self, event: dict[str, Any]) -> None:
        self.frames.append((event["metadata"]["timestamp"], base64.b64decode(event["data"])))
        self._session.send("Page.screencastFrameAck", {"sessionId": event["sessionId"]})

    def stop(self) -> None:
        """Take no more frames."""
        self._session.send("Page.stopScreencast")


MOVE = """([x, top, height]) => {
  const tool = document.getElementById('tool');
  const start = performance.now();
  const move = (now) => {
    const phase = 2 * Math.PI * 0.8 * (now - start) / 1e3;
    const depth = 0.56 - 0.14 * Math.cos(phase) - 0.05 * Math.cos(0.37 * phase);
    const place = { clientX: x, clientY: top + height * depth };
    const pressed = { pointerId: 1, pointerType: 'mouse', buttons: 1, isPrimary: true };
    tool.dispatchEvent(new PointerEvent('pointermove', { bubbles: true, ...pressed, ...place }));
    requestAnimationFrame(move);
  };
  requestAnimationFrame(move);
}"""
"""Move the pressed pointer in each frame: also on a busy machine, the motion is even."""


def press_and_palpate(page: Page) -> None:
    """Press the mouse in the picture of the tool, and move it down and up from now on."""
    box = page.locator("#tool").bounding_box()
    assert box is not None
    x = box["x"] + box["width"] / 2
    page.mouse.move(x, box["y"] + box["height"] * 0.37)
    page.mouse.down()
    page.evaluate(MOVE, [x, box["y"], box["height"]])


def record_palpation(browser: Browser) -> list[Image.Image]:
    """Palpate with the mouse; write the picture, and return the frames of the animation."""
    command = ("run", "--live", "--operator", "pointer", "--duration", str(DURATION), *MODEL)
    with tempfile.TemporaryDirectory() as folder:
        recording = ("--record", str(Path(folder) / "trial.mcap"))
        with served(*command, *recording) as url:
            page = opened(browser, url, "dark")
            wait_for(page, "teleop.state().mode === 'ready'")
            page.click("#unlock")
            page.click("#start")
            wait_for(page, "teleop.state().mode === 'active'")
            press_and_palpate(page)
            page.wait_for_timeout(1e3 * STILL)
            page.screenshot(path=IMAGES / "live.png")
            cast = Screencast(page)
            page.wait_for_timeout(1e3 * (DURATION - STILL))
            wait_for(page, "teleop.state().mode === 'ended'")
            wait_for(page, RESULT)
            page.wait_for_timeout(1000)
            cast.stop()
            page.close()
    return regular(cast.frames)


def regular(frames: list[tuple[float, bytes]]) -> list[Image.Image]:
    """Return the newest frame of each period, in the size of the animation."""
    start, end = frames[0][0], frames[-1][0]
    chosen, index = [], 0
    for number in range(int((end - start) / PERIOD) + 1):
        while index + 1 < len(frames) and frames[index + 1][0] <= start + number * PERIOD:
            index += 1
        if chosen[-STANDSTILL:] != [index] * STANDSTILL:
            chosen.append(index)
    size = (WIDTH, WIDTH * SIZE["height"] // SIZE["width"])
    return [
        Image.open(io.BytesIO(frames[i][1])).convert("RGB").resize(size, Image.Resampling.LANCZOS)
        for i in chosen
    ]


def write_animation(frames: list[Image.Image], path: Path) -> None:
    """Write the animation with the best quality at which it is not too large."""
    durations = [round(1e3 * PERIOD)] * len(frames)
    durations[-1] = round(1e3 * HOLD)
    for quality in (80, 70, 60, 50, 40):
        frames[0].save(
            path,
            save_all=True,
            append_images=frames[1:],
            duration=durations,
            loop=0,
            quality=quality,
            method=4,
            minimize_size=False,
        )
        if path.stat().st_size < LARGEST:
            print(f"{path.name}: {len(frames)} frames, quality {quality}")
            return
    raise ValueError(f"{path.name} is larger than {LARGEST} bytes")


def picture_mimic(browser: Browser) -> None:
    """Show a recording of the condition `mimic`, and write its picture."""
    with tempfile.TemporaryDirectory() as folder:
        trial = str(Path(folder) / "trial.mcap")
        command = ("run", "--condition", "mimic", "--clock", "virtual", "--duration", "20")
        subprocess.run(
            [sys.executable, "-m", "teleop", *command, "--record", trial],
            cwd=ROOT,
            check=True,
            stdout=subprocess.DEVNULL,
        )
        with served("live", trial) as url:
            page = opened(browser, url, "light")
            page.evaluate(
                """(t) => {
                  const seek = document.getElementById('seek');
                  seek.value = t;
                  seek.dispatchEvent(new Event('input', {bubbles: true}));
                }""",
                MIMIC_TIME,
            )
            page.wait_for_timeout(2000)
            page.screenshot(path=IMAGES / "live-mimic.png")
            page.close()


def main() -> None:
    """Make the pictures and the animation."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    os.environ["PYTHONPATH"] = str(ROOT)
    with sync_playwright() as playwright:
        path = next((found for name in BROWSERS if (found := shutil.which(name))), None)
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        picture_mimic(browser)
        frames = record_palpation(browser)
        browser.close()
    write_animation(frames, IMAGES / "live.webp")
    for name in ("live.png", "live-mimic.png", "live.webp"):
        print(f"{name}: {(IMAGES / name).stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
