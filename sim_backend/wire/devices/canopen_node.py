"""Emulated CANopen node: network management, heartbeat, error messages, SDO, PDO (CiA 301)."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

import can

from sim_backend.wire.devices.canopen_sdo import (
    NO_OBJECT,
    NOT_MAPPABLE,
    PDO_TOO_LONG,
    PRESENT_STATE,
    UNSUPPORTED_ACCESS,
    VALUE_RANGE,
    Abort,
    Entry,
    ObjectDictionary,
    SdoServer,
)
from sim_backend.wire.emulated_device import EmulatedCanDevice, Mount

INITIALISING, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0x00, 0x04, 0x05, 0x7F
BOOTING = 20e-3
"""Time from power-up or a reset to the boot-up message [s]."""
BACKLOG = 5
"""Largest number of overdue heartbeats that are sent at once; older heartbeats are omitted."""
INVALID = 1 << 31
MISSED_HEARTBEAT, PDO_TOO_SHORT, MISSED_PDO = 0x8130, 0x8210, 0x8250
COMMUNICATION_ERROR = 0x11
"""Value of the error register: the bits of a generic error and of a communication error."""


class CanopenNode(EmulatedCanDevice):
    """A CANopen node with four PDOs in each direction.

    A PDO (process data object) is a CAN frame with values. The node sends PDOs only after a SYNC.
    """

    def __init__(self, name: str, settings: Any, mount: Mount, objects: ObjectDictionary) -> None:
        super().__init__(name, settings, mount)
        self.node_id: int = settings.node_id
        self.objects = communication_objects(self.node_id) | objects
        self._power_up = deepcopy(self.objects)
        self.sdo = SdoServer(self.objects, self.write)
        self.nmt = INITIALISING
        self._out: list[can.Message] = []
        self._boot_at = -math.inf
        self._beat_at = math.inf
        self._master_due = math.inf
        self._rpdo_due = [math.inf] * 4
        self._waiting: dict[int, tuple[list[tuple[int, int]], bytes]] = {}
        self._syncs = 0
        self._errors: set[int] = set()
        self._now = -math.inf

    @abstractmethod
    def run(self, now: float) -> None:
        """Advance the device to time `now` [s], and update the objects with measured values."""

    @abstractmethod
    def written(self, index: int) -> None:
        """React to the new value of an object of the device, which has an index >= 2000h."""

    @abstractmethod
    def connection_lost(self) -> None:
        """React to the end of the state operational, or to a missing heartbeat or PDO."""

    @abstractmethod
    def reset(self) -> None:
        """Reset the device, for example a drive, to its state at power-up."""

    def __getitem__(self, at: tuple[int, int]) -> int:
        value = self.objects[at].value
        assert isinstance(value, int)
        return value

    def write(self, index: int, sub: int, value: int) -> None:
        """Write `value` to the object `index`, sub-index `sub`; raise Abort if it is refused."""
        self.check(index, sub, value)
        self.objects[index, sub].value = value
        if index == 0x1017:
            self._beat_at = self._now + value * 1e-3 if value else math.inf
        elif index == 0x1016:
            self._master_due = math.inf
        elif index >= 0x2000:
            self.written(index)

    def check(self, index: int, sub: int, value: int) -> None:
        """Raise Abort if CiA 301 (7.5.2.35 to 38) forbids writing `value` to a PDO setting."""
        kind = index & 0xFE00
        if kind not in (0x1400, 0x1600, 0x1800, 0x1A00):
            return
        communication = index & ~0x0200
        valid = not self[communication, 1] & INVALID
        if kind in (0x1400, 0x1800):
            if sub == 1 and valid and not value & INVALID and value != self[index, 1]:
                raise Abort(VALUE_RANGE)
            at_sync = 1 <= value <= 240
            if sub == 2 and not at_sync and (kind == 0x1800 or value not in (0, 254, 255)):
                raise Abort(VALUE_RANGE)
            return
        if self.nmt == OPERATIONAL:
            raise Abort(PRESENT_STATE)
        if valid or (sub and self[index, 0]):
            raise Abort(UNSUPPORTED_ACCESS)
        if sub == 0:
            if value > 8:
                raise Abort(VALUE_RANGE)
            entries = [self._mapped(self[index, i]) for i in range(1, value + 1)]
            if sum(entry.size for entry in entries) > 8:
                raise Abort(PDO_TOO_LONG)
        elif value:
            self._mapped(value)

    def _mapped(self, mapping: int) -> Entry:
        entry = self.objects.get((mapping >> 16, mapping >> 8 & 0xFF))
        if not entry:
            raise Abort(NO_OBJECT)
        if not entry.mappable or entry.size * 8 != mapping & 0xFF:
            raise Abort(NOT_MAPPABLE)
        return entry

    def receive(self, frame: can.Message, now: float) -> None:
        """Process a CAN frame from the bus at time `now` [s]."""
        self._advance(now)
        identifier, data = frame.arbitration_id, bytes(frame.data)
        if frame.is_extended_id or frame.is_remote_frame or self.nmt == INITIALISING:
            return
        if identifier == 0x000:
            if len(data) == 2 and data[1] in (0, self.node_id):
                self._command(data[0])
        elif identifier == 0x600 + self.node_id:
            if len(data) == 8 and self.nmt != STOPPED and (answer := self.sdo.answer(data)):
                self._send(0x580 + self.node_id, answer)
        elif identifier == 0x700 + (self[0x1016, 1] >> 16 & 0x7F):
            if period := self[0x1016, 1] & 0xFFFF:
                self._master_due = now + period * 1e-3
                self._over(MISSED_HEARTBEAT)
        elif self.nmt == OPERATIONAL:
            if identifier == self[0x1005, 0]:
                self._synchronise()
            else:
                self._process_pdo(identifier, data)

    def emit(self, now: float) -> list[can.Message]:
        """Return the CAN frames that the node sends at time `now` [s]."""
        self._advance(now)
        out, self._out = self._out, []
        return out

    def _send(self, identifier: int, data: bytes) -> None:
        self._out.append(
            can.Message(arbitration_id=identifier, data=data, is_extended_id=False, check=True)
        )

    def _advance(self, now: float) -> None:
        self._now = now
        if self.nmt == INITIALISING:
            if self._boot_at == -math.inf:
                self._boot_at = now + BOOTING
            if now < self._boot_at:
                self.run(now)
                return
            self.nmt = PRE_OPERATIONAL
            self._send(0x700 + self.node_id, b"\0")
        period = self[0x1017, 0] * 1e-3
        if period and self._beat_at < now - BACKLOG * period:
            self._beat_at = now - (BACKLOG - 1) * period
        while self._beat_at <= now:
            self._send(0x700 + self.node_id, bytes((self.nmt,)))
            self._beat_at += period
        if self._master_due <= now:
            self._master_due = math.inf
            self._lose(MISSED_HEARTBEAT)
        for n, due in enumerate(self._rpdo_due):
            if due <= now:
                self._rpdo_due[n] = math.inf
                self._lose(MISSED_PDO)
        self.run(now)

    def _command(self, command: int) -> None:
        """Execute a network management command (CiA 301, 7.2.8.2), for example a reset."""
        commands = {0x01: OPERATIONAL, 0x02: STOPPED, 0x80: PRE_OPERATIONAL, 0x81: 0, 0x82: 0}
        before, self.nmt = self.nmt, commands.get(command, self.nmt)
        if before == OPERATIONAL != self.nmt:
            self._rpdo_due = [math.inf] * 4
            self._waiting.clear()
            self.connection_lost()
        if self.nmt == INITIALISING:
            for at, entry in self._power_up.items():
                if command == 0x81 or at[0] < 0x2000:
                    self.objects[at].value = entry.value
            if command == 0x81:
                self.reset()
            self._boot_at = self._now + BOOTING
            self._beat_at = self._master_due = math.inf
            self._errors.clear()

    def emergency(self, code: int, register: int) -> None:
        """Set the error register (object 1001h), and send an error message (EMCY) with the code.

        Code 0 means that all errors have ended. A node that boots or is stopped sends no message.
        """
        self.objects[0x1001, 0].value = register
        if self.nmt in (PRE_OPERATIONAL, OPERATIONAL):
            self._send(
                0x80 + self.node_id, code.to_bytes(2, "little") + bytes((register,)) + bytes(5)
            )

    def _lose(self, error: int) -> None:
        self._errors.add(error)
        self.emergency(error, COMMUNICATION_ERROR)
        self.connection_lost()
        if self.nmt == OPERATIONAL and self[0x1029, 1] != 1:
            self.nmt = STOPPED if self[0x1029, 1] == 2 else PRE_OPERATIONAL

    def _over(self, error: int) -> None:
        if error in self._errors:
            self._errors.discard(error)
            self.emergency(0, 0)

    def _pdos(self, first: int) -> Iterator[tuple[int, int, list[tuple[int, int]]]]:
        """Yield number (0 to 3), CAN identifier and mapped objects of each enabled PDO."""
        for n in range(4):
            if not (identifier := self[first + n, 1]) & INVALID:
                mapping = first + 0x200 + n
                mapped = [self[mapping, i] for i in range(1, self[mapping, 0] + 1)]
                yield n, identifier & 0x7FF, [(m >> 16, m >> 8 & 0xFF) for m in mapped]

    def _process_pdo(self, identifier: int, data: bytes) -> None:
        for n, own, mapped in self._pdos(0x1400):
            if identifier != own:
                continue
            if len(data) < sum(self.objects[at].size for at in mapped):
                self.emergency(PDO_TOO_SHORT, COMMUNICATION_ERROR)
                continue
            timer = self[0x1400 + n, 5] * 1e-3 if (0x1400 + n, 5) in self.objects else 0.0
            self._rpdo_due[n] = self._now + timer if timer else math.inf
            self._over(MISSED_PDO)
            if self[0x1400 + n, 2] > 240:
                self._apply(mapped, data)
            else:
                self._waiting[n] = mapped, data

    def _apply(self, mapped: list[tuple[int, int]], data: bytes) -> None:
        for at in mapped:
            entry = self.objects[at]
            entry.value, data = entry.unpack(data[: entry.size]), data[entry.size :]
            self.written(at[0])

    def _synchronise(self) -> None:
        for mapped, data in self._waiting.values():
            self._apply(mapped, data)
        self._waiting.clear()
        self.run(self._now)
        self._syncs += 1
        for n, identifier, mapped in self._pdos(0x1800):
            if self._syncs % self[0x1800 + n, 2] == 0:
                self._send(identifier, b"".join(self.objects[at].pack() for at in mapped))


def communication_objects(node: int) -> ObjectDictionary:
    """Return the objects of CiA 301 with their values at power-up, for the node id `node`."""
    objects: ObjectDictionary = {
        (0x1001, 0): Entry("B"),
        (0x1005, 0): Entry("I", 0x80),
        (0x1014, 0): Entry("I", 0x80 + node),
        (0x1016, 0): Entry("B", 1),
        (0x1016, 1): Entry("I", 0, writable=True),
        (0x1017, 0): Entry("H", 0, writable=True),
        (0x1029, 0): Entry("B", 1),
        (0x1029, 1): Entry("B", 0, writable=True),
    }
    for first, base in ((0x1400, 0x200), (0x1800, 0x180)):
        for n in range(4):
            at = first + n
            objects |= {
                (at, 0): Entry("B", 5),
                (at, 1): Entry("I", INVALID | base + 0x100 * n + node, writable=True),
                (at, 2): Entry("B", 1, writable=True),
                (at + 0x200, 0): Entry("B", 0, writable=True),
            }
            if first == 0x1400:
                objects[at, 5] = Entry("H", 0, writable=True)
            for i in range(1, 9):
                objects[at + 0x200, i] = Entry("I", 0, writable=True)
    return objects
