"""A headless browser, and servers of the live page that it opens."""

from __future__ import annotations

import asyncio
import contextlib
import math
import shutil
import threading
import time
from collections import deque

import numpy as np
import pytest

from teleop.live.feed import Feed, estimator_indices, shown_columns
from teleop.live.history import History
from teleop.live.security import Gate
from teleop.live.server import Server, read_pages
from teleop.streams.columns import COLUMNS, DROPPED, FEEDBACK_COLUMNS, POINTER, STATION_COLUMNS

TOKEN = "0123456789abcdef" * 2
BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
RATE = 250.0


WATCH = """() => {
  window.shifts = [];
  window.black = [];
  const name = (node) =>
    node && (node.id || node.className || `${node.nodeName} of ${node.parentElement?.className}`);
  new PerformanceObserver((list) => {
    for (const { sources } of list.getEntries())
      window.shifts.push(sources.map((one) => name(one.node)).join(", "));
  }).observe({ type: "layout-shift" });
  const sample = new OffscreenCanvas(4, 4).getContext("2d", { willReadFrequently: true });
  const isBlack = (canvas) => {
    sample.drawImage(canvas, 0, 0, 4, 4);
    return sample.getImageData(0, 0, 4, 4).data.every((value, i) => i % 4 === 3 || value < 5);
  };
  const painted = new MessageChannel(); // its messages arrive after the frame has been painted
  window.frames = 0;
  painted.port1.onmessage = () => {
    window.frames += 1;
    const canvases = [...document.querySelectorAll("canvas")];
    const shown = canvases.filter((one) => one.clientWidth && one.clientHeight);
    window.black.push(...shown.filter(isBlack).map(name));
  };
  const frame = () => {
    painted.port2.postMessage(0);
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}"""
"""Note each change of the layout, and each canvas that is black when a frame is shown."""


def wait_for(page, expression, argument=None, timeout=10.0):
    """Return the value of a JavaScript expression as soon as it is true.

    `wait_for_function` of Playwright does not work under the content security policy of the page.
    """
    end = time.monotonic() + timeout
    while not (value := page.evaluate(expression, argument)):
        assert time.monotonic() < end, f"never true: {expression} {argument or ''}"
        time.sleep(0.02)
    return value


@pytest.fixture(scope="package")  # its event loop must not run in the tests of other folders
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    path = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if path is None:
        pytest.skip(f"needs a browser: one of {', '.join(BROWSERS)}")
    with playwright.sync_playwright() as run:
        started = run.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield started
        started.close()


class Tab:
    """A tab of the browser, and what its pages have requested and reported.

    One tab is used for many tests, because a new tab starts a process and needs more time than
    everything else in most of the tests. Each test has its own server at its own port, so
    that a page finds nothing that another page has left.
    """

    def __init__(self, browser):
        self.page = browser.new_context().new_page()
        self.requested, self.problems = [], []
        self.page.on("console", self._note_error)
        self.page.on("pageerror", lambda error: self.problems.append(str(error)))
        self.page.on("request", lambda request: self.requested.append(request.url))

    def _note_error(self, message):
        if message.type == "error":
            self.problems.append(message.text)

    def open(self, url, size, scheme):
        width, height = size
        self.page.set_viewport_size({"width": width, "height": height})
        self.page.emulate_media(color_scheme=scheme)
        self.page.goto(url)
        wait_for(self.page, "Boolean(window.teleop && teleop.state().mode)")

    def leave(self):
        """Leave the page, and release the mouse."""
        self.page.goto("about:blank")
        self.page.mouse.up()

    def close(self):
        self.page.context.close()


@pytest.fixture(scope="package")
def tab(browser):
    """The tab in which most tests open their page."""
    shared = Tab(browser)
    yield shared
    shared.close()


@pytest.fixture
def open_page(browser, tab):
    """Return a function that opens a page; at the end of the test, no page may have an error."""
    used, origins = [], set()
    tab.requested.clear()
    tab.problems.clear()

    def open_one(url, fake_time=False, size=(1280, 800), scheme="dark"):
        one = Tab(browser) if used or fake_time else tab
        used.append(one)
        if fake_time:
            one.page.clock.install()
        origins.add(url.split("/")[2])
        one.open(url, size, scheme)
        return one.page

    yield open_one
    for one in used:
        one.leave() if one is tab else one.close()
    lost = "WebSocket connection to"  # a test has closed the server
    assert [text for one in used for text in one.problems if lost not in text] == []
    others = [url for one in used for url in one.requested if not url.startswith("data:")]
    assert {url.split("/")[2] for url in others} <= origins


class Serving:
    """A server of the live page in a thread, which can be closed early.

    With `delay`, pages connect through this proxy. With `quick`, a new question can be answered
    after a tenth of the usual time.
    """

    def __init__(self, feed, delay=None, quick=False):
        self._delay = delay
        self._pages = read_pages()
        if quick:
            controls = self._pages["/controls.js"]
            content = controls.content.replace(b"READING = 700", b"READING = 70")
            assert content != controls.content
            self._pages["/controls.js"] = controls._replace(content=content)
        self._started = threading.Event()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, args=[feed])
        self._thread.start()
        assert self._started.wait(10.0)

    def url(self, view=""):
        return f"http://127.0.0.1:{self._port}/{view}#t={TOKEN}"

    def _run(self, feed):
        self._loop.run_until_complete(self._serve(feed))
        self._loop.close()

    async def _serve(self, feed):
        self._end = asyncio.Event()
        server = Server(feed, TOKEN, self._pages)
        async with (
            server.serving("127.0.0.1", 0) as self._port,
            contextlib.AsyncExitStack() as slow,
        ):
            if self._delay:
                proxy = self._delay.before(f"127.0.0.1:{self._port}")
                self._port = int((await slow.enter_async_context(proxy)).split(":")[1])
                server._gate = Gate("127.0.0.1", "127.0.0.1", self._port)
            sending = asyncio.create_task(server.run())
            self._started.set()
            await self._end.wait()
            sending.cancel()

    def close(self):
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._end.set)
            self._thread.join()


