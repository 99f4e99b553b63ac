"""Limits: what each channel may read, and what the telemanipulator may do."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from drivers import CHANNELS


@dataclass(frozen=True)
class ChannelLimits:
    """What a healthy channel reads, in its SI unit.

    Raises
    ------
    ValueError
        The range is empty or not finite, or a bound is not positive.
    """

    low: float
    high: float
    """Ends of the sensor's range."""
    max_rate: float = math.inf
    """Fastest change that is possible [unit/s]."""
    max_age: float = 0.02
    """Oldest sample that is taken [s]."""
    frozen_time: float = math.inf
    """Longest time for which a live sensor repeats one value to the bit [s]."""
    frozen_travel: float = math.inf
    """Farthest that the drive is commanded to change the value without any change [unit]."""
    required: bool = True
    """Whether the rig must have it: one that is not required may read NaN from the start on."""

    def __post_init__(self) -> None:
        if not -math.inf < self.low < self.high < math.inf:
            raise ValueError(f"a channel's range must be finite: {self.low} to {self.high}")
        for name in ("max_rate", "max_age", "frozen_time", "frozen_travel"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")

    def shifted(self, zero: float) -> ChannelLimits:
        """The limits of a channel from whose samples this zero is subtracted.

        Raises
        ------
        ValueError
            The zero is not a value that the sensor can read.
        """
        if not self.low <= zero <= self.high:
            raise ValueError(
                f"{zero:g}: expected a value in the range of the sensor, "
                f"{self.low:g} to {self.high:g}"
            )
        return replace(self, low=self.low - zero, high=self.high - zero)


def usual_channels() -> dict[str, ChannelLimits]:
    """Channels of a laboratory's linear actuator with a contact force sensor of 1 kN."""
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
    """What the telemanipulator may do.

    Soft limits hold the command back and let it move away from the limit; beyond a hard limit
    the supervisor trips.

    Raises
    ------
    ValueError
        A limit is not positive, a hard limit lies inside its soft limit, or a channel is missing.
    """

    max_velocity: float = 0.2
    """Soft: greatest commanded speed of the slave [m/s]; the measured one may be twice that."""
    max_acceleration: float = 10.0
    """Soft: greatest change of the slave's commanded velocity [m/s^2]; that of every ramp."""
    max_master_velocity: float = 0.5
    """Soft: greatest commanded speed of the master [m/s]."""
    max_master_acceleration: float = 25.0
    """Soft: greatest change of the master's commanded velocity [m/s^2]."""
    soft_position: tuple[float, float] = (-20e-3, 20e-3)
    """Where the slave is braked [m]."""
    hard_position: tuple[float, float] = (-25e-3, 25e-3)
    """Where the slave may not be [m]."""
    soft_force: float = 60.0
    """Size of the contact force at which the slave moves no further against it [N]."""
    hard_force: float = 80.0
    """Greatest size of the contact force [N]."""
    following_error: float = 2e-3
    """Farthest that the slave may depart from its command [m]."""
    drive_compliance: float = 0.0
    """How far the slave's drive gives way to the contact force [m/N]."""
    rest_velocity: float = 2e-3
    """Greatest speed of the slave that counts as rest [m/s]."""
    rest_master_force: float = 5.0
    """Greatest force on the handle with which the master may be armed [N]."""
    preflight: float = 0.05
    """Time for which all must be well before the supervisor is ready [s]."""
    start_ramp: float = 0.1
    """Time in which the limits of velocity open after arming [s]."""
    max_gap: float = 0.08
    """Longest time between two ticks [s]; less than the drives' watchdogs."""
    max_lost: float = 0.25
    """Greatest share of periods that the loop may skip, over about a second."""
    channels: dict[str, ChannelLimits] = field(default_factory=usual_channels)

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            least = 0.0 if name == "drive_compliance" else math.ulp(0.0)
            if isinstance(value, float | int) and not least <= value < math.inf:
                raise ValueError(f"{name} must be positive, got {value}")
        if self.max_lost >= 1.0:
            raise ValueError(f"max_lost must be a share below 1, got {self.max_lost}")
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

    def shifted(self, zeros: Mapping[str, float]) -> Limits:
        """These limits for measurements from whose channels the given zeros are subtracted.

        The ranges of the sensors are shifted, so that a sample is held against what the sensor
        itself can read. All other limits count from the zeros.

        Parameters
        ----------
        zeros
            What is subtracted from each channel, in its SI unit.

        Raises
        ------
        ValueError
            A zero is not a value that its sensor can read; the message names the channel.
        """
        channels = dict(self.channels)
        for name, zero in zeros.items():
            try:
                channels[name] = channels[name].shifted(zero)
            except ValueError as error:
                raise ValueError(f"{name} {error}") from error
        return replace(self, channels=channels)
