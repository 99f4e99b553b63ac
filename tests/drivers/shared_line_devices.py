"""Meters with Modbus RTU that share a serial line, for tests: a driver and an emulated device."""

from __future__ import annotations

from collections import Counter
from struct import pack
from typing import Literal

from drivers.device import (
    NO_SAMPLE,
    DeviceSettings,
    LineFrames,
    LineRequest,
    Sample,
    SharedSerialDevice,
)
from drivers.framing.crc import crc16_modbus
from drivers.rig import RigError
from sim_backend.wire.emulated_device import EmulatedSerialDevice

ANSWER = 7
"""Length of an answer [bytes]."""
PATIENCE = 0.05
"""Longest time until the answer [s]. A busy machine delays the thread of the emulated meters."""


class MeterSettings(DeviceSettings):
    kind: Literal["meter"]
    bus: str
    address: int


def with_crc(data):
    return data + crc16_modbus(data).to_bytes(2, "little")


class Meter(SharedSerialDevice):
    """A meter whose input register 0 is the force [0.01 N]."""

    Settings = MeterSettings

    @property
    def address(self):
        return self.settings.address

    def signals(self):
        return {"force": "N"}

    @classmethod
    def split(cls, data):
        frames, rejected = [], Counter()
        while len(data) >= ANSWER:
            if with_crc(data[: ANSWER - 2]) == data[:ANSWER]:
                frames.append((data[0], data[:ANSWER]))
                data = data[ANSWER:]
            else:
                rejected["checksum"] += 1
                data = data[1:]
        return LineFrames(frames, rejected, data)

    def start(self, line):
        self.samples["force"] = NO_SAMPLE
        if not line.wait_for(lambda: self.samples["force"] is not NO_SAMPLE, 0.5):
            raise RigError(f"{self.name}: no answer on {line.name} ({line.port}): expected a meter")

    def request(self, now):
        return LineRequest(with_crc(bytes([self.address, 4, 0, 0, 0, 1])), PATIENCE)

    def receive(self, frame, time):
        self.samples["force"] = Sample(int.from_bytes(frame[3:5], "big", signed=True) * 0.01, time)


class EmulatedMeter(EmulatedSerialDevice):
    """A meter that answers 1 ms after the end of a request."""

    def __init__(self, name, settings, mount):
        super().__init__(name, settings, mount)
        self._due = float("inf")
        self.silent = False
        self.heard = 0

    def receive(self, data, now):
        self.heard += len(data)
        if data[0] == self.settings.address and not self.silent:
            self._due = now + 1e-3

    def due(self):
        return self._due

    def emit(self, now):
        if now < self._due:
            return []
        self._due = float("inf")
        counts = round(self.mount.sense("force") * 100)
        answer = pack(">BBBh", self.settings.address, 4, 2, counts)
        register = 0xFFFF
        for byte in answer:
            register ^= byte
            for _ in range(8):
                register = register >> 1 ^ 0xA001 * (register & 1)
        return [answer + pack("<H", register)]