@pytest.fixture
def serve():
    """Return a function that starts a server for a feed."""
    started = []

    def start(feed, delay=None, **options):
        started.append(Serving(feed, delay, **options))
        return started[-1]

    yield start
    for one in started:
        one.close()


class TrialFeed(Feed):
    """A trial that moves the slave along a sine and carries out the requests of the page."""

    def __init__(
        self,
        mode="active",
        estimators=("rls", "me"),
        further=(),
        values=None,
        station="",
        **trial,
    ):
        self.estimators, self.values = estimators, values or {}
        known = [column.name for column in (*COLUMNS, DROPPED, *POINTER, *FEEDBACK_COLUMNS)]
        known += [column.name for column in STATION_COLUMNS if station]
        parts = ("k", "b", "k_std", "b_std", "held", "misfit")
        known += [f"{name}_{part}" for name in self.estimators for part in (*parts, *further)]
        self.names = shown_columns(known, self.estimators)
        self.history = History(len(self.names))
        self.mode = mode
        self.text = "a text"
        self.is_sending = True
        self.is_over = self.is_faulted = False
        self.prompt = {"number": 1, "answers": ["next", "repeat", "skip", "notes"]}
        self.armed_at = 0.0
        self.lateness = 55e-6
        self.trust = {
            "k": {"mark": "can be used", "reason": "± 1.0 % (rls)"},
            "b": {"mark": "not yet", "reason": "interval ± 65 % (rls)"},
            "supported": [{"k": True, "b": False}] + [{"k": False, "b": False}] * 22,
        }
        self.requests = []
        self.welcome = {
            "type": "welcome",
            "version": 1,
            "kind": "live",
            "columns": [{"name": name, "unit": "-", "meaning": ""} for name in self.names],
            "estimators": estimator_indices(self.names, self.estimators),
            "rate": 1000.0,
            "may_arm": True,
            "pointer": True,
            "choices": {
                "condition": ["free", "mimic"],
                "specimen": ["soft", "hard"],
                "duration": [10.0, 20.0],
                "feedback": ["none", "model-mediated"],
                "estimators": ["rls", "me", "kalman"],
            },
        }
        self.trial = {
            "type": "trial",
            "station": station or None,
            "number": 1,
            "condition": "free",
            "specimen": "soft",
            "duration": 10.0,
            "choice": {
                "condition": "free",
                "specimen": "soft",
                "duration": 10.0,
                "feedback": "none",
                "estimators": ["rls", "me"],
            },
            "rig": "simulated",
            "simulated": True,
            "limits": {
                "soft_position": [-0.01, 0.02],
                "soft_force": 40.0,
                "hard_force": 60.0,
                "max_velocity": 0.2,
            },
            "truth": {"k_surface": 2060.0, "k": 2000.0, "b": 3.0},
            "target": None,
            "feedback": None,
            "explanations": {name: f"what {name} is" for name in self.estimators},
            "operator": "",
            "series": None,
            **trial,
        }
        self.news = deque()  # a test appends in its own thread
        self._start = time.monotonic()
        self._row = 0
        self._lock = threading.Lock()

    def row(self, t):
        depth = 0.008 - 0.006 * math.cos(2.0 * math.pi * t)
        values = dict.fromkeys(self.names, 0.0) | {
            "time": t,
            "slave_position": depth,
            "contact_force": 2000.0 * depth,
            "target": 0.008,
            "k_bound": 0.01,
            "b_bound": 0.1,
            "mode": 3.0,
            "rls_k": 2000.0 + t,
            "rls_k_std": 10.0,
            "rls_b": 3.0,
            "rls_b_std": 1.0,
            "me_k": 2100.0,
            "me_k_std": 40.0,
            "me_held": 1.0,
            "me_misfit": 0.12,
            **self.values,
        }
        return [values[name] for name in self.names]

    def advance(self):
        end = int((time.monotonic() - self._start) * RATE)
        with self._lock:
            if self.is_sending and end > self._row:
                self.history.add(np.array([self.row(i / RATE) for i in range(self._row, end)]))
                self._row = end
        return [self.news.popleft() for _ in range(len(self.news))]

    def stop_sending(self):
        """Add no more rows, and return the time of the last one [s]."""
        with self._lock:
            self.is_sending = False
            return (self._row - 1) / RATE

    def documents(self):
        return [self.welcome, self.trial]

    def state(self):
        health = {"overruns": 2, "skipped": 1, "dropped": 0, "lateness_max": self.lateness}
        return {
            "mode": self.mode,
            "faulted": self.is_faulted,
            "text": self.text,
            "prompt": self.prompt if self.mode in ("ended", "idle") else None,
            "armed_by": None,
            "armed_at": self.armed_at,
            "loop": "gone" if self.is_over else "running",
            "health": health,
            "trust": self.trust,
        }

    def request(self, request):
        self.requests.append(request)
        if request["type"] == "stop":
            self.mode, self.text = "fault", "emergency stop: STOP was pressed on the page"
        if request["type"] == "start":
            self.mode = "active"
        if request["type"] == "end":
            self.mode = "ended"

    def kinds(self):
        return [request["type"] for request in self.requests]

    def beat(self, seen):
        """Do nothing."""

    def lost(self):
        """Do nothing."""


@pytest.fixture
def trial_feed():
    return TrialFeed
