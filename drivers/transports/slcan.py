"""An slcan (Lawicel) CAN adapter on a serial port, read in bulk for loops of 1 kHz and more.

The adapter's lines of text end with CR: `t1812A5B0` is a data frame with identifier 0x181 and two
bytes, `T` one with a 29-bit identifier, `r` and `R` are remote frames. The adapter answers each
frame that it takes with `z` or `Z` and CR, every other command with CR, and what it refuses with a
bare BEL; frames from the bus come between the answers. Protocol: Lawicel, CANUSB Manual 1.0.
"""

from __future__ import annotations

import contextlib
import io
import os
import select
import time
from binascii import hexlify, unhexlify
from collections import deque
from enum import IntFlag

import can
import serial

CR, BEL = b"\r", b"\a"
BITRATES = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
"""Bit rates [bit/s] of the commands S0 to S8."""
LINE_LIMIT = 64
"""Length kept of a line that does not end: twice the longest frame's."""
CHUNK = 65_536
"""Most bytes taken by one read."""
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


class PortablePort:
    """A serial port by the calls that pyserial has on every system and for every URL."""

    def __init__(self, port: serial.SerialBase) -> None:
        self._port = port

    def read(self, timeout: float | None) -> bytes:
        """All bytes that have arrived; if there are none, wait for some [s], None for ever."""
        deadline = None if timeout is None else time.monotonic() + timeout
        while not (waiting := self._port.in_waiting):
            if deadline is not None and time.monotonic() >= deadline:
                return b""
            time.sleep(1e-3)
        return bytes(self._port.read(waiting))

    def write(self, data: bytes, timeout: float) -> int:
        """Write all bytes, or raise where the port takes none; how many it took."""
        return int(self._port.write(data))

    def close(self) -> None:
        """Close the port."""
        self._port.close()


class DescriptorPort(PortablePort):
    """The same by POSIX calls on the file descriptor, at a fifth of the time."""

    def __init__(self, port: serial.SerialBase) -> None:
        super().__init__(port)
        self._descriptor: int = port.fileno()

    def read(self, timeout: float | None) -> bytes:
        """All bytes that have arrived; if there are none, wait for some [s], None for ever."""
        if not select.select([self._descriptor], [], [], timeout)[0]:
            return b""
        data = os.read(self._descriptor, CHUNK)
        if not data:
            raise OSError("end of file")
        return data

    def write(self, data: bytes, timeout: float) -> int:
        """Write what the port takes within a time [s]; how many bytes it took."""
        taken = self._write_some(data)
        if taken < len(data):
            deadline = time.monotonic() + timeout
            while taken < len(data) and (left := deadline - time.monotonic()) > 0.0:
                select.select([], [self._descriptor], [], left)
                taken += self._write_some(data[taken:])
        return taken

    def close(self) -> None:
        """Close the port; no use of it afterwards reaches another file."""
        self._descriptor = -1
        super().close()

    def _write_some(self, data: bytes) -> int:
        try:
            return os.write(self._descriptor, data)
        except BlockingIOError:
            return 0


def open_port(channel: str, tty_baudrate: int) -> PortablePort:
    """A serial port by the fastest calls that it has, and with the least latency."""
    port = serial.serial_for_url(channel, tty_baudrate, timeout=0, write_timeout=ANSWER)
    with contextlib.suppress(AttributeError, NotImplementedError, ValueError, OSError):
        port.set_low_latency_mode(True)
    with contextlib.suppress(io.UnsupportedOperation):
        if os.name == "posix":
            return DescriptorPort(port)
    return PortablePort(port)


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
        self._refusal = ""
        try:
            self._port = open_port(channel, tty_baudrate)
        except (OSError, ValueError) as error:
            raise can.CanInitializationError(f"{channel} cannot be opened: {error}") from error
        try:
            self._open_channel(bitrate)
        except BaseException:
            self._port.close()
            raise
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
                    f"{self.channel_info}: 'C' (close) is not answered: check that this is the port "
                    "of an slcan adapter, that no other program uses it, and that its firmware "
                    "acknowledges commands"
                )
        with self._port_in_use():
            while self._port.read(QUIET) and time.monotonic() < deadline + BOOT:
                pass
        if bitrate is not None:
            code = b"S%d" % BITRATES.index(bitrate)
            self._demand(code, "bit rate", f"check that the adapter offers {bitrate} bit/s")
        self._demand(b"O", "open", "check its bit rate, and that no other program uses it")

    def _demand(self, command: bytes, meaning: str, advice: str) -> None:
        answer = self._ask(command)
        if answer != CR:
            fault = "is refused" if answer else "is not acknowledged"
            raise can.CanInitializationError(
                f"{self.channel_info}: {command.decode()!r} ({meaning}) {fault}: {advice}"
            )

    def _ask(self, command: bytes) -> bytes:
        """The CR or BEL at the end of an adapter's first line of answer; empty if none came."""
        deadline = time.monotonic() + ANSWER
        answer = b""
        with self._port_in_use():
            self._port.write(command + CR, ANSWER)
            while (left := deadline - time.monotonic()) > 0.0:
                answer += self._port.read(left)
                for place, byte in enumerate(answer):
                    ...
        return b""
