"""The live process, which serves the live page separately from the control process.

    python -m teleop.live.process

The control process, which runs the control loop, starts the live process. On standard input, the
live process receives one JSON document per line: first a description of the session, then messages
about the trials. When standard input ends, the control process has ended. On standard output, the
live process sends the address of the page, or the text of a problem. After that, it sends the
requests of the page that the control process carries out between two trials.
"""

from __future__ import annotations

import asyncio
import os
import sys
import time
from pathlib import Path
from typing import Any

from teleop.errors import InputError
from teleop.json_documents import dumps, loads
from teleop.live.cells import CellWriter
from teleop.live.ring import RingReader
from teleop.live.serving import serve
from teleop.live.shared_file import SharedFile
from teleop.live.trial_feed import TrialFeed

FAREWELL = 1.0
"""Time for which the live process continues after the control process has ended [s]."""
MOST_UNREAD = 1 << 16
"""Largest number of bytes that are read from standard input in one call."""


class ControlPipe:
    """Exchanges JSON documents with the control process, through standard input and output.

    Only `read_line` waits for a message.
    """

    def __init__(self) -> None:
        self._input, self._output = sys.stdin.fileno(), sys.stdout.fileno()
        self._received = b""
        self.ended = 0.0
        """Time at which standard input ended [s]; 0 before it ended."""

    def read_line(self) -> dict[str, Any]:
        """Wait for a message of the control process, and return the message.

        Raises
        ------
        EOFError
            The control process has ended.
        """
        while b"\n" not in self._received:
            if not (part := os.read(self._input, MOST_UNREAD)):
                raise EOFError
            self._received += part
        line, _, self._received = self._received.partition(b"\n")
        return loads(line)

    def receive_into(self, feed: TrialFeed) -> None:
        """Pass the messages that have arrived from the control process to the feed.

        The feed is the source of data of the live page. If the control process has ended, this is
        also reported to the feed. This method does not wait.
        """
        if self.ended:
            return
        try:
            part = os.read(self._input, MOST_UNREAD)
        except BlockingIOError:
            return
        if not part:
            self.ended = time.monotonic()
            feed.leave()
        *lines, self._received = (self._received + part).split(b"\n")
        for line in lines:
            feed.receive(loads(line))

    def send(self, document: dict[str, Any]) -> None:
        """Send a JSON document to the control process.

        If the control process does not read or has ended, the document is discarded.
        """
        try:
            os.write(self._output, dumps(document).encode() + b"\n")
        except (BlockingIOError, BrokenPipeError):
            return


async def main() -> None:
    """Serve the live page until the control process has ended."""
    pipe = ControlPipe()
    session = pipe.read_line()
    ring, events, cells = (
        SharedFile.open(Path(session["files"][name]), name == "cells")
        for name in ("ring", "events", "cells")
    )
    ticks, bridge, addresses = RingReader(ring.buffer, *session["ring"]), None, {}
    if session["foxglove"] is not None:
        from teleop.live.foxglove_bridge import FoxgloveBridge

        try:
            bridge = FoxgloveBridge(ticks, session["foxglove"])
        except InputError as error:
            pipe.send({"problem": str(error)})
            return
        addresses["foxglove"] = bridge.url
    feed = TrialFeed(
        ticks,
        RingReader(events.buffer, *session["events"]),
        CellWriter(cells.buffer),
        session["welcome"],
        pipe.send,
        bridge,
    )
    os.set_blocking(sys.stdin.fileno(), False)
    os.set_blocking(sys.stdout.fileno(), False)

    def is_over() -> bool:
        pipe.receive_into(feed)
        return pipe.ended > 0.0 and time.monotonic() - pipe.ended > FAREWELL

    try:
        await serve(
            is_over,
            feed,
            session["host"],
            session["port"],
            lambda url: pipe.send({"url": url, **addresses}),
        )
    except InputError as error:
        pipe.send({"problem": str(error)})
    finally:
        if bridge:
            bridge.close()


if __name__ == "__main__":
    asyncio.run(main())
