"""The key file that two stations share, and the keys of a session that are derived from it.

Only a station that has the key can begin a session or sign a datagram. Each session and each of its
two directions has its own key. A datagram of an earlier session, or one that is sent back to its
sender, therefore has no valid signature. The datagrams are signed but not encrypted.
"""

from __future__ import annotations

import os
import secrets
from hashlib import blake2s
from pathlib import Path
from typing import NamedTuple

from drivers.input_file import read_input
from drivers.posix import is_posix
from teleop.errors import InputError
from teleop.files import unreadable, unwritable
from teleop.names import SideName

KEY_SIZE = 32
"""Size of a key [bytes]."""
NONCE_SIZE = 16
"""Size of the random number that each station contributes to a session [bytes]."""
OTHERS: dict[SideName, SideName] = {"master": "slave", "slave": "master"}
"""The other side of each side."""


class Session(NamedTuple):
    """Number and keys of a session, as one of the stations uses them."""

    number: int
    send_key: bytes
    receive_key: bytes


def derive(key: bytes, purpose: str, data: bytes = b"") -> bytes:
    """Return a key for a purpose that is derived from another key and from some bytes."""
    return blake2s(data, digest_size=KEY_SIZE, key=key, person=purpose.encode()).digest()


def make_session(key: bytes, nonces: bytes, side: SideName) -> Session:
    """Return the session of the nonces of master and slave, for the station of this side."""
    number = int.from_bytes(derive(key, "session", nonces)[:8], "little")
    return Session(number, derive(key, side, nonces), derive(key, OTHERS[side], nonces))


def write_key(path: Path) -> None:
    """Write a new random key to a file that only its owner can read."""
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "w") as file:
            file.write(f"{secrets.token_hex(KEY_SIZE)}\n")
    except FileExistsError as error:
        raise InputError(f"{path}: the file exists: expected a new file for the key") from error
    except OSError as error:
        raise unwritable(path, error) from error


def read_key(path: Path) -> bytes:
    """Return the key in a file."""
    try:
        data, mode = read_input(path), path.stat().st_mode
    except OSError as error:
        raise unreadable(path, error) from error
    if is_posix() and mode & 0o077:
        raise InputError(
            f"{path}: other users of this computer can read the key: expected a file that only its "
            f"owner can read (chmod 600 {path})"
        )
    try:
        key = bytes.fromhex(data.decode())
    except ValueError:
        key = b""
    if len(key) != KEY_SIZE:
        raise InputError(
            f"{path}: expected {2 * KEY_SIZE} hexadecimal digits, as `teleop station key` writes"
        )
    return key
