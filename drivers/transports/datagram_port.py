"""Exchange UDP datagrams with a device in a control loop. They are read once per tick."""

from __future__ import annotations

import contextlib
import socket
import struct
import sys
import time
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from drivers.rig import RigError, reason
from drivers.transports.bus import Bus

if TYPE_CHECKING:
    from drivers.device import DatagramDevice

MOST = 256
"""Largest number of datagrams that one reading returns. The next reading returns the others."""
BUFFER = 1 << 20
"""Wanted size of the kernel's buffer for received datagrams [bytes]. If it is full, new datagrams
are lost."""
LARGEST = 65_535
"""Largest number of bytes of a datagram."""
PACKET = 2048
"""Number of bytes that a reading on Linux returns of a datagram, more than one Ethernet frame."""
LATEST = 1.0
"""Largest age of a time stamp of the kernel [s]. An older time stamp is not used."""
SO_TIMESTAMPNS = 35
"""Socket option of Linux: the kernel adds the time of arrival to each received datagram."""
IP_RECVERR = 11
"""Socket option of Linux: a datagram that was refused is reported also without a connection."""
MSG_ERRQUEUE = 0x2000
"""Flag of Linux for the reading of the reports on refused datagrams."""
TIMESPEC = struct.Struct("@ll")
CONTROL = 64
"""Size of the buffer for the time stamp of a datagram [bytes]."""
REFUSED = (ConnectionRefusedError, ConnectionResetError)
"""Errors that report a datagram which was refused, on Linux and on Windows."""


Datagram = tuple[bytes, tuple[Any, ...], float]
"""Received data, address of their sender, and time of arrival on the system clock [s]; 0 if it is
not known."""


class DatagramPort(Bus):
    """The exchange of UDP datagrams with one device.

    A datagram is refused if no program of the device receives from its port. If this happens before
    the first datagram of the device has arrived, it is an error. Later it is counted, and the
    device is only silent, because it may restart.
    """

    def __init__(
        self,
        name: str,
        now: Callable[[], float],
        host: str,
        udp_port: int,
        local_host: str = "",
        local_port: int = 0,
    ) -> None:
        super().__init__(name, now)
        self.host = host
        self.port = f"{host}:{udp_port}"
        """Address of the device in messages."""
        self.received = 0
        """Number of datagrams that the device has sent."""
        self.rejected: Counter[str] = Counter()
        """Number of datagrams that were not passed to the device, by reason."""
        self._address = host, udp_port
        self._local = local_host, local_port
        self._device: tuple[Any, ...] = ()
        self._socket: socket.socket | None = None
        self._take: Callable[[], Datagram] = self._take_plain
        self._receive: Callable[[bytes, float], object] | None = None
        self._polled = now()

    def attach(self, receive: Callable[[bytes, float], object], rejected: Counter[str]) -> None:
        """Register the function to which `poll` passes each datagram and its arrival time [s].

        The datagrams of other senders and the refused datagrams are counted in `rejected`.
        """
        self._receive, self.rejected = receive, rejected

    def connect(self, device: DatagramDevice) -> None:
        """Pass the received datagrams to a device."""
        self.attach(device.receive, device.rejected)

    def open(self) -> None:
        """Find the address of the device, and open a local port. Nothing is sent yet."""
        try:
            found = socket.getaddrinfo(*self._address, type=socket.SOCK_DGRAM)
            family, kind, protocol, _, self._device = found[0]
            self._claim(f"UDP {self._device[:2]}", f"UDP port {self.port}")
            self._socket = opened = socket.socket(family, kind, protocol)
            opened.setblocking(False)
            opened.bind(self._local)
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        except OSError as error:
            self.close()
            raise RigError(
                f"{self.name}: UDP port {self.port} cannot be opened: {reason(error)}"
            ) from error
        self._take = self._take_plain
        if sys.platform == "linux":
            opened.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
            if family == socket.AF_INET:
                opened.setsockopt(socket.IPPROTO_IP, IP_RECVERR, 1)
            self._take = self._take_stamped
        self.received = 0
        self._polled = self.now()

    def _take_plain(self) -> Datagram:
        assert self._socket
        return *self._socket.recvfrom(LARGEST), 0.0

    def _take_stamped(self) -> Datagram:
        assert self._socket
        data, control, _, sender = self._socket.recvmsg(PACKET, CONTROL)
        for _, kind, stamp in control:
            if kind == SO_TIMESTAMPNS and len(stamp) == TIMESPEC.size:
                seconds, nanoseconds = TIMESPEC.unpack(stamp)
                return data, sender, seconds + 1e-9 * nanoseconds
        return data, sender, 0.0

    def poll(self) -> None:
        """Pass each datagram of the device to the function that `attach` has registered.

        The arrival time is the time stamp of the kernel on Linux. On other systems, it is the mean
        of the time of this reading and the time of the previous reading.
        """
        datagrams: list[Datagram] = []
        try:
            for _ in range(MOST):
                try:
                    datagrams.append(self._take())
                except REFUSED:
                    self._count_refusal()
        except BlockingIOError:
            pass
        except OSError as error:
            raise self._gone(error) from error
        now = self.now()
        middle, self._polled = 0.5 * (self._polled + now), now
        if not datagrams:
            return
        wall, device = time.time(), self._device[:2]
        for data, sender, stamp in datagrams:
            if sender[:2] != device:
                self.rejected["another sender"] += 1
                continue
            self.received += 1
            if self.log:
                self.log("<", data.hex())
            if self._receive:
                age = wall - stamp
                self._receive(data, now - age if 0.0 <= age < LATEST else middle)

    def send(self, data: bytes) -> None:
        """Send a datagram to the device, without waiting."""
        assert self._socket
        if self.log:
            self.log(">", data.hex())
        try:
            try:
                self._socket.sendto(data, self._device)
            except REFUSED:  # of an earlier datagram: this one was not sent
                self._count_refusal()
                self._socket.sendto(data, self._device)
        except BlockingIOError as error:
            raise RigError(
                f"{self.name}: UDP port {self.port} does not send: its buffer is full"
            ) from error
        except OSError as error:
            raise self._gone(error) from error

    def _count_refusal(self) -> None:
        """Count a refused datagram. If nothing has arrived yet, the device is missing."""
        assert self._socket
        if self._take == self._take_stamped:
            with contextlib.suppress(BlockingIOError):
                self._socket.recvmsg(0, CONTROL, MSG_ERRQUEUE)
        self.rejected["refused"] += 1
        if not self.received:
            raise RigError(
                f"{self.name}: UDP port {self.port} refuses datagrams: expected a device that "
                "receives them on this port"
            )

    def close(self) -> None:
        """Close the local port."""
        if self._socket:
            self._socket.close()
        self._socket = None
        self._held.close()

    def _gone(self, error: Exception) -> RigError:
        return RigError(f"{self.name}: UDP port {self.port} is disconnected: {reason(error)}")
