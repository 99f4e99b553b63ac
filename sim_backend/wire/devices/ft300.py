"""Emulated FT 300 force-torque sensor of Robotiq.

Source: instruction manual of the sensor, section 4.4. The sensor is a Modbus RTU slave. When the
host writes 0x0200 to register 410, the sensor starts to send frames with measured values
periodically (the stream). When the host sends a sequence of bytes 0xFF, the stream ends.
"""

from __future__ import annotations

import math
from struct import pack
from typing import TYPE_CHECKING

from sim_backend.wire.emulated_device import EmulatedSerialDevice, Mount

if TYPE_CHECKING:
    from drivers.devices.ft300 import Ft300Settings

PERIOD = 10e-3
"""Time between two frames [s]."""
BACKLOG = 5
"""Largest number of overdue frames that are sent at once; older frames are omitted."""
RANGES = {"fx": 300.0, "fy": 300.0, "fz": 300.0, "mx": 30.0, "my": 30.0, "mz": 30.0}
"""Measuring ranges [N, N m]. Larger values are limited to the range."""
COUNTS = {"f": 100, "m": 1000}
"""Transmitted number per newton, and per newton metre."""
SLAVE, WRITE_REGISTERS = 9, 0x10
REQUEST = bytes((SLAVE, WRITE_REGISTERS, 0x01, 0x9A, 0, 1, 2, 0x02, 0x00))
INTERRUPTION = 10
"""Number of successive bytes 0xFF that end the stream. According to the manual, a host sends 50."""


class EmulatedFt300(EmulatedSerialDevice):
    """A force-torque sensor with the signals `fx`, `fy`, `fz`, `mx`, `my` and `mz`.

    On request, the sensor sends frames with measured values periodically (the stream). The request
    that starts the stream is the only Modbus request that is emulated. While the stream is active,
    it has no effect.
    """

    def __init__(self, name: str, settings: Ft300Settings, mount: Mount) -> None:
        super().__init__(name, settings, mount)
        self._received = b""
        self._streaming = False
        self._due = 0.0
        self._answers: list[bytes] = []

    def receive(self, data: bytes, now: float) -> None:
        """Start or end the stream (periodic frames) if bytes from the host request this."""
        request = REQUEST + pack("<H", crc(REQUEST))
        for byte in data:
            self._received = (self._received + bytes((byte,)))[-len(request) :]
            if self._streaming:
                self._streaming = not self._received.endswith(INTERRUPTION * b"\xff")
            elif self._received == request:
                self._streaming, self._due = True, now + PERIOD
                answer = REQUEST[:6]
                self._answers.append(answer + pack("<H", crc(answer)))

    def due(self) -> float:
        """Return the time of the next frame [s]; infinite while no periodic frames are sent."""
        return self._due if self._streaming else math.inf

    def emit(self, now: float) -> list[bytes]:
        """Return the answers to requests, followed by the periodic frames up to time `now` [s]."""
        out, self._answers = self._answers, []
        if self._streaming:
            count = max(0, math.ceil((now - self._due) / PERIOD))
            out += [self._frame() for _ in range(min(count, BACKLOG))]
            self._due += count * PERIOD
        return out

    def _frame(self) -> bytes:
        counts = [
            round(min(max(self.mount.sense(signal), -most), most) * COUNTS[signal[0]])
            for signal, most in RANGES.items()
        ]
        frame = pack("<BB6h", 0x20, 0x4E, *counts)
        return frame + pack("<H", crc(frame))


def crc(data: bytes) -> int:
    """Return the check sum CRC-16/MODBUS of the bytes `data`, computed bit by bit."""
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ 0xA001 * (register & 1)
    return register
