"""`teleop merge`: one recording of the recordings of two stations."""

from __future__ import annotations

from pathlib import Path

from teleop.commands.options import Json, OutputFile


def merge(
    one: Path,
    two: Path,
    /,
    *,
    out: OutputFile = None,
    json: Json = False,
) -> int:
    """Write the recordings of a master station and a slave station to one recording.

    The merged recording has the ticks and the clock of the slave, the columns of both, and the
    interval of the offset between the clocks at each tick. The commands estimate, report, compare
    and live read it like any other recording.

    Example: `teleop merge master.mcap slave.mcap --out both.mcap`

    Parameters
    ----------
    one
        Recording of one station (.mcap).
    two
        Recording of the other station.
    out
        File to write. Default: NAME-merged.mcap, where NAME.mcap is the recording of the slave.
    """
    import numpy as np

    from teleop.files import RECORDING, check_ending, check_outputs
    from teleop.output import console
    from teleop.recording.recording import load
    from teleop.recording.two_stations import merge as merged_of
    from teleop.recording.two_stations import side_of, write_merged

    recordings = load(one), load(two)
    merged = merged_of(*recordings)
    slave = one if side_of(recordings[0]) == "slave" else two
    out = out or slave.with_name(f"{slave.stem}-merged.mcap")
    check_ending(out, RECORDING)
    check_outputs(out, sources=(one, two))
    write_merged(out, merged)
    width = merged["offset_high"] - merged["offset_low"]
    half = 0.5 * float(np.nanmedian(width))
    matched = int(np.sum(np.isfinite(merged["master_position"] + merged["slave_position"])))
    summary = {"out": str(out), "ticks": len(merged), "matched": matched, "offset_error_s": half}
    if json:
        console.print_json(summary)
    else:
        console.plain_console().print(
            f"{out}: {len(merged)} ticks, {matched} of them with data of both stations; the time "
            f"of the master is known to ± {half * 1e3:.3g} ms"
        )
    return 0
