"""Emulated Haply Inverse Service with one Inverse3.

Sources: "WebSocket Protocol" and "Control Commands" of docs.haply.co (version 3.5) for the
messages, and RFC 6455 for the WebSocket connection. When the messages end, the service returns the
device to idle. The documentation does not state after which time; here it is 0.1 s.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
from typing import TYPE_CHECKING, Any

from sim_backend.wire.emulated_device import EmulatedSerialDevice, Mount

if TYPE_CHECKING:
    from drivers.devices.haply import HaplySettings

GUID = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"
KEPT = 0.1
"""Time for which a force is kept [s]."""


class EmulatedHaply(EmulatedSerialDevice):
    """A service with a device that moves one axis of the telemanipulator."""

    settings: HaplySettings

    def __init__(self, name: str, settings: HaplySettings, mount: Mount) -> None:
        super().__init__(name, settings, mount)
        self.status = {"calibrated": True, "in_use": False, "power_supply": True, "ready": True}
        self.type = "inverse3"
        self.force = dict.fromkeys("xyz", 0.0)
        self._buffer = b""
        self._open = False
        self._pushed = -math.inf
        self._answers: list[bytes] = []

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the host."""
        if data.startswith(b"GET "):
            self._open, self._buffer, self._answers = False, b"", []
        self._buffer += data
        if not self._open:
            head, end, rest = self._buffer.partition(b"\r\n\r\n")
            if not end:
                return
            self._buffer = rest
            self._greet(head)
        while frame := self._frame():
            opcode, payload = frame
            if opcode == 8:
                self._open = False
                self._answers.append(b"\x88\x00")
            elif opcode == 9:
                self._answers.append(bytes([0x8A, len(payload)]) + payload)
            elif opcode in (1, 2):
                self._process(payload, now)

    def _greet(self, head: bytes) -> None:
        lines = (line.partition(b":") for line in head.split(b"\r\n")[1:])
        fields = {name.strip().lower(): value.strip() for name, _, value in lines}
        digest = hashlib.sha1(fields.get(b"sec-websocket-key", b"") + GUID).digest()
        self._answers.append(
            b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Accept: " + base64.b64encode(digest) + b"\r\n\r\n"
        )
        self._open = True
        config = {"type": self.type, "handedness": "right", "preset": "defaults"}
        self._say({"session_id": 7, "inverse3": [self._state() | {"config": config}]})

    def _frame(self) -> tuple[int, bytes] | None:
        """Remove a whole frame from the buffer; return its opcode and payload."""
        data = self._buffer
        if len(data) < 2:
            return None
        size, place = data[1] & 0x7F, 2
        if size == 126:
            size, place = int.from_bytes(data[2:4], "big"), 4
        elif size == 127:
            size, place = int.from_bytes(data[2:10], "big"), 10
        end = place + 4 + size
        if len(data) < end:
            return None
        mask = data[place : place + 4]
        payload = bytes(byte ^ mask[n % 4] for n, byte in enumerate(data[place + 4 : end]))
        self._buffer = data[end:]
        return data[0] & 0x0F, payload

    def _process(self, payload: bytes, now: float) -> None:
        try:
            wanted = json.loads(payload)["inverse3"]
        except (ValueError, KeyError, TypeError):
            wanted = []
        for device in wanted:
            if device.get("device_id") != self.settings.device_id:
                continue
            command = device.get("commands", {}).get("set_cursor_force")
            if command:
                self.force = {name: float(command["vector"][name]) for name in "xyz"}
                if any(self.force.values()):
                    self._pushed = now
        self._say({"inverse3": [self._state()]})

    def _state(self) -> dict[str, Any]:
        position, velocity = dict.fromkeys("xyz", 0.0), dict.fromkeys("xyz", 0.0)
        position[self.settings.axis] = self.mount.sense("position")
        velocity[self.settings.axis] = self.mount.sense("velocity")
        return {
            "device_id": self.settings.device_id,
            "state": {
                "cursor_position": position,
                "cursor_velocity": velocity,
                "current_cursor_force": dict(self.force),
                "control_mode": "idle",
            },
            "status": dict(self.status),
        }

    def _say(self, message: dict[str, Any]) -> None:
        payload = json.dumps(message).encode()
        size = len(payload)
        head = bytes([0x81, size]) if size < 126 else b"\x81\x7e" + size.to_bytes(2, "big")
        self._answers.append(head + payload)

    def emit(self, now: float) -> list[bytes]:
        """Move the device, and return the answers."""
        if now - self._pushed > KEPT or not any(self.force.values()):
            self.mount.brake("axis")
        else:
            self.mount.push("axis", self.force[self.settings.axis])
        answers, self._answers = self._answers, []
        return answers
