"""Define the options of the live page for the commands that run trials, and serve the page."""

from __future__ import annotations

import contextlib
import socket
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

if TYPE_CHECKING:
    from teleop.trial.live_link import LiveLink
    from teleop.trial.settings import TrialSettings

POINTER = "pointer"
"""Name of the operator who moves the handle with the pointer (mouse, finger) in the live page."""
FOXGLOVE_PORT = 8765
"""Port at which Foxglove and similar viewers look for a server by default."""
DURATIONS = (5.0, 10.0, 20.0, 30.0, 60.0)
"""Durations of a trial that the live page offers [s]."""


@dataclass(frozen=True)
class LiveOptions:
    """Options of the live page."""

    live: Annotated[bool, Parameter(negative="")] = False
    """Show the trial in a page of the browser, and print the address of the page. On the simulated
    rig, a person starts the trials in the page (UNLOCK, then START), unless --yes is given."""
    live_arm: Annotated[bool, Parameter(negative="")] = False
    """Let the live page arm the drives of a hardware rig."""
    open: Annotated[bool, Parameter(negative="")] = False
    """Open the live page in the browser."""
    host: str = "127.0.0.1"
    """Network address of the live page. With an address other than the default, other machines
    can connect, without encryption."""
    port: int = 0
    """Port of the live page; 0 for any free port."""
    foxglove: Annotated[bool, Parameter(negative="")] = False
    """Also send the data of each tick to the viewers Foxglove, Lichtblick and PlotJuggler on this
    machine, at port 8765, or at any free port if port 8765 is used. These viewers cannot control
    the trial."""

    def requested(self, settings: Sequence[TrialSettings]) -> LiveOptions:
        """Return a copy of these options, in which `live` is True if any trial requests the page.

        Otherwise, `live` is the same as in these options.
        """
        return replace(self, live=self.live or any(one.live for one in settings))

    def arms(self, settings: Sequence[TrialSettings], yes: bool) -> bool:
        """Return whether a person arms the drives in the live page.

        Parameters
        ----------
        settings
            Settings of all trials.
        yes
            Whether the drives are armed without asking.

        Raises
        ------
        InputError
            The options contradict each other or the settings.
        """
        from teleop.errors import InputError

        for one in settings:
            if one.operator == POINTER and not self.live:
                raise InputError("--operator pointer: needs --live")
            if one.operator == POINTER and (one.rig or one.condition == "autonomous"):
                raise InputError(
                    "--operator pointer: expected the simulated rig, and free or mimic"
                )
            if self.live and one.clock != "real":
                raise InputError("--live: expected --clock real")
        if not self.live:
            for name in ("live_arm", "open", "foxglove"):
                if getattr(self, name):
                    raise InputError(f"--{name.replace('_', '-')}: needs --live")
            return False
        if self.live_arm and yes:
            raise InputError("--live-arm and --yes: expected at most one of them")
        return not yes and (self.live_arm or not any(one.rig for one in settings))

    @contextlib.contextmanager
    def linked(
        self, settings: Sequence[TrialSettings], by_page: bool, choose: bool
    ) -> Iterator[LiveLink | None]:
        """Serve the live page within the block.

        Parameters
        ----------
        settings
            Settings of all trials.
        by_page
            Whether a person arms the drives in the live page.
        choose
            Whether this person may choose other settings for trials on the simulated rig.

        Yields
        ------
        The link to the page; None without the option --live.

        Raises
        ------
        InputError
            The page cannot be served.
        """
        if not self.live:
            yield None
            return
        check_installed()
        from sim_backend import PointerOperator
        from teleop.trial.assembly import make_layout
        from teleop.trial.live_link import LiveLink

        pointer = any(one.operator == POINTER for one in settings)
        operator = PointerOperator(lambda: (0.0, False)) if pointer else None
        size = max(
            make_layout(one, one.estimation_preset.bank(), operator).size for one in settings
        )
        choices = choices_of(settings[0]) if choose else NO_CHOICES
        foxglove = free_port(FOXGLOVE_PORT) if self.foxglove else None
        link = LiveLink(size, self.host, self.port, by_page, pointer, choices, foxglove)
        try:
            if link.foxglove_url:
                print(f"Foxglove: {link.foxglove_url}", file=sys.stderr, flush=True)
            show_address(link.url, self.host, self.open)
            yield link
        finally:
            link.end()


NOT_LIVE = LiveOptions()
"""The default options, with which no live page is served."""
Live = Annotated[LiveOptions, Parameter(name="*")]
"""Type of the parameter with which a command receives `LiveOptions`.

The names of the options get no prefix.
"""
NO_CHOICES: dict[str, list[Any]] = {"condition": [], "specimen": [], "duration": []}


def choices_of(settings: TrialSettings) -> dict[str, list[Any]]:
    """Return the conditions, specimens and durations [s] that the live page offers for choice.

    For a hardware rig or a custom setup, only the values in the settings are offered.
    """
    from sim_backend import CUBES
    from teleop.control.conditions import CONDITIONS

    if settings.rig or settings.custom_setup:
        return {
            "condition": [settings.condition],
            "specimen": [settings.palpated],
            "duration": [settings.duration],
        }
    by_pointer = settings.operator == POINTER
    return {
        "condition": [c for c in CONDITIONS if not (by_pointer and c == "autonomous")],
        "specimen": list(CUBES),
        "duration": sorted({*DURATIONS, settings.duration}),
    }


def free_port(port: int) -> int:
    """Return the port, or 0 (for any free port) if another program uses this port."""
    with socket.socket() as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return 0
    return port


def check_installed() -> None:
    """Check that the library of the live page is installed.

    Raises
    ------
    InputError
        The library is not installed.
    """
    from teleop.errors import InputError

    if find_spec("websockets") is None:
        raise InputError("the live page needs the package websockets: pip install 'teleop[live]'")


def show_address(url: str, host: str, open_page: bool) -> None:
    """Print the address of the live page, and open the page in the browser if requested.

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
