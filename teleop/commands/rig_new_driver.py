"""`teleop rig new-driver`: write the package of a new driver."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from teleop.commands.options import IN_OUTPUT


def new_driver(
    name: str,
    /,
    *,
    kind: Literal["serial", "can", "udp"] = "serial",
    drive: Literal["none", "velocity", "force", "position"] = "none",
    out: Annotated[Path | None, IN_OUTPUT] = None,
) -> int:
    """Write a package with the driver of a device, its emulated device, a rig file and tests.

    The package works as it is written: its tests pass after `pip install -e FOLDER`. Its protocol
    is an example. Replace it by the protocol of your device, and run the tests again.

    Example: `teleop rig new-driver acme_ft --kind udp`

    Parameters
    ----------
    name
        Kind of the device in a rig file, and name of its Python module, such as acme_ft.
    kind
        Kind of its bus. A device on a TCP connection is a serial device.
    drive
        What its drive accepts; none for a force sensor.
    out
        Folder to write. It must not exist, or be empty. Default: the name.
    """
    from teleop.output.console import plain_console
    from teleop.output.next_command import print_command
    from teleop.rig.new_driver import write_driver

    folder = out or Path(name)
    files = write_driver(name, kind, drive, folder)
    console = plain_console()
    for file in files:
        console.print(str(file), soft_wrap=True)
    print_command("install it", ["pip", "install", "-e", str(folder)])
    print_command("test it", ["pytest", str(folder)])
    return 0
