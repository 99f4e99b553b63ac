"""`teleop rig tare`: measure the zero offsets of force and position."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from teleop.commands.overwriting import Overwrite
from teleop.names import CubeName


def tare(
    *,
    rig: Path | None = None,
    out: Path = Path("tare.json"),
    contact: str = "keep",
    yes: Annotated[bool, Parameter(negative="")] = False,
    cube: CubeName = "soft",
    seed: int = 0,
    overwrite: Overwrite = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Measure the zero offsets of force and position, and store them with the date.

    The zero offsets of the forces are measured with disabled drives and without load: nobody holds
    the handle. If the rig moves or a force changes, the command waits until the rig is at rest. It
    ends with an error if this takes more than 5 s. It cannot detect a small constant load.
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
        Arm the drives for `--contact touch` without asking, for scripts.
    cube
        Cube on the simulated rig.
    seed
        Seed of the noise of the simulated sensors.
    json
        Print one JSON document instead of text.
    """
    from drivers import Rig
    from drivers.wired_rig import WiredRig
    from sim_backend import Sensors
    from teleop.control.clock import Clock, RealClock, VirtualClock
    from teleop.control.tare import FARTHEST, write_tare
    from teleop.errors import InputError
    from teleop.evaluation.units import quantity
    from teleop.files import check_outputs
    from teleop.output import console
    from teleop.output.rig_tables import print_tare
    from teleop.rig.touching import arming_text, dated_tare, rig_away_from_cube, touch
    from teleop.rig.zeroing import force_zero
    from teleop.trial.arming import is_armed
    from teleop.trial.rig_loading import load_rig_file

    given = 0.0 if contact in ("keep", "touch") else quantity(contact, "position")
    if given is None or not abs(given) <= FARTHEST:
        raise InputError(f"contact {contact!r}: expected keep, touch, or a position such as 1.5mm")
    check_outputs(out, sources=(rig,), overwrite=overwrite)
    sensors = Sensors()
    rig_file = load_rig_file(rig) if rig else None
    touches = contact == "touch"
    if rig_file and touches and not is_armed(rig_file, arming_text(rig_file), yes):
        return 130
    clock: Clock
    if rig_file:
        clock = RealClock(rig_file.sections.rate_hz)
        opened: Rig = WiredRig(rig_file, clock.now)
    else:
        clock = VirtualClock(1000.0)
        opened = rig_away_from_cube(cube, clock.now, sensors, seed)
    with opened:
        zero = force_zero(opened, clock)
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
