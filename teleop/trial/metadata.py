"""Create the metadata of a recording: software, machine, date, rig and settings."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Iterator
from datetime import datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version

from drivers.registry import device_class
from teleop.json_documents import dumps
from teleop.recording.schema import KEY, SCHEMA
from teleop.settings.documents import to_document
from teleop.settings.trial_settings import TrialSettings
from teleop.software import software
from teleop.trial.loop_verdict import LoopVerdict

TEXTS = ("operator", "notes")
"""Settings that are part of the session metadata if they are not empty."""


COMPUTE = ("numpy", "scipy", "numba")
"""Packages that compute the numbers of a trial; numba is optional."""


@cache
def libraries(names: tuple[str, ...] = COMPUTE) -> str:
    """Return the names and versions of those of the packages that are installed."""
    found = []
    for name in names:
        with contextlib.suppress(PackageNotFoundError):
            found.append(f"{name} {version(name)}")
    return ", ".join(found)


def versions() -> dict[str, str]:
    """Return the versions of the software, and the name of the machine."""
    return {
        "software": f"teleop {software()}",
        "python": platform.python_version(),
        "libraries": libraries(),
        "machine": f"{platform.node()}, {platform.platform()}",
    }


def session_metadata(
    settings: TrialSettings, checked: LoopVerdict | None = None
) -> dict[str, dict[str, str]]:
    """Return the metadata of a recording, which consists of the records `session` and `settings`.

    Each record is a dictionary of texts. The record `session` describes software, machine, date,
    rig and specimen. The record `settings` has only the key `json`. Its text is a JSON document
    with the settings of the trial. `checked` is the check of the computer before the trial.
    """
    return {
        "session": {
            **versions(),
            KEY: str(SCHEMA),
            "created": datetime.now().astimezone().isoformat(timespec="seconds"),
            "seed": str(settings.seed),
            "rig": settings.rig_name,
            "specimen": settings.palpated,
            **{name: text for name in TEXTS if (text := getattr(settings, name))},
            **settings.about.texts(),
            "units": "SI units, stated for each column",
            "hand_force": settings.hand_force_source,
            **({"hand_observer": observer.text} if (observer := settings.hand_observer) else {}),
            "estimated_channels": ", ".join(estimated_channels(settings)) or "none",
            **({"machine_check": checked.text} if checked else {}),
        },
        "settings": {"json": dumps(to_document(settings))},
    }


def estimated_channels(settings: TrialSettings) -> Iterator[str]:
    """Yield the names of the channels for which the rig has no sensor.

    An observer estimates these channels, for example `contact_force`.
    """
    if settings.rig:
        devices = settings.rig.devices
        for name, channel in settings.rig.sections.channels.items():
            if device_class(devices[channel.device].kind).estimated:
                yield name
