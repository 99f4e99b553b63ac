"""Create the metadata of a recording: software, machine, date, rig and settings."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Iterator
from datetime import datetime
from importlib.metadata import PackageNotFoundError, version

from drivers.registry import device_class
from teleop.json_documents import dumps
from teleop.trial.settings import TrialSettings
from teleop.trial.settings_json import to_document

TEXTS = ("operator", "notes")
"""Settings that are part of the session metadata if they are not empty."""


COMPUTE = ("numpy", "scipy", "numba")
"""Packages that compute the numbers of a trial; numba is optional."""


def libraries() -> Iterator[str]:
    """Yield name and version of each installed package of `COMPUTE`."""
    for name in COMPUTE:
        with contextlib.suppress(PackageNotFoundError):
            yield f"{name} {version(name)}"


def session_metadata(settings: TrialSettings) -> dict[str, dict[str, str]]:
    """Return the metadata records `session` and `settings` of a recording, as text by key."""
    return {
        "session": {
            "software": f"teleop {version('teleop')}",
            "python": platform.python_version(),
            "libraries": ", ".join(libraries()),
            "machine": f"{platform.node()}, {platform.platform()}",
            "created": datetime.now().astimezone().isoformat(timespec="seconds"),
            "seed": str(settings.seed),
            "rig": settings.rig_name,
            "specimen": settings.palpated,
            **{name: text for name in TEXTS if (text := getattr(settings, name))},
            "estimated_channels": ", ".join(estimated_channels(settings)) or "none",
        },
        "settings": {"json": dumps(to_document(settings))},
    }


def estimated_channels(settings: TrialSettings) -> Iterator[str]:
    """Yield the names of the channels that an observer estimates, because they have no sensor."""
    if settings.rig:
        devices = settings.rig.devices
        for name, channel in settings.rig.sections.channels.items():
            if device_class(devices[channel.device].kind).estimated:
                yield name
