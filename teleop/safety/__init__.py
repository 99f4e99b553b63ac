"""Safety: limits, the checks of every channel, and the supervisor between desired and applied."""

from teleop.safety.channels import Watch, check_channel
from teleop.safety.events import Event, Fault, Mode, describe, stops_at_once
from teleop.safety.limits import ChannelLimits, Limits
from teleop.safety.state import Request, Supervision, Verdict
from teleop.safety.supervisor import activated, rearm, supervise

__all__ = [
    "ChannelLimits",
    "Event",
    "Fault",
    "Limits",
    "Mode",
    "Request",
    "Supervision",
    "Verdict",
    "Watch",
    "activated",
    "check_channel",
    "describe",
    "rearm",
    "stops_at_once",
    "supervise",
]
