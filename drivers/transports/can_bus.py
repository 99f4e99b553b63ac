"""Use a CAN bus in a control loop. The bus is read once per tick."""

from __future__ import annotations

import contextlib
import ipaddress
import json
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can

from drivers.rig import RigError, reason
from drivers.transports.bus import Bus
from drivers.transports.can_adapter import (
    EXTENDED,
    CanAdapter,
    PythonCanAdapter,
    SocketCanAdapter,
)
from drivers.transports.can_frame import CanFrame
from drivers.transports.slcan import SlcanBus, StatusFlags

if TYPE_CHECKING:
    from drivers.device import CanDevice, Device

LATEST = 1.0
"""Largest age of a frame's time stamp on the system clock [s].

If a time stamp is older, it must be from another clock. Such a time stamp is not used.
"""
STATUS_EVERY = 0.01
"""Period of the status requests to an slcan adapter [s]."""
BUS_OFF = 0x40
"""Bit in the identifier of a Linux error frame. It is set if the CAN controller is bus-off."""
MULTICAST_PORT = 43113
"""Port of the interface `udp_multicast` of python-can if the options contain none."""
NOT_IDENTIFYING = ("can_filters", "fd", "receive_own_messages", "timing")
"""Options of python-can that every interface may have. The other options may identify an adapter.
"""
UNSHARED = ("slcan", "virtual")
"""Interfaces that are not claimed. `SlcanBus` locks its serial port, and a virtual bus exists only
in one process."""


FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Possible numbers of data bytes of a CAN FD frame."""
FD_MTU = 72
"""Smallest maximum transmission unit of a SocketCAN interface with CAN FD [bytes]."""


BITS = tuple(47 + 8 * n + (33 + 8 * n) // 4 for n in range(9))
"""Largest number of bits of a CAN frame with n data bytes, with stuff bits and interframe space."""
EXTENDED_BITS = tuple(67 + 8 * n + (53 + 8 * n) // 4 for n in range(9))
"""The same for a frame with an identifier of 29 bits."""
FD_BITS = 30
"""Number of bits of a CAN FD frame that are sent with the bit rate of the arbitration."""
FD_EXTENDED_BITS = 48
FD_CHECK_BITS = 30
"""Largest number of bits of a CAN FD frame besides its data that are sent with their bit rate."""


class CanBus(Bus):
    """A CAN bus. Each received frame is passed to the function registered for its identifier.

    `bitrate`: None to leave the bit rate unchanged. `fd`: whether the bus has CAN FD.
    `data_bitrate`: bit rate of the data of a CAN FD frame; None to leave it unchanged.
    """

    def __init__(
        self,
        name: str,
        now: Callable[[], float],
        interface: str,
        channel: str,
        bitrate: int | None,
        options: Mapping[str, Any],
        fd: bool = False,
        data_bitrate: int | None = None,
    ) -> None:
        super().__init__(name, now)
        self.interface = interface
        self.channel = channel
        self._bitrate = bitrate
        self._options = options
        self.fd = fd
        self._data_bitrate = data_bitrate
        self._adapter: CanAdapter | None = None
        self._routes: dict[int, Callable[[CanFrame, float], object]] = {}
        self._queue: list[CanFrame] | None = None
        """Frames that `transmit` sends together; None while frames are sent at once."""
        self._polled = now()
        self._asked = -math.inf
        self.received = 0
        """Number of received frames."""
        self.errors = 0
        """Number of received error frames."""
        self._bits = self._data_bits = 0

    def attach(
        self, identifiers: Iterable[int], receive: Callable[[CanFrame, float], object]
    ) -> None:
        """Register the function that receives the frames with the given identifiers."""
        self._routes.update(dict.fromkeys(identifiers, receive))

    def connect(self, device: CanDevice) -> None:
        """Pass the frames with the identifiers of a device to it."""
        self.attach(device.identifiers(), device.receive)

    def open(self) -> None:
        """Open the adapter.

        Before, the bus is claimed, because several processes can open the same SocketCAN interface.
        """
        if self.interface not in UNSHARED:
            identity = json.dumps(self._identity(), sort_keys=True, default=str)
            self._claim(identity, f"CAN bus {self.channel} ({self.interface})")
        try:
            if self.interface == "slcan":
                self._adapter = SlcanBus(self.channel, bitrate=self._bitrate, **self._options)
            else:
                options = dict(self._options)
                if self._bitrate:
                    options["bitrate"] = self._bitrate
                if self.fd:
                    options |= self._fd_options()
                other = can.Bus(interface=self.interface, channel=self.channel, **options)
                is_socket = self.interface == "socketcan"
                self._adapter = (SocketCanAdapter if is_socket else PythonCanAdapter)(other)
        except (can.CanError, OSError, ValueError, TypeError, ImportError) as error:
            self._held.close()
            raise RigError(
                f"{self.name}: CAN bus {self.channel} ({self.interface}) cannot be opened: "
                f"{reason(error)}"
            ) from error
        if self.fd and not self._has_fd():
            self.close()
            raise RigError(
                f"{self.name}: CAN bus {self.channel} ({self.interface}) has no CAN FD: expected "
                "an interface that was set up with CAN FD"
            )
        self._polled = self.now()

    def _fd_options(self) -> dict[str, Any]:
        """Return the arguments with which python-can opens a bus with CAN FD."""
        if self.interface == "virtual":
            return {"protocol": can.CanProtocol.CAN_FD}
        rate = {"data_bitrate": self._data_bitrate} if self._data_bitrate else {}
        return {"fd": True, **rate}

    def _has_fd(self) -> bool:
        """Return whether the opened bus can send CAN FD frames."""
        if (
            not isinstance(self._adapter, PythonCanAdapter)
            or self._adapter.bus.protocol is can.CanProtocol.CAN_20
        ):
            return False
        if self.interface == "socketcan":
            with contextlib.suppress(OSError, ValueError):
                return int(Path(f"/sys/class/net/{self.channel}/mtu").read_text()) >= FD_MTU
        return True

    def _identity(self) -> list[object]:
        """Return what identifies the bus: the same for each way to name the same bus."""
        if self.interface == "socketcan":
            return [self.interface, self.channel]
        if self.interface == "udp_multicast":
            with contextlib.suppress(ValueError, TypeError):
                group = ipaddress.ip_address(self.channel)
                return [self.interface, group, int(self._options.get("port", MULTICAST_PORT))]
        options = {name: v for name, v in self._options.items() if name not in NOT_IDENTIFYING}
        return [self.interface, self.channel, options]

    def poll(self) -> None:
        """Pass each received frame to the function registered for its identifier.

        The arrival time is the time stamp that the interface gives. If the time stamp is not within
        the last second, or if the adapter is an slcan adapter, the arrival time is estimated. The
        estimate is the mean of the time of this reading and the time of the previous reading.
        """
        assert self._adapter
        try:
            frames = self._adapter.drain()
        except (can.CanError, OSError) as error:
            raise self._gone(error) from error
        now = self.now()
        if isinstance(self._adapter, SlcanBus) and now - self._asked > STATUS_EVERY:
            self._asked = now
            self._watch_adapter(self._adapter)
        middle, self._polled = 0.5 * (self._polled + now), now
        if not frames:
            return
        self.received += len(frames)
        wall, routes = time.time(), self._routes
        for frame in frames:
            self._count(frame)
            if self.log:
                self.log("<", frame_text(frame))
            if frame.is_error_frame:
                self.errors += 1
                if frame.arbitration_id & BUS_OFF:
                    raise RigError(f"{self.name}: CAN bus {self.channel} is off")
                continue
            if receive := routes.get(frame.arbitration_id | frame.is_extended_id * EXTENDED):
                age = wall - frame.timestamp
                receive(frame, now - age if 0.0 <= age < LATEST else middle)

    def _watch_adapter(self, bus: SlcanBus) -> None:
        """Check the status flags of an slcan adapter, which sends no error frames."""
        flags = bus.status()
        if flags and flags & StatusFlags.BUS_ERROR:
            raise RigError(
                f"{self.name}: CAN bus {self.channel} is off: the adapter reports a bus error"
            )
        if flags and flags & (StatusFlags.ERROR_WARNING | StatusFlags.ERROR_PASSIVE):
            self.errors += 1

    def send(
        self,
        identifier: int,
        data: bytes,
        extended: bool = False,
        fd: bool = False,
        bitrate_switch: bool = False,
    ) -> None:
        """Send a data frame without waiting.

        `fd`: whether it is a CAN FD frame. `bitrate_switch`: whether its data are sent with the
        bit rate of the data.
        """
        if fd and (not self.fd or len(data) not in FD_LENGTHS):
            raise ValueError(f"CAN FD frame of {len(data)} bytes: expected a bus with CAN FD")
        self._put(
            CanFrame(
                identifier, data, is_extended_id=extended, is_fd=fd, bitrate_switch=bitrate_switch
            )
        )

    def request(self, identifier: int, length: int = 8) -> None:
        """Send a remote frame, which is a request for the data frame with the same identifier."""
        self._put(CanFrame(identifier, is_remote_frame=True, requested=length))

    @property
    def occupied(self) -> float:
        """Time for which the frames of this computer and of its devices used the bus so far [s].

        Each frame has the largest possible number of stuff bits.
        """
        if not self._bitrate:
            return math.nan
        return self._bits / self._bitrate + self._data_bits / (self._data_bitrate or self._bitrate)

    def _count(self, frame: CanFrame) -> None:
        """Add the bits of a frame to those that the bus has carried."""
        size = 0 if frame.is_remote_frame else len(frame.data)
        if frame.is_fd:
            self._bits += FD_EXTENDED_BITS if frame.is_extended_id else FD_BITS
            self._data_bits += (8 * size + FD_CHECK_BITS) * 5 // 4
        elif size <= 8:
            self._bits += (EXTENDED_BITS if frame.is_extended_id else BITS)[size]

    def transmit(self, devices: Sequence[Device]) -> None:
        """Let devices send their commands, and send the frames of all of them together."""
        queue: list[CanFrame] = []
        self._queue = queue
        try:
            super().transmit(devices)
        finally:
            self._queue = None
            self._send_all(queue)

    def _put(self, frame: CanFrame) -> None:
        self._count(frame)
        if self.log:
            self.log(">", frame_text(frame))
        if self._queue is None:
            self._send_all((frame,))
        else:
            self._queue.append(frame)

    def _send_all(self, frames: Sequence[CanFrame]) -> None:
        if not frames:
            return
        assert self._adapter
        try:
            self._adapter.put(frames)
        except (can.CanError, OSError) as error:
            raise self._gone(error) from error

    def close(self) -> None:
        """Close the adapter."""
        if self._adapter:
            with contextlib.suppress(can.CanError, OSError):
                self._adapter.shutdown()
        self._adapter = None
        self._held.close()

    def _gone(self, error: Exception) -> RigError:
        where = "" if self.interface == "slcan" else f"CAN bus {self.channel} ({self.interface}): "
        return RigError(f"{self.name}: {where}{reason(error)}")


def frame_text(frame: CanFrame) -> str:
    """Return a frame in the form of candump: identifier, #, and the bytes or R (remote frame)."""
    digits = 8 if frame.is_extended_id else 3
    kind = "E" if frame.is_error_frame else "R" if frame.is_remote_frame else ""
    mark = "##0" if frame.is_fd else "#"
    return f"{frame.arbitration_id:0{digits}X}{mark}{kind or frame.data.hex()}"
