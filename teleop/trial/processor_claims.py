"""Claim names, for example of processors. At most one process of this machine claims a name."""

from __future__ import annotations

import errno
import socket


def claim(name: str) -> socket.socket | None:
    """Claim a name until the returned socket is closed or the process ends.

    The claim is an abstract Unix socket with this name. The names of such sockets are common to all
    users, and no file remains. The kernel releases the name when the process ends, even if the
    process is killed.

    Parameters
    ----------
    name
        The name to claim.

    Returns
    -------
    The socket that holds the claim; None if another process has claimed the name.

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
