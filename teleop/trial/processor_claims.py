"""Names of which each belongs to one process of this machine at a time."""

from __future__ import annotations

import errno
import socket


def claim(name: str) -> socket.socket | None:
    """Claim a name until the socket is closed, at the latest when the process ends.

    A claim is an abstract Unix socket: all users share the names, no file remains, and the kernel
    gives the name back when the process ends, in whatever way.

    Parameters
    ----------
    name
        What is claimed.

    Returns
    -------
    The socket that holds the claim; None if another process has it.

    Raises
    ------
    AttributeError
        There are no Unix sockets on this system.
    OSError
        There are no abstract ones.
    """
    held = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        held.bind(address(name))
    except OSError as error:
        held.close()
        if error.errno == errno.EADDRINUSE:
            return None
        raise
    return held


def is_claimed(name: str) -> bool:
    """Whether a process has claimed this name."""
    if not hasattr(socket, "AF_UNIX"):
        return False
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(address(name))
        except OSError:
            return False
        return True


def address(name: str) -> bytes:
    """The socket's abstract address."""
    return b"\0teleop " + name.encode()
