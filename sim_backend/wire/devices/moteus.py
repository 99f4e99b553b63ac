"""Emulated moteus motor controller of mjbots on a CAN FD bus.

Sources: "CAN Protocol", "Register Reference", "Control Modes" and "moteus reports mode 11" of the
documentation of moteus. The mode `position` is emulated without a position: as velocity control, or
without gains as torque control.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from struct import calcsize, pack, unpack
from typing import TYPE_CHECKING

import can

from sim_backend.wire.emulated_device import EmulatedCanDevice, Mount

if TYPE_CHECKING:
    from drivers.devices.moteus import MoteusSettings

FORMATS = "bhif"
"""Formats of the types of values: int8, int16, int32, float."""
SCALES = {
    0x01: (0.01, 0.0001, 0.00001, 1.0),
    0x02: (0.1, 0.00025, 0.00001, 1.0),
    0x03: (0.5, 0.01, 0.001, 1.0),
}
"""Units of the integers of position, velocity and torque."""
STOPPED, FAULT, ENABLING, POSITION, TIMEOUT = 0, 1, 2, 10, 11
DEFAULTS = {
    0x20: 0.0,
    0x21: 0.0,
    0x22: 0.0,
    0x23: 1.0,
    0x24: 1.0,
    0x25: math.nan,
    0x26: math.nan,
    0x27: 0.0,
    0x28: math.nan,
    0x29: math.nan,
    0x2B: 1.0,
}
"""Values of the command registers that a command does not contain."""
DEFAULT_TIMEOUT = 0.1
"""Watchdog time of a command whose watchdog time is 0 [s]."""
STARTING = 3e-3
"""Time in a mode that prepares the operation [s]."""
IDENTITY = {0x100: 0x0, 0x101: 0x010A, 0x102: 5, 0x120: 0x3A1B, 0x121: 0x2C5D, 0x122: 0x77}


class EmulatedMoteus(EmulatedCanDevice):
    """A motor controller that moves one axis of the telemanipulator."""

    settings: MoteusSettings

    def __init__(self, name: str, settings: MoteusSettings, mount: Mount) -> None:
        super().__init__(name, settings, mount)
        self._travel = settings.travel_mm_per_turn * 1e-3
        self.mode, self.fault = STOPPED, 0
        self.identity = dict(IDENTITY)
        self._command = dict(DEFAULTS)
        self._fed = self._enabled = math.nan
        self._answers: list[can.Message] = []

    def receive(self, frame: can.Message, now: float) -> None:
        """Process a CAN FD frame. Frames for other nodes are ignored."""
        if frame.is_remote_frame or frame.arbitration_id & 0x7F != self.settings.node:
            return
        self._watch(now)
        answer = b""
        try:
            for kind, register, values in self._subframes(bytes(frame.data)):
                if values is None:
                    answer += self._read(kind, register)
                else:
                    answer += self._write(register, values, now)
        except (IndexError, ValueError):
            return
        source = frame.arbitration_id >> 8
        if source & 0x80 and answer:
            identifier = self.settings.node << 8 | source & 0x7F
            self._answers.append(
                can.Message(
                    arbitration_id=identifier,
                    is_extended_id=identifier > 0x7FF,
                    is_fd=True,
                    bitrate_switch=True,
                    data=answer.ljust(can.util.dlc2len(can.util.len2dlc(len(answer))), b"\x50"),
                )
            )

    def _subframes(self, data: bytes) -> Iterator[tuple[int, int, list[float] | None]]:
        """Yield type, register and values of each written block, and None for a read register."""
        place = 0

        def number() -> int:
            nonlocal place
            value = data[place] & 0x7F
            if data[place] & 0x80:
                place += 1
                value |= (data[place] & 0x7F) << 7
            place += 1
            return value

        while place < len(data):
            head = data[place]
            place += 1
            if head == 0x50:
                continue
            if head > 0x1F:
                raise ValueError("no request")
            kind = head >> 2 & 3
            count = head & 3 or number()
            first = number()
            if head & 0x10:
                for offset in range(count):
                    yield kind, first + offset, None
            else:
                layout = f"<{count}{FORMATS[kind]}"
                block = data[place : place + calcsize(layout)]
                if len(block) < calcsize(layout):
                    raise ValueError("incomplete")
                place += len(block)
                yield kind, first, list(unpack(layout, block))

    def _write(self, first: int, values: list[float], now: float) -> bytes:
        answer = b""
        for offset, value in enumerate(values):
            register = first + offset
            if register == 0:
                self._enter(int(value), now)
            elif register in self._command:
                self._command[register] = value
            else:
                answer += bytes([0x30, register & 0x7F, 1])
        return answer

    def _enter(self, mode: int, now: float) -> None:
        if mode == STOPPED:
            self.mode, self.fault = STOPPED, 0
        elif mode == POSITION:
            self._command, self._fed = dict(DEFAULTS), now
            if self.mode == STOPPED:
                self.mode, self._enabled = ENABLING, now + STARTING

    def _read(self, kind: int, register: int) -> bytes:
        values = {
            0x00: float(self.mode),
            0x01: self.mount.sense("position") / self._travel,
            0x02: self.mount.sense("velocity") / self._travel,
            0x03: self.mount.sense("force") * self._travel / math.tau,
            0x0D: 24.0,
            0x0E: 30.0,
            0x0F: float(self.fault),
        }
        head = bytes([register & 0x7F | 0x80, register >> 7]) if register > 0x7F else b""
        head = head or bytes([register])
        if register in self.identity and kind == 2:
            return bytes([0x29]) + head + pack("<i", self.identity[register])
        if register not in values:
            return b"\x31" + head + b"\x01"
        value = values[register] / SCALES.get(register, (1.0,) * 4)[kind]
        if kind < 3:
            most = 2 ** (8 * 2**kind - 1) - 1
            value = min(max(round(value), -most), most)
        return bytes([0x21 | kind << 2]) + head + pack(f"<{FORMATS[kind]}", value)

    def _watch(self, now: float) -> None:
        """Enter the mode timeout if the last command is too old."""
        if self.mode in (ENABLING, POSITION):
            limit = self._command[0x27] or DEFAULT_TIMEOUT
            if now - self._fed > limit:
                self.mode = TIMEOUT
        if self.mode == ENABLING and now >= self._enabled:
            self.mode = POSITION

    def trip(self, fault: int) -> None:
        """Enter the mode fault."""
        self.mode, self.fault = FAULT, fault

    def emit(self, now: float) -> list[can.Message]:
        """Check the watchdog, move the motor, and return the answers."""
        self._watch(now)
        if self.mode != POSITION:
            self.mount.brake("axis")
        elif self._command[0x23] == 0.0 and self._command[0x24] == 0.0:
            most = self._command[0x25]
            torque = self._command[0x22]
            if not math.isnan(most):
                torque = min(max(torque, -most), most)
            self.mount.push("axis", torque * math.tau / self._travel)
        else:
            self.mount.drive("axis", self._command[0x21] * self._travel)
        answers, self._answers = self._answers, []
        return answers
