"""Emulated slcan adapter: a CAN adapter that sends CAN frames as text on a serial port.

The emulated adapter is the CANUSB of Lawicel. This module only processes the text. The caller reads
from the serial port and writes to it.
"""

from __future__ import annotations

import re

import can

BITRATES = {
    "S0": 10_000,
    "S1": 20_000,
    "S2": 50_000,
    "S3": 100_000,
    "S4": 125_000,
    "S5": 250_000,
    "S6": 500_000,
    "S7": 800_000,
    "S8": 1_000_000,
}
STANDARD = re.compile("([tr])([0-7][0-9A-Fa-f]{2})([0-8])([0-9A-Fa-f]*)")
EXTENDED = re.compile("([TR])([01][0-9A-Fa-f]{7})([0-8])([0-9A-Fa-f]*)")
DONE, REFUSED = "\r", "\a"
TRANSMIT_QUEUE_FULL = 0x02
LONGEST = 40
"""Largest number of stored characters of a line. All valid lines are shorter."""


class SlcanAdapter:
    """An emulated slcan adapter, which connects a host to a CAN bus by lines of text.

    A line of the host contains a CAN frame or a command. The adapter answers each line. The answer
    to a CAN frame is `z`, or `Z` if the frame has an extended identifier.

    The CAN channel of the adapter is open or closed. At the start, it is closed. While the channel
    is closed, the adapter refuses CAN frames, the request of the status flags, and the command that
    closes the channel. While the channel is open, the adapter refuses changes of its settings, and
    the command that opens the channel.

    Attributes
    ----------
    is_open
        Whether the channel is open.
    bitrate
        Bit rate of the bus [bit/s]; None until the host sets it.
    flags
        Status flags, which the host can request. While the flag `TRANSMIT_QUEUE_FULL` is set, the
        adapter refuses CAN frames of the host.
    stamps
        Whether the CAN frames that the adapter sends to the host have a time stamp [ms].
    """

    def __init__(self) -> None:
        self.is_open = False
        self.bitrate: int | None = None
        self.flags = 0
        self.stamps = False
        self._line = ""
        self._replies = ""

    def receive(self, data: bytes) -> list[can.Message]:
        """Process bytes from the host; return the CAN frames that they contain, for the bus.

        An incomplete line at the end is stored until the next call.
        """
        frames = []
        for character in data.decode("latin-1"):
            if character != "\r":
                self._line = (self._line + character)[:LONGEST]
                continue
            line, self._line = self._line, ""
            frame = self._frame(line)
            if frame:
                frames.append(frame)
            self._replies += self._reply(line, frame)
        return frames

    def pending(self) -> bytes:
        """Return all answers for the host that no earlier call of this method has returned."""
        replies, self._replies = self._replies, ""
        return replies.encode("latin-1")

    def encode(self, message: can.Message) -> bytes:
        """Return the line of text by which the adapter sends a CAN frame of the bus to the host.

        The line is empty while the channel is closed.
        """
        if not self.is_open:
            return b""
        kind = "r" if message.is_remote_frame else "t"
        identifier = f"{message.arbitration_id:03X}"
        if message.is_extended_id:
            kind, identifier = kind.upper(), f"{message.arbitration_id:08X}"
        line = f"{kind}{identifier}{message.dlc}{message.data.hex().upper()}"
        if self.stamps:
            line += f"{int(message.timestamp * 1e3) % 60_000:04X}"
        return f"{line}\r".encode()

    def _frame(self, line: str) -> can.Message | None:
        match = STANDARD.fullmatch(line) or EXTENDED.fullmatch(line)
        if not match or not self.is_open or self.flags & TRANSMIT_QUEUE_FULL:
            return None
        kind, identifier, length, data = match.groups()
        is_remote = kind in "rR"
        if len(data) != (0 if is_remote else 2 * int(length)):
            return None
        return can.Message(
            arbitration_id=int(identifier, 16),
            is_extended_id=kind in "TR",
            is_remote_frame=is_remote,
            dlc=int(length),
            data=bytes.fromhex(data),
        )

    def _reply(self, line: str, frame: can.Message | None) -> str:
        """Execute the command in a line of the host, and return the answer to the line.

        `frame`: None if the line is a command, or if the frame is refused.
        """
        if frame:
            return "Z\r" if frame.is_extended_id else "z\r"
        if line == "":
            return DONE
        if line == "V":
            return "V1013\r"
        if line == "N":
            return "NTELE\r"
        if line == "F" and self.is_open:
            return f"F{self.flags:02X}\r"
        if line == "C" and self.is_open:
            self.is_open = False
            return DONE
        if line == "O" and not self.is_open and self.bitrate:
            self.is_open = True
            return DONE
        if line in BITRATES and not self.is_open:
            self.bitrate = BITRATES[line]
            return DONE
        if line in ("Z0", "Z1") and not self.is_open:
            self.stamps = line == "Z1"
            return DONE
        return REFUSED
