"""Communicate with an slcan (Lawicel) CAN adapter on a serial port, in a loop of 1 kHz or more.

The adapter sends and receives lines of text that end with CR. `t1812A5B0` is a data frame with the
identifier 0x181 and two bytes, 0xA5 and 0xB0. A line that starts with `T` is a data frame with a
29-bit identifier. Lines that start with `r` and `R` are remote frames. If the adapter accepts a
frame, it answers `z` or `Z`, followed by CR. If it accepts another command, it answers CR. If the
command requests data, the data come before this CR. If it refuses a frame or command, it answers
BEL. Frames from the CAN bus can arrive between the answers. See Lawicel, CANUSB Manual 1.0.
"""

from __future__ import annotations

import contextlib
import re
import time
from binascii import hexlify, unhexlify
from collections import deque
from enum import IntFlag

import can

from drivers.transports.bulk_port import open_port


def encode(msg: can.Message) -> bytes:
    """Return a CAN frame as a line of the slcan protocol, with the CR at the end."""
    length = 0 if msg.is_remote_frame else msg.dlc
    limit = 1 << 29 if msg.is_extended_id else 1 << 11
    if (
        msg.is_fd
        or msg.is_error_frame
        or msg.dlc > 8
        or len(msg.data) != length
        or not 0 <= msg.arbitration_id < limit
    ):
        raise ValueError(f"slcan frame {msg!r}: expected a classical data or remote frame")
    kind = "r" if msg.is_remote_frame else "t"
    if msg.is_extended_id:
        head = f"{kind.upper()}{msg.arbitration_id:08X}{msg.dlc}"
    else:
        head = f"{kind}{msg.arbitration_id:03X}{msg.dlc}"
    return head.encode() + hexlify(msg.data).upper() + b"\r"


def decode(line: bytes, timestamp: float) -> can.Message:
    """Return the CAN frame that a line of the slcan protocol contains."""
    extended, remote = line[:1] in b"TR", line[:1] in b"rR"
    place = 9 if extended else 4
    identifier = int.from_bytes(unhexlify(line[1:9] if extended else b"0" + line[1:4]), "big")
    length = b"012345678".index(line[place : place + 1])
    stop = place + 1 + (0 if remote else 2 * length)
    if len(line) not in (stop, stop + 4) or identifier >= 1 << (29 if extended else 11):
        raise ValueError("invalid frame")
    data = unhexlify(line[place + 1 :])
    return can.Message(
        timestamp=timestamp,
        arbitration_id=identifier,
        is_extended_id=extended,
        is_remote_frame=remote,
        dlc=length,
        data=data[:length],
    )


CR, BEL = b"\r", b"\a"
ACKNOWLEDGEMENTS = (b"", b"z", b"Z")
"""Lines, without CR, with which the adapter accepts a command."""
FRAMES = (b"t", b"T", b"r", b"R")
"""First bytes of the lines that contain a CAN frame."""
BARE = re.compile(rb"(?<![^\r\a])[\r\a]")
"""Pattern of CR or BEL on a line without other text, which is the answer to a set-up command."""
BITRATES = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
"""Bit rates [bit/s] of the commands S0 to S8."""
LINE_LIMIT = 64
"""Largest number of stored bytes of an incomplete line, twice the length of the longest line."""
IN_FLIGHT_LIMIT = 1000
"""Largest number of stored unanswered commands."""
BOOT = 2.0
"""Longest boot time of an adapter [s]. Many adapters boot when their port is opened."""
ANSWER = 0.25
"""Longest answer time of an adapter during set-up [s]."""
QUIET = 0.05
"""If no byte arrives during this time [s], all bytes that the adapter has sent are assumed to
have arrived. USB adapters can delay bytes by 16 ms."""


class StatusFlags(IntFlag):
    """Status flags of an slcan adapter: the states of its queues, and the errors on its CAN bus."""

    RECEIVE_QUEUE_FULL = 0x01
    TRANSMIT_QUEUE_FULL = 0x02
    ERROR_WARNING = 0x04
    DATA_OVERRUN = 0x08
    ERROR_PASSIVE = 0x20
    ARBITRATION_LOST = 0x40
    BUS_ERROR = 0x80


