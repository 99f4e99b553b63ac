"""The encoding of a tick: a ROS 2 message of doubles in CDR."""

from __future__ import annotations

import struct

CDR = b"\0\1\0\0"
"""First bytes of a little-endian CDR message."""
TIME = struct.Struct("<4xd")
"""Position of the time in the message of a tick."""
MESSAGE_NAME = "teleop/msg/Tick"
"""Name of the message."""
