"""Claim a name, so that no other process of this machine can claim the same name.

For example, a process claims the name of a processor to reserve this processor for its control
loop. A claim has an effect only on processes that also use this module.
"""

from __future__ import annotations

import errno
import socket


def claim(name: str) -> socket.socket | None:
    """Claim a name, so that no other process of this machine can claim it.

    The claim ends when the returned socket is closed or when the process ends, even if it is
    killed. The socket is an abstract Unix socket with this name. All users of the machine share the
    names of such sockets, and no file is created.

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
    """Return whether a process of this machine has claimed a name, see `claim`.

    The result is False on a system without abstract Unix sockets.
    """
    if not hasattr(socket, "AF_UNIX"):
        return False
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(address(name))
        except OSError:
            return False
        return True


def address(name: str) -> bytes:
    """Return the address of the Unix socket with which a process claims a name, see `claim`.

    The address begins with a zero byte. Such an address is called abstract: it has no file.
    """
    return b"\0teleop " + name.encode()
