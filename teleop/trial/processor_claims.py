"""Claims on names; at most one process of this machine can hold the claim on a name at a time."""

from __future__ import annotations

import errno
import socket


def claim(name: str) -> socket.socket | None:
    """Claim a name until the socket is closed, at the latest when the process ends.

    A claim is an abstract Unix socket: the names are common to all users, no file remains, and
    the kernel releases the name when the process ends, also if it is killed.

    Parameters
    ----------
    name
        The name to claim.

    Returns
    -------
    The socket that holds the claim; None if another process holds it.

    Raises
    ------
    AttributeError
        The system has no Unix sockets.
    OSError
        The system has no abstract Unix sockets.
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
    """Return whether a process has claimed a name."""
    if not hasattr(socket, "AF_UNIX"):
        return False
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(address(name))
        except OSError:
            return False
        return True


def address(name: str) -> bytes:
    """Return the abstract address of the socket that claims a name."""
    return b"\0teleop " + name.encode()
