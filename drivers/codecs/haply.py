"""Encode and decode messages of the Haply Inverse Service, version 3.5.

Sources: "WebSocket Protocol", "Control Commands" and "Print Inverse3" of docs.haply.co. The
messages are JSON. The first message of the service describes all devices. After it, the service
sends exactly one message with the state of the devices for each message that it receives.
"""

from __future__ import annotations

import json
import math
from typing import Any, NamedTuple

AXES = ("x", "y", "z")
NEEDED = ("ready", "calibrated", "power_supply")
"""Entries of the status that must not be false."""


class State(NamedTuple):
    """State of a device in a message."""

    position: float
    """Position of the cursor along the axis [m]."""
    velocity: float
    """Velocity of the cursor along the axis [m/s]."""
    problem: str
    """Problem in the status as text; empty if there is none."""


def command(device: str, axis: str, force: float) -> str:
    """Return the message that sets the force of a device [N]; it is 0 along the other axes."""
    vector = {name: force if name == axis else 0.0 for name in AXES}
    commands = {"set_cursor_force": {"vector": vector}}
    return json.dumps({"inverse3": [{"device_id": device, "commands": commands}]})


def devices(message: str) -> dict[str, dict[str, Any]]:
    """Return the devices in a message by id. ValueError if the message is malformed."""
    try:
        found = json.loads(message)["inverse3"]
        return {str(device["device_id"]): dict(device) for device in found}
    except (KeyError, TypeError, RecursionError) as error:
        raise ValueError("no list of devices") from error


def state(device: dict[str, Any], axis: str) -> State:
    """Return the state of a device. ValueError if it is malformed."""
    try:
        values = device["state"]
        position = float(values["cursor_position"][axis])
        velocity = float(values["cursor_velocity"][axis])
        status = dict(device.get("status") or {})
    except (KeyError, TypeError, OverflowError) as error:
        raise ValueError("no state") from error
    if not (math.isfinite(position) and math.isfinite(velocity)):
        raise ValueError("not finite")
    missing = [name for name in NEEDED if status.get(name) is False]
    return State(position, velocity, f"not {', not '.join(missing)}" if missing else "")
