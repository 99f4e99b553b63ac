"""Write the package of a new driver: device, emulated device, rig file and tests."""

from __future__ import annotations

import importlib.util
import keyword
import re
import shutil
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from drivers.registry import kinds
from teleop.errors import InputError
from teleop.files import unwritable

NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
"""Pattern of the name of a device, which is also the name of its module."""
BASES = {"serial": "SerialDevice", "can": "CanDevice", "udp": "DatagramDevice"}
"""Base class of a device, by the kind of its bus."""
DRIVES = {
    "none": "",
    "velocity": "VelocityDrive",
    "force": "ForceDrive",
    "position": "PositionDrive",
}
"""Base class of a drive, by what it accepts."""


def check_name(name: str) -> None:
    """Raise InputError if a driver cannot have this name."""
    if not NAME.fullmatch(name) or keyword.iskeyword(name):
        raise InputError(
            f"{name!r}: expected a name of small letters, digits and _ that is no keyword of "
            "Python, for example acme_ft"
        )
    if name in kinds():
        raise InputError(f"{name!r}: a kind of device with this name exists")
    for module in (name, f"{name}_emulated"):
        if importlib.util.find_spec(module):
            raise InputError(f"{name!r}: a Python module {module} exists: expected another name")


def write_driver(name: str, kind: str, drive: str, out: Path) -> list[Path]:
    """Write the package of a new driver into a new folder; return its files.

    Parameters
    ----------
    name
        Name of the kind of device, and of the module.
    kind
        Kind of the bus, a key of `BASES`.
    drive
        What the drive accepts, a key of `DRIVES`; `none` for a sensor.
    out
        The folder. It must not exist, or be empty.

    Raises
    ------
    InputError
        The name is not permitted or is used, or the folder is not empty or cannot be written.
    """
    check_name(name)
    templates = Environment(
        loader=PackageLoader("teleop.rig", "driver_templates"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    names = ["DeviceSettings", "Sample", BASES[kind], *filter(None, [DRIVES[drive]])]
    if drive == "none":
        names.append("NO_SAMPLE")
    values = {
        "name": name,
        "cls": "".join(part.capitalize() for part in name.split("_")),
        "kind": kind,
        "drive": drive,
        "base": BASES[kind],
        "drive_base": DRIVES[drive],
        "imports": ", ".join(sorted(names, key=lambda n: (not n.isupper(), n))),
        "what": {"none": "force sensor", "force": "torque motor"}.get(drive, "motor"),
        "measured": "angle [urad]" if drive == "force" else "position [um]",
        "commanded": {"force": "torque [uN m]", "velocity": "[um/s]"}.get(drive, "[um]"),
    }
    files = {
        f"{name}.py": "driver.py.j2",
        f"{name}_emulated.py": "emulated.py.j2",
        f"test_{name}.py": "test.py.j2",
        "rig.toml": "rig.toml.j2",
        "pyproject.toml": "pyproject.toml.j2",
    }
    texts = {file: templates.get_template(one).render(values) for file, one in files.items()}
    try:
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise InputError(f"{out}: expected a folder that does not exist or is empty")
        is_new = not out.exists()
        out.mkdir(parents=True, exist_ok=True)
        try:
            for file, text in texts.items():
                (out / file).write_text(text, encoding="utf-8")
        except OSError:
            if is_new:
                shutil.rmtree(out, ignore_errors=True)
            raise
    except OSError as error:
        raise unwritable(out, error) from error
    return [out / file for file in texts]
