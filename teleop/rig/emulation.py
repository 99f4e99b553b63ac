"""Emulate the devices of a rig in software, and connect them to a simulated telemanipulator."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drivers.rig_file import RigFile
from drivers.rig_sections import CanSettings, SerialSettings
from sim_backend import CUBES, AttentiveOperator, MimickedSine
from sim_backend.wire.emulator import ACTIONS, Emulator, PlannedFault
from sim_backend.wire.mechanism import NEVER
from sim_backend.wire.wire_faults import FAULTS, ON_CAN, ON_SERIAL_LINES
from teleop.control.conditions import CONDITIONS
from teleop.errors import InputError
from teleop.trial.assembly import make_simulated_rig
from teleop.trial.settings import TrialSettings

if TYPE_CHECKING:
    from sim_backend import SimulatedRig

SEEDS_APART = 1_000_000
"""Difference of the seeds of two successive trials. It is large, so that two emulators with similar
seeds have no trial with the same seed."""
ANY = "any"
"""Name that stands for every condition. The simulated operator is then an `AttentiveOperator`."""
DEPTH = re.compile(r"(\d+\.?\d*|\.\d+)mm")
"""Pattern of a depth in a typed line, for example `5mm`."""


def read_fault(text: str, rig: RigFile) -> PlannedFault:
    """Return the fault that the emulator must cause, from a text such as `corrupt:force@3`."""
    kind, _, rest = text.partition(":")
    where, _, at = rest.partition("@")
    kinds = (*FAULTS, *ACTIONS)
    try:
        seconds = float(at)
    except ValueError:
        seconds = -1.0
    if kind not in kinds or not 0.0 <= seconds < 1e6:
        raise InputError(
            f"fault {text!r}: expected KIND:BUS@SECONDS such as corrupt:force@3, the kind one of "
            f"{', '.join(kinds)}"
        )
    places = list(rig.devices)
    if kind != "reset":
        places = [name for name, bus in rig.sections.buses.items() if is_possible(kind, bus)]
    if where not in places:
        raise InputError(
            f"fault {text!r}: {where!r}: expected one of {', '.join(places) or 'none'}"
        )
    return PlannedFault(kind, where, seconds)


def is_possible(kind: str, bus: SerialSettings | CanSettings) -> bool:
    """Return whether a kind of fault can occur on a bus.

    Some kinds of fault occur only on serial lines, other kinds only on CAN buses. All kinds can
    occur on a CAN bus with an slcan adapter, because this adapter is on a serial line.
    """
    if kind in ON_CAN:
        return isinstance(bus, CanSettings)
    return (
        kind not in ON_SERIAL_LINES or not isinstance(bus, CanSettings) or bus.interface == "slcan"
    )


def make_emulator(
    rig: RigFile,
    settings: TrialSettings,
    folder: Path,
    faults: Sequence[PlannedFault] = (),
    mimic: type[MimickedSine] = MimickedSine,
) -> Emulator:
    """Return an emulator of the devices of a rig, connected to a simulated telemanipulator."""
    try:
        return Emulator(rig, Palpation(settings, mimic).rig, folder, faults)
    except ValueError as error:
        raise InputError(f"{rig.path}: {error}") from error


@dataclass(frozen=True)
class Palpation:
    """A simulated palpation: trial settings, and the class of the simulated operator.

    The emulated devices measure and move the simulated telemanipulator of this palpation.
    """

    settings: TrialSettings
    """Settings of the trial that is simulated."""
    mimic: type[MimickedSine] = MimickedSine
    """Class of the simulated operator. It is used only if the control condition is `mimic`."""

    @property
    def text(self) -> str:
        """Condition, palpated body and depth as text, such as `mimic, soft cube, depth 10.9 mm`.

        The condition is given as `any` if the simulated operator does not know the condition.
        """
        is_any, settings = self.mimic is AttentiveOperator, self.settings
        depth = f"depth {settings.setup.depth * 1e3:g} mm"
        return f"{ANY if is_any else settings.condition}, {settings.palpated}, {depth}"

    def rig(self, now: Callable[[], float], enabled: int) -> SimulatedRig:
        """Return a new simulated telemanipulator. Its random seed is different in each trial."""
        seed = self.settings.seed + SEEDS_APART * enabled
        return make_simulated_rig(replace(self.settings, seed=seed), now, NEVER, self.mimic)

    def changed(self, line: str) -> Palpation:
        """Return a copy of the palpation, changed by the line that a person typed."""
        changes: dict[str, Any] = {}
        mimic, words = self.mimic, line.split()
        for word in words:
            if word == ANY:
                changes["condition"], mimic = "mimic", AttentiveOperator
            elif word in CONDITIONS:
                changes["condition"], mimic = word, MimickedSine
            elif word in CUBES:
                changes["cube"] = word
            elif depth := DEPTH.fullmatch(word):
                changes["depth"] = float(depth[1]) * 1e-3
            else:
                words = []
        if not words:
            raise InputError(
                f"{line.strip()!r}: expected a condition ({', '.join((*CONDITIONS, ANY))}), a cube "
                f"({', '.join(CUBES)}), a depth such as 5mm, or several of them"
            )
        return Palpation(replace(self.settings, **changes), mimic)


@contextlib.contextmanager
def opened(emulator: Emulator) -> Iterator[None]:
    """Open an emulator on entry of a `with` block, and close it on exit."""
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(emulator)
        except (OSError, NotImplementedError) as error:
            path = emulator.file.path
            raise InputError(f"{path}: cannot be emulated here: {error}") from error
        yield
