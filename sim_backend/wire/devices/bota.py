"""Emulated serial force-torque sensor of Bota Systems.

Sources: the Python example of Bota Systems and their driver `rokubimini_serial`. The sensor sends a
message at power-up, and then frames with measured values. The command `C` starts the configuration
mode, in which the sensor sends no frames. The command `R` ends this mode.
"""

from __future__ import annotations

import math
from struct import pack
from typing import TYPE_CHECKING

from sim_backend.wire.emulated_device import EmulatedSerialDevice, Mount

if TYPE_CHECKING:
    from drivers.devices.bota import BotaSettings

FASTEST = 51200 / 64
"""Largest sample rate [Hz]: one sample per 64 analogue-to-digital conversions."""
BACKLOG = 5
"""Largest number of overdue frames that are sent at once; older frames are omitted."""
RANGES = {"fx": 500.0, "fy": 500.0, "fz": 1200.0, "mx": 15.0, "my": 15.0, "mz": 12.0}
"""Measuring ranges of a Rokubi sensor [N, N m]. Larger values are limited to the range."""
OVERRANGE = 2
"""Status of a frame with a value outside of its measuring range."""


class EmulatedBota(EmulatedSerialDevice):
    """A force-torque sensor with the signals `fx`, `fy`, `fz`, `mx`, `my`, `mz` and `temperature`.

    The configuration mode, in which the sensor sends no frames, can be started and ended. The
    commands that change a configuration are not emulated.
    """

    def __init__(self, name: str, settings: BotaSettings, mount: Mount) -> None:
        super().__init__(name, settings, mount)
        self._period = 1.0 / min(FASTEST, mount.rate)
        self._power_up = math.nan
        self._due = math.nan
        self._configuring = False
        self._answers: list[bytes] = []

    def receive(self, data: bytes, now: float) -> None:
        """Start the configuration mode at the command `C`, and end it at the command `R`."""
        for letter in data:
            if letter in b"CR":
                self._configuring = letter == ord("C")
                self._answers.append(b"r,0,%c,0\r\n" % letter)
                self._due = now + self._period

    def due(self) -> float:
        """Return the time of the next frame [s]. It is infinite in the configuration mode."""
        return math.inf if self._configuring else self._due

    def emit(self, now: float) -> list[bytes]:
        """Return the bytes that the sensor sends at time `now` [s].

        The first call returns the message at power-up. Later calls return answers to commands, and
        frames with measured values.
        """
        if math.isnan(self._power_up):
            self._power_up, self._due = now, now
            self._answers.append(b"App Init\r\n")
        out, self._answers = self._answers, []
        if not self._configuring:
            count = max(0, math.ceil((now - self._due) / self._period))
            for i in range(max(0, count - BACKLOG), count):
                out.append(self._frame(self._due + i * self._period - self._power_up))
            self._due += count * self._period
        return out

    def _frame(self, uptime: float) -> bytes:
        status, values = 0, []
        for signal, most in RANGES.items():
            value = self.mount.sense(signal)
            if abs(value) > most:
                status = OVERRANGE
            values.append(min(max(value, -most), most))
        microseconds = round(uptime * 1e6) % 2**32
        temperature = self.mount.sense("temperature")
        data = pack("<H6fIf", status, *values, microseconds, temperature)
        return b"\xaa" + data + pack("<H", crc(data))


def shifted(byte: int) -> int:
    """Return the value of the CRC-16/X.25 shift register after the input of one byte.

    The value before the byte is 0.
    """
    for _ in range(8):
        byte = byte >> 1 ^ 0x8408 * (byte & 1)
    return byte


TABLE = [shifted(byte) for byte in range(256)]


def crc(data: bytes) -> int:
    """Return the check sum CRC-16/X.25 of the bytes `data`."""
    register = 0xFFFF
    for byte in data:
        register = register >> 8 ^ TABLE[(register ^ byte) & 0xFF]
    return register ^ 0xFFFF
