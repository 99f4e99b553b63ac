"""`teleop rig emulate`: emulate the devices of a rig, without hardware."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from teleop.commands.options import IN_OUTPUT, Json, Overwrite
from teleop.commands.quantities import Hertz, Length
from teleop.names import CubeName, PalpationName, RealtimeName

if TYPE_CHECKING:
    from sim_backend.wire.mechanism import Mechanism
    from teleop.rig.emulation import Palpation

REALTIME_STEPS = ("SCHED_FIFO", "no garbage collection")
"""Real-time settings of the emulator. The emulator does not reserve a processor for itself, because
the control loop may need it."""
WRITER = "teleop rig emulate"
"""Name of this command in the first line of the rig file that it writes."""


def emulate(
    file: Path,
    /,
    *,
    out: Annotated[Path, IN_OUTPUT] = Path("run.toml"),
    cube: CubeName = "soft",
    condition: PalpationName = "any",
    depth: Length | None = None,
    frequency: Hertz | None = None,
    seed: int = 0,
    fault: tuple[str, ...] = (),
    overwrite: Overwrite = False,
    json: Json = False,
) -> int:
    """Emulate the devices of a rig, connected to the simulated plant, until stopped.

    Pseudo-terminals replace the serial ports and slcan adapters, and ports of the loopback
    interface replace UDP and TCP. If the rig uses a SocketCAN bus, this bus must exist. When the
    devices are ready, the command prints a `teleop run` command, which you enter in another
    terminal. A little more than one second after the drives are disabled, the simulated plant
    returns to its initial state.

    The simulated operator presses to the depth that is given to this command, not to the depth that
    is given to `teleop run`. To change the operator, the cube or the depth between two trials, type
    the name of a condition, the name of a cube, a depth, or several of them, such as
    `mimic medium 5mm`, and press Enter.

    Example: `teleop rig emulate rigs/serial-board.toml --cube hard`

    Parameters
    ----------
    file
        Rig file (TOML).
    out
        Rig file to write, for runs with the emulator. An existing file is replaced without
        --overwrite if this command wrote it and nobody edited it afterwards.
    cube
        Cube that is palpated.
    condition
        Behaviour of the simulated operator. free: palpates freely. mimic: follows a sine after a
        count-in of 3 s. autonomous: does not touch the handle. any: for runs with any condition;
        follows the sine as in mimic, but releases the handle if it moves by itself.
    depth
        Depth to which the simulated operator palpates, such as 5mm. Default: the
        depth in the paper for the cube and the condition.
    frequency
        Frequency of the sine that the operator follows with --condition any or mimic [Hz].
        Default: 1.
    seed
        Seed of the simulated operator and of the sensor noise. The random numbers of a trial depend
        on this seed and on the number of the trial since the start of this command.
    fault
        Fault of a bus as KIND:BUS@SECONDS, such as corrupt:force@3. SECONDS is the time between the
        enabling of the drives and the fault. The option may be repeated. Kinds: drop, double,
        reorder, delay, truncate, corrupt, length, burst, noise, baud, silence, error-frames,
        bus-off, unplug, replug; and reset, with the name of a device instead of a bus.
    """
    import os
    import shutil
    import tempfile

    from sim_backend import AttentiveOperator, MimickedSine
    from sim_backend.wire.emulator import host_file, host_ports
    from teleop.commands.trial_options import make_signal
    from teleop.files import check_outputs, write_text
    from teleop.interruption import stop_signals
    from teleop.output import console, rig_tables
    from teleop.rig.emulation import (
        Palpation,
        emulated_master,
        is_unchanged,
        make_emulator,
        opened,
        read_fault,
        with_checksum,
    )
    from teleop.settings.ranges import COUNT_IN
    from teleop.settings.rig_loading import load_rig_file
    from teleop.settings.trial_settings import TrialSettings
    from teleop.trial.realtime import realtime

    rig = load_rig_file(file)
    overwrite = overwrite or is_unchanged(out, WRITER)
    check_outputs(out, sources=(file,), overwrite=overwrite)
    faults = [read_fault(text, rig) for text in fault]
    settings = TrialSettings(
        condition="mimic" if condition == "any" else condition,
        cube=cube,
        seed=seed,
        depth=depth,
        signal=None if frequency is None else make_signal("sine", frequency),
        count_in=COUNT_IN,
        force_master=emulated_master(rig),
    )
    palpated = Palpation(settings, AttentiveOperator if condition == "any" else MimickedSine)
    urgency: RealtimeName = "try" if (os.cpu_count() or 1) > 1 else "off"
    folder = Path(tempfile.mkdtemp(prefix="teleop-"))
    try:
        emulator = make_emulator(rig, settings, folder, faults, palpated.mimic)
        with (
            stop_signals() as stopped,
            opened(emulator),
            realtime(urgency, REALTIME_STEPS) as real_time,
        ):
            write_text(out, with_checksum(host_file(emulator), WRITER), overwrite)
            ports = host_ports(emulator)
            if json:
                console.print_json({"rig": rig.sections.name, "file": str(out), "ports": ports})
            else:
                palpation: dict[str, Any] = {
                    **({} if condition == "any" else {"condition": condition}),
                    "specimen": cube,
                    "depth": f"{settings.setup.depth * 1e3:g}mm",
                    **({} if frequency is None else {"frequency": f"{frequency:g}"}),
                }
                sections = rig.sections
                rig_tables.print_emulation(sections.name, ports, out, palpation, sections.has_slave)
            real_time.start()
            emulator.serve(stopped, changes_of(palpated, emulator.mechanism))
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return 0


def changes_of(palpated: Palpation, mechanism: Mechanism) -> Callable[[], None]:
    """A function that reads typed lines and changes the operator, the cube or the depth."""
    from sim_backend.wire.mechanism import PUT_BACK
    from teleop.errors import InputError
    from teleop.printable import print_error
    from teleop.rig.emulation import TypedLines

    typed, early = TypedLines(), 0

    def change() -> None:
        nonlocal palpated, early
        if mechanism.early > early:
            early = mechanism.early
            print_error(
                "the drives were enabled before the simulated plant returned to its initial "
                f"state: expected {PUT_BACK:g} s between two trials (in a plan, rest_s = 2)"
            )
        for line in typed.read():
            try:
                palpated = palpated.changed(line)
            except InputError as error:
                print_error(str(error))
                continue
            when = "after this trial" if mechanism.driven else "now"
            mechanism.exchange(palpated.rig)
            print_error(f"{when}: {palpated.text}")

    return change
