"""`teleop rig emulate`: a rig's devices in software, on wires that are real."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from teleop.commands.overwriting import Overwrite
from teleop.names import ConditionName, CubeName, RealtimeName

DEVICES_ARE_PUNCTUAL = ("SCHED_FIFO", "no garbage collection")
"""Steps of the real-time set-up that an emulator takes; the processor is left to the controller."""
WRITER = "teleop rig emulate"


def emulate(
    file: Path,
    /,
    *,
    out: Path = Path("run.toml"),
    cube: CubeName = "soft",
    condition: ConditionName = "free",
    depth: str | None = None,
    seed: int = 0,
    fault: tuple[str, ...] = (),
    overwrite: Overwrite = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Serve a rig's devices in software, with the simulated plant behind them, until stopped.

    Serial ports and slcan adapters become pseudo-terminals; a SocketCAN bus must be there. In
    another terminal: `teleop run --rig run.toml --condition CONDITION`. A little more than
    a second after the drives were idled the plant is put back to its start.

    Example: `teleop rig emulate rigs/serial-board.toml --condition mimic --cube hard`

    Parameters
    ----------
    file
        Rig file, TOML.
    out
        Where to write the rig file to run against the emulator. A file that an emulator wrote,
        and that nobody has edited since, is replaced.
    cube
        The cube that is palpated.
    condition
        Who holds the handle: an operator who palpates as they like (free), one who tries to
        track a sine (mimic), or nobody (autonomous).
    depth
        How deep the operator palpates, such as 5mm; by default as deep as in the paper.
    seed
        Seed of operator and sensor noise.
    fault
        A fault of a wire, KIND:BUS@SECONDS after the drives are enabled, such as
        corrupt:force@3; may be repeated. Kinds: drop, double, reorder, delay, truncate, corrupt,
        length, burst, noise, baud, silence, error-frames, bus-off, unplug, replug; reset takes a
        device for the bus.
    json
        Print one JSON document, once it serves, instead of a text.
    """
    import os
    import shutil
    import tempfile

    from sim_backend.wire.emulator import host_file, host_ports
    from teleop.commands.run import read_depth
    from teleop.files import check_outputs, write_text
    from teleop.interruption import stop_signals
    from teleop.output import rig_tables as rig_console
    from teleop.output import tables as console
    from teleop.rig.emulation import make_emulator, opened, read_fault
    from teleop.rig.loading import load_rig_file
    from teleop.rig.stamp import is_unchanged, stamped
    from teleop.trial.realtime import realtime
    from teleop.trial.settings import TrialSettings

    rig = load_rig_file(file)
    overwrite = overwrite or is_unchanged(out, WRITER)
    check_outputs(out, sources=(file,), overwrite=overwrite)
    faults = [read_fault(text, rig) for text in fault]
    settings = TrialSettings(condition=condition, cube=cube, seed=seed, depth=read_depth(depth))
    urgency: RealtimeName = "try" if (os.cpu_count() or 1) > 1 else "off"
    folder = Path(tempfile.mkdtemp(prefix="teleop-"))
    try:
        emulator = make_emulator(rig, settings, folder, faults)
        with (
            stop_signals() as stopped,
            opened(emulator),
            realtime(urgency, DEVICES_ARE_PUNCTUAL) as real_time,
        ):
            write_text(out, stamped(host_file(rig, folder), WRITER), overwrite)
            ports = host_ports(rig, folder)
            if json:
                console.print_json({"rig": rig.sections.name, "file": str(out), "ports": ports})
            else:
                rig_console.print_emulation(rig.sections.name, ports, out, condition, cube)
            real_time.start()
            emulator.serve(stopped)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return 0
