"""Limits of the samples of each channel, and of the motion and force of the telemanipulator."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from drivers import CHANNELS
from teleop.names import SideName

SIDE_CHANNELS: dict[SideName, tuple[str, ...]] = {
    "master": ("master_force", "master_position"),
    "slave": ("slave_position", "contact_force", "slave_velocity"),
}
"""Names of the channels of each side of the telemanipulator."""


@dataclass(frozen=True)
class ChannelLimits:
    """Limits of the samples of a channel, in the channel's SI unit.

    A sample that exceeds a limit is a fault.

    Raises
    ------
    ValueError
        The range is empty or not finite, or another limit is not positive.
    """

    low: float
    """Lower end of the sensor's range."""
    high: float
    """Upper end of the sensor's range."""
    max_rate: float = math.inf
    """Largest rate of change that is physically possible [unit/s]."""
    max_age: float = 0.02
    """Largest age of a sample [s]."""
    frozen_time: float = math.inf
    """Longest time for which a working sensor can give exactly the same value [s]."""
    frozen_travel: float = math.inf
    """Largest commanded change for which the measured value may remain unchanged [unit]."""
    required: bool = True
    """Whether the rig must have the channel. If not, all values of the channel may be NaN."""

    def __post_init__(self) -> None:
        if not -math.inf < self.low < self.high < math.inf:
            raise ValueError(f"a channel's range must be finite: {self.low} to {self.high}")
        for name in ("max_rate", "max_age", "frozen_time", "frozen_travel"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")

    @property
    def optional(self) -> ChannelLimits:
        """Limits for a channel that the rig does not measure. Only the range is kept."""
        return ChannelLimits(self.low, self.high, required=False)

    def shifted(self, zero: float) -> ChannelLimits:
        """Return the limits for samples from which a zero offset is subtracted.

        The range is shifted by the zero offset. The other limits do not change.
        """
        if not self.low <= zero <= self.high:
            raise ValueError(
                f"{zero:g}: expected a value in the range of the sensor, "
                f"{self.low:g} to {self.high:g}"
            )
        return replace(self, low=self.low - zero, high=self.high - zero)


def default_channel_limits() -> dict[str, ChannelLimits]:
    """Return the default limits of each channel, by the name of the channel.

    They are suitable for a rig with a linear actuator and a force sensor for large forces.
    """
    return {
        "master_force": ChannelLimits(-200.0, 200.0, max_rate=2e4, frozen_time=0.05),
        "master_position": ChannelLimits(
            -0.5, 0.5, max_rate=5.0, frozen_travel=2e-3, required=False
        ),
        "slave_position": ChannelLimits(-0.5, 0.5, max_rate=5.0, frozen_travel=2e-3),
        "contact_force": ChannelLimits(-1000.0, 1000.0, max_rate=5e4, frozen_time=0.05),
        "slave_velocity": ChannelLimits(
            -2.0, 2.0, max_rate=500.0, frozen_travel=0.02, required=False
        ),
    }


@dataclass(frozen=True)
class Limits:
    """Limits of motion and force of the telemanipulator, and of its channels.

    The limits of a trial are computed by `rig_limits` from the rig file, or by
    `simulated_rig_limits` from the palpation depth and the body. The defaults are those of
    `teleop rig tare` on the simulated rig.

    If a soft limit is reached, the supervisor reduces the command, but permits motion away from the
    limit. If a hard limit is exceeded, the supervisor stops the drives because of a fault.

    Raises
    ------
    ValueError
        A limit is not positive, a hard limit is tighter than its soft limit, or the limits of a
        channel are missing.
    """

    max_velocity: float = 0.2
    """Soft limit: largest commanded speed of the slave [m/s].

    The hard limit of the measured speed is twice this value.
    """
    max_acceleration: float = 10.0
    """Soft limit: largest commanded acceleration and deceleration of the slave [m/s^2].

    During a stop with a ramp, the slave decelerates with this value.
    """
    max_master_velocity: float = 0.5
    """Soft limit: largest commanded speed of the master [m/s]."""
    max_master_acceleration: float = 25.0
    """Soft limit: largest commanded acceleration of the master [m/s^2]."""
    soft_position: tuple[float, float] = (-20e-3, 20e-3)
    """Soft limits of the slave's position, lower and upper [m]; the slave stops at these limits."""
    hard_position: tuple[float, float] = (-25e-3, 25e-3)
    """Hard limits of the slave's position, lower and upper [m]."""
    soft_force: float = 60.0
    """Soft limit: magnitude of the contact force above which the slave presses no further [N]."""
    hard_force: float = 80.0
    """Hard limit of the magnitude of the contact force [N]."""
    following_error: float = 2e-3
    """Hard limit of the difference between commanded and measured travel of the slave [m]."""
    drive_compliance: float = 0.0
    """Compliance of the slave's drive: displacement divided by contact force [m/N]."""
    drive_lag: float = 0.0
    """Lag with which the slave's drive follows its command [s]. It causes no following error."""
    rest_velocity: float = 2e-3
    """Largest speed at which the slave is treated as at rest [m/s]."""
    rest_master_force: float = 5.0
    """Largest force on the handle at which the drives may be armed [N]."""
    preflight: float = 0.05
    """Time for which all checks must pass before the mode becomes ready [s]."""
    start_ramp: float = 0.1
    """Time after arming in which the velocity limits increase from zero to their values [s]."""
    max_gap: float = 0.08
    """Longest time between two ticks [s]; shorter than the watchdog times of the drives."""
    max_skipped_fraction: float = 0.25
    """Largest fraction of its periods that the loop may skip, averaged over `AVERAGING_TIME`."""
    channels: dict[str, ChannelLimits] = field(default_factory=default_channel_limits)
    """Limits of each channel, by the name of the channel."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            least = 0.0 if name in ("drive_compliance", "drive_lag") else math.ulp(0.0)
            if isinstance(value, float | int) and not least <= value < math.inf:
                raise ValueError(f"{name} must be positive, got {value}")
        if self.max_skipped_fraction >= 1.0:
            raise ValueError(
                f"max_skipped_fraction must be a fraction below 1, got {self.max_skipped_fraction}"
            )
        (hard_low, hard_high), (low, high) = self.hard_position, self.soft_position
        if not -math.inf < hard_low <= low < high <= hard_high < math.inf:
            raise ValueError(
                f"soft position limits {self.soft_position} must lie within the hard ones, "
                f"{self.hard_position}"
            )
        if self.soft_force > self.hard_force:
            raise ValueError(
                f"soft force limit {self.soft_force:g} N is above the hard one, "
                f"{self.hard_force:g} N"
            )
        if set(self.channels) != set(CHANNELS):
            raise ValueError(f"expected limits for the channels {', '.join(CHANNELS)}")

    def of_side(self, side: SideName) -> Limits:
        """Return the limits for a station that measures the channels of one side only."""
        channels = {
            name: limit if name in SIDE_CHANNELS[side] else limit.optional
            for name, limit in self.channels.items()
        }
        return replace(self, channels=channels)

    def shifted(self, zeros: Mapping[str, float]) -> Limits:
        """Return the limits for measurements from which zero offsets are subtracted.

        The range of each channel is shifted by its zero offset. The sample without subtraction is
        thus still compared with the range of the sensor. The other limits do not change, because
        they are limits of the values after subtraction.
        """
        channels = dict(self.channels)
        for name, zero in zeros.items():
            try:
                channels[name] = channels[name].shifted(zero)
            except ValueError as error:
                raise ValueError(f"{name} {error}") from error
        return replace(self, channels=channels)
