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
from collections.abc import Sequence
from enum import IntFlag

import can

from drivers.rig import new_tuple
from drivers.transports.bulk_port import open_port
from drivers.transports.can_frame import CanFrame


def encode(frame: CanFrame) -> bytes:
    """Return a CAN frame as a line of the slcan protocol, with the CR at the end."""
    identifier, length, extended = frame.arbitration_id, frame.dlc, frame.is_extended_id
    if (
        frame.is_fd
        or frame.is_error_frame
        or length > 8
        or (frame.is_remote_frame and frame.data)
        or not 0 <= identifier < (1 << 29 if extended else 1 << 11)
    ):
        raise ValueError(f"slcan frame {frame!r}: expected a classical data or remote frame")
    kind = KINDS[extended, frame.is_remote_frame]
    layout = b"%b%08X%d%b\r" if extended else b"%b%03X%d%b\r"
    return layout % (kind, identifier, length, hexlify(frame.data).upper())


def decode(line: bytes) -> CanFrame:
    """Return the CAN frame that a line of the slcan protocol contains.

    The time stamp of the adapter, two bytes that may be at the end, is not used.
    """
    kind = line[:1]
    extended, remote = kind in b"TR", kind in b"rR"
    if extended:
        octets, start, most = unhexlify(b"0" + line[1:]), 5, 1 << 29
    else:
        octets, start, most = unhexlify(line[1:]), 2, 1 << 11
    head = int.from_bytes(octets[:start], "big")
    identifier, length = head >> 4, head & 0xF
    stop = start if remote else start + length
    if len(octets) not in (stop, stop + 2) or length > 8 or identifier >= most:
        raise ValueError("invalid frame")
    requested = length if remote else 0
    values = (identifier, octets[start:stop], 0.0, extended, remote, False, False, False, requested)
    return new_tuple(CanFrame, values)


CR, BEL = b"\r", b"\a"
ACKNOWLEDGEMENTS = (b"", b"z", b"Z")
"""Lines, without CR, with which the adapter accepts a command."""
FRAMES = (b"t", b"T", b"r", b"R")
"""First bytes of the lines that contain a CAN frame."""
KINDS = {(False, False): b"t", (True, False): b"T", (False, True): b"r", (True, True): b"R"}
"""First byte of a line, for each `is_extended_id` and `is_remote_frame` of the frame."""
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
    changed by noise, are counted and skipped. `send` and `put` do not wait for the adapter's
    answer. `put` sends several frames at once. If the adapter refuses a frame, a later call of
    `recv` or `drain` reads the refusal and raises
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
        self._received: deque[CanFrame] = deque()
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

    def drain(self) -> list[CanFrame]:
        """Return all received frames, without waiting."""
        self._fetch(0.0)
        frames = list(self._received)
        self._received.clear()
        if self._filters:
            return [frame for frame in frames if self._matches_filters(frame.message())]
        return frames

    def put(self, frames: Sequence[CanFrame]) -> None:
        """Send frames to the adapter, without waiting for its answers."""
        self._write([encode(frame) for frame in frames], 0.0)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame to the adapter, without waiting for its answer.

        `timeout`: None for no wait.
        """
        frame = CanFrame.of(msg)
        if frame.dlc != msg.dlc:
            raise ValueError(f"slcan frame {msg!r}: expected a classical data or remote frame")
        self._write([encode(frame)], timeout or 0.0)

    def status(self) -> StatusFlags | None:
        """Request the status flags of the adapter, without waiting for the answer.

        The result is None if there is no answer yet.
        """
        self._write([b"F\r"], 0.0)
        return self.flags

    def shutdown(self) -> None:
        """Close the adapter's CAN channel and the port. This method may be called repeatedly."""
        if not self._is_shutdown:
            super().shutdown()
            with contextlib.suppress(can.CanOperationError):
                self._write([b"C\r"], 0.0)
            self._port.close()

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._received:
            self._fetch(timeout)
        if not self._received:
            return None, False
        return self._received.popleft()._replace(timestamp=time.time()).message(), False

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

    def _write(self, lines: list[bytes], timeout: float) -> None:
        """Write lines at once. After a line that the port accepts in part, no further line is sent.

        The next call completes this line by CR. The adapter then answers it.
        """
        data = self._cut + b"".join(lines)
        try:
            written = self._port.write(data, timeout) if timeout else self._port.send(data)
        except (OSError, ValueError) as error:
            raise self._gone(error) from error
        if written == len(data):
            self._in_flight.extend(lines)
            self._cut = b""
            return
        end = len(self._cut)
        for line in lines:
            self._in_flight.append(line)
            end += len(line)
            if end > written:
                break
        self._cut = CR
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
        for line in lines:
            try:
                if line[-1:] == BEL:
                    self._process_refusal(line)
                elif line[:1] in FRAMES:
                    self._received.append(decode(line))
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
