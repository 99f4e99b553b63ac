"""The process that serves viewers of the Foxglove protocol.

    python -m teleop.live.foxglove_process

The server for the viewers is code of another project, and limits neither the number of its clients
nor their use of the processor. Therefore it runs neither in the control process nor in the live
process, which sends the heartbeat to the control loop, and it has a lower priority than both.

The server checks neither a token nor the origin of a request. Any program and any web page on this
machine can receive the ticks. For this reason, viewers can only view data.
"""

from __future__ import annotations

import contextlib
import logging
import os
import time
from typing import Any

import foxglove
from foxglove import Channel, Context, Schema

from teleop.errors import InputError
from teleop.streams.control_pipe import ControlPipe
from teleop.streams.message import MESSAGE_NAME, definition_of, messages_of
from teleop.streams.stream import StreamReader

ALL, SLOW = "/tick", "/tick_60hz"
"""Topic with every tick, and topic for slow viewers, with one tick per call of `advance`."""
BATCH = 400
"""Largest number of ticks that one call of `advance` sends."""
NICENESS = 10
"""Increase of the niceness of this process, which lowers its priority."""
PERIOD = 1.0 / 60.0
"""Time between two transmissions of ticks [s]."""


class FoxgloveBridge:
    """Sends the ticks of the trials to Foxglove viewers at a port; 0 for any free port."""

    def __init__(self, port: int) -> None:
        logging.getLogger("foxglove").setLevel(logging.CRITICAL)
        foxglove.set_log_level("CRITICAL")
        self._stream: StreamReader | None = None
        self._context = Context()
        self._channels: dict[str, Channel] = {}
        self._definition = ""
        try:
            self._server = foxglove.start_server(
                name="teleop", host="127.0.0.1", port=port, capabilities=[], context=self._context
            )
        except RuntimeError as error:
            raise InputError(f"port {port}: cannot be used: {error}") from error
        self.url = f"ws://127.0.0.1:{self._server.port}"

    def receive(self, document: dict[str, Any]) -> None:
        """Open the stream of a trial that begins; ignore other messages."""
        if document["type"] == "begin":
            with contextlib.suppress(OSError):  # the trial has ended before it was read
                self.begin(StreamReader.open(document["stream"], "foxglove"))

    def begin(self, stream: StreamReader) -> None:
        """Announce the columns of a trial, and read its stream from now on."""
        self._stream = stream
        columns = stream.schema.columns
        definition = definition_of(columns)
        if definition == self._definition:
            return
        self._definition = definition
        for channel in self._channels.values():
            channel.close()
        schema = Schema(name=MESSAGE_NAME, encoding="ros2msg", data=definition.encode())
        self._channels = {
            topic: Channel(
                topic,
                schema=schema,
                message_encoding="cdr",
                metadata={column.name: column.unit for column in columns},
                context=self._context,
            )
            for topic in (ALL, SLOW)
        }

    def advance(self) -> None:
        """Send the ticks that are new since the last call, but at most the newest `BATCH` ticks."""
        batch = self._stream.read() if self._stream else None
        if not batch or not len(batch.rows):
            return
        wall = time.time() - time.monotonic()
        message, written = b"", 0
        messages = messages_of(batch.rows[-BATCH:])
        for message, at in zip(messages, batch.written[-BATCH:].tolist(), strict=True):
            written = round((wall + at) * 1e9)
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
    try:
        bridge = FoxgloveBridge(session["foxglove"])
    except InputError as error:
        pipe.send({"problem": str(error)})
        return
    pipe.send({"url": bridge.url})
    pipe.stop_waiting()
    try:
        while not pipe.is_over:
            for message in pipe.messages():
                bridge.receive(message)
            bridge.advance()
            time.sleep(PERIOD)
    finally:
        bridge.close()


if __name__ == "__main__":
    main()
