"""State what the results of a sweep depend on, besides the plan and the machine.

The origin of results consists of the versions of the packages that compute them, the plug-ins of
other packages, and the files that the plan names. Results with different origins do not belong into
one table.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from datetime import datetime
from functools import cache, lru_cache
from importlib.metadata import EntryPoint, PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from drivers.input_file import open_input
from drivers.registry import offered as entry_points_of
from estimation.registry import offered, package
from teleop.errors import reason
from teleop.json_documents import dumps
from teleop.settings.plug_ins import PARTS
from teleop.software import software
from teleop.trial.metadata import COMPUTE

Origin = dict[str, dict[str, Any]]
"""What is known of each package, plug-in and file, by its name."""
MODIFIED = "modified"
"""Key of the time at which a file was changed. Files with the same content may have other times."""
CODE = (".py", ".so", ".pyd")
"""Endings of the names of files that contain the code of a plug-in."""


def origin_of(files: Mapping[str, Path], plug_ins: Iterable[str]) -> Origin:
    """Return the origin of results that this process computes."""
    return {
        **{name: {"version": text} for name, text in versions().items()},
        **{name: plug_in(name) for name in plug_ins},
        **{name: file(path) for name, path in files.items()},
    }


@cache
def versions() -> dict[str, str]:
    """Return the version of each installed package that computes results, by its name."""
    found = {"teleop": software()}
    for name in COMPUTE:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def points() -> dict[str, EntryPoint]:
    """Return the entry points of other packages, by what they provide and their name."""
    found = {f"estimator {name}": point for name, point in offered().points.items()}
    for part, about in PARTS.items():
        for point in entry_points_of(about.group, tuple(sys.path)):
            found[f"{part} {point.name}"] = point
    return found


def plug_ins_in(document: Any) -> tuple[str, ...]:
    """Return the plug-ins of other packages whose names a document contains."""
    text = dumps(document)
    return tuple(what for what in sorted(points()) if dumps(what.partition(" ")[2]) in text)


@cache
def plug_in(what: str) -> dict[str, Any]:
    """Return the package and version of a plug-in of another package, and a hash of its code.

    The code consists of all modules of the package that contains the plug-in.
    """
    point = points().get(what)
    if point is None:
        return {}
    known = {"version": package(point)}
    digest = code_hash(point.module.partition(".")[0])
    return {**known, "sha256": digest} if digest else known


def code_hash(module: str) -> str:
    """Return a hash of the code of a module or package; empty if the module is not found."""
    try:
        spec = find_spec(module)
    except (ImportError, ValueError):
        spec = None
    if spec is None:
        return ""
    folders = [Path(folder) for folder in spec.submodule_search_locations or ()]
    paths = [(path.relative_to(top), path) for top in folders for path in top.rglob("*")]
    if not folders and spec.origin:
        paths = [(Path(spec.name), Path(spec.origin))]
    digest = hashlib.sha256()
    for place, path in sorted(paths):
        if path.suffix in CODE:
            digest.update(f"{place.as_posix()}\n{untimed(file(path))}\n".encode())
    return digest.hexdigest()


def file(path: Path) -> dict[str, Any]:
    """Return the size, time and hash of a file, or the problem why it cannot be read."""
    try:
        with open_input(path) as opened:
            stat = os.fstat(opened.fileno())
        return {
            "size": stat.st_size,
            MODIFIED: datetime.fromtimestamp(int(stat.st_mtime)).astimezone().isoformat(),
            "sha256": content(path, stat.st_ino, stat.st_size, stat.st_mtime_ns),
        }
    except OSError as error:
        return {"problem": reason(error)}


@lru_cache(maxsize=1000)
def content(path: Path, *_: int) -> str:
    """Return the hash of the content of a file. Further arguments change when the file changes."""
    digest = hashlib.sha256()
    with open_input(path) as opened:
        while part := opened.read(1 << 20):
            digest.update(part)
    return digest.hexdigest()


def differences(expected: Origin, found: Origin) -> str:
    """Return a text that names what differs between two origins; empty if they are the same."""
    return "; ".join(
        f"{name}: {text(found.get(name))}, expected {text(expected.get(name))}"
        for name in dict.fromkeys((*expected, *found))
        if untimed(expected.get(name)) != untimed(found.get(name))
    )


def untimed(known: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return what is known of a package, plug-in or file, without the time."""
    return {key: value for key, value in (known or {}).items() if key != MODIFIED}


def text(known: Mapping[str, Any] | None) -> str:
    """Return a text with what is known of a package, plug-in or file."""
    if not known:
        return "not installed"
    parts = [str(known[key]) for key in ("problem", "version") if key in known]
    if "size" in known:
        parts.append(f"{known['size']} bytes of {known[MODIFIED]}")
    if "sha256" in known:
        parts.append(f"sha256 {known['sha256'][:8]}")
    return ", ".join(parts)
