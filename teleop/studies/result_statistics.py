"""Test effects of factors on the results of files, and compute their repeatability."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from estimation.stiffening import Interval
from teleop.errors import InputError
from teleop.evaluation.across.agreement import (
    Agreement,
    Repeatability,
    agreement,
    repeatability,
    value_table,
)
from teleop.evaluation.across.comparison import (
    REPETITIONS,
    Compared,
    check_factors,
)
from teleop.evaluation.across.groups import independent_unit, ranks_of
from teleop.evaluation.across.mixed_model import MixedModel, fit_mixed_model
from teleop.evaluation.across.response import RESPONSES, responses
from teleop.studies.anova import depth_note

NO_RANDOM = "none"
"""Value of the option for no random factor."""
NESTED = ":"
"""Character between the names of factors whose combinations are the levels of the random factor."""
NAMED = 3
"""Largest number of objects that a note lists."""


class EffectsOnResults(NamedTuple):
    """Effects of factors on a quantity of the results."""

    model: MixedModel
    """The fitted model."""
    notes: list[str]
    """Sentences on the design, the variances and the recordings."""


def effects_on_results(
    rows: Sequence[Compared],
    factors: Sequence[str],
    symbol: str,
    random: str | None = None,
    stated: Sequence[str] = (),
    logarithm: bool = False,
) -> EffectsOnResults:
    """Test the effects of factors on a quantity of `RESPONSES`, see `fit_mixed_model`.

    `random` is the random factor; None for `independent_unit`. `stated` are all factors that say
    how the recordings differ.
    """
    chosen = independent_unit(rows, factors) if random is None else random
    if chosen == NO_RANDOM:
        chosen = None
    parts = chosen.split(NESTED) if chosen else []
    fixed = [name for name in factors if name != chosen]
    if not fixed:
        raise InputError("analysis of variance: expected factors with two levels or more (--by)")
    check_factors(rows, parts)
    known = [row for row in rows if row.factors.keys() >= {*fixed, *parts}]
    used = responses(known, symbol, logarithm)
    columns = [[row.factors[name] for row in used.rows] for name in fixed]
    groups = [NESTED.join(row.levels(parts)) for row in used.rows]
    if chosen and len(set(groups)) < 2:
        raise InputError(f"--random {chosen}: expected at least 2 levels, got 1")
    model = fit_mixed_model(used.values, used.std, fixed, columns, chosen, groups)
    pooled = [
        name
        for name in stated
        if name not in (*fixed, *parts) and len({row.factors.get(name) for row in used.rows}) > 1
    ]
    notes = [design(model, symbol, fixed, chosen, pooled, logarithm), *used.notes]
    if unknown := len(rows) - len(known):
        names = ", ".join(dict.fromkeys([*fixed, *parts]))
        notes.append(
            f"Left out: {unknown} of {len(rows)} recordings, whose level of {names} is not known."
        )
    if symbol != "b" and (note := depth_note(used.rows, fixed)):
        notes.append(note)
    return EffectsOnResults(model, notes)


def design(
    model: MixedModel,
    symbol: str,
    fixed: Sequence[str],
    random: str | None,
    pooled: Sequence[str],
    logarithm: bool,
) -> str:
    """Return a text on the model: its factors, its weights and its variances."""
    what = f"the logarithms of {symbol}" if logarithm else symbol
    texts = [
        f"Linear mixed model (REML) of {what} of the results of {model.recordings} recordings, "
        "each weighted by its 95 % interval and the spread between recordings.",
        f"Fixed: {', '.join(fixed)}.",
    ]
    if random:
        texts.append(f"Random: {random}; the effects are tested against its variation.")
    else:
        texts.append("Random: none; each recording counts as independent.")
    if pooled:
        differ = ", ".join(pooled)
        texts.append(f"Recordings that differ in {differ} count as repetitions.")
    spreads = [f"between levels of {name}" for name in [*model.components][:-1]]
    spreads.append("between repeated recordings")
    show = deviation_text(symbol, logarithm)
    parts = [
        f"{show(value)} {where}"
        for value, where in zip(model.components.values(), spreads, strict=True)
    ]
    parts.append(f"{show(model.error)} by the intervals of the results")
    texts.append(f"Standard deviations: {', '.join(parts)}.")
    return " ".join(texts)


def deviation_text(symbol: str, logarithm: bool) -> Callable[[float], str]:
    """Return the function that shows a standard deviation: with its unit, or in percent."""
    if logarithm:
        return lambda value: f"{100.0 * variation(value):.3g} %"
    return lambda value: RESPONSES[symbol].text(value, ".3g")


def variation(deviation: float) -> float:
    """Return the coefficient of variation for a standard deviation of the logarithm."""
    return math.sqrt(math.expm1(deviation**2))


class Measure(NamedTuple):
    """A measure of repeatability or agreement, in SI units."""

    quantity: str
    interval: Interval
    unit: str


@dataclass(frozen=True)
class RepeatedResults:
    """Repeatability of a quantity of the results, and the agreement of two levels."""

    symbol: str
    over: str
    """Factor whose levels are compared."""
    repeatability: Repeatability
    agreement: Agreement | None
    """None if more than two levels are compared."""
    logarithm: bool
    """Whether the logarithms were analysed. The measures are then ratios."""
    notes: list[str]

    @property
    def measures(self) -> list[Measure]:
        """All measures, for a table."""
        found = self.repeatability
        unit = RESPONSES[self.symbol].si
        measures = [Measure(name, value, "") for name, value in found.icc.items()]
        if self.logarithm:
            unit = ""
            relative = Interval(*(variation(end) for end in found.within))
            measures.append(Measure("coefficient of variation within objects", relative, unit))
        else:
            within = "standard deviation within objects"
            measures.append(Measure(within, found.within, unit))
        what = "ratio" if self.logarithm else "difference"
        coefficient = f"repeatability coefficient ({what})"
        measures.append(Measure(coefficient, self.natural(found.coefficient), unit))
        if self.agreement:
            first, second = self.agreement.columns
            sign = "/" if self.logarithm else "-"
            for name, value in (
                (f"bias ({second} {sign} {first})", self.agreement.bias),
                ("lower limit of agreement", self.agreement.lower),
                ("upper limit of agreement", self.agreement.upper),
            ):
                measures.append(Measure(name, self.natural(value), unit))
        return measures

    @property
    def drawn(self) -> Agreement | None:
        """The agreement for a figure: ratios instead of differences of logarithms."""
        found = self.agreement
        if found is None or not self.logarithm:
            return found
        return replace(
            found,
            means=tuple(map(math.exp, found.means)),
            differences=tuple(map(math.exp, found.differences)),
            bias=self.natural(found.bias),
            lower=self.natural(found.lower),
            upper=self.natural(found.upper),
        )

    def natural(self, value: Interval) -> Interval:
        """Return differences of logarithms as ratios; other values as they are."""
        return Interval(*(math.exp(end) for end in value)) if self.logarithm else value

    def summary(self) -> dict[str, Any]:
        """Return the measures as a dictionary for JSON."""
        return {
            "response": self.symbol,
            "over": self.over,
            "levels": list(self.repeatability.columns),
            "objects": self.repeatability.objects,
            "log": self.logarithm,
            "measures": [
                {"quantity": one.quantity, **one.interval._asdict(), "unit": one.unit}
                for one in self.measures
            ],
            "notes": self.notes,
        }


def repeated_results(
    rows: Sequence[Compared],
    symbol: str,
    stated: Sequence[str],
    over: str | None = None,
    logarithm: bool = False,
    planned: Mapping[str, Sequence[str]] | None = None,
) -> RepeatedResults:
    """Return the repeatability of the results of recordings.

    Parameters
    ----------
    rows
        The recordings.
    symbol
        Quantity, a key of `RESPONSES`.
    stated
        All factors that say how the recordings differ. Recordings with the same levels of all of
        them, except `over`, are of the same object.
    over
        Factor whose levels are compared, or `NAME=A,B` for some of its levels. None for the number
        of the repetition.
    logarithm
        Whether the logarithms are analysed.
    planned
        Order of the levels of factors.

    Raises
    ------
    InputError
        The factor is not known, two recordings have the same levels, or too few objects have a
        value for each level.
    """
    name, _, chosen = (over or repetition_factor(rows)).partition("=")
    check_factors(rows, [name])
    numbering = [one for one in REPETITIONS if any(one in row.factors for row in rows)]
    known = {one for row in rows for one in row.factors} - {name}
    objects_by = [one for one in (*stated, *numbering[:1]) if one in known]
    used = responses(rows, symbol, logarithm)
    ranks = ranks_of((planned or {}).get(name, ()), (row.levels([name])[0] for row in used.rows))
    occurring = {row.factors.get(name) for row in used.rows}
    levels = [one for one in ranks if one in occurring]  # in their order
    if chosen:
        wanted = [one.strip() for one in chosen.split(",")]
        for level in wanted:
            if level not in levels:
                raise InputError(
                    f"--over {over}: {name} has no level {level!r}: expected some of "
                    f"{', '.join(levels)}"
                )
        levels = list(dict.fromkeys(wanted))
    values: dict[tuple[str, ...], dict[str, float]] = {}
    files: dict[tuple[tuple[str, ...], str], str] = {}
    errors = []
    for row, value, std in zip(used.rows, used.values, used.std, strict=True):
        one, (level,) = row.levels(objects_by), row.levels([name])
        if level not in levels:
            continue
        if (one, level) in files:
            same = ", ".join(
                f"{by} = {at}" for by, at in zip((*objects_by, name), (*one, level), strict=True)
            )
            raise InputError(
                f"repeatability: {files[one, level]} and {row.file} both have {same}: expected one "
                "file for each; state further factors (--factors)"
            )
        files[one, level] = row.file
        values.setdefault(one, {})[level] = float(value)
        errors.append(float(std))
    complete, table, others = value_table(values, levels)
    if not complete:
        raise InputError(
            f"repeatability: no object has a value for each of the {len(levels)} levels of {name}: "
            f"expected some of them, such as --over {name}={','.join(levels[:2])}"
        )
    found = repeatability(table, levels)
    both = None
    if len(levels) == 2:
        both = agreement(table[:, 0], table[:, 1], levels)
    notes = [
        f"{found.objects} objects ({', '.join(objects_by)}) with a value for each of "
        f"{len(levels)} levels of {name} ({', '.join(levels)}). The intervals are 95 % intervals. "
        "An ICC depends on how much the objects differ from each other.",
        f"The intervals of the results explain a standard deviation of "
        f"{deviation_text(symbol, logarithm)(float(np.sqrt(np.mean(np.square(errors)))))}.",
        *used.notes,
    ]
    if others:
        names = ["/".join(one) for one in others]
        more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
        notes.append(f"Left out, without a value for a level: {', '.join(names[:NAMED])}{more}.")
    if both and both.increases and not logarithm:
        notes.append(
            "The differences increase with the value: use --log, which states them as ratios."
        )
    return RepeatedResults(symbol, name, found, both, logarithm, notes)


def repetition_factor(rows: Sequence[Compared]) -> str:
    """Return the name of the factor that numbers the repetitions."""
    for name in REPETITIONS:
        if any(name in row.factors for row in rows):
            return name
    raise InputError(
        f"repeatability: no factor has one of the names {', '.join(REPETITIONS)}: expected --over "
        "with the factor whose levels are compared"
    )
