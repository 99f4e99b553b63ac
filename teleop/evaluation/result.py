"""Compute the result for publication: stiffness and damping with 95 % intervals.

k is the tangent stiffness at half of the force range, in loading (`local_stiffness`). k depends
neither on the zero of position and force nor on the length of the record. The secant stiffness (the
force divided by the depth) depends on the zero and on the length of the record. It is reported in
addition to k. The result also states how much the secant stiffness would change if the zero of the
position had an error of 0.1 mm.

The interval accounts for the autocorrelation of the residual, for the spread between models, and
for the change of k with the smoothing bandwidth. If the data are not sufficient for k, both k and b
are None, and `reasons` contains the reasons.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from estimation.estimator import LEVEL_95
from teleop.evaluation.constancy import change_over_cycles
from teleop.evaluation.kinds import BESIDES_RELAXATION, LOSS, TANGENT, UNDETERMINED
from teleop.evaluation.local_stiffness import LocalStiffness, merged
from teleop.evaluation.phases import Phases
from teleop.evaluation.prepared import Prepared
from teleop.evaluation.reason import Reason
from teleop.evaluation.reasons import reasons_after_fit, reasons_before_fit, remarks

DATUM_ERROR = 1e-4
"""Datum error for which the change of the secant stiffness is reported [m]."""


@dataclass(frozen=True)
class Result:
    """Stiffness and damping with 95 % intervals, and the force and depth at which they hold."""

    k: float | None = None
    """Tangent stiffness [N/m]; None if it is not identifiable."""
    k_low: float | None = None
    """Lower end of the 95 % interval of k [N/m]."""
    k_high: float | None = None
    """Upper end of the 95 % interval of k [N/m]."""
    b: float | None = None
    """Damping [N s/m]; None if it is not identifiable."""
    b_low: float | None = None
    """Lower end of the 95 % interval of b [N s/m]."""
    b_high: float | None = None
    """Upper end of the 95 % interval of b [N s/m]."""
    identifiable: bool = False
    """Whether the data are sufficient for k and b."""
    reasons: tuple[str, ...] = ()
    """Reasons why k is not identifiable; if k is identifiable, remarks on the result."""
    hints: tuple[str, ...] = ()
    """Options and commands of this program that concern the reasons. They are printed in a
    terminal only."""
    force: float | None = None
    """Force at which the tangent stiffness is evaluated: half of the force range [N]."""
    depth: float | None = None
    """Depth at `force`, relative to the contact point or to the lowest position in contact [m]."""
    secant: float | None = None
    """Secant stiffness at `force`: force divided by depth [N/m]."""
    secant_change: float | None = None
    """Relative change of the secant stiffness that a datum error of 0.1 mm causes."""
    times: tuple[float, ...] = field(default=())
    """Relaxation time constants of the best model [s]."""
    depth_error: float = 0.0
    """Half width of the 95 % interval of the contact point [m]; 0 if `depth` is not measured from
    a contact point."""
    depth_from: str = "lowest position"
    """Position at which `depth` is zero: the contact point or the lowest position in contact."""
    damping_at_hz: float | None = None
    """Frequency at which b is k''/omega [Hz]; None if relaxing parts may cause part of the loss."""

    @property
    def kinds(self) -> dict[str, str]:
        """Kinds of k and b, by symbol."""
        loss = self.damping_at_hz is not None
        return {"k": TANGENT, "b": LOSS if loss else BESIDES_RELAXATION}

    @property
    def b_change_per_ms(self) -> float | None:
        """Decrease of b that each millisecond of a lag of the force causes [N s/m].

        This applies to a lag that is not compensated. The value is None if k is not identifiable.
        """
        return None if self.k is None else 1e-3 * self.k

    def interval(self, symbol: str) -> tuple[float, float]:
        """Return the lower and upper end of the interval of k or b (`symbol`)."""
        return getattr(self, f"{symbol}_low"), getattr(self, f"{symbol}_high")

    def determines(self, symbol: str) -> bool:
        """Return whether the record determines k or b (`symbol`)."""
        low, high = self.interval(symbol)
        return high - low >= UNDETERMINED

    def summary(self) -> dict[str, Any]:
        """Return the result as a dictionary for JSON."""
        document = asdict(self)
        document["reasons"] = list(self.reasons)
        document["hints"] = list(self.hints)
        document["b_change_per_ms_of_lag"] = self.b_change_per_ms
        document["tangent"] = {
            "force_n": document.pop("force"),
            "depth_m": document.pop("depth"),
            "depth_error_m": document.pop("depth_error"),
            "depth_from": document.pop("depth_from"),
            "secant_n_per_m": document.pop("secant"),
            "secant_change_per_0.1mm": document.pop("secant_change"),
        }
        document["relaxation_times_s"] = list(document.pop("times"))
        return document


def publishable(
    record: Prepared, phases: Phases, local: LocalStiffness | None, other: LocalStiffness | None
) -> Result:
    """Return the result of a record.

    Parameters
    ----------
    record
        The prepared record.
    phases
        Phases of the record.
    local
        Stiffness and damping in contact; None if there are too few samples.
    other
        Stiffness and damping in contact with another smoothing bandwidth. A difference between
        `other` and `local` widens the intervals. If `other` is None, the intervals do not contain
        this difference.
    """
    against = reasons_before_fit(record, phases)
    if local is None and not against:
        against.append(
            Reason("too few samples in contact: expected a longer record or a faster rate")
        )
    if local is None or against:
        return without_result(against)
    second = other or local
    half_k = LEVEL_95 * math.hypot(local.k_std, 0.5 * (local.k - second.k))
    half_b = LEVEL_95 * math.hypot(local.b_std, 0.5 * (local.b - second.b))
    change = change_over_cycles(record, phases)
    against = reasons_after_fit(local, half_k, phases)
    if change and change.with_frequency:
        against = [Reason(change.text)]
    if against:
        return without_result(against)
    found = remarks(record, phases, local, half_b, change)
    inside = phases.usable
    lowest = float(record.x[inside].min())
    point, level = phases.contact_point, phases.free_force
    if local.baseline_size > 0.0:  # contact point and level change with the baseline
        point = level = None
    zero = point.value if point else lowest
    force = local.best.force
    depth = local.best.position - zero
    secant = secant_change = None
    if level is not None and depth > 0.0:
        secant = (force - level) / depth
        secant_change = DATUM_ERROR / depth
    return Result(
        local.k,
        local.k - half_k,
        local.k + half_k,
        local.b,
        local.b - half_b,
        local.b + half_b,
        True,
        *texts_and_hints(found),
        force if level is None else force - level,
        depth,
        secant,
        secant_change,
        merged(local.best.times),
        0.5 * (point.high - point.low) if point else 0.0,
        "contact point" if point else "lowest position",
        local.frequency if math.isfinite(local.frequency) else None,
    )


def without_result(against: Sequence[Reason]) -> Result:
    """Return a result without k and b, for a record from which they cannot be determined.

    Parameters
    ----------
    against
        Reasons why k and b are not reported.
    """
    reasons, hints = texts_and_hints(against)
    return Result(reasons=reasons, hints=hints)


def texts_and_hints(found: Sequence[Reason]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the texts of reasons, and their distinct hints."""
    hints = dict.fromkeys(one.hint for one in found if one.hint)
    return tuple(one.text for one in found), tuple(hints)
