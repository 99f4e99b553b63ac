"""Create the notes below the tables that compare several recordings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from teleop.evaluation.across.comparison import RESULT
from teleop.evaluation.across.groups import Group
from teleop.evaluation.batch.kinds import FURTHER_MEANING, MEANING, WITH
from teleop.output.console import small
from teleop.printable import one_line

CAPTION = (
    "result: mean of the results of n recordings, which have no e_f; its k is the tangent "
    "stiffness at half of the force range. Other rows: mean of the averages of an online "
    "estimator over each record, without the count-in of mimic and the ramp at the end of "
    "autonomous; their k is the slope of a line through the datum, unless a note states another "
    "model. The two kinds of k agree only for a linear specimen. \u00b1: 95 % interval. For a "
    "result, it combines the spread between the recordings and the mean of the recordings' own "
    "95 % intervals, because the errors in these may be the same in all recordings. For an "
    "estimator, it contains only the spread, without the errors that are the same in all "
    "recordings; with n = 1 there is no \u00b1."
)
"""Note below the table of groups that explains the rows of the table."""
TRACKING_CAPTION = (
    "Tracking of the target in mimic: mean of n recordings; the mean of the phases is circular. "
    "\u00b1: 95 % interval of the mean, from the spread between the recordings. It is left out for "
    "n = 1, and if it exceeds the possible values (half a turn for a phase, at least 0 for the "
    "others): then more recordings are needed."
)
UNNAMED = (
    "No factor names the specimen of each recording: all are averaged as recordings of one "
    "specimen. If they are not, state their factors (--factors, --by)."
)
"""Note below the table of groups, if all recordings are averaged and their specimens not known."""
FILES_NAMED = 3
"""Largest number of files that a note lists for one reason."""
GROUPS_NAMED = 8
"""Largest number of groups that the note on a remark lists."""
DEPTHS = (
    "If the stiffness depends on the depth, groups with different depths have a different k for "
    "this reason alone."
)


def pooled_text(names: Sequence[str]) -> str:
    """Return a note on groups that contain recordings with different levels of some factors."""
    several = ", ".join(names)
    return (
        f"Recordings that differ in {several} are pooled: the interval contains the differences "
        f"between the levels of {several}, as if these levels were a random sample."
    )


def unit_note(units: Collection[str]) -> str:
    """Return a note on groups in which the recordings of one unit, such as a subject, are averaged.

    `units` are names of factors.
    """
    names = " or ".join(units)
    return (
        f"The recordings of the same {names} are averaged first. The mean and its interval are "
        f"those of these averages: with few levels of {names}, the interval is wide, however many "
        "recordings there are."
    )


def damping_note(kinds: Collection[str]) -> str:
    """Return a note that describes the damping b of the results."""
    named = [MEANING[kind] for kind in MEANING if kind in kinds]
    text = " or ".join(named)
    if len(named) > 1:
        text += (
            ", which depends on the motion. These are different quantities, and are not averaged "
            "together"
        )
    return f"The b of a result is {text}. The b of an estimator is an average over the record."


def model_notes(kinds: Collection[str]) -> list[str]:
    """Return one note for each estimator model with a parameter besides b and k, such as k3."""
    return [
        f"{kind}: the estimator has the model {meaning}."
        for kind in kinds
        if (meaning := FURTHER_MEANING.get(kind.removeprefix(WITH)))
    ]


def correction_note(lags: Collection[float], lost_motions: Collection[float]) -> str:
    """Return a note: the lag of the force [s] and the lost motion [m] compensated in results."""
    lag = f"lag of the force of {span(lags, 1e3)} ms"
    if any(lost_motions):
        return (
            f"The results are corrected for a {lag} and for lost motion of "
            f"{span(lost_motions, 1e6)} um. The online estimates of recorded trials are not."
        )
    return f"A {lag} is compensated." if any(lags) else "No lag of the force is compensated."


def span(values: Collection[float], factor: float) -> str:
    """Return the range of values, multiplied by a factor, as text; one number if all are equal."""
    return " to ".join(dict.fromkeys(f"{factor * one(values):.4g}" for one in (min, max)))


def different_text(symbol: str, kinds: Mapping[str, int]) -> str:
    """Return a note: no mean, because the values are different quantities (number by kind)."""
    parts = (
        f"{MEANING.get(kind, kind)} in {count} recording{'s' if count > 1 else ''}"
        for kind, count in kinds.items()
    )
    return f"No mean of {symbol}: it is {', and '.join(parts)}."


def missing_text(method: str, missing: Mapping[str, str]) -> str:
    """Return a note: why a method has no value for some files (reason by name of the file)."""
    files: dict[str, list[str]] = {}
    for file, reason in missing.items():
        files.setdefault(reason, []).append(Path(file).name)
    parts = []
    for reason, names in files.items():
        more = len(names) - FILES_NAMED
        named = ", ".join(names[:FILES_NAMED]) + (f" and {more} more" if more > 0 else "")
        parts.append(f"{reason} ({named})")
    what = "recording" if len(missing) == 1 else "recordings"
    value = RESULT if method == RESULT else "estimate"
    return one_line(f"No {value} for {len(missing)} {what}: {'; '.join(parts)}.")


def holding_text(groups: Sequence[Group]) -> str:
    """Return a note: force, depth and frequency at which k and b of the groups are valid, or ""."""
    parts = [
        f"{levels_text(group)}: {where}" if group.levels else where
        for group in groups
        if (where := held_at(group))
    ]
    if not parts:
        return ""
    depths = f" {DEPTHS}" if len(parts) > 1 else ""
    return f"Force, depth and frequency at which the results hold: {'; '.join(parts)}.{depths}"


def held_at(group: Group) -> str:
    """Return, if known, "k at 1.00 to 1.20 N, 2.00 mm from the contact point, b at 1.00 Hz"."""
    parts = []
    if group.holding.keys() >= {"force_n", "depth_m"}:
        force = range_text(group.holding["force_n"], 1.0, "N")
        depth = range_text(group.holding["depth_m"], 1e3, "mm")
        zero = " or the ".join(group.depth_from)
        parts.append(f"k at {force}, {depth} from the {zero}")
    if "damping_at_hz" in group.holding:
        parts.append(f"b at {range_text(group.holding['damping_at_hz'], 1.0, 'Hz')}")
    return ", ".join(parts)


def range_text(ends: tuple[float, float], size: float, unit: str) -> str:
    """Return a range in SI units, converted with the factor `size`: "1.00 to 2.00 mm"."""
    low, high = (small(size * end) for end in ends)
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"


def remark_texts(groups: Sequence[Group]) -> list[str]:
    """Return one note for each remark on the results of the recordings.

    A remark is a sentence about a limitation of a result. If a remark does not concern all results,
    the note names the groups of recordings that it concerns, or their number.
    """
    results = sum(group.means[RESULT]["k"].recordings for group in groups)
    counts: Counter[str] = Counter()
    for group in groups:
        counts.update(group.remarks)
    found = []
    for remark, count in counts.most_common():
        concerned = [group for group in groups if remark in group.remarks]
        where = ""
        if len(concerned) > GROUPS_NAMED:
            where = f" (in {len(concerned)} of {len(groups)} groups)"
        elif len(groups) > 1 and count < results:
            parts = (f"{levels_text(one)}: {one.remarks[remark]}" for one in concerned)
            where = f" ({'; '.join(parts)})"
        noun = "result" if results == 1 else "results"
        found.append(one_line(f"Remark on {count} of {results} {noun}{where}: {remark}."))
    return found


def levels_text(group: Group) -> str:
    """Return the levels of a group, separated by commas, for example "mimic, soft"."""
    return ", ".join(group.levels)
