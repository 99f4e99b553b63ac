"""What only POSIX systems (Linux and macOS) have. No other module imports these modules."""

from __future__ import annotations

import platform
from importlib import import_module
from types import ModuleType


def posix_module(name: str) -> ModuleType | None:
    """Return a module of Python, such as `fcntl`, that only POSIX systems have; else None."""
    try:
        return import_module(name)
    except ImportError:
        return None


def is_posix() -> bool:
    """Return whether pipes can be read without waiting, and processes have sessions."""
    return posix_module("fcntl") is not None


def needs_posix(what: str) -> str:
    """Return the message that something does not work on this system."""
    return f"{what}: not available on {platform.system()}: expected Linux or macOS"
