"""Define the options of the live page, a web page that shows a running trial, and serve it."""

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
    from teleop.settings.trial_settings import TrialSettings
    from teleop.trial.live_link import LiveLink

POINTER = "pointer"
"""Value of --operator with which the mouse or a finger in the live page moves the handle."""
FOXGLOVE_PORT = 8765
"""Port at which Foxglove and similar viewers look for a server by default."""
DURATIONS = (5.0, 10.0, 20.0, 30.0, 60.0)
"""Durations of a trial that the live page offers [s]."""


@dataclass(frozen=True)
class LiveOptions:
    """Options of the live page, a web page that shows a running trial and can control it."""

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
        """Combine the option --live with the settings of the trials.

        Returns
        -------
        A copy of these options. Its `live` is True if the option --live is given, or if the
        settings of at least one trial contain `live = True`.
        """
        return replace(self, live=self.live or any(one.live for one in settings))

    def arms(self, settings: Sequence[TrialSettings], yes: bool) -> bool:
        """Return whether a person arms the drives in the live page, that is, permits them to move.

        Parameters
        ----------
        settings
            Settings of all trials.
        yes
            Whether the option --yes is given, with which the drives are armed without asking.

        Raises
        ------
        InputError
            Two options contradict each other, or an option contradicts the settings of a trial.
        """
        from teleop.control.conditions import BY_HAND
        from teleop.errors import InputError

        for one in settings:
            if one.operator == POINTER and not self.live:
                raise InputError("--operator pointer: needs --live")
            if one.operator == POINTER and (one.rig or one.condition not in BY_HAND):
                raise InputError(
                    f"--operator pointer: expected the simulated rig, and {' or '.join(BY_HAND)}"
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
        """Serve the live page, a web page that shows the running trials, during a `with` block.

        Parameters
        ----------
        settings
            Settings of all trials.
        by_page
            Whether a person arms the drives in the live page (permits them to move), see `arms`.
        choose
            Whether a person can choose settings of the next trial in the live page, see
            `choices_of`.

        Yields
        ------
        The object that sends the data of the trials to the live page, and receives the requests of
        the page; None if `live` is False.

        Raises
        ------
        InputError
            The live page cannot be served, for example because a package is not installed.
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
"""Default options, with which no live page is served."""
Live = Annotated[LiveOptions, Parameter(name="*")]
"""Type of the parameter with which a command receives `LiveOptions`.

Each field of `LiveOptions` is an option with the name of the field, for example --live-arm.
"""
NO_CHOICES: dict[str, list[Any]] = {"condition": [], "specimen": [], "duration": []}
"""Replacement for the result of `choices_of` if a person can choose no settings in the page."""


def choices_of(settings: TrialSettings) -> dict[str, list[Any]]:
    """Return the values that a person can choose in the live page for the settings of a trial.

    Parameters
    ----------
    settings
        Settings of the first trial. For a hardware rig, or for a custom setup of the simulated rig,
        only the values in these settings can be chosen.

    Returns
    -------
    Lists of the values of `condition`, `specimen` and `duration` [s], by the name of the setting.
    """
    from sim_backend import CUBES
    from teleop.control.conditions import BY_HAND, CONDITIONS

    if settings.rig or settings.custom_setup:
        return {
            "condition": [settings.condition],
            "specimen": [settings.palpated],
            "duration": [settings.duration],
        }
    return {
        "condition": list(BY_HAND if settings.operator == POINTER else CONDITIONS),
        "specimen": list(CUBES),
        "duration": sorted({*DURATIONS, settings.duration}),
    }


def free_port(port: int) -> int:
    """Return `port` if it is free; otherwise 0, with which the system chooses a free port."""
    with socket.socket() as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return 0
    return port


def check_installed() -> None:
    """Check that the package that is needed to serve the live page is installed.

    Raises
    ------
    InputError
        The package is not installed.
    """
    from teleop.errors import InputError

    if find_spec("websockets") is None:
        raise InputError("the live page needs the package websockets: pip install 'teleop[live]'")


def show_address(url: str, host: str, open_page: bool) -> None:
    """Print the address of the live page, a web page that shows a trial; open it if requested.

    Parameters
    ----------
    url
        Address of the page.
    host
        Network address at which the page is served. If other machines can connect to this address,
        a warning is printed.
    open_page
        Whether to open the page in the browser.
    """
    from teleop.live.security import is_loopback, resolve
    from teleop.printable import print_error

    if not is_loopback(resolve(host)):
        print_error(
            f"--host {host}: other machines can connect, without encryption; ssh -L is safer"
        )
    print(f"live page: {url}", file=sys.stderr, flush=True)
    if open_page:
        import webbrowser

        webbrowser.open(url)
