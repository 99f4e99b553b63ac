"""A CAN frame as a tuple, which takes a tenth of the time of a message of python-can."""

from __future__ import annotations

from typing import NamedTuple

import can


class CanFrame(NamedTuple):
    """A CAN frame. The fields have the names that they have in `can.Message`."""

    arbitration_id: int
    """Identifier of 11 bits, or of 29 bits if `is_extended_id` is true."""
    data: bytes = b""
    timestamp: float = 0.0
    """Time of arrival on the system clock [s]; 0 if it is not known."""
    is_extended_id: bool = False
    is_remote_frame: bool = False
    is_error_frame: bool = False
    is_fd: bool = False
    bitrate_switch: bool = False
    """Whether the data of a CAN FD frame have the bit rate of the data."""
    requested: int = 0
    """Number of data bytes that a remote frame requests."""

    @property
    def dlc(self) -> int:
        """Number of data bytes, or of requested data bytes."""
        return self.requested if self.is_remote_frame else len(self.data)

    @classmethod
    def of(cls, message: can.Message) -> CanFrame:
        """Return the frame of a message of python-can."""
        return cls(
            message.arbitration_id,
            bytes(message.data),
            message.timestamp,
            message.is_extended_id,
            message.is_remote_frame,
            message.is_error_frame,
            message.is_fd,
            message.bitrate_switch,
            message.dlc if message.is_remote_frame else 0,
        )

    def message(self) -> can.Message:
        """Return the frame as a message of python-can."""
        return can.Message(
            timestamp=self.timestamp,
            arbitration_id=self.arbitration_id,
            is_extended_id=self.is_extended_id,
            is_remote_frame=self.is_remote_frame,
            is_error_frame=self.is_error_frame,
            is_fd=self.is_fd,
            bitrate_switch=self.bitrate_switch,
            dlc=self.dlc,
            data=self.data,
            check=False,
        )
