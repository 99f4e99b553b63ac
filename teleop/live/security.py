"""Decide who may connect to the server of the live page, and define the headers of the responses.

The live page is a web page that shows a running trial or a recording. Only pages of this server
that know the token may connect. The token is a random text, which is a part of the address of the
live page. The server also checks two headers of a request. `Host` must be an address of the server,
and `Origin`, which names the server of the page that sent the request, must be this server. A page
of another server is therefore refused, even if the name of that server has been directed to this
machine (DNS rebinding).
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
HTTP_PORT = 80
"""Default port of HTTP, which browsers omit in the headers `Host` and `Origin`."""
LOOPBACK = ("127.0.0.1", "localhost", "::1")
"""Addresses that only programs of this machine can reach."""
ANY_ADDRESS = ("", "0.0.0.0", "::")
"""Addresses that make a server listen at all addresses of a machine."""


def new_token() -> str:
    """Return a new random token as hexadecimal digits. It is so long that nobody can guess it.

    A page must send the token to the server before it receives data.
    """
    return secrets.token_hex(16)


def is_token(given: object, token: str) -> bool:
    """Return whether `given` equals the token.

    The time of the comparison does not depend on the number of equal characters. An attacker can
    therefore not find the token by measuring this time.
    """
    if not isinstance(given, str):
        return False
    return hmac.compare_digest(given.encode(errors="replace"), token.encode())


class Gate:
    """Decides from the headers of an HTTP request whether the server accepts the request.

    Parameters
    ----------
    host
        Name or address of the server, as in the URL of the live page.
    port
        Port of the server.

    Attributes
    ----------
    hosts
        Allowed values of the header `Host`, in lower-case letters.
    """

    def __init__(self, host: str, port: int) -> None:
        names = {host, "127.0.0.1", "localhost"} if host in LOOPBACK[:2] else {host}
        addresses = {f"[{name}]" if ":" in name else name.lower() for name in names}
        self.hosts = {f"{address}:{port}" for address in addresses}
        if port == HTTP_PORT:
            self.hosts |= addresses

    def refusal(self, values: Callable[[str], list[str]], with_origin: bool) -> str:
        """Return the reason why an HTTP request is refused; an empty text if it is accepted.

        Parameters
        ----------
        values
            Function from the name of a header to the list of all its values in the request.
        with_origin
            Whether a request without the header `Origin` is refused. Use True for a request that
            opens a WebSocket.
        """
        hosts = [host.lower() for host in values("Host")]
        origins = [origin.lower() for origin in values("Origin")]
        if len(hosts) != 1 or hosts[0] not in self.hosts:
            return "Host: expected the address of this server"
        own = [f"http://{hosts[0]}"]
        if origins != own and (origins or with_origin):
            return "Origin: expected the page of this server"
        return ""
