"""`teleop rig tare`: where force and position are zero."""

from __future__ import annotations

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
    cube: CubeName = "soft",
    seed: int = 0,
    overwrite: Overwrite = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Find where force and position are zero, and store it with its date.

    The force zero is taken with idle drives and nothing loaded; a rig that moves or bears a
    load is refused. Apply it with `teleop run --tare`.

    Example: `teleop rig tare --contact touch --out tare.json`

    Parameters
    ----------
    rig
        Rig file, TOML; by default the rig is simulated.
    out
        File for the zeros.
    contact
        The contact datum: the encoder's own zero (keep), found by going forward slowly, by
        4 mm at the most, until the slave touches (touch), or a position such as 1.5mm.
    cube
        The cube on the simulated rig.
    seed
        Seed of the simulated sensors' noise.
    json
        Print one JSON document instead of a text.
    """
    from drivers import Rig
    from drivers.wired_rig import WiredRig
    from sim_backend import Sensors
    from teleop.control.clock import Clock, RealClock, VirtualClock
    from teleop.control.tare import FARTHEST, write_tare
    from teleop.errors import InputError
    from teleop.evaluation.units import quantity
    from teleop.files import check_outputs
    from teleop.output import tables as console
    from teleop.rig.loading import load_rig_file
    from teleop.rig.touching import off_the_cube, touch, touch_settings
    from teleop.rig.zeroing import dated, force_zero

    given = 0.0 if contact in ("keep", "touch") else quantity(contact, "position")
    if given is None or not abs(given) <= FARTHEST:
        raise InputError(f"contact {contact!r}: expected keep, touch, or a position such as 1.5mm")
    check_outputs(out, sources=(rig,), overwrite=overwrite)
    sensors = Sensors()
    rig_file = load_rig_file(rig) if rig else None
    clock: Clock
    if rig_file:
        clock = RealClock(rig_file.sections.rate_hz)
        opened: Rig = WiredRig(rig_file, clock.now)
    else:
        clock = VirtualClock(1000.0)
        opened = off_the_cube(cube, clock.now, sensors, seed)
    with opened:
        zero = force_zero(opened, clock)
    if contact == "touch":
        given = touch(touch_settings(rig_file, cube, zero, sensors, seed), record=None)
    found = dated(zero, given, rig_file.sections.name if rig_file else "simulated")
    write_tare(found, out, overwrite)
    if json:
        console.print_json({**found._asdict(), "noise_n": zero.noise, "file": str(out)})
    else:
        console.print_tare(found, zero.noise, out)
    return 0
