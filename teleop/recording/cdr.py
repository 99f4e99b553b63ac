"""Define the encoding of the message in which a tick (cycle of the control loop) is recorded.

The message is a ROS 2 message whose fields are all doubles. Its encoding is CDR (Common Data
Representation).
"""

from __future__ import annotations

import struct

CDR = b"\0\1\0\0"
"""First bytes of a little-endian CDR message."""
TIME = struct.Struct("<4xd")
"""Layout of the start of a tick's message: the bytes of the constant `CDR`, then the time [s]."""
MESSAGE_NAME = "teleop/msg/Tick"
"""Name of the ROS 2 message type of a tick."""
