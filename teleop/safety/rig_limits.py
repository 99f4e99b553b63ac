"""Convert the limits in a rig file (TOML description of a telemanipulator) to SI units."""

from __future__ import annotations

from typing import Any

from drivers.rig_sections import ForceSettings, PositionSettings, RigSections, VelocitySettings
from teleop.safety.limits import ChannelLimits, Limits, default_channel_limits


def rig_limits(rig: RigSections) -> Limits:
    """Convert the limits of a rig file to SI units."""
    given = rig.limits
    channels = {name: limits.optional for name, limits in default_channel_limits().items()}
    for name, channel in rig.channels.items():
        try:
            channels[name] = channel_limits(channel)
        except ValueError as error:
            raise ValueError(f"channels.{name}: {error}") from error
    try:
        return Limits(
            max_velocity=given.max_velocity_mm_per_s * 1e-3,
            max_acceleration=given.max_acceleration_m_per_s2,
            max_master_velocity=given.max_master_velocity_mm_per_s * 1e-3,
            max_master_acceleration=given.max_master_acceleration_m_per_s2,
            soft_position=to_metres(given.soft_position_mm),
            hard_position=to_metres(given.hard_position_mm),
            soft_force=given.soft_force_n,
            hard_force=given.hard_force_n,
            following_error=given.following_error_mm * 1e-3,
            drive_compliance=given.drive_compliance_um_per_n * 1e-6,
            drive_lag=rig.drives.slave.lag_ms * 1e-3 if rig.drives.slave else 0.0,
            rest_velocity=given.rest_velocity_mm_per_s * 1e-3,
            rest_master_force=given.rest_master_force_n,
            channels=channels,
        )
    except ValueError as error:
        raise ValueError(f"limits: {error}") from error


def channel_limits(channel: ForceSettings | PositionSettings | VelocitySettings) -> ChannelLimits:
    """Convert the limits of one channel of a rig file to SI units."""
    common: dict[str, Any] = {"max_age": channel.max_age_ms * 1e-3}
    match channel:
        case ForceSettings():
            low, high = channel.range_n
            common["max_rate"] = channel.max_rate_n_per_s
            common["frozen_time"] = channel.frozen_ms and channel.frozen_ms * 1e-3
        case PositionSettings():
            low, high = to_metres(channel.range_mm)
            common["max_rate"] = optional_to_metres(channel.max_rate_mm_per_s)
            common["frozen_travel"] = optional_to_metres(channel.frozen_travel_mm)
        case VelocitySettings():
            low, high = to_metres(channel.range_mm_per_s)
            common["max_rate"] = optional_to_metres(channel.max_rate_mm_per_s2)
            common["frozen_travel"] = optional_to_metres(channel.frozen_travel_mm_per_s)
    return ChannelLimits(low, high, **{name: v for name, v in common.items() if v is not None})


def optional_to_metres(value: float | None) -> float | None:
    """Convert a value from mm to m; return None if the value is None (not given)."""
    return None if value is None else value * 1e-3


def to_metres(ends: tuple[float, float]) -> tuple[float, float]:
    """Convert the two ends of a range from mm to m."""
    return ends[0] * 1e-3, ends[1] * 1e-3
