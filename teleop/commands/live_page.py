"""What the commands with a live page have in common: its library, and its address."""

from __future__ import annotations

import sys
from importlib.util import find_spec


def installed() -> None:
    """Check that the library of the live page is installed.

    Raises
    ------
    InputError
        It is not installed.
    """
    from teleop.errors import InputError

    if find_spec("websockets") is None:
        raise InputError("the live page needs the package websockets: pip install 'teleop[live]'")


def show_address(url: str, host: str, open_page: bool) -> None:
    """Print the address of the page, and open it in the browser if requested.

    A warning is printed if other machines can connect.
    """
    from teleop.live.security import LOOPBACK
    from teleop.printable import print_error

    if host not in LOOPBACK:
        print_error(
            f"--host {host}: other machines can connect, without encryption; ssh -L is safer"
        )
    print(f"live page: {url}", file=sys.stderr, flush=True)
    if open_page:
        import webbrowser

        webbrowser.open(url)
