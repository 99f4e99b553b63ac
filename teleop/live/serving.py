"""Run the server of the live page, a web page, until a given function returns True."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from teleop.errors import InputError, reason
from teleop.live.feed import Feed
from teleop.live.pages import read_pages
from teleop.live.security import new_token
from teleop.live.server import Server

CHECK = 0.1
"""Time between two checks whether the server must end [s]."""


def page_url(host: str, port: int, token: str) -> str:
    """Return the URL of the live page with the token, which permits a page to connect.

    The token is in the fragment (after `#`), because a browser does not send this part of a URL.
    """
    name = f"[{host}]" if ":" in host else host
    return f"http://{name}:{port}/#t={token}"


def serve_until(
    stopped: Callable[[], bool],
    feed: Feed,
    host: str,
    port: int,
    ready: Callable[[str], object],
) -> None:
    """Serve the live page until `stopped` returns True.

    Parameters
    ----------
    stopped
        Function that returns whether the server must end.
    feed
        Source of the data: running trials or a recording.
    host, port
        Address and port at which the server listens; port 0 for any free port.
    ready
        Function that is called with the URL of the live page as soon as the page can be opened.

    Raises
    ------
    InputError
        The address cannot be used.
    """
    asyncio.run(serve(stopped, feed, host, port, ready))


async def serve(
    stopped: Callable[[], bool],
    feed: Feed,
    host: str,
    port: int,
    ready: Callable[[str], object],
) -> None:
    """Serve the live page as an asyncio task; the parameters are those of `serve_until`."""
    if not 0 <= port <= 65535:
        raise InputError(f"port {port}: expected 0 to 65535")
    token = new_token()
    server = Server(feed, token, read_pages())
    try:
        serving = server.serving(host, port)
        used = await serving.__aenter__()
    except OSError as error:
        raise InputError(f"{host}, port {port}: cannot be used: {reason(error)}") from error
    try:
        sending = asyncio.create_task(server.run())
        ready(page_url(host, used, token))
        while not stopped():
            done, _ = await asyncio.wait([sending], timeout=CHECK)
            if done:
                sending.result()
        sending.cancel()
    finally:
        await serving.__aexit__(None, None, None)
