"""`teleop recover`: write the intact part of an incomplete recording to a new file."""

from __future__ import annotations

from pathlib import Path

from teleop.commands.options import Json, OutputFile


def recover(
    file: Path,
    /,
    *,
    out: OutputFile = None,
    json: Json = False,
) -> int:
    """Write the intact part of an incomplete recording to a new, complete file.

    The original recording is not changed.

    Example: `teleop recover trial.mcap`

    Parameters
    ----------
    file
        Recording of teleop run (.mcap) that is damaged or whose end is missing.
    out
        File to write, which must not exist yet. Default: NAME-recovered.mcap, where NAME.mcap is
        the incomplete recording.
    """
    from teleop.files import RECORDING, check_ending
    from teleop.output import console
    from teleop.recording.gaps import gap_rows, missing_text
    from teleop.recording.recovery import recover_recording

    out = out or file.with_name(f"{file.stem}-recovered.mcap")
    check_ending(out, RECORDING)
    recovery = recover_recording(file, out)
    if json:
        console.print_json(
            {
                "file": str(file),
                "out": str(out) if recovery.damage else None,
                "ticks": recovery.ticks,
                "duration_s": recovery.duration,
                "damage": recovery.damage,
                "missing_ticks": gap_rows(recovery.gaps),
            }
        )
    elif recovery.damage:
        console.plain_console().print(
            f"{out}: {recovery.ticks} ticks, {recovery.duration:.3f} s, {recovery.loss}"
        )
    else:
        console.plain_console().print(
            f"{file}: the file is intact, {recovery.ticks} ticks: nothing to recover"
        )
    if recovery.gaps and not json:
        console.plain_console().print(
            f"{missing_text(recovery.gaps)}: the recorder did not receive them"
        )
    return 0
