"""Claim a name, so that no other process of this machine can claim the same name.

For example, a process claims the name of a processor to reserve this processor for its control
loop, or the name of a CAN bus that it uses. A claim has an effect only on processes that also use
this module.
"""

from __future__ import annotations

import errno
import os
import socket
import struct
from pathlib import Path

LONGEST_COMMAND = 100
"""Largest number of characters of a command line in `process_text`."""


def claim(name: str) -> socket.socket | None:
    """Claim a name, so that no other process of this machine can claim it.

    The result is None if the name is already claimed.

    The claim ends when the returned socket is closed or when the process ends, even if it is
    killed. The socket is an abstract Unix socket with this name. All users of the machine share the
    names of such sockets, and no file is created.
    """
    held = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        held.bind(address(name))
        held.listen(socket.SOMAXCONN)  # so that `claimant` can connect; nobody accepts
    except OSError as error:
        held.close()
        if error.errno == errno.EADDRINUSE:
            return None
        raise
    return held


def is_claimed(name: str) -> bool:
    """Return whether a process of this machine has claimed a name, see `claim`.

    The result is False on a system without abstract Unix sockets.
    """
    return claimant(name) is not None


def claimant(name: str) -> int | None:
    """Return the id of the process that has claimed a name, see `claim`.

    The result is 0 if the process is not known, and None if no process has claimed the name.
    """
    if not hasattr(socket, "AF_UNIX"):
        return None
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.setblocking(False)
        try:
            probe.connect(address(name))
            credentials = probe.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12)
        except BlockingIOError:  # many processes have asked already
            return 0
        except (OSError, AttributeError):
            return None
    return int(struct.unpack("3i", credentials)[0])


def address(name: str) -> bytes:
    """Return the address of the Unix socket with which a process claims a name, see `claim`.

    The address begins with a zero byte. Such an address is called abstract: it has no file.
    """
    return b"\0teleop " + name.encode()


def lock_holder(path: str) -> int:
    """Return the id of a process that has locked a file or serial port by `flock`; 0 if unknown."""
    try:
        status = Path(path).stat()
        device = f"{os.major(status.st_dev):02x}:{os.minor(status.st_dev):02x}:{status.st_ino}"
        for line in Path("/proc/locks").read_text().splitlines():
            fields = line.split()
            if fields[1] == "FLOCK" and fields[5] == device:
                return int(fields[4])
    except (OSError, ValueError, IndexError, AttributeError):  # not on Linux
        pass
    return 0


def process_text(pid: int) -> str:
    """Return a process as text for a message, such as `process 812 (teleop run --rig a.toml)`.

    The command line is omitted if it is not known. The text is `another process` if `pid` is 0.
    """
    if not pid:
        return "another process"
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return f"process {pid}"
    if Path(words[0]).name.startswith("python"):
        words = [word for word in words[1:] if word != "-m"]
    command = " ".join(" ".join([Path(words[0]).name, *words[1:]]).split()) if words else ""
    return f"process {pid} ({command[:LONGEST_COMMAND]})" if command else f"process {pid}"
