"""`teleop rig report`: write one file about a rig, for the developers of its drivers."""

from __future__ import annotations

from pathlib import Path

from teleop.commands.machine import check_duration
from teleop.commands.options import Json, OutputFile, Overwrite
from teleop.commands.quantities import Seconds


def report(
    file: Path,
    /,
    *,
    out: OutputFile = None,
    seconds: Seconds = 3.0,
    duration: Seconds = 60.0,
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Check a rig at standstill, and write one file with everything that is known about it.

    The file is a ZIP archive of texts: versions of the software, this computer and its ports, what
    each device states about itself (for a CANopen drive its objects), the result of teleop rig
    check, the rig file, and the first transmissions on each bus. It is written also if the rig
    cannot be opened. The exit code is then 2. Nothing moves: the drives are enabled at standstill
    to test their watchdogs. Send the file to the developers: no driver could be tested with its
    device yet.

    Example: `teleop rig report rigs/odrive-bota.toml --out report.zip`

    Parameters
    ----------
    file
        Rig file (TOML).
    out
        File to write (.zip). Default: the name of the rig file with the ending -report.zip.
    seconds
        Time during which the channels are read [s].
    duration
        Time during which the loop is measured [s].
    """
    from teleop.control.clock import RealClock
    from teleop.errors import InputError
    from teleop.files import check_ending, check_outputs
    from teleop.output.console import plain_console, print_json
    from teleop.rig.report import ENDING, report_rig, write_report
    from teleop.settings.rig_loading import load_rig_file

    check_duration("seconds", seconds)
    check_duration("duration", duration)
    out = out or file.with_name(f"{file.stem}-report{ENDING}")
    check_ending(out, ENDING)
    rig_file = load_rig_file(file)
    check_outputs(out, sources=(file,), overwrite=overwrite)
    found = report_rig(rig_file, RealClock(rig_file.sections.rate_hz), seconds, duration)
    write_report(out, rig_file, found, overwrite)
    if json:
        print_json({"out": str(out), **{name: found[name] for name in found if name != "wire"}})
    if problems := [found["error"]] if found["error"] else found["check"]["problems"]:
        raise InputError(f"{file}: {'; '.join(problems)}: this is in {out}")
    if not json:
        plain_console().print(str(out))
    return 0
