"""Clients that may not connect, that send nonsense, too much, or nothing, or that do not read."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.server import ServerProtocol

from teleop.live.clients import MOST_CLIENTS, MOST_UNSENT_TEXT
from teleop.live.feed import Feed
from teleop.live.history import History
from teleop.live.limited_connection import LONGEST_HEAD, MOST_FRAMES, MOST_WAITING
from teleop.live.security import HEADERS, new_token
from teleop.live.server import Page, Server

from .live_client import TOKEN, page, served, until

pytestmark = pytest.mark.real_time

PAGES = {"/": Page("text/html; charset=utf-8", b"<!doctype html>")}


class Quiet(Feed):
    """A feed that records the requests."""

    def __init__(self):
        self.history = History(2)
        self.requests = []
        self.lost_count = 0
        self.size = 0

    def advance(self):
        return [{"type": "filler", "text": "x" * self.size}] if self.size else []

    def documents(self):
        return [{"type": "welcome", "columns": []}]

    def state(self):
        return {"mode": "ready"}

    def request(self, request):
        self.requests.append(request["type"])

    def beat(self, seen):
        pass

    def lost(self):
        self.lost_count += 1


@pytest.fixture
def feed():
    return Quiet()


def run(coroutine):
    return asyncio.run(asyncio.wait_for(coroutine, 60.0))


async def closed(client):
    """Receive until the connection is closed; return the code, or None for an aborted one."""
    async with asyncio.timeout(10.0):
        while True:
            try:
                await client.receive()
            except ConnectionClosed as error:
                return error.rcvd.code if error.rcvd else None


async def answer(address, *lines, path="/"):
    """Send a raw HTTP request, and return the whole answer."""
    reader, writer = await asyncio.open_connection(*address.split(":"))
    writer.write("\r\n".join([f"GET {path} HTTP/1.1", *lines, "", ""]).encode())
    data = await asyncio.wait_for(reader.read(), 10.0)
    writer.close()
    return data.decode()


UPGRADE = (
    "Upgrade: websocket",
    "Connection: Upgrade",
    "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
)


def test_tokens_have_128_random_bits():
    assert len({new_token() for _ in range(100)}) == 100
    assert all(len(bytes.fromhex(new_token())) == 16 for _ in range(100))


@pytest.mark.parametrize("token", ["", TOKEN[:-1], TOKEN + "0", TOKEN.upper() + "é", "\0" * 32])
def test_a_wrong_token_is_refused_and_receives_no_data(feed, token):
    async def scenario():
        async with served(feed) as (_, address), page(address, token) as client:
            assert await closed(client) == 1008
            assert not client.latest
            assert client.rows is None

    run(scenario())


@pytest.mark.parametrize(
    "first",
    [
        {"type": "stop"},
        {"type": "hello", "token": 1, "view": "main"},
        {"type": "hello", "token": TOKEN, "view": "../main"},
        {"type": "hello", "token": TOKEN},
        {"type": "hello", "token": [TOKEN], "view": "main"},
    ],
)
def test_the_first_message_must_be_a_valid_hello(feed, first):
    async def scenario():
        async with served(feed) as (_, address), page(address, greet=False) as client:
            await client.connection.send(json.dumps(first))
            assert await closed(client) == 1008

    run(scenario())
    assert not feed.requests


@pytest.mark.parametrize("origin", [None, "http://evil.example", "null", "https://127.0.0.1"])
def test_a_page_of_another_origin_cannot_open_the_websocket(feed, origin):
    async def scenario():
        async with served(feed) as (_, address):
            with pytest.raises(InvalidStatus) as refused:
                async with page(address, origin=origin):
                    pass
            assert refused.value.response.status_code == 403

    run(scenario())


@pytest.mark.parametrize(
    "lines",
    [
        ["Host: evil.example:{port}", "Origin: http://evil.example:{port}"],
        ["Host: 127.0.0.1", "Origin: http://127.0.0.1"],
        ["Host: {address}", "Host: {address}", "Origin: http://{address}"],
        ["Host: {address}", "Host: evil.example", "Origin: http://{address}"],
        ["Host: {address}", "Origin: http://{address}", "Origin: http://{address}"],
        ["Host: {address}", "Origin: http://{address}", "Origin: http://evil.example"],
        ["Host: {address}", "Origin: http://localhost:{port}"],
        ["Host: {address}, evil.example", "Origin: http://{address}"],
        ["Host: {address}.", "Origin: http://{address}."],
        ["Origin: http://{address}"],
    ],
    ids=lambda lines: " | ".join(lines),
)
@pytest.mark.parametrize("path", ["/", "/ws"])
def test_other_or_duplicate_hosts_and_origins_are_refused(feed, lines, path):
    async def scenario():
        async with served(feed, PAGES) as (_, address):
            port = address.partition(":")[2]
            sent = [line.format(address=address, port=port) for line in lines]
            text = await answer(address, *sent, *(UPGRADE if path == "/ws" else ()), path=path)
            assert text.startswith(("HTTP/1.1 403", "HTTP/1.1 400"))
            assert "doctype" not in text

    run(scenario())


def test_the_page_and_refusals_have_the_security_headers_and_no_cookie(feed):
    async def scenario():
        async with served(feed, PAGES) as (_, address):
            for host, path, status in (
                (address, "/", 200),
                (address, "/etc/passwd", 404),
                (address, "/../../../etc/passwd", 404),
                (address, "/%2e%2e/page.css", 404),
                ("evil.example", "/", 403),
            ):
                text = await answer(address, f"Host: {host}", path=path)
                assert text.startswith(f"HTTP/1.1 {status}")
                for name, value in HEADERS.items():
                    assert f"{name}: {value}\r\n" in text
                assert "cookie" not in text.lower()
                assert "Server:" not in text

    run(scenario())


@pytest.mark.parametrize(
    "message",
    [
        b"\x00\x01",
        "",
        "stop",
        "[]",
        "null",
        '{"type":"stop"',
        '{"type":"stop","force":1}',
        '{"type":"no such"}',
        '{"type":["stop"]}',
        '{"type":"pointer","depth":NaN,"grip":true}',
        '{"type":"pointer","depth":"1","grip":true}',
        '{"type":"pointer","depth":true,"grip":true}',
        '{"type":"pointer","depth":0.1,"grip":1}',
        '{"type":"choose","condition":1}',
        '{"type":"choose","limits":1}',
        "[" * 1000,
        '{"type":"notes","text":"' + "x" * 1100 + '"}',
    ],
)
def test_malformed_and_oversized_messages_close_the_connection(feed, message):
    async def scenario():
        async with served(feed) as (_, address), page(address) as client:
            await client.until(client.is_in("ready"))
            await client.connection.send(message)
            assert await closed(client) in (1008, 1009)
            async with page(address) as other:  # the server goes on
                await other.until(other.is_in("ready"))

    run(scenario())
    assert not feed.requests


def test_a_flooding_client_is_aborted_and_others_are_still_served(feed):
    async def scenario():
        async with served(feed) as (_, address), page(address) as other, page(address) as client:
            await client.until(client.is_in("ready"))
            with contextlib.suppress(ConnectionClosed):
                for n in range(5 * MOST_FRAMES):
                    await client.send("beat", seen=0, at=n)
            assert await closed(client) is None
            await other.until(lambda: other.latest.get("state", {}).get("clients") == 1)
            await other.send("stop")
            await until(lambda: feed.requests == ["stop"])

    run(scenario())


def test_at_most_eight_clients_and_the_place_of_one_that_leaves_is_free(feed):
    async def scenario():
        async with served(feed) as (_, address), contextlib.AsyncExitStack() as stack:
            clients = [await stack.enter_async_context(page(address)) for _ in range(MOST_CLIENTS)]
            for client in clients:
                await client.until(client.is_in("ready"))
            async with page(address) as ninth:
                assert await closed(ninth) == 1008
                assert not ninth.latest
            await clients[0].connection.close()
            async with page(address) as next_one:
                await next_one.until(next_one.is_in("ready"))

    run(scenario())


def test_a_client_that_does_not_read_is_aborted_and_others_are_still_served(feed):
    async def scenario():
        async with served(feed) as (server, address), page(address) as reading:
            await reading.until(reading.is_in("ready"))
            slow = socket.create_connection(address.split(":"))
            slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            head = ["GET /ws HTTP/1.1", f"Host: {address}", f"Origin: http://{address}", *UPGRADE]
            slow.sendall("\r\n".join([*head, "", ""]).encode())
            hello = json.dumps({"type": "hello", "token": TOKEN, "view": "main"}).encode()
            masked = bytes([0x81, 0x80 | len(hello), 0, 0, 0, 0]) + hello
            slow.sendall(masked)
            await reading.until(lambda: reading.latest["state"]["clients"] == 2)
            most = 0
            feed.size = 50_000
            async with asyncio.timeout(20.0):
                while reading.latest["state"]["clients"] == 2:
                    most = max([most, *(client.unsent for client in server._clients)])
                    await reading.receive()
            assert most < MOST_UNSENT_TEXT + 2 * feed.size
            slow.close()

    run(scenario())


def test_half_open_connections_are_closed_and_do_not_keep_others_out(feed, monkeypatch):
    monkeypatch.setattr("teleop.live.server.GREETING", 1.0)

    async def scenario():
        async with served(feed, PAGES) as (server, address):
            host, port = address.split(":")
            with contextlib.ExitStack() as sockets:

                async def connected(count):
                    for number in range(count):
                        one = socket.create_connection((host, int(port)))
                        sockets.enter_context(one)
                        if number % 20 == 0:
                            await asyncio.sleep(0.02)

                await connected(MOST_WAITING + 20)
                await until(lambda: len(server.waiting) == MOST_WAITING)
                async with page(address) as client:
                    await client.until(client.is_in("ready"))
                    await connected(MOST_WAITING)
                    await client.send("stop")
                    await until(lambda: feed.requests == ["stop"])
                    assert len(server.waiting) == MOST_WAITING
                await until(lambda: not server.waiting)
            async with page(address, greet=False) as late:
                assert await closed(late) == 1008

    run(scenario())


def test_too_large_headers_are_neither_stored_nor_parsed(feed, monkeypatch):
    received = []
    process = ServerProtocol.receive_data
    monkeypatch.setattr(
        ServerProtocol,
        "receive_data",
        lambda self, data: (received.append(len(data)), process(self, data)),
    )

    async def scenario():
        async with served(feed, PAGES) as (_, address):
            reader, writer = await asyncio.open_connection(*address.split(":"))
            with contextlib.suppress(ConnectionError):
                writer.write(b"GET / HTTP/1.1\r\n")
                for _ in range(100):
                    writer.write(b"a: " + b"x" * 8000 + b"\r\n")
                    await writer.drain()
                assert await reader.read() == b""
            writer.close()
            assert sum(received) <= LONGEST_HEAD

    run(scenario())


def masked(opcode, content=b""):
    """Return a WebSocket frame of a client."""
    return bytes([opcode, 0x80 | len(content), 0, 0, 0, 0]) + content


SMALL = {
    "pongs": (b"", masked(0x8A)),
    "pings": (b"", masked(0x89, b"1234")),
    "continuations": (masked(0x01), masked(0x00)),
}
"""Small frames that are no messages, and the frame before the first of them."""


@pytest.mark.parametrize("token", [TOKEN, ""])
@pytest.mark.parametrize("kind", SMALL)
def test_a_flood_of_frames_that_are_no_messages_ends_at_the_limit(feed, monkeypatch, kind, token):
    opcodes = []
    process = ServerProtocol.recv_frame
    monkeypatch.setattr(
        ServerProtocol, "recv_frame", lambda self, f: (opcodes.append(f.opcode), process(self, f))
    )

    async def scenario():
        async with served(feed) as (_, address), page(address) as other:
            await other.until(other.is_in("ready"))
            reader, writer = await asyncio.open_connection(*address.split(":"))
            head = ["GET /ws HTTP/1.1", f"Host: {address}", f"Origin: http://{address}", *UPGRADE]
            writer.write("\r\n".join([*head, "", ""]).encode())
            if token:
                hello = json.dumps({"type": "hello", "token": token, "view": "main"}).encode()
                writer.write(masked(0x81, hello))
                await other.until(lambda: other.latest["state"]["clients"] == 2)
            before, one = SMALL[kind]
            opcodes.clear()
            with contextlib.suppress(ConnectionError):
                writer.write(before + 40_000 * one)
                while await asyncio.wait_for(reader.read(1 << 20), 10.0):
                    pass
            writer.close()
            await other.until(lambda: other.latest["state"]["clients"] == 1)
            assert len(opcodes) <= 2 * MOST_FRAMES  # the limit is one per second
            await other.send("stop")
            await until(lambda: feed.requests == ["stop"])

    run(scenario())


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="needs /proc")
def test_no_descriptor_and_no_client_is_left_after_many_connections(feed):
    def descriptors():
        return len(list(Path("/proc/self/fd").iterdir()))

    async def scenario():
        async with served(feed, PAGES) as (server, address):
            before = descriptors()
            for number in range(100):
                async with page(address, TOKEN if number % 3 else "wrong") as client:
                    if number % 3 == 1:
                        await client.until(client.is_in("ready"))
                    elif number % 3 == 2:
                        client.connection.transport.abort()
                await answer(address, f"Host: {address}")
            await until(lambda: not server.waiting)
            assert not server._clients
            assert server.control.holder is None
            assert descriptors() <= before

    run(scenario())


def test_only_the_client_in_control_may_act_but_everybody_may_stop(feed):
    async def scenario():
        async with served(feed) as (_, address), page(address) as one, page(address) as two:
            await one.until(one.is_in("ready"))
            await one.send("start")
            await one.until(lambda: len(one.errors) == 1)
            await one.send("control")
            await one.until(lambda: one.latest["state"]["control"] == "you")
            await two.until(lambda: two.latest.get("state", {}).get("control") == "other")
            for kind in ("control", "unlock", "start", "end"):
                await two.send(kind)
            await two.send("next", prompt=1)
            await two.send("stop")
            await two.until(lambda: len(two.errors) == 4)
            assert feed.requests == ["stop"]
            await one.receive_for(0.1)
            await one.send("start")
            await one.until(lambda: len(one.errors) == 2)
            await one.beat()
            await one.send("unlock")
            await one.until(lambda: one.latest["state"]["unlocked"])
            await one.beat()
            await one.send("start")
            await one.until(lambda: not one.latest["state"]["unlocked"])
            assert feed.requests == ["stop", "start"]

    run(scenario())


@pytest.mark.parametrize("later", [-1.0, 1e-6, 0.1, 1e300])
def test_only_times_that_were_sent_to_the_page_count_as_confirmed_data(feed, later):
    async def scenario():
        async with served(feed) as (server, address), page(address) as client:
            await client.send("control")
            await client.until(lambda: client.seen)
            for _ in range(10):
                await client.receive()
                await client.send("beat", seen=client.seen + later, at=0.0)
            await client.send("unlock")
            await client.until(lambda: client.errors)
            assert "the connection of this page is too slow" in client.errors[0]
            assert not server.control.unlocked

    run(scenario())


def test_a_client_that_leaves_or_stops_beating_loses_control(feed, monkeypatch):
    monkeypatch.setattr("teleop.live.clients.ALIVE", 0.5)

    async def scenario():
        async with served(feed) as (_, address), page(address) as watching:
            async with page(address) as first:
                await first.send("control")
                await watching.until(
                    lambda: watching.latest.get("state", {}).get("control") == "other"
                )
            await watching.until(lambda: watching.latest["state"]["control"] == "none")
            async with page(address) as silent:
                await silent.send("control")
                await watching.until(lambda: watching.latest["state"]["control"] == "other")
                await watching.until(lambda: watching.latest["state"]["control"] == "none")
            assert feed.lost_count == 2

    run(scenario())


def test_an_exception_of_the_feed_ends_the_task_that_also_beats(feed):
    async def scenario():
        def fail():
            raise RuntimeError("broken")

        feed.advance = fail
        with pytest.raises(RuntimeError, match="broken"):
            await asyncio.wait_for(Server(feed, TOKEN, {}).run(), 5.0)

    run(scenario())
