"""Decide who may connect to the live page, and define the headers of the responses.

Only a page of this server with the correct token may connect. The headers `Host` and `Origin` are
compared with the exact address of the server. Pages of other origins are therefore refused. Host
names that an attacker directs to this machine (DNS rebinding) are refused, too.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Callable

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
LOOPBACK = ("127.0.0.1", "localhost", "::1")
"""Addresses that only programs of this machine can reach."""
ANY_ADDRESS = ("", "0.0.0.0", "::")
"""Addresses that make a server listen at all addresses of a machine."""


def new_token() -> str:
    """Return a new random token of 128 bits, as 32 hexadecimal digits."""
    return secrets.token_hex(16)


def is_token(given: object, token: str) -> bool:
    """Return whether `given` equals the token, in a time that does not depend on `given`."""
    if not isinstance(given, str):
        return False
    return hmac.compare_digest(given.encode(errors="replace"), token.encode())


class Gate:
    """Decides from the headers of a request whether its sender may connect.

    Parameters
    ----------
    host
        Name or address of the server, as in its URL.
    port
        Port of the server.

    Attributes
    ----------
    hosts
        Allowed values of the header `Host`.
    """

    def __init__(self, host: str, port: int) -> None:
        names = {host, "127.0.0.1", "localhost"} if host in LOOPBACK[:2] else {host}
        self.hosts = {f"[{name}]:{port}" if ":" in name else f"{name}:{port}" for name in names}

    def refusal(self, values: Callable[[str], list[str]], with_origin: bool) -> str:
        """Return the reason why a request is refused; empty if it is allowed.

        Parameters
        ----------
        values
            Function that returns all values of a header by its name.
        with_origin
            Whether the request must have the header `Origin`; True for a WebSocket.
        """
        hosts, origins = values("Host"), values("Origin")
        if len(hosts) != 1 or hosts[0] not in self.hosts:
            return "Host: expected the address of this server"
        own = [f"http://{hosts[0]}"]
        if origins != own and (origins or with_origin):
            return "Origin: expected the page of this server"
        return ""
