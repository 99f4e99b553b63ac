"""The server of the live page. Its files are sent by HTTP; data and requests use a WebSocket."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import time
from collections.abc import AsyncIterator, Callable, Mapping
from functools import partial
from http import HTTPStatus
from importlib.resources import files
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.asyncio.server import serve as listen
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from estimation.expected_intervals import LARGEST_EXPECTED
from estimation.misfit import LARGEST_MISFIT
from estimation.quantities import RESULTS, SIGNALS
from teleop.errors import InputError, reason
from teleop.live.cells import LONGEST_ROUND_TRIP
from teleop.live.clients import MOST_CLIENTS, Client, Control
from teleop.live.downloads import Downloads, Page
from teleop.live.feed import Feed
from teleop.live.limited_connection import LimitedConnection
from teleop.live.requests import IN_CONTROL, LONGEST_MESSAGE, BadRequest, parse_request
from teleop.live.security import HEADERS, Gate, is_token, new_token, resolve

KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
"""Media types of the files, by the ending of the file name."""
CHECK = 0.1
"""Time between two checks whether the server must end [s]."""
PERIOD = 1.0 / 60.0
"""Time between two frames of data [s]."""
GREETING = 2.0
"""Time limit for opening a connection, and a second time limit for sending the token [s]."""
REPEAT = 1.0
"""Longest time between two messages `state` [s]."""
VIEWS = ("main", "operator")
QUANTITIES = {
    symbol: {"unit": one.unit, "factor": one.factor, "decimals": one.decimals}
    for symbol, one in (RESULTS | SIGNALS).items()
}
"""How the page shows the quantities, by symbol."""
THRESHOLDS = {"expected": LARGEST_EXPECTED, "misfit": LARGEST_MISFIT}
"""Largest expected half width, as a fraction of the value, and largest misfit of an estimate that
can be used."""


def read_pages() -> dict[str, Page]:
    """Return all files of the live page by the path of their URL.

    The server sends only these files and `Downloads`. No path in a request can select another file.
    """
    pages = {}
    folder = files("teleop.live").joinpath("page")
    for file in folder.iterdir() if folder.is_dir() else ():
        ending = "." + file.name.rpartition(".")[2]
        if file.is_file() and ending in KINDS:
            pages[f"/{file.name}"] = Page(KINDS[ending], file.read_bytes())
    for path, name in (("/", "/index.html"), ("/operator", "/operator.html")):
        if name in pages:
            pages[path] = pages[name]
    return pages


class Server:
    """Sends data to the open live pages (clients), and passes their requests to the data source.

    One task sends all data to the clients, and also the heartbeat to the control process. If this
    task fails, the heartbeat stops, and the control process detects the failure.
    """

    def __init__(
        self,
        feed: Feed,
        token: str,
        pages: Mapping[str, Page],
        downloads: Downloads | None = None,
    ) -> None:
        self.control = Control()
        self._feed = feed
        self._token = token
        self._pages = pages
        self._downloads = downloads
        self._gate = Gate("localhost", "127.0.0.1", 0)
        self._clients: set[Client] = set()
        self.waiting: dict[LimitedConnection, None] = {}
        self._known: object = None
        self._due = 0.0

    @contextlib.asynccontextmanager
    async def serving(self, host: str, port: int) -> AsyncIterator[int]:
        """Serve the page within a `with` block, which gets the port; port 0 for any free port."""
        address = resolve(host)
        quiet = logging.getLogger("teleop.live")
        quiet.setLevel(logging.CRITICAL)  # a refused connection is not shown on the terminal
        create: Any = partial(LimitedConnection, waiting=self.waiting)
        async with listen(
            self._converse,
            address,
            port,
            process_request=self._process_request,
            create_connection=create,
            server_header=None,
            compression=None,
            max_size=LONGEST_MESSAGE,
            max_queue=16,
            open_timeout=GREETING,
            close_timeout=1.0,
            ping_interval=5.0,
            ping_timeout=10.0,
            logger=quiet,
        ) as server:
            used = server.server.sockets[0].getsockname()[1]
            self._gate = Gate(host, address, used)
            yield int(used)

    @property
    def has_clients(self) -> bool:
        """Whether a live page is open."""
        return bool(self._clients)

    async def run(self) -> None:
        """Send the data once per `PERIOD` until the task is cancelled."""
        due = time.monotonic()
        while True:
            self.fan_out()
            due = max(due + PERIOD, time.monotonic() - PERIOD)
            await asyncio.sleep(max(0.0, due - time.monotonic()))

    def fan_out(self) -> None:
        """Send all new messages and rows of data to every client."""
        if self.control.is_silent:
            self._lose_control()
        news = self._feed.advance()
        state = {
            "type": "state",
            **self._feed.state(),
            "clients": len(self._clients),
            "unlocked": self.control.unlocked,
        }
        known = {**state, "health": None}, self.control.holder
        now = time.monotonic()
        is_due = now >= self._due or known != self._known
        if is_due:
            self._known, self._due = known, now + REPEAT
        frames: dict[tuple[int, bool], tuple[bytes, int]] = {}
        for client in list(self._clients):
            own = {"view": client.view, "control": self.control.of(client)}
            for document in self._feed.documents() if client.is_new else news:
                if document["type"] == "welcome":
                    shown = {"quantities": QUANTITIES, "thresholds": THRESHOLDS}
                    document = {**document, **own, **shown}
                client.send(document)
            if is_due or client.is_new:
                client.send({**state, **own})
            client.is_new = False
            client.send_rows(self._feed.history, frames)

    def _lose_control(self) -> None:
        if self.control.holder:
            self.control.release(self.control.holder)
            self._feed.lost()

    async def _process_request(
        self, connection: ServerConnection, request: Request
    ) -> Response | None:
        """Return a file of the live page, or the reason of a refusal; None to open a WebSocket."""
        path = request.path
        refusal = self._gate.refusal(request.headers.get_all, path == "/ws")
        if refusal:
            return response(HTTPStatus.FORBIDDEN, Page("text/plain", f"{refusal}\n".encode()))
        if path == "/ws":
            return None
        if page := self._pages.get(path):
            return response(HTTPStatus.OK, page)
        if self._downloads and (page := await self._downloads.page(path)):
            assert isinstance(connection, LimitedConnection)
            connection.send_completely()
            return response(HTTPStatus.OK, page)
        return response(HTTPStatus.NOT_FOUND, Page("text/plain", b"not found\n"))

    async def _converse(self, connection: ServerConnection) -> None:
        """Receive the requests of a connection until the connection ends."""
        assert isinstance(connection, LimitedConnection)
        client = Client(connection)
        try:
            async with asyncio.timeout(GREETING):
                hello = parse_request(await connection.recv())
            if hello["type"] != "hello" or not is_token(hello["token"], self._token):
                raise BadRequest("Wrong token: open the address that the command printed.")
            if hello["view"] not in VIEWS:
                raise BadRequest(f"view: expected one of {', '.join(VIEWS)}")
            if len(self._clients) >= MOST_CLIENTS:
                raise BadRequest(f"{MOST_CLIENTS} pages are open: close one of them.")
        except (BadRequest, TimeoutError) as error:
            await connection.close(1008, str(error)[:100])
            return
        except ConnectionClosed:
            return
        client.view = hello["view"]
        connection.admit()
        self._clients.add(client)
        try:
            async for message in connection:
                self._receive(client, parse_request(message))
        except BadRequest as error:
            await connection.close(1008, str(error)[:100])
        except ConnectionClosed:
            pass
        finally:
            self._clients.discard(client)
            if self.control.holder is client:
                self._lose_control()

    def _receive(self, client: Client, request: dict[str, Any]) -> None:
        """Carry out a request of a client, or send the client the reason for a refusal."""
        kind = request["type"]
        if kind == "beat":
            client.confirm(request["seen"])
            client.send({"type": "echo", "at": request["at"]})
            if self.control.beat(client):
                self._feed.beat(client.seen)
        elif kind == "control":
            if self.control.ask(client):
                self._feed.beat(client.seen)
        elif kind == "release":
            if self.control.holder is client:
                self._lose_control()
        elif kind in IN_CONTROL and self.control.holder is not client:
            client.send({"type": "error", "text": f"{kind}: expected the client in control"})
        elif kind in ("unlock", "start") and client.age > LONGEST_ROUND_TRIP:
            text = f"{kind}: the connection of this page is too slow to arm the drives"
            limit = f"expected at most {LONGEST_ROUND_TRIP:g} s"
            client.send(
                {"type": "error", "text": f"{text}: round trip {client.age:.1f} s, {limit}"}
            )
        elif kind == "unlock":
            self.control.unlock()
        elif kind == "start" and not self.control.unlocked:
            client.send({"type": "error", "text": "start: expected UNLOCK within 2 s before it"})
        elif kind == "hello":
            raise BadRequest("hello: expected once")
        else:
            try:
                self._feed.request(request)
            except BadRequest as error:
                client.send({"type": "error", "text": str(error)})
            if kind == "start":
                self.control.lock()


def response(status: HTTPStatus, page: Page) -> Response:
    """Return an HTTP response that contains a page and the security headers."""
    usual = {**HEADERS, "Content-Type": page.kind, "Connection": "close"}
    headers = Headers(usual | dict(page.headers))
    headers["Content-Length"] = str(len(page.content))
    return Response(status.value, status.phrase, headers, page.content)


def page_url(host: str, port: int, token: str) -> str:
    """Return the URL of the live page with the token, which permits a page to connect.

    The token is in the fragment (after `#`), because a browser does not send this part of a URL.
    """
    name = f"[{host}]" if ":" in host else host
    return f"http://{name}:{port}/#t={token}"


async def serve(
    stopped: Callable[[], bool],
    feed: Feed,
    host: str,
    port: int,
    ready: Callable[[str], object],
    farewell: float = 0.0,
    downloads: Downloads | None = None,
) -> None:
    """Serve the live page until `stopped` returns True; `ready` gets its URL when it is open.

    After that, open pages are informed for at most the time `farewell` [s]. `downloads` are the
    files that the feed offers.
    """
    if not 0 <= port <= 65535:
        raise InputError(f"port {port}: expected 0 to 65535")
    token = new_token()
    server = Server(feed, token, read_pages(), downloads)
    try:
        serving = server.serving(host, port)
        used = await serving.__aenter__()
    except OSError as error:
        raise InputError(f"{host}, port {port}: cannot be used: {reason(error)}") from error
    try:
        sending = asyncio.create_task(server.run())
        ready(page_url(host, used, token))
        end = math.inf
        while time.monotonic() < end:
            done, _ = await asyncio.wait([sending], timeout=CHECK)
            if done:
                sending.result()
            if end == math.inf and stopped():
                end = time.monotonic() + farewell
            if end < math.inf and not server.has_clients:
                break
        sending.cancel()
    finally:
        await serving.__aexit__(None, None, None)
