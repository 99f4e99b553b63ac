"""An slcan (Lawicel) CAN adapter on a serial port, read in bulk for loops of 1 kHz and more.

The adapter's lines of text end with CR: `t1812A5B0` is a data frame with identifier 0x181 and two
bytes, `T` one with a 29-bit identifier, `r` and `R` are remote frames. The adapter answers each
frame that it takes with `z` or `Z` and CR, every other command with CR, and what it refuses with a
bare BEL; frames from the bus come between the answers. Protocol: Lawicel, CANUSB Manual 1.0.
"""

from __future__ import annotations

import contextlib
import re
import time
from binascii import unhexlify
from collections import deque
from enum import IntFlag

import can

from drivers.transports.bulk_port import open_port
from drivers.transports.slcan_frames import decode, encode

CR, BEL = b"\r", b"\a"
ACKNOWLEDGEMENTS = (b"", b"z", b"Z")
FRAMES = (b"t", b"T", b"r", b"R")
BARE = re.compile(rb"(?<![^\r\a])[\r\a]")
"""CR or BEL that ends an empty line."""
BITRATES = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
"""Bit rates [bit/s] of the commands S0 to S8."""
LINE_LIMIT = 64
"""Length kept of a line that does not end: twice the longest frame's."""
IN_FLIGHT_LIMIT = 1000
"""Unanswered commands that are remembered."""
BOOT = 2.0
"""Time that an adapter may take to boot, as many do when their port is opened [s]."""
ANSWER = 0.25
"""Time that an adapter may take to answer while it is set up [s]."""
QUIET = 0.05
"""Silence after which nothing of what came before is under way: USB delays by 16 ms [s]."""


class StatusFlags(IntFlag):
    """What an adapter reports of itself and of the bus."""

    RECEIVE_QUEUE_FULL = 0x01
    TRANSMIT_QUEUE_FULL = 0x02
    ERROR_WARNING = 0x04
    DATA_OVERRUN = 0x08
    ERROR_PASSIVE = 0x20
    ARBITRATION_LOST = 0x40
    BUS_ERROR = 0x80


class SlcanBus(can.BusABC):
    """A CAN bus behind an slcan adapter.

    `recv` and `drain` take all that the port holds at once. Lines that are no slcan, such as
    frames hit by noise, are counted and skipped. `send` does not wait for the adapter's answer:
    the `recv` or `drain` that finds a frame refused raises CanOperationError, once, and what was
    received meanwhile stays for the next call. Read about as often as you send: an adapter whose
    answers nobody takes may come to a stop. It has no `fileno`, since frames may be waiting here
    when nothing is at the port; python-can's Notifier then reads from a thread.

    Parameters
    ----------
    channel
        Serial port, such as `/dev/ttyACM0` or `COM8`, or a pyserial URL.
    bitrate
        Bit rate of the bus [bit/s]; None for what the adapter was set to before.
    tty_baudrate
        Line rate [bit/s]; adapters on USB ignore it. At 115200 bit/s, 500 frames pass a second.
    can_filters
        python-can's filters of what is received.

    Raises
    ------
    ValueError
        The protocol has no such bit rate.
    can.CanInitializationError
        The port cannot be opened, or the adapter does not acknowledge a command.
    """

    def __init__(
        self,
        channel: str,
        bitrate: int | None = None,
        tty_baudrate: int = 115_200,
        can_filters: can.typechecking.CanFilters | None = None,
    ) -> None:
        if bitrate is not None and bitrate not in BITRATES:
            offered = ", ".join(map(str, BITRATES))
            raise ValueError(f"{channel}: slcan has no bit rate {bitrate}, choose one of {offered}")
        self.channel_info = f"slcan adapter on {channel}"
        self.flags: StatusFlags | None = None
        """The adapter's flags as of its last answer to `status`."""
        self.acknowledged = 0
        """Commands that the adapter took."""
        self.refused = 0
        """Commands that it refused."""
        self.unassigned = 0
        """Acknowledgements and refusals that answer nothing that was sent."""
        self.malformed = 0
        """Lines that are no slcan."""
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
        """Commands that the adapter has neither taken nor refused yet, at most 1000."""
        return len(self._in_flight)

    def drain(self) -> list[can.Message]:
        """All frames received, without waiting.

        Raises
        ------
        can.CanOperationError
            The adapter refused a frame, or its port is gone.
        """
        self._fetch(0.0)
        frames = list(self._received)
        self._received.clear()
        return [f for f in frames if self._matches_filters(f)] if self._filters else frames

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Hand a frame to the adapter, without waiting for its answer.

        Parameters
        ----------
        msg
            Classical data or remote frame.
        timeout
            How long to wait for room in the port [s]; None not to wait.

        Raises
        ------
        ValueError
            Not a classical frame, or one with too large an identifier or the wrong length.
        can.CanOperationError
            The port is full or gone; the frame is lost.
        """
        self._write(encode(msg), timeout or 0.0)

    def status(self) -> StatusFlags | None:
        """Ask the adapter for its flags, and return those last known, None before any.

        Raises
        ------
        can.CanOperationError
            The port is full or gone.
        """
        self._write(b"F\r", 0.0)
        return self.flags

    def shutdown(self) -> None:
        """Close the adapter's channel and the port; may be repeated."""
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
        """Close what another program left open, set the bit rate, and open."""
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
        """The bare CR or BEL that answers a command, empty if none came in time."""
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
            taken = self._port.write(data, timeout)
        except (OSError, ValueError) as error:
            raise self._gone(error) from error
        self._in_flight.append(line)
        self._cut = b"" if taken == len(data) else CR
        if self._cut:
            raise can.CanOperationError(
                f"{self.channel_info}: the port takes no more, has the adapter come to a stop?"
            )

    def _fetch(self, timeout: float | None) -> None:
        """Take all that the port holds, and tell of a frame that was refused."""
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
                    self._take_refusal(line)
                elif line[:1] in FRAMES:
                    self._received.append(decode(line, now))
                else:
                    self._take_answer(line)
            except ValueError:
                self.malformed += 1

    def _take_answer(self, line: bytes) -> None:
        if line[:1] == b"F" and len(line) == 3:
            self.flags = StatusFlags(unhexlify(line[1:])[0])
        elif line not in ACKNOWLEDGEMENTS:
            raise ValueError("no slcan")
        if self._in_flight:
            self._in_flight.popleft()
            self.acknowledged += 1
        else:
            self.unassigned += 1

    def _take_refusal(self, line: bytes) -> None:
        """Of the oldest command without an answer: adapters answer in order."""
        if not self._in_flight:
            self.unassigned += 1
        else:
            self.refused += 1
            command = self._in_flight.popleft()
            if command[:1] in FRAMES:
                self._refusal = command
        if line != BEL:
            raise ValueError("no slcan before the refusal")

    def _gone(self, error: Exception) -> can.CanOperationError:
        return can.CanOperationError(
            f"{self.channel_info}: the port is gone, was it unplugged? ({error})"
        )
