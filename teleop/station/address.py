"""Addresses of stations, such as 192.168.1.2 or 192.168.1.2:47100 or [fe80::1]:47100."""

from __future__ import annotations

import re
import socket
from typing import Any, NamedTuple

from teleop.errors import InputError

PORT = 47100
"""UDP port of the slave station if its address states none."""
PATTERN = re.compile(
    r"(?:\[(?P<v6>[^][]+)\]|(?P<host>[^:\s]+)|(?P<bare>[^][\s]*:[^][\s]*:.*?))"
    r"(?::(?P<port>\d+))?"
)


class Address(NamedTuple):
    """Address of a UDP port, as the operating system uses it."""

    family: socket.AddressFamily
    place: tuple[Any, ...]

    @property
    def text(self) -> str:
        """Host and port."""
        return text_of(self.place)


def text_of(place: tuple[Any, ...]) -> str:
    """Return host and port of an address of the operating system."""
    host, port = place[:2]
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def parse_address(text: str) -> Address:
    """Return the address in a text with a host and an optional port."""
    found = PATTERN.fullmatch(text)
    port = int(found["port"] or PORT) if found else 0
    if not found or not 0 < port < 65536:
        raise InputError(
            f"address {text!r}: expected a host and a port, such as 192.168.1.2:{PORT}"
        )
    host = found["v6"] or found["host"] or found["bare"]
    try:
        family, _, _, _, place = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise InputError(
            f"address {text!r}: {why}: expected the name or the number of a computer"
        ) from error
    return Address(family, place)
