"""The options of the live page, and its server during a command."""

from __future__ import annotations

import contextlib
import socket
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from teleop.commands.options import LIVE

if TYPE_CHECKING:
    from teleop.settings.trial_settings import TrialSettings
    from teleop.streams.child_process import ChildProcess
    from teleop.trial.live_link import LiveLink

POINTER = "pointer"
"""Value of --operator with which the mouse or a finger in the live page moves the handle."""
FOXGLOVE_PORT = 8765
"""Port at which Foxglove and similar viewers look for a server by default."""
FIRM_ARM = 1500.0
"""Stiffness of the hand that follows the pointer [N/m], if the hand first feels a stiff spring, as
with the feedback law model-mediated. A person presses a stiff body with a firm hand. With the usual
400 N/m, a pointer 7 mm deep moves the tool by 0.14 mm. Because of the lost motion, the contact
force is then below the 0.2 N that the law needs to estimate the specimen, and the hand feels the
stiff spring for the whole trial. With 1500 N/m, 4 mm suffice on each cube, with and without a
channel."""
DURATIONS = (5.0, 10.0, 20.0, 30.0, 60.0)
"""Durations of a trial that the live page offers [s]."""


@dataclass(frozen=True)
class LiveOptions:
    """Options of the live page."""

    live: bool = False
    """Show the trial in a page of the browser, and print the address of the page. On the simulated
    rig, a person starts the trials in the page (UNLOCK, then START), unless --yes is given."""
    live_arm: bool = False
    """Let the live page arm the drives of a hardware rig."""
    open: bool = False
    """Open the live page in the browser."""
    host: str = "127.0.0.1"
    """Network address of the live page. With an address other than the default, other machines
    can connect, without encryption."""
    port: int = 0
    """Port of the live page; 0 for any free port."""
    foxglove: bool = False
    """Also send the data of each tick to the viewers Foxglove, Lichtblick and PlotJuggler on this
    machine, at port 8765, or at any free port if port 8765 is used. These viewers cannot control
    the trial."""

    def requested(self, settings: Sequence[TrialSettings]) -> LiveOptions:
        """These options, with --live if the settings of a trial ask for the live page."""
        return replace(self, live=self.live or any(one.live for one in settings))

    def arms(self, settings: Sequence[TrialSettings], yes: bool) -> bool:
        """Whether a person arms the drives in the live page.

        InputError if options contradict each other or the settings.
        """
        from teleop.control.conditions import BY_HAND
        from teleop.errors import InputError

        for one in settings:
            if one.operator == POINTER and not self.live:
                raise InputError("--operator pointer: needs --live")
            if one.operator == POINTER and not (one.is_simulated and one.by_hand):
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
        return not yes and (self.live_arm or not any(one.needs_arming for one in settings))

    @contextlib.contextmanager
    def starting(self) -> Iterator[ChildProcess | None]:
        """With --live, start the live process, which imports its modules while this one does.

        It is ended after the `with` block, if it does not serve the live page.
        """
        from drivers.posix import is_posix

        if not self.live or not is_posix() or find_spec("websockets") is None:
            yield None
            return
        from teleop.streams.child_process import LIVE_PROCESS, ChildProcess

        process = ChildProcess(LIVE_PROCESS)
        try:
            yield process
        finally:
            process.end()

    @contextlib.contextmanager
    def linked(
        self,
        settings: Sequence[TrialSettings],
        by_page: bool,
        choose: bool,
        page: ChildProcess | None = None,
    ) -> Iterator[LiveLink | None]:
        """Serve the live page during a `with` block; None without --live.

        With `choose`, a person can choose settings of the next trial in the page. `page` is the
        live process, if it was started before.
        """
        if not self.live:
            yield None
            return
        check_installed()
        from teleop.trial.live_link import LiveLink

        pointer = any(one.operator == POINTER for one in settings)
        choices = choices_of(settings[0]) if choose else NO_CHOICES
        foxglove = free_port(FOXGLOVE_PORT) if self.foxglove else None
        link = LiveLink(self.host, self.port, by_page, pointer, choices, foxglove, page)
        try:
            if link.foxglove_url:
                print(f"Foxglove: {link.foxglove_url}", file=sys.stderr, flush=True)
            show_address(link.url, self.host, self.open)
            yield link
        finally:
            link.end()


def for_pointer(settings: TrialSettings) -> TrialSettings:
    """The settings, with the arm and the count-in that a person with the pointer needs by default.

    The settings of other operators are not changed.
    """
    from sim_backend.operators import ARM
    from teleop.settings.ranges import COUNT_IN

    if settings.operator != POINTER:
        return settings
    model = settings.operator_model
    if settings.feedback.law_type.displays_prior and model.arm_stiffness == ARM.stiffness:
        model = replace(model, arm_stiffness=FIRM_ARM)
    count_in = COUNT_IN if settings.count_in is None else settings.count_in
    return replace(settings, operator_model=model, count_in=count_in)


NOT_LIVE = LiveOptions()
Live = Annotated[LiveOptions, Parameter(name="*", group=LIVE)]
NO_CHOICES: dict[str, list[Any]] = {
    "condition": [],
    "specimen": [],
    "duration": [],
    "feedback": [],
    "estimators": [],
}


def choices_of(settings: TrialSettings) -> dict[str, list[Any]]:
    """The values that a person can choose in the live page, by the name of the setting.

    `settings` are those of the first trial. A hardware rig or a custom setup leaves no choice.
    """
    from estimation.registry import METHODS
    from sim_backend import CUBES
    from teleop.control.conditions import BY_HAND, CONDITIONS
    from teleop.control.feedback.settings import LAWS

    of_estimation = {"estimators": list(settings.estimators if settings.preset else METHODS)}
    if not settings.is_simulated or settings.custom_setup or settings.custom_condition:
        return {
            "condition": [settings.condition_name],
            "specimen": [settings.palpated],
            "duration": [settings.duration],
            "feedback": [settings.feedback.law],
            **of_estimation,
        }
    return {
        "condition": list(BY_HAND if settings.operator == POINTER else CONDITIONS),
        "specimen": list(CUBES),
        "duration": sorted({*DURATIONS, settings.duration}),
        "feedback": list(LAWS),
        **of_estimation,
    }


def free_port(port: int) -> int:
    """`port` if it is free; otherwise 0, with which the system chooses a free port."""
    with socket.socket() as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return 0
    return port


def check_installed() -> None:
    """Raise InputError if the package that serves the live page is not installed."""
    from teleop.errors import InputError
    from telepalpation import needs

    if find_spec("websockets") is None:
        raise InputError(needs("the live page", "websockets", "live"))


def show_address(url: str, host: str, open_page: bool) -> None:
    """Print the address of the live page, with a warning if other machines can connect."""
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
