"""Decide who may connect to the server of the live page, and define the headers of the responses.

Only pages of this server that know the token may connect. The token is a random text in the address
of the live page. The server also checks two headers of a request. `Host` must be an address of the
server, and `Origin`, which names the server of the page that sent the request, must be this server.
A page of another server is therefore refused, even if the name of that server has been directed to
this machine (DNS rebinding).
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from collections.abc import Callable

from teleop.errors import InputError

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content security policy, with which the page may load only files of this server."""
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Headers of every response."""
BROADCAST = ipaddress.IPv4Address("255.255.255.255")
"""Address of all machines of the local network."""
HTTP_PORT = 80
"""Default port of HTTP, which browsers omit in the headers `Host` and `Origin`."""


def new_token() -> str:
    """Return a new random token of 128 bits as hexadecimal digits."""
    return secrets.token_hex(16)


def is_token(given: object, token: str) -> bool:
    """Return whether `given` equals the token.

    The time of the comparison does not depend on the number of equal characters, so that an
    attacker cannot find the token by measuring it.
    """
    if not isinstance(given, str):
        return False
    return hmac.compare_digest(given.encode(errors="replace"), token.encode())


def resolve(host: str) -> str:
    """Return the network address of a host in its usual form, such as `127.0.0.1` for `127.1`.

    Addresses are checked instead of the text that was given, because there are many texts for one
    address, and a name can have any address. An IPv4 address is preferred. An InputError is raised
    for an address of all addresses of this machine, as 0.0.0.0, or of a group of machines; an
    OSError for an unknown name.
    """
    # AI_PASSIVE changes the meaning of some texts. Without the flag, `*` would be this machine.
    try:
        found = socket.getaddrinfo(host or "*", 0, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except UnicodeError as error:
        raise InputError(f"host {host!r}: expected a name or an address") from error
    addresses = sorted((str(entry[4][0]) for entry in found), key=lambda address: ":" in address)
    for address in map(plain, addresses):
        if address.is_unspecified or address.is_multicast or address == BROADCAST:
            raise InputError(f"host {host!r}: expected one address or name of this machine")
    return addresses[0]


def plain(address: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    """Return an IP address. An IPv4 address that is written as IPv6 address is returned as IPv4."""
    parsed = ipaddress.ip_address(address)
    return getattr(parsed, "ipv4_mapped", None) or parsed


def is_loopback(address: str) -> bool:
    """Return whether only programs of this machine can reach a network address."""
    return plain(address).is_loopback


class Gate:
    """Decides from the headers of an HTTP request whether the server at `address` accepts it.

    `host` is the name or address in the URL of the live page.
    """

    def __init__(self, host: str, address: str, port: int) -> None:
        names = {host, address} | ({"localhost"} if is_loopback(address) else set())
        addresses = {f"[{name}]" if ":" in name else name.lower() for name in names}
        # allowed values of the header `Host`, in lower-case letters
        self.hosts = {f"{address}:{port}" for address in addresses}
        if port == HTTP_PORT:
            self.hosts |= addresses

    def refusal(self, values: Callable[[str], list[str]], with_origin: bool) -> str:
        """Return the reason why an HTTP request is refused; an empty text if it is accepted.

        `values` returns all values of a header. A request that opens a WebSocket needs an `Origin`.
        """
        hosts = [host.lower() for host in values("Host")]
        origins = [origin.lower() for origin in values("Origin")]
        if len(hosts) != 1 or hosts[0] not in self.hosts:
            return "Host: expected the address of this server"
        own = [f"http://{hosts[0]}"]
        if origins != own and (origins or with_origin):
            return "Origin: expected the page of this server"
        return ""
