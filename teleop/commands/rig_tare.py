"""`teleop rig tare`: measure the zero offsets of force and position."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from teleop.commands.options import IN_OUTPUT, Json, Overwrite
from teleop.names import CubeName

if TYPE_CHECKING:
    from drivers.rig_file import RigFile
    from sim_backend import Sensors
    from teleop.rig.zeroing import ForceZero


def tare(
    *,
    rig: Path | None = None,
    out: Annotated[Path, IN_OUTPUT] = Path("tare.json"),
    contact: str = "keep",
    yes: bool = False,
    cube: CubeName = "soft",
    seed: int = 0,
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Measure the zero offsets of force and position, and store them with the date.

    The zero offsets of the forces are measured with disabled drives and without load: nobody holds
    the handle. If the rig moves or a force changes, the command waits until the rig is at rest. It
    ends with an error if this takes more than 5 s. If a reading is above 1 % of the range of the
    sensor or of the hard force limit, it may be a constant load. A person then has to confirm that
    nothing loads the sensors, and the command measures again. A reading above 10 % is refused.
    `teleop run --tare` reads the file.

    Example: `teleop rig tare --contact touch --out tare.json`

    Parameters
    ----------
    rig
        Rig file (TOML). Default: the simulated rig.
    out
        File for the zero offsets (JSON).
    contact
        Position at which contact begins: `keep` for the zero of the encoder; `touch` to move the
        slave forward slowly, by at most 4 mm, until contact; or a position such as 1.5mm. On a
        hardware rig, a person has to arm the drives before `touch`.
    yes
        Arm the drives for `--contact touch`, and accept a reading above 1 %, without asking, for
        scripts.
    cube
        Cube on the simulated rig.
    seed
        Seed of the noise of the simulated sensors.
    """
    from sim_backend import Sensors
    from teleop.control.tare import FARTHEST, write_tare
    from teleop.errors import InputError
    from teleop.evaluation.formats.units import quantity
    from teleop.files import check_outputs
    from teleop.output import console
    from teleop.output.rig_tables import print_tare
    from teleop.printable import print_error
    from teleop.rig.touching import arming_text, dated_tare, touch
    from teleop.rig.zeroing import confirmed_zero
    from teleop.safety import Limits
    from teleop.safety.rig_limits import rig_limits
    from teleop.settings.rig_loading import load_rig_file
    from teleop.trial.arming import is_armed

    given = 0.0 if contact in ("keep", "touch") else quantity(contact, "position")
    if given is None or not abs(given) <= FARTHEST:
        raise InputError(f"contact {contact!r}: expected keep, touch, or a position such as 1.5mm")
    check_outputs(out, sources=(rig,), overwrite=overwrite)
    sensors = Sensors()
    rig_file = load_rig_file(rig) if rig else None
    touches = contact == "touch"
    if rig_file and touches and not is_armed(rig_file, arming_text(rig_file), yes):
        return 130

    limits = rig_limits(rig_file.sections) if rig_file else Limits()
    zero = confirmed_zero(
        lambda: measured(rig_file, cube, sensors, seed),
        limits,
        lambda reading: is_unloaded(rig_file, reading, yes),
    )
    if zero is None:
        print_error("no zero offsets were stored")
        return 130
    if touches:
        given = touch(zero, rig_file, cube, sensors, seed)
    found = dated_tare(zero, given, rig_file.sections.name if rig_file else "simulated")
    write_tare(found, out, overwrite)
    if json:
        noise = {"master_noise_n": zero.master_noise, "noise_n": zero.contact_noise}
        console.print_json({**asdict(found), **noise, "file": str(out)})
    else:
        print_tare(found, zero.master_noise, zero.contact_noise, out, rig)
    return 0


def measured(rig_file: RigFile | None, cube: CubeName, sensors: Sensors, seed: int) -> ForceZero:
    """The zero offsets of the hardware rig, or of the simulated rig without a rig file."""
    from drivers import Rig
    from drivers.wired_rig import WiredRig
    from teleop.control.clock import Clock, RealClock, VirtualClock
    from teleop.rig.touching import rig_away_from_cube
    from teleop.rig.zeroing import force_zero

    clock: Clock
    if rig_file:
        clock = RealClock(rig_file.sections.rate_hz)
        opened: Rig = WiredRig(rig_file, clock.now)
    else:
        clock = VirtualClock(1000.0)
        opened = rig_away_from_cube(cube, clock.now, sensors, seed)
    with opened:
        return force_zero(opened, clock)


def is_unloaded(rig_file: RigFile | None, reading: str, yes: bool) -> bool:
    """Ask a person whether nothing loads the sensors, although there is this large reading."""
    from teleop.output.console import terminal_width
    from teleop.printable import print_error, wrapped
    from teleop.trial.arming import answer, check_person

    if yes or not rig_file:
        print_error(f"{reading}: accepted without a question")
        return True
    check_person(rig_file, f"confirm that no sensor is loaded ({reading})")
    text = f"{rig_file.sections.name}: {reading}. Check that nothing touches tip and handle."
    choice = "Enter measures again, any other answer ends."
    return answer(f"{wrapped(text, terminal_width())}\n{choice}") == ""