class SlcanBus(can.BusABC):
    """A CAN bus with an slcan adapter, as an interface of python-can.

    `bitrate`: None to keep the present setting of the adapter.

    `recv` and `drain` read all waiting bytes of the port. Invalid lines, for example frames
    changed by noise, are counted and skipped. `send` does not wait for the adapter's answer. If the
    adapter refuses a frame, a later call of `recv` or `drain` reads the refusal and raises
    CanOperationError. The frames that this call received are not lost: the next call returns them.
    Call `recv` or `drain` about as often as `send`, because an adapter may stop if its answers are
    not read. This class has no method `fileno`, because waiting for the file descriptor of the port
    would not detect frames that were already read from the port and stored in this object.
    Therefore, python-can's Notifier reads this bus in a thread.
    """

    def __init__(
        self,
        channel: str,
        bitrate: int | None = None,
        tty_baudrate: int = 115_200,
        can_filters: can.typechecking.CanFilters | None = None,
    ) -> None:
        if bitrate is not None and bitrate not in BITRATES:
            rates = ", ".join(map(str, BITRATES))
            raise ValueError(f"{channel}: slcan bit rate {bitrate}: expected one of {rates}")
        self.channel_info = f"slcan adapter on {channel}"
        self.flags: StatusFlags | None = None
        """Flags in the adapter's last answer to a status request."""
        self.acknowledged = 0
        """Number of commands that the adapter accepted."""
        self.refused = 0
        """Number of commands that the adapter refused."""
        self.unassigned = 0
        """Number of answers that arrived when no command was waiting for an answer."""
        self.malformed = 0
        """Number of invalid lines."""
        self._received: deque[can.Message] = deque()
        self._in_flight: deque[bytes] = deque(maxlen=IN_FLIGHT_LIMIT)
        self._rest = b""
        self._cut = b""
        self._refusal = b""
        try:
            self._port = open_port(channel, tty_baudrate)
            try:
                self._open_channel(bitrate)
            except BaseException:
                self._port.close()
                raise
        except (OSError, ValueError) as error:
            raise can.CanInitializationError(
                f"{self.channel_info} cannot be opened: {error}"
            ) from error
        super().__init__(channel, can_filters)

    @property
    def unanswered(self) -> int:
        """Number of sent commands that the adapter has not yet answered. It is limited to 1000."""
        return len(self._in_flight)

    def drain(self) -> list[can.Message]:
        """Return all received frames, without waiting."""
        self._fetch(0.0)
        frames = list(self._received)
        self._received.clear()
        return [f for f in frames if self._matches_filters(f)] if self._filters else frames

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame to the adapter, without waiting for its answer.

        `timeout`: None for no wait.
        """
        self._write(encode(msg), timeout or 0.0)

    def status(self) -> StatusFlags | None:
        """Request the status flags of the adapter, without waiting for the answer.

        The result is None if there is no answer yet.
        """
        self._write(b"F\r", 0.0)
        return self.flags

    def shutdown(self) -> None:
        """Close the adapter's CAN channel and the port. This method may be called repeatedly."""
        if not self._is_shutdown:
            super().shutdown()
            with contextlib.suppress(can.CanOperationError):
                self._write(b"C\r", 0.0)
            self._port.close()

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._received:
            self._fetch(timeout)
        return (self._received.popleft() if self._received else None), False

    def _open_channel(self, bitrate: int | None) -> None:
        """Close the CAN channel, set the bit rate if it is not None, and open the channel."""
        deadline = time.monotonic() + BOOT
        while not self._ask(b"\rC"):
            if time.monotonic() > deadline:
                raise can.CanInitializationError(
                    f"{self.channel_info}: 'C' (close) is not acknowledged: check that this is the "
                    "port of an slcan adapter whose firmware acknowledges commands, and that no "
                    "other program uses it"
                )
        while self._port.read(QUIET) and time.monotonic() < deadline + BOOT:
            pass
        if bitrate is not None:
            code = b"S%d" % BITRATES.index(bitrate)
            self._demand(code, f"check that the adapter offers {bitrate} bit/s")
        self._demand(b"O", "check that a bit rate is set, and that no other program uses the port")
        self._parse(b"")

    def _demand(self, command: bytes, advice: str) -> None:
        answer = self._ask(command)
        if answer != CR:
            fault = "is refused" if answer else "is not acknowledged"
            raise can.CanInitializationError(
                f"{self.channel_info}: {command.decode()!r} {fault}: {advice}"
            )

    def _ask(self, command: bytes) -> bytes:
        """Send a set-up command; return CR if accepted, BEL if refused, b"" if not answered."""
        self._port.write(command + CR, ANSWER)
        deadline = time.monotonic() + ANSWER
        text = b""
        while (left := deadline - time.monotonic()) > 0.0:
            text += self._port.read(left)
            if answer := BARE.search(text):
                self._rest = text[answer.end() :]
                return answer[0]
        return b""

    def _write(self, line: bytes, timeout: float) -> None:
        data = self._cut + line
        try:
            written = self._port.write(data, timeout)
        except (OSError, ValueError) as error:
            raise self._gone(error) from error
        self._in_flight.append(line)
        self._cut = b"" if written == len(data) else CR
        if self._cut:
            raise can.CanOperationError(
                f"{self.channel_info}: the port's buffer is full: expected a running adapter"
            )

    def _fetch(self, timeout: float | None) -> None:
        """Read and process all waiting bytes; raise CanOperationError if a frame was refused."""
        try:
            data = self._port.read(timeout)
        except (OSError, ValueError) as error:
            raise self._gone(error) from error
        if data:
            self._parse(data)
            if self._refusal:
                refusal, self._refusal = self._refusal, b""
                raise can.CanOperationError(
                    f"{self.channel_info}: frame {refusal.decode().strip()} was refused, "
                    f"{self.refused} so far: its queue is full, or the bus is off or closed"
                )

    def _parse(self, data: bytes) -> None:
        *lines, rest = (self._rest + data).replace(BEL, BEL + CR).split(CR)
        self._rest = rest[:LINE_LIMIT]
        now = time.time()
        for line in lines:
            try:
                if line[-1:] == BEL:
                    self._process_refusal(line)
                elif line[:1] in FRAMES:
                    self._received.append(decode(line, now))
                else:
                    self._process_answer(line)
            except ValueError:
                self.malformed += 1

    def _process_answer(self, line: bytes) -> None:
        if line[:1] == b"F" and len(line) == 3:
            self.flags = StatusFlags(unhexlify(line[1:])[0])
        elif line not in ACKNOWLEDGEMENTS:
            raise ValueError("invalid slcan line")
        if self._in_flight:
            self._in_flight.popleft()
            self.acknowledged += 1
        else:
            self.unassigned += 1

    def _process_refusal(self, line: bytes) -> None:
        """Process the answer with which the adapter refuses the oldest unanswered command."""
        if not self._in_flight:
            self.unassigned += 1
        else:
            self.refused += 1
            command = self._in_flight.popleft()
            if command[:1] in FRAMES:
                self._refusal = command
        if line != BEL:
            raise ValueError("invalid slcan line before the refusal")

    def _gone(self, error: Exception) -> can.CanOperationError:
        return can.CanOperationError(f"{self.channel_info}: the port is disconnected: {error}")
