"""The transmission between the encoder and the tip of a rig: calibrated values, corrected results.

The position at the encoder and the position at the tip differ by the lag of the force channel, by
lost motion (play of half width d) and by the compliance c:

    x_tip = lag(play(x, d)) - c f

The lag tau is a pure delay of s tau followed by a first-order lag with the time constant
(1 - s) tau. Lag and play are applied to the measured position, so that k and b are those of
specimen and transmission in series. The compliance is a spring in series: the stiffness at the tip
is

    k_tip = k / (1 - c k)

The compliance cannot be identified from a record of tissue, because f(x - c f) is only another law
of the force. It needs a reference spring of known stiffness (`teleop lag --stiffness`).
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace

from estimation.estimator import LEVEL_95
from estimation.stiffening import Interval


@dataclass(frozen=True)
class TransmissionCalibration:
    """Calibrated values of the transmission of a rig; 0 for what is unknown or negligible."""

    force_lag: float = 0.0
    """Lag tau of the force channel: sum of its pure delay and of its time constant [s]."""
    lost_motion: float = 0.0
    """Half width d of the play between encoder and tip [m]."""
    compliance: float = 0.0
    """Compliance c between encoder and tip [m/N]."""
    force_lag_error: float = 0.0
    """Half width of the 95 % interval of the lag [s]."""
    lost_motion_error: float = 0.0
    """Half width of the 95 % interval of the lost motion [m]."""
    compliance_error: float = 0.0
    """Half width of the 95 % interval of the compliance [m/N]."""
    delay_share: float = 0.0
    """Share s of the pure delay in the lag, from 0 to 1."""
    delay_share_error: float = 0.0
    """Half width of the 95 % interval of the share."""
    lag_lost_motion_correlation: float = 0.0
    """Correlation of the errors of lag and lost motion, from -1 to 1. It is negative if both were
    measured in one record: both delay the force, and the record determines their sum best."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            least = -1.0 if name == "lag_lost_motion_correlation" else 0.0
            if not least <= value < math.inf:
                raise ValueError(f"{name} must be finite and at least {least:g}, got {value:g}")
        if self.lag_lost_motion_correlation > 1.0:
            raise ValueError("lag_lost_motion_correlation must be at most 1")
        if self.delay_share > 1.0:
            raise ValueError(f"delay_share must be at most 1, got {self.delay_share:g}")

    @property
    def delay(self) -> float:
        """Pure delay of the force channel [s]."""
        return self.delay_share * self.force_lag

    @property
    def time_constant(self) -> float:
        """Time constant of the first-order lag of the force channel [s]."""
        return (1.0 - self.delay_share) * self.force_lag

    def response(self, omega: float) -> complex:
        """Frequency response of the force channel at the angular frequency `omega` [rad/s]."""
        return cmath.exp(-1j * omega * self.delay) / (1.0 + 1j * omega * self.time_constant)

    def form_error(self, omega: float) -> complex:
        """Half width of the 95 % interval of (k + j omega b) / k that the share causes.

        Real and imaginary part are positive.
        """
        shares = (self.delay_share + sign * self.delay_share_error for sign in (-1.0, 1.0))
        changes = [
            self.response(omega) / replace(self, delay_share=min(max(s, 0.0), 1.0)).response(omega)
            - 1.0
            for s in shares
        ]
        return complex(max(abs(c.real) for c in changes), max(abs(c.imag) for c in changes))

    def stiffness_error(
        self, k: float, amplitude: float, omega: float, position_error: float = 0.0
    ) -> float:
        """Half width of the 95 % interval of k that the errors of play and delay cause [N/m].

        The fitted play has the amplitude A - d, and the force determines the product of k and this
        amplitude. `amplitude` is A [m], half of the travel in contact, and `omega` the angular
        frequency of the motion [rad/s]. `position_error` is the standard deviation of a measured
        position [m]: a few samples near a turning point determine the state of the play until the
        next turning point.
        """
        form = self.form_error(omega).real
        if not self.lost_motion:
            return abs(k) * form
        error = math.hypot(self.lost_motion_error, LEVEL_95 * position_error)
        played = amplitude - self.lost_motion
        return abs(k) * math.hypot(form, error / played) if played > 0.0 else math.inf

    def damping_error(self, k: float, per_speed: float, omega: float) -> float:
        """Half width of the 95 % interval of b that the errors of lag and play cause [N s/m].

        An error of the lag changes b by k times the error. An error of the lost motion moves the
        position by this error against the motion, which changes b by k times the error times
        `per_speed` = mean |v| / mean v^2 [s/m]; this is 4 / (pi omega A) for a sine. `omega` is the
        angular frequency of the motion [rad/s]. The errors of lag and lost motion are correlated.
        """
        return abs(k) * math.hypot(
            self.propagated(1.0, per_speed), self.form_error(omega).imag / omega
        )

    def propagated(
        self, by_lag: float, by_lost_motion: float, position_error: float = 0.0
    ) -> float:
        """Half width of the 95 % interval of a value that the errors of lag and play cause.

        The parameters are the derivatives of the value to the lag and to the lost motion.
        `position_error` is the standard deviation of a measured position [m]: a few samples near a
        turning point determine the state of the play until the next turning point.
        """
        lag, lost = by_lag * self.force_lag_error, by_lost_motion * self.lost_motion_error
        delay = lag**2 + lost**2 + 2.0 * self.lag_lost_motion_correlation * lag * lost
        state = LEVEL_95 * by_lost_motion * position_error if self.lost_motion else 0.0
        return math.hypot(math.sqrt(max(delay, 0.0)), state)

    def at_tip(self, k: Interval) -> Interval | None:
        """Stiffness at the tip [N/m] from the stiffness `k` in series with the transmission.

        None if it is not determined: the transmission alone is not stiffer than the measured
        stiffness, or the half width of the interval is more than half of the value.
        """
        c, half = self.compliance, 0.5 * (k.high - k.low)
        if not (k.value > 0.0 and c * k.value < 1.0):
            return None
        tip = k.value / (1.0 - c * k.value)
        error = math.hypot(half / (1.0 - c * k.value) ** 2, tip**2 * self.compliance_error)
        return Interval(tip, tip - error, tip + error) if error < 0.5 * tip else None


def stated_lag(known: TransmissionCalibration, lag: float) -> TransmissionCalibration:
    """Return the calibration with a stated lag [s], of which the form is not known.

    The lag is between a pure delay and a first-order lag.
    """
    return replace(
        known, force_lag=lag, force_lag_error=0.0, delay_share=0.5, delay_share_error=0.5
    )


RIGID = TransmissionCalibration()
"""Rigid transmission, and a force channel without lag."""
