"""Recognize commands that a busy machine has refused or stopped, by their messages."""

from __future__ import annotations

import re

CAUSES = (
    r"fewer programs at the same time",
    r"drive error: watchdog$",
    r"the loop overran: \d+",
    r"the live process was silent for (0\.3|5) s",
    r"the page has confirmed no data of the last 1 s",
)
"""Messages about a refused rate, and about a pause of the loop, the live process or the page."""
CAUSES_ON_DEVICES = (
    r"drive error: board: watchdog: no command arrived in time",
    r"drive error: \w+: WATCHDOG_TIMER_EXPIRED",
    r"drive error: \w+: the controller's heartbeat was missed",
    r"is stale: last sample [\d.]+ ms old",
    r": [\d.]+ ms old, limit 100 ms",
    r"the slave does not follow its command: 2\.\d+ mm behind it",
    r"commanded [-+][\d.]+ mm, \w+ shows [-+][\d.]+ mm",
)
"""Messages about a pause of the loop, or of emulated devices, which also need a processor."""
REPEATS = 2
"""Number of times that a trial is repeated at most after such a cause."""


def busy_cause(error: str, on_devices: bool = False) -> str:
    """The message in the standard error of a command that states such a cause; empty if none."""
    causes = CAUSES + CAUSES_ON_DEVICES * on_devices
    found = re.search("|".join(causes), error, re.MULTILINE)
    return found[0] if found else ""
