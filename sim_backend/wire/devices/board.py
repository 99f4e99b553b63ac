"""Emulated microcontroller board. docs/serial-protocol.md describes board and protocol."""

from __future__ import annotations

import math
import random
import struct
from binascii import crc_hqx
from typing import TYPE_CHECKING

from sim_backend.wire.emulated_device import EmulatedSerialDevice, Mount

if TYPE_CHECKING:
    from drivers.devices.board_settings import BoardSettings

HELLO, CONFIGURE, ENABLE, COMMAND, DISABLE = 1, 2, 3, 4, 5
IDENTITY, CONFIGURED, SAMPLE = 0x81, 0x82, 0x83
LENGTHS = {HELLO: 0, CONFIGURE: 4, ENABLE: 1, COMMAND: 8, DISABLE: 0}
"""Length of the payload [bytes] of each kind of frame that the host sends."""
IDLE, ENABLED, WATCHDOG, EMERGENCY_STOP, DRIVE_FAULT = range(5)
LONGEST = 32
"""Largest length of an encoded frame of the host [bytes]."""
BACKLOG = 5
"""Largest number of overdue samples that are sent at once; older samples are omitted."""
WIDEST = (1 << 31) - 1


class EmulatedBoard(EmulatedSerialDevice):
    """A microcontroller board that measures signals and moves axes, on a serial port.

    The board has only the inputs and axes for which the rig file (TOML file that describes the
    telemanipulator) contains a scale. A scale converts transmitted integers to physical values.

    Attributes
    ----------
    version
        Version of the protocol between board and host.
    boot
        Number that changes at each start of the board. With this number, the host detects a start.
    started
        Time at which the board was started [s]. At this time, the clock of the board is 0.
    emergency_stop
        Whether the emergency-stop circuit is open. A test may set this attribute.
    drive_fault
        Whether a drive reports a fault. A test may set this attribute.
    """

    def __init__(self, name: str, settings: BoardSettings, mount: Mount) -> None:
        super().__init__(name, settings, mount)
        self.version = 1
        self.emergency_stop = False
        self.drive_fault = False
        self._scales = [
            (f"{quantity}_{i}", scales[i] * unit if i < len(scales) else 0.0)
            for quantity, unit, number, scales in (
                ("force", 1.0, 2, settings.force_n_per_count),
                ("position", 1e-6, 2, settings.position_um_per_count),
                ("velocity", 1e-6, 2, settings.velocity_um_per_s_per_count),
                ("analogue", 1e-3, 4, settings.analogue_mv_per_count),
            )
            for i in range(number)
        ]
        self._forces = [*settings.axis_force_n_per_count, 0.0, 0.0][:2]
        self._axes = max(
            len(settings.velocity_um_per_s_per_count), len(settings.axis_force_n_per_count)
        )
        if any(self._forces):
            self.version = 2
        self.boot = random.getrandbits(32)
        self.reset(0.0)

    def reset(self, now: float) -> None:
        """Restart the board at time `now` [s], as after an interruption of its power supply."""
        self.boot = (self.boot + 1) & 0xFFFFFFFF
        self.started = now
        self._begun = b""
        self._due: set[int] = {IDENTITY}
        self._sequence = 0
        self._last: int | None = None
        self._rejected = 0
        self._configured = False
        self._watchdog_ms = 0
        self._rate_hz = 0
        self._sample_due = 0.0
        self._commanded = 0.0
        self._halt(IDLE)

    def _halt(self, state: int) -> None:
        self._state = state
        self._enabled: set[int] = set()
        for i in range(self._axes):
            self.mount.brake(f"axis_{i}")

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the host at time `now` [s].

        Malformed, delayed and repeated frames have no effect, but are counted.
        """
        *frames, self._begun = (self._begun + data).split(b"\0")
        self._begun = self._begun[: LONGEST + 1]
        for frame in frames:
            if frame and not self._process(unstuffed(frame), now):
                self._rejected = (self._rejected + 1) & 0xFFFF

    def _process(self, body: bytes, now: float) -> bool:
        if len(body) < 5 or check_sum(body[:-2]) != int.from_bytes(body[-2:], "little"):
            return False
        kind, sequence = struct.unpack_from("<BH", body)
        payload = body[3:-2]
        if LENGTHS.get(kind) != len(payload):
            return False
        if kind != HELLO and self._last is not None:
            ahead = (sequence - self._last) & 0xFFFF
            if not 0 < ahead < 0x8000:
                return False
        self._last = sequence
        self._watch(now)
        if kind == HELLO:
            self._halt(IDLE)
            self._configured = False
            self._rejected = 0
        if kind == CONFIGURE:
            watchdog_ms, rate_hz = struct.unpack("<HH", payload)
            self._configure(watchdog_ms, rate_hz, now)
        elif not self._configured:
            self._due.add(IDENTITY)
        elif kind == ENABLE:
            self._enable(payload[0], now)
        elif kind == COMMAND:
            self._command(struct.unpack("<2i", payload), now)
        else:
            self._halt(IDLE)
        return True

    def _configure(self, watchdog_ms: int, rate_hz: int, now: float) -> None:
        self._halt(IDLE)
        self._watchdog_ms = min(max(watchdog_ms, 1), 1000)
        self._rate_hz = min(max(rate_hz, 1), 4000)
        self._sample_due = now
        self._configured = True
        self._due.add(CONFIGURED)

    def _enable(self, mask: int, now: float) -> None:
        if self._state == IDLE:
            self._state = ENABLED
            self._commanded = now
            self._watch(now)
        if self._state == ENABLED:
            for i in range(self._axes):
                if mask >> i & 1 and i not in self._enabled:
                    self._enabled.add(i)
                    self._actuate(i, 0)

    def _command(self, counts: tuple[int, ...], now: float) -> None:
        if self._state != ENABLED:
            return
        self._commanded = now
        for i in self._enabled:
            self._actuate(i, counts[i])

    def _actuate(self, axis: int, counts: int) -> None:
        if force := self._forces[axis]:
            self.mount.push(f"axis_{axis}", counts * force)
        else:
            scale = self.settings.velocity_um_per_s_per_count[axis] * 1e-6
            self.mount.drive(f"axis_{axis}", counts * scale)

    def _watch(self, now: float) -> None:
        """Disable all axes at an emergency stop, a drive fault or an expired watchdog."""
        if self._state != ENABLED:
            return
        if self.emergency_stop:
            self._halt(EMERGENCY_STOP)
        elif self.drive_fault:
            self._halt(DRIVE_FAULT)
        elif now - self._commanded > self._watchdog_ms * 1e-3:
            self._halt(WATCHDOG)

    def due(self) -> float:
        """Return the time of the next sample [s]; infinite until the host configures the board."""
        return self._sample_due if self._configured else math.inf

    def emit(self, now: float) -> list[bytes]:
        """Return the answers to the host, followed by all samples that are due at `now` [s]."""
        self._watch(now)
        frames = []
        if IDENTITY in self._due:
            s = self.settings
            numbers = (
                len(s.force_n_per_count),
                len(s.position_um_per_count),
                self._axes,
                len(s.analogue_mv_per_count),
            )
            identity = struct.pack("<3BI4B", self.version, 1, 0, self.boot, *numbers)
            if any(self._forces):
                identity += bytes((sum(1 << i for i, force in enumerate(self._forces) if force),))
            frames.append(self._frame(IDENTITY, now, identity))
        if CONFIGURED in self._due:
            configured = struct.pack("<HH", self._watchdog_ms, self._rate_hz)
            frames.append(self._frame(CONFIGURED, now, configured))
        self._due.clear()
        if self._configured:
            frames += self._samples(now)
        return frames

    def _samples(self, now: float) -> list[bytes]:
        period = 1.0 / self._rate_hz
        self._sample_due = max(self._sample_due, now - (BACKLOG - 1) * period)
        frames: list[bytes] = []
        if self._sample_due > now:
            return frames
        sample = struct.pack(
            "<3BHH10i",
            self._state,
            sum(1 << i for i in self._enabled),
            self.emergency_stop | self.drive_fault << 1,
            self._last or 0,
            self._rejected,
            *(self._counts(signal, scale) for signal, scale in self._scales),
        )
        while self._sample_due <= now:
            frames.append(self._frame(SAMPLE, self._sample_due, sample))
            self._sample_due += period
        return frames

    def _counts(self, signal: str, scale: float) -> int:
        if not scale:
            return 0
        return round(min(max(self.mount.sense(signal) / scale, -WIDEST), WIDEST))

    def _frame(self, kind: int, time: float, payload: bytes) -> bytes:
        microseconds = round((time - self.started) * 1e6) & 0xFFFFFFFF
        body = struct.pack("<BHI", kind, self._sequence, microseconds) + payload
        self._sequence = (self._sequence + 1) & 0xFFFF
        return stuffed(body + check_sum(body).to_bytes(2, "little")) + b"\0"


MIRROR = bytes(sum((b >> i & 1) << 7 - i for i in range(8)) for b in range(256))


def check_sum(data: bytes) -> int:
    """Return the check sum CRC-16/IBM-SDLC (also called CRC-16/X.25) of the bytes `data`.

    The function `crc_hqx` of Python uses the same polynomial, but processes the bits of a byte in
    the opposite order. The order of the bits is therefore reversed before and after its call.
    """
    high, low = (crc_hqx(data.translate(MIRROR), 0xFFFF) ^ 0xFFFF).to_bytes(2, "big")
    return MIRROR[low] << 8 | MIRROR[high]


def stuffed(data: bytes) -> bytes:
    """Return the COBS encoding of `data` (consistent overhead byte stuffing).

    The result contains no zero byte. `data` must have fewer than 254 bytes.
    """
    return b"".join(bytes((len(run) + 1,)) + run for run in data.split(b"\0"))


def unstuffed(frame: bytes) -> bytes:
    """Return the decoded bytes of a frame that is encoded by COBS; the inverse of `stuffed`.

    The result is empty if the frame is malformed or longer than `LONGEST` bytes.
    """
    if len(frame) > LONGEST:
        return b""
    runs = []
    rest = frame
    while rest:
        code = rest[0]
        if code > len(rest):
            return b""
        runs.append(rest[1:code])
        rest = rest[code:]
    return b"\0".join(runs)
