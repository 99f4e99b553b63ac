"""Safety supervisor, which checks the measurements and limits the commands to the drives."""

from teleop.safety.channels import ChannelState, check_channels
from teleop.safety.events import Event, Fault, Mode, describe, stops_immediately
from teleop.safety.limits import ChannelLimits, Limits
from teleop.safety.state import Request, Supervision, Verdict
from teleop.safety.supervisor import activate, rearm, supervise

__all__ = [
    "ChannelLimits",
    "ChannelState",
    "Event",
    "Fault",
    "Limits",
    "Mode",
    "Request",
    "Supervision",
    "Verdict",
    "activate",
    "check_channels",
    "describe",
    "rearm",
    "stops_immediately",
    "supervise",
]
