"""The process that serves viewers of the Foxglove protocol.

    python -m teleop.live.foxglove_process

The server for the viewers is code of another project, and limits neither the number of its clients
nor their use of the processor. Therefore it runs neither in the control process nor in the live
process, which sends the heartbeat to the control loop, and it has a lower priority than both.

The server checks neither a token nor the origin of a request. Any program and any web page on this
machine can receive the ticks. For this reason, viewers can only view data.
"""

from __future__ import annotations

import logging
import os
import time
from pathlib import Path
from typing import Any

import foxglove
from foxglove import Channel, Context, Schema

from teleop.errors import InputError
from teleop.live.control_pipe import ControlPipe
from teleop.live.ring import RingReader
from teleop.live.shared_file import SharedFile

ALL, SLOW = "/tick", "/tick_60hz"
"""Topic with every tick, and topic for slow viewers, with one tick per call of `advance`."""
BATCH = 400
"""Largest number of ticks that one call of `advance` sends."""
NICENESS = 10
"""Increase of the niceness of this process, which lowers its priority."""
PERIOD = 1.0 / 60.0
"""Time between two transmissions of ticks [s]."""


class FoxgloveBridge:
    """Sends the ticks in the ring buffer to Foxglove viewers at a port; 0 for any free port."""

    def __init__(self, ring: RingReader, port: int) -> None:
        logging.getLogger("foxglove").setLevel(logging.CRITICAL)
        foxglove.set_log_level("CRITICAL")
        self._ring = ring
        self._context = Context()
        self._channels: dict[str, Channel] = {}
        self._definition = ""
        self._read = ring.newest
        try:
            self._server = foxglove.start_server(
                name="teleop", host="127.0.0.1", port=port, capabilities=[], context=self._context
            )
        except RuntimeError as error:
            raise InputError(f"Foxglove, port {port}: cannot be used: {error}") from error
        self.url = f"ws://127.0.0.1:{self._server.port}"

    def begin(self, definition: str, name: str, units: dict[str, str], first: int) -> None:
        """Announce the columns of a trial, whose first tick has the number `first` in the ring."""
        self._read = first - 1
        if definition == self._definition:
            return
        self._definition = definition
        for channel in self._channels.values():
            channel.close()
        schema = Schema(name=name, encoding="ros2msg", data=definition.encode())
        self._channels = {
            topic: Channel(
                topic,
                schema=schema,
                message_encoding="cdr",
                metadata=units,
                context=self._context,
            )
            for topic in (ALL, SLOW)
        }

    def receive(self, document: dict[str, Any]) -> None:
        """Announce the columns of a trial that begins; ignore other messages."""
        if document["type"] == "begin":
            units = {column["name"]: column["unit"] for column in document["columns"]}
            self.begin(document["definition"], document["message"], units, document["first"])

    def leave(self) -> None:
        """Do nothing: viewers are not informed that the control process has ended."""

    def advance(self) -> None:
        """Send the ticks that are new since the last call, but at most the newest `BATCH` ticks."""
        end = self._ring.newest + 1
        first = max(self._read + 1, self._ring.oldest, end - BATCH)
        if first >= end or not self._channels:
            return
        found, slots = self._ring.read(range(first, end))
        if not found:
            return
        self._read = found[-1]
        wall = time.time() - time.monotonic()
        message, written = b"", 0
        for slot in slots:
            written = round((wall + float(slot["written"])) * 1e9)
            message = slot["message"][: slot["length"]].tobytes()
            self._channels[ALL].log(message, log_time=written)
        self._channels[SLOW].log(message, log_time=written)

    def close(self) -> None:
        """Stop the server that sends ticks to Foxglove viewers."""
        self._server.stop()


def main() -> None:
    """Serve viewers until the control process has ended."""
    os.nice(NICENESS)
    pipe = ControlPipe()
    try:
        session = pipe.read_line()
    except EOFError:  # the control process has ended before the first trial
        return
    ring = SharedFile.open(Path(session["files"]["ring"]), writable=False)
    try:
        bridge = FoxgloveBridge(RingReader(ring.buffer, *session["ring"]), session["foxglove"])
    except InputError as error:
        pipe.send({"problem": str(error)})
        return
    pipe.send({"url": bridge.url})
    pipe.stop_waiting()
    try:
        while not pipe.is_over:
            pipe.receive_into(bridge)
            bridge.advance()
            time.sleep(PERIOD)
    finally:
        bridge.close()


if __name__ == "__main__":
    main()
