"""SDO server and object dictionary of an emulated CANopen node (CiA 301, section 7.2.4).

The object dictionary contains the values of the node. With an SDO (service data object), the host
reads or writes one entry. In an expedited transfer, the value is in the request or in the answer.
In a segmented transfer, a longer value is transmitted in several messages. The host can write with
expedited transfers, and read with expedited and segmented transfers. All other transfers are
refused, as by real small drives.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

HEADER = struct.Struct("<BHB")
UNKNOWN_COMMAND = 0x05040001
TOGGLE_NOT_ALTERNATED = 0x05030000
UNSUPPORTED_ACCESS = 0x06010000
READ_ONLY = 0x06010002
NO_OBJECT = 0x06020000
NOT_MAPPABLE = 0x06040041
PDO_TOO_LONG = 0x06040042
LENGTH_MISMATCH = 0x06070010
NO_SUB_INDEX = 0x06090011
VALUE_RANGE = 0x06090030
PRESENT_STATE = 0x08000022


class Abort(Exception):
    """Exception: the SDO server refuses to read or write an object."""

    def __init__(self, code: int) -> None:
        super().__init__(f"SDO abort {code:08X}h")
        self.code = code


@dataclass
class Entry:
    """An entry of the object dictionary of a CANopen node: a value that the host can read."""

    kind: str
    """Format character of the value for the module `struct`; `s` for a string."""
    value: int | bytes = 0
    """Present value."""
    writable: bool = False
    """Whether the host may write the entry."""
    mappable: bool = False
    """Whether a PDO (process data object) can contain the value."""

    def pack(self) -> bytes:
        """Return the value as bytes, as they are transmitted in a CANopen message."""
        if isinstance(self.value, bytes):
            return self.value
        return struct.pack(f"<{self.kind}", self.value)

    def unpack(self, data: bytes) -> int:
        """Return the integer that `data`, the bytes of a value in a CANopen message, represent."""
        number: int = struct.unpack(f"<{self.kind}", data)[0]
        return number

    @property
    def size(self) -> int:
        """Length of the value in a CANopen message [bytes]."""
        return len(self.pack())


ObjectDictionary = dict[tuple[int, int], Entry]
"""Entries of a CANopen node, by index and sub-index."""


class SdoServer:
    """SDO server of a CANopen node. It answers requests of the host to read or write an object."""

    def __init__(self, objects: ObjectDictionary, write: Callable[[int, int, int], None]) -> None:
        self._objects = objects
        self._write = write
        self._rest = b""
        self._toggle = 0

    def answer(self, request: bytes) -> bytes | None:
        """Execute an SDO request of 8 bytes; return the answer, or None if there is no answer."""
        command, index, sub = HEADER.unpack_from(request)
        try:
            match command >> 5:
                case 1:
                    return self._download(command, index, sub, request[4:])
                case 2:
                    return self._upload(index, sub)
                case 3:
                    return self._segment(command & 0x10)
                case 4:
                    self._rest = b""
                    return None
                case _:
                    raise Abort(UNKNOWN_COMMAND)
        except Abort as abort:
            return HEADER.pack(0x80, index, sub) + abort.code.to_bytes(4, "little")

    def _entry(self, index: int, sub: int) -> Entry:
        if entry := self._objects.get((index, sub)):
            return entry
        known = any(index == other for other, _ in self._objects)
        raise Abort(NO_SUB_INDEX if known else NO_OBJECT)

    def _download(self, command: int, index: int, sub: int, data: bytes) -> bytes:
        entry = self._entry(index, sub)
        if not entry.writable:
            raise Abort(READ_ONLY)
        if not command & 2:
            raise Abort(UNKNOWN_COMMAND)
        size = 4 - (command >> 2 & 3) if command & 1 else entry.size
        if size != entry.size:
            raise Abort(LENGTH_MISMATCH)
        self._write(index, sub, entry.unpack(data[:size]))
        return HEADER.pack(0x60, index, sub) + bytes(4)

    def _upload(self, index: int, sub: int) -> bytes:
        data = self._entry(index, sub).pack()
        if 0 < len(data) <= 4:
            return HEADER.pack(0x43 | (4 - len(data)) << 2, index, sub) + data.ljust(4, b"\0")
        self._rest, self._toggle = data, 0
        return HEADER.pack(0x41, index, sub) + len(data).to_bytes(4, "little")

    def _segment(self, toggle: int) -> bytes:
        if toggle != self._toggle:
            raise Abort(TOGGLE_NOT_ALTERNATED)
        part, self._rest = self._rest[:7], self._rest[7:]
        self._toggle ^= 0x10
        head = toggle | (7 - len(part)) << 1 | (not self._rest)
        return bytes((head,)) + part.ljust(7, b"\0")
