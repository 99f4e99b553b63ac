"""Emulated Dynamixel X servo on a serial line, with protocol 2.0 and bus watchdog.

Source: ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0" and the control table of the X series.
"""

from __future__ import annotations

import math
from struct import pack, pack_into, unpack_from
from typing import TYPE_CHECKING

from sim_backend.wire.emulated_device import EmulatedSerialDevice, Mount

if TYPE_CHECKING:
    from drivers.devices.dynamixel import DynamixelSettings

NUMBERS = {
    "XL330-M077": (1190, 1.0),
    "XL330-M288": (1200, 1.0),
    "XC330-M288": (1240, 1.0),
    "XM430-W350": (1020, 2.69),
    "XM540-W270": (1120, 2.69),
}
"""Model number, and unit of the current [mA]."""
LONGEST = 300
"""Largest number of stored bytes."""
SERVO = 2.0 * math.pi * 4.0
"""Gain of the position controller [1/s]."""
RANGE, ACCESS = 4, 7


class EmulatedDynamixel(EmulatedSerialDevice):
    """A Dynamixel X servo, which moves or pushes one axis of the telemanipulator.

    Attributes
    ----------
    table
        Control table. A test may change it.
    """

    settings: DynamixelSettings

    def __init__(self, name: str, settings: DynamixelSettings, mount: Mount) -> None:
        super().__init__(name, settings, mount)
        number, milliamperes = NUMBERS[settings.model]
        travel = settings.travel_mm_per_turn * 1e-3
        self._metres = travel / 4096.0
        self._speed = 0.229 / 60.0 * travel
        constant = settings.torque_constant_nm_per_a or 1.0
        self._newtons = constant * milliamperes * 1e-3 * 2.0 * math.pi / travel
        self.table = bytearray(147)
        pack_into("<H", self.table, 0, number)
        self.table[7], self.table[11], self.table[68] = settings.id, 3, 2
        pack_into("<H", self.table, 38, 1193)
        self._fed = -math.inf
        self._stored = b""
        self._answers: list[bytes] = []

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the host at time `now` [s]."""
        self._stored = (self._stored + data)[-LONGEST:]
        while (start := self._stored.find(b"\xff\xff\xfd\x00")) >= 0:
            packet = self._stored[start:]
            if len(packet) < 7 or len(packet) < (size := 7 + unpack_from("<H", packet, 5)[0]):
                return
            self._stored = packet[size:] if size > 9 else packet[4:]
            if size > 9 and remainder(packet[:size]) == 0:
                self._obey(packet[4], packet[7 : size - 2], now)

    def _obey(self, identifier: int, body: bytes, now: float) -> None:
        if identifier not in (self.settings.id, 0xFE):
            return
        self._watch(now)
        self._fed = now
        parameters = body[1:].replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")
        if body[0] == 0x01:
            self._answer(0, bytes((*self.table[0:2], self.table[6])))
        elif body[0] == 0x02:
            address, length = unpack_from("<HH", parameters)
            self._measure()
            self._answer(0, bytes(self.table[address : address + length]))
        elif body[0] == 0x03:
            address = unpack_from("<H", parameters)[0]
            self._answer(self._write(address, parameters[2:]))
        elif body[0] == 0x83:
            address, length = unpack_from("<HH", parameters)
            rest = parameters[4:]
            while len(rest) > length:
                if rest[0] == self.settings.id:
                    self._write(address, rest[1 : 1 + length])
                rest = rest[1 + length :]

    def _write(self, address: int, data: bytes) -> int:
        """Write data; return the error of the answer."""
        if address < 64 and self.table[64]:
            return ACCESS
        if address in (100, 102, 104, 116) and self.table[98] == 0xFF:
            return RANGE
        if address == 98 and data[0] > 127:
            return RANGE
        self.table[address : address + len(data)] = data
        return 0

    def _watch(self, now: float) -> None:
        """Stop the servo if its bus watchdog has expired."""
        steps = self.table[98]
        if self.table[64] and 0 < steps < 128 and now - self._fed > steps * 20e-3:
            self.table[98] = 0xFF

    def emit(self, now: float) -> list[bytes]:
        """Check the watchdog, move the servo, and return the answers to the host."""
        self._watch(now)
        if not self.table[64] or self.table[70] or self.table[98] == 0xFF:
            self.mount.brake("axis")
        elif self.table[11] == 0:
            limit = unpack_from("<H", self.table, 38)[0]
            current = unpack_from("<h", self.table, 102)[0]
            self.mount.push("axis", max(-limit, min(limit, current)) * self._newtons)
        elif self.table[11] == 1:
            self.mount.drive("axis", unpack_from("<i", self.table, 104)[0] * self._speed)
        else:
            goal = unpack_from("<i", self.table, 116)[0] * self._metres
            self.mount.drive("axis", SERVO * (goal - self.mount.sense("position")))
        answers, self._answers = self._answers, []
        return answers

    def _measure(self) -> None:
        force = max(-32768, min(32767, round(self.mount.sense("force") / self._newtons)))
        velocity = round(self.mount.sense("velocity") / self._speed)
        position = round(self.mount.sense("position") / self._metres)
        pack_into("<hii", self.table, 126, force, velocity, position)

    def _answer(self, error: int, data: bytes = b"") -> None:
        alert = 0x80 if self.table[70] else 0
        body = bytes((0x55, error | alert)) + data
        body = body.replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")
        packet = b"\xff\xff\xfd\x00" + pack("<BH", self.settings.id, len(body) + 2) + body
        self._answers.append(packet + pack("<H", remainder(packet + b"\0\0")))


def remainder(packet: bytes) -> int:
    """Return the CRC of all bytes but the last two, XOR the last two; 0 for a valid packet."""
    register = 0
    for byte in packet[:-2]:
        register ^= byte << 8
        for _ in range(8):
            register = (register << 1) ^ (0x18005 if register & 0x8000 else 0)
    return register ^ int.from_bytes(packet[-2:], "little")
