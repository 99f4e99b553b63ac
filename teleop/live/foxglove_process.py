"""The process that serves viewers of the Foxglove protocol.

    python -m teleop.live.foxglove_process

The control process starts this process, and sends it messages as to the live process. The server
for the viewers is code of another project, and limits neither the number of its clients nor their
use of the processor. Therefore it runs neither in the control process nor in the live process,
which sends the heartbeat to the control loop, and it has a lower priority than both.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

from teleop.errors import InputError
from teleop.live.control_pipe import ControlPipe
from teleop.live.foxglove_bridge import FoxgloveBridge
from teleop.live.ring import RingReader
from teleop.live.shared_file import SharedFile

NICENESS = 10
"""Increase of the niceness of this process, which lowers its priority."""
PERIOD = 1.0 / 60.0
"""Time between two transmissions of ticks [s]."""


def main() -> None:
    """Serve viewers until the control process has ended."""
    os.nice(NICENESS)
    pipe = ControlPipe()
    session = pipe.read_line()
    ring = SharedFile.open(Path(session["files"]["ring"]), writable=False)
    try:
        bridge = FoxgloveBridge(RingReader(ring.buffer, *session["ring"]), session["foxglove"])
    except InputError as error:
        pipe.send({"problem": str(error)})
        return
    pipe.send({"url": bridge.url})
    pipe.stop_waiting()
    try:
        while not pipe.is_over:
            pipe.receive_into(bridge)
            bridge.advance()
            time.sleep(PERIOD)
    finally:
        bridge.close()


if __name__ == "__main__":
    main()
