"""A client of the live page for tests, and a server with a given feed in this process."""

from __future__ import annotations

import asyncio
import contextlib
import json
import struct

import numpy as np
from websockets.asyncio.client import connect

from teleop.live.server import Server

TOKEN = "0123456789abcdef" * 2


@contextlib.asynccontextmanager
async def served(feed, pages=None, downloads=None):
    """Serve a feed; yield the server and its address."""
    server = Server(feed, TOKEN, pages or {}, downloads)
    async with server.serving("127.0.0.1", 0) as port:
        task = asyncio.create_task(server.run())
        try:
            yield server, f"127.0.0.1:{port}"
            assert not task.done(), task.exception()
        finally:
            task.cancel()


async def until(condition, step=lambda: None):
    """Repeat a step until a condition is true."""
    async with asyncio.timeout(20.0):
        while not condition():
            step()
            await asyncio.sleep(0.01)


class Client:
    """A page: it receives everything and keeps the latest message of each kind."""

    def __init__(self, connection):
        self.connection = connection
        self.latest = {}
        self.rows = None
        self.frames = []
        self.errors = []
        self.seen = 0.0
        """Time in the newest frame."""

    async def send(self, kind, **fields):
        await self.connection.send(json.dumps({"type": kind, **fields}))

    async def answer(self, kind, question="", **fields):
        """Wait for a question that contains a text, and answer it."""
        await self.until(lambda: self.prompt and question in self.latest["state"]["text"])
        await self.send(kind, prompt=self.prompt["number"], **fields)

    @property
    def prompt(self):
        """Number and possible answers of the present question; None without a question."""
        return self.latest.get("state", {}).get("prompt")

    async def beat(self):
        await self.send("beat", seen=self.seen, at=0.0)

    async def receive(self):
        message = await self.connection.recv()
        if isinstance(message, bytes):
            kind, rows, columns, flags, sent = struct.unpack_from("<IIIId", message)
            assert kind == 1
            values = np.frombuffer(message, "<f8", offset=24).reshape(rows, columns)
            self.seen = sent
            self.frames.append((flags, sent, values))
            kept = self.rows is not None and not flags & 1
            self.rows = np.vstack([self.rows, values]) if kept else values
            return "rows"
        document = json.loads(message)
        self.latest[document["type"]] = document
        if document["type"] == "error":
            self.errors.append(document["text"])
        return document["type"]

    async def until(self, condition, seconds=30.0):
        """Receive until a condition is true."""
        async with asyncio.timeout(seconds):
            while not condition():
                await self.receive()

    async def receive_for(self, seconds):
        """Receive, and confirm the data as a page does, for some time."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while True:
                    if await self.receive() == "rows":
                        await self.beat()

    def is_in(self, mode):
        return lambda: self.latest.get("state", {}).get("mode") == mode

    def column(self, name):
        names = [column["name"] for column in self.latest["welcome"]["columns"]]
        return self.rows[:, names.index(name)]


@contextlib.asynccontextmanager
async def page(address, token=TOKEN, view="main", greet=True, through=None, **options):
    """Connect as the page of a server does, directly or through a proxy at another address."""
    closing = {"close_timeout": 0.2}  # a server that hangs, or a client that does not read
    settings = {"origin": f"http://{address}", "compression": None, **closing, **options}
    if through:
        host, port = through.split(":")
        settings |= {"host": host, "port": int(port)}
    async with connect(f"ws://{address}/ws", **settings) as connection:
        client = Client(connection)
        if greet:
            await client.send("hello", token=token, view=view)
        yield client
