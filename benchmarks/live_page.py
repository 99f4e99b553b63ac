"""Measure the live page in a headless browser: frame rate, processor time, and latencies.

    python benchmarks/live_page.py              # 30 s of palpation with the mouse, 30 stops

A headless Chromium without a graphics processor opens the page of `teleop run --live`, starts the
trials, palpates with the mouse, and presses STOP. The results are

- the frame rate, and the processor time of the page (renderer and graphics process), both also for
  a page that only fills a rectangle of the same size as the window in each frame;
- sensor to pixel: the time from the write of a tick by the loop to the frame that follows the frame
  in which the page draws this tick;
- click to stop: the time from the key event to the first tick in another mode than active. The page
  receives every fourth tick, so that this time is up to 4 ms too long.

The benchmark needs playwright, psutil, and a Chromium of the system.
"""

from __future__ import annotations

import argparse
import math
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from playwright.sync_api import Page, sync_playwright

RESULTS = Path(__file__).parent / "results" / "live-page.txt"
ACTIVE = 3.0
PEER = """<canvas id=c width=1280 height=800></canvas>"""
MOVE = """() => {
  const context = document.getElementById('c').getContext('2d', {alpha: false});
  let n = 0;
  const draw = () => {
    requestAnimationFrame(draw);
    context.fillStyle = n++ % 2 ? '#111' : '#222';
    context.fillRect(0, 0, 1280, 800);
  };
  draw();
}"""
WATCH = """() => {
  window.shown = [];
  let drawn = NaN;
  const frame = (now) => {
    if (drawn === drawn) window.shown.push([drawn, performance.now()]);
    const newest = teleop.last('sent');
    drawn = newest === window.before ? NaN : newest;
    window.before = newest;
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
  window.pressed = NaN;
  addEventListener('keydown', () => { window.pressed = performance.now(); }, {capture: true});
}"""


def clock_offset(page: Page) -> float:
    """Return the monotonic clock minus the clock of the page [s]."""
    best = (math.inf, math.nan)
    for _ in range(200):
        before = time.monotonic()
        shown = page.evaluate("performance.now()") / 1e3
        after = time.monotonic()
        best = min(best, (after - before, (before + after) / 2 - shown))
    return best[1]


def processor_times() -> dict[str, float]:
    """Return the processor time of the processes of the browser by their kind [s]."""
    times: dict[str, float] = {}
    for process in psutil.Process().children(recursive=True):
        try:
            kind = re.search(r"--type=([\w-]+)", " ".join(process.cmdline()))
            if kind:
                used = process.cpu_times()
                times[kind[1]] = times.get(kind[1], 0.0) + used.user + used.system
        except psutil.Error:
            continue
    return times


def load_of(page: Page, seconds: float, work: Any = None) -> tuple[float, float]:
    """Return the share of a processor that the page takes, and its frames per second."""
    count = """() => { window.frames_seen = 0;
      const f = () => { window.frames_seen += 1; requestAnimationFrame(f); }; f(); }"""
    page.evaluate(count)
    before, start = processor_times(), time.monotonic()
    first = page.evaluate("window.frames_seen")
    while time.monotonic() - start < seconds:
        if work:
            work(time.monotonic() - start)
        time.sleep(0.03)
    duration = time.monotonic() - start
    frames = page.evaluate("window.frames_seen") - first
    after = processor_times()
    used = sum(after[kind] - before[kind] for kind in ("renderer", "gpu-process"))
    return used / duration, frames / duration


def wait_for(page: Page, expression: str, seconds: float = 15.0) -> None:
    """Wait until a JavaScript expression is true."""
    end = time.monotonic() + seconds
    while not page.evaluate(expression):
        if time.monotonic() > end:
            raise TimeoutError(expression)
        time.sleep(0.01)


def start_trial(page: Page) -> None:
    """Start a trial from the page."""
    page.click("#unlock")
    page.click("#start")
    wait_for(page, f"teleop.last('mode') === {ACTIVE}")


def palpate(page: Page) -> Any:
    """Press and hold the mouse; return a function of the time [s] that moves the mouse."""
    box = page.locator("#tool").bounding_box()
    assert box is not None
    x = box["x"] + box["width"] / 2

    def move(t: float) -> None:
        page.mouse.move(x, box["y"] + box["height"] * (0.62 - 0.18 * math.cos(4.0 * t)))

    move(0.0)
    page.mouse.down()
    return move


def stop_time(page: Page, offset: float) -> float:
    """Press Escape in a running trial; return the time to the first tick that is not active [s]."""
    page.keyboard.press("Escape")
    wait_for(page, f"teleop.last('mode') !== {ACTIVE}")
    modes = np.array(page.evaluate("teleop.series('mode')"))
    sent = np.array(page.evaluate("teleop.series('sent')"))
    last_active = int(np.flatnonzero(modes == ACTIVE)[-1])
    return float(sent[last_active + 1] - offset - page.evaluate("window.pressed") / 1e3)


def measure(url: str, page: Page, seconds: float, stops: int) -> list[str]:
    """Return the lines of the result."""
    page.goto(url)
    wait_for(page, "Boolean(window.teleop && teleop.state().mode === 'ready')")
    page.evaluate(WATCH)
    start_trial(page)
    move = palpate(page)
    used, rate = load_of(page, seconds, move)
    offset = clock_offset(page)
    drawn, seen = np.array(page.evaluate("window.shown"), float).T
    latency = 1e3 * (seen / 1e3 + offset - drawn)
    page.mouse.up()
    times = []
    for _ in range(stops):
        times.append(1e3 * stop_time(page, offset))
        wait_for(page, "['fault', 'ended'].includes(teleop.state().mode)")
        page.locator("#next").wait_for(state="visible")
        page.locator("#summary-close").click(timeout=5000)
        page.click("#next")
        wait_for(page, "teleop.state().mode === 'ready'")
        start_trial(page)
        time.sleep(0.5)
    p50, p99 = np.percentile(latency, (50, 99))
    s50, s99 = np.percentile(times, (50, 99))
    return [
        f"page: {rate:.1f} frames/s, {used:.0%} of a processor",
        f"sensor to pixel: p50 {p50:.1f} ms, p99 {p99:.1f} ms, {len(latency)} frames",
        f"click to stop: p50 {s50:.1f} ms, p99 {s99:.1f} ms, {stops} stops, the longest "
        + ", ".join(f"{time:.1f}" for time in sorted(times)[-5:]),
    ]


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--stops", type=int, default=30)
    options = parser.parse_args()
    command = ["-m", "teleop", "run", "--live", "--operator", "pointer", "--no-record"]
    trial = subprocess.Popen(
        [sys.executable, *command, "--duration", str(options.seconds + 20.0)],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )
    try:
        assert trial.stderr is not None
        url = next(line for line in trial.stderr if "http" in line).split()[-1]
        with sync_playwright() as playwright:
            path = shutil.which("chromium") or shutil.which("chromium-headless-shell")
            browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            lines = measure(url, page, options.seconds, options.stops)
            page.close()
            peer = browser.new_page(viewport={"width": 1280, "height": 800})
            peer.set_content(PEER)
            peer.evaluate(MOVE)
            used, rate = load_of(peer, 10.0)
            lines.insert(
                1, f"a page that fills a rectangle: {rate:.1f} frames/s, {used:.0%} of a processor"
            )
            lines.append(f"load average of the machine: {os.getloadavg()[0]:.1f}")
            browser.close()
    finally:
        trial.terminate()
        trial.wait()
    print("\n".join(lines))
    RESULTS.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
