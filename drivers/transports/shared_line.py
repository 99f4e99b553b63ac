"""Take turns on a serial line that several devices share, for example RS-485."""

from __future__ import annotations

import math
from collections import deque

from drivers.device import SharedSerialDevice
from drivers.transports.bus import Bus
from drivers.transports.stream_port import StreamPort

LONGEST_REST = 4096
"""Largest number of stored bytes of an incomplete frame."""


class SharedLine(Bus):
    """A serial line whose devices answer requests, one at a time.

    When the line is free, the next device in turn is asked for a request, which is sent at once.
    The line is free again when this device has answered, or when the time of the request has
    passed. The line is served when it is read, once per tick. Therefore at most one request is
    sent per tick, and nothing waits.
    """

    def __init__(self, stream: StreamPort) -> None:
        super().__init__(stream.name, stream.now)
        self.port = stream.port
        """Name of the port in messages."""
        self._stream = stream
        self._stream.attach(self._receive)
        self._devices: dict[int, SharedSerialDevice] = {}
        self._turns: deque[SharedSerialDevice] = deque()
        self._asked: SharedSerialDevice | None = None
        """Device whose answer is expected."""
        self._free_at = -math.inf
        """Time at which the next request can be sent without an answer [s]."""
        self._rest = b""

    def open(self) -> None:
        """Open the port. The devices must then be attached and started again."""
        self._devices.clear()
        self._turns.clear()
        self._asked, self._free_at, self._rest = None, -math.inf, b""
        self._stream.log = self.log
        self._stream.open()

    def connect(self, device: SharedSerialDevice) -> None:
        """Pass the frames with the address of a device to this device."""
        self._devices[device.address] = device

    def start(self, device: SharedSerialDevice) -> None:
        """Let a device take part in the turns, and start it."""
        self._turns.append(device)
        device.start(self)

    def poll(self) -> None:
        """Pass each received frame to its device. If the line is free, send the next request."""
        self._stream.poll()
        now = self.now()
        if now < self._free_at:
            return
        if self._asked:
            self._asked.rejected["no answer"] += 1
            self._asked, self._rest = None, b""
        for _ in range(len(self._turns)):
            device = self._turns[0]
            self._turns.rotate(-1)
            if request := device.request(now):
                self._stream.write(request.data)
                self._free_at = now + self.line_time(len(request.data)) + request.seconds
                self._asked = device if request.is_answered else None
                return

    def line_time(self, size: int) -> float:
        """Return the time [s] that the line needs for `size` bytes; 0 if not known."""
        return self._stream.line_time(size)

    @property
    def occupied(self) -> float:
        """Time for which the line has carried requests and answers so far [s]."""
        stream = self._stream
        return stream.line_time(stream.written + stream.received) if stream.baud else math.nan

    def close(self) -> None:
        """Close the port."""
        self._stream.close()

    def _receive(self, data: bytes, time: float) -> None:
        if not self._devices:
            return
        some_device = self._asked or next(iter(self._devices.values()))
        found = some_device.split(self._rest + data)
        self._rest = found.rest[-LONGEST_REST:]
        some_device.rejected.update(found.rejected)
        for address, frame in found.frames:
            if device := self._devices.get(address):
                if device is self._asked:
                    self._asked, self._free_at = None, -math.inf
                device.receive(frame, time)
            else:
                some_device.rejected["unknown address"] += 1
