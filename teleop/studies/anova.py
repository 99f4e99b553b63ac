"""Compute the analysis of variance of repeated trials, with statsmodels.

All estimators process the data of the same trials. The factor `estimator` therefore varies within a
trial. All other factors vary between trials. There are two designs.

- Split plot, without subjects. Factors that vary between trials are tested against the variance
  between trials with the same levels of these factors. The factor `estimator` and its interactions
  are tested against the interaction of estimator and trial.
- Repeated measures, with subjects. Each subject does all trials. The subject is a random factor,
  and each effect is tested against the interaction of the effect and the subject.

References
----------
R. E. Kirk, "Experimental Design", 4th ed., 2013, chapters 10 and 12.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from teleop.errors import InputError
from teleop.evaluation.across.comparison import SUBJECT, Compared
from teleop.output.table_files import TextTable
from telepalpation import needs

ESTIMATOR = "estimator"
"""Name of the factor `estimator`, which varies within a trial."""
VALUE = "y"
"""Name of the column of the response in the data frames."""
LARGEST = 1e100
"""Largest response, whose squares can be summed."""
NO_VARIANCE = 1e-24
"""Ratio of the variance between trials with the same levels to the variance of all trials, below
which the former is due to rounding."""


class Effect(NamedTuple):
    """One effect of an analysis of variance."""

    source: str
    """Name of the factor; for an interaction, names of its factors."""
    degrees: int
    """Degrees of freedom of the effect."""
    error_degrees: int
    """Degrees of freedom of the error term of the F test."""
    f: float
    """F statistic."""
    p: float
    """p value of the F test."""
    partial_eta_squared: float
    """Sum of squares of the effect, divided by the sum of squares of effect plus error term."""
    eta_squared: float
    """Sum of squares of the effect, divided by the total sum of squares."""


def check_available() -> None:
    """Check that statsmodels is installed."""
    try:
        import statsmodels.formula.api  # noqa: F401
    except ImportError as error:
        raise InputError(needs("the analysis of variance", "statsmodels", "stats")) from error


def analysis_of_variance(
    rows: Sequence[Mapping[str, Any]],
    response: str,
    factors: Sequence[str],
    trial: str,
    subject: str | None = None,
) -> list[Effect]:
    """Return the effects of factors and of their interactions on a response (balanced design).

    A row has the values of one estimator in one trial, by column. `response`, `factors`, `trial`
    and `subject` name columns; `trial` differs between trials, and `subject` is a random factor.
    Factors with one level are left out. An InputError states why the design cannot be analysed.
    """
    check_available()
    import pandas as pd

    if not rows:
        raise InputError("analysis of variance: expected at least one trial")
    frame = pd.DataFrame(list(rows))
    columns = {name: f"f{i}" for i, name in enumerate([*factors, ESTIMATOR])}
    frame = frame.rename(columns={**columns, response: VALUE, trial: "trial"})
    kept = [column for column in columns.values() if frame[column].nunique() > 1]
    if not kept:
        raise InputError("analysis of variance: expected a factor with two levels or more")
    check_design(frame, kept, response, subject)
    names = {column: name for name, column in columns.items()}
    squares = sums_of_squares(frame, kept)
    total = float(((frame[VALUE] - frame[VALUE].mean()) ** 2).sum())
    if subject:
        tests = repeated_measures(frame.rename(columns={subject: "subject"}), kept)
    else:
        tests = split_plot(frame, kept, squares, columns[ESTIMATOR])
    return [
        Effect(
            " x ".join(names[column] for column in effect),
            degrees,
            error_degrees,
            f,
            p,
            f * degrees / (f * degrees + error_degrees) if math.isfinite(f) else 1.0,
            squares[effect][0] / total,
        )
        for effect, (degrees, error_degrees, f, p) in tests.items()
    ]


def design_text(
    effects: Sequence[Effect], pooled: Sequence[str] = (), subject: str | None = None
) -> str:
    """Return a text that states the design of an analysis of variance.

    `pooled` names factors that are ignored although their levels differ between the trials.
    """
    between = [e.source for e in effects if " x " not in e.source and e.source != ESTIMATOR]
    within = [ESTIMATOR] if any(e.source == ESTIMATOR for e in effects) else []
    differ = f", which differ in {', '.join(pooled)}," if pooled else ""
    if subject:
        return (
            f"Design: repeated measures. {subject} is the random factor; "
            f"{', '.join([*between, *within])} vary within each {subject}. The trials of a "
            f"{subject} with the same levels{differ} are averaged. Each effect is tested against "
            f"its interaction with {subject}."
        )
    strata = ["No factor is random."]
    if between:
        strata.append(f"Between trials: {', '.join(between)}, tested against the spread of trials.")
    if within:
        strata.append(f"Within a trial: {ESTIMATOR}, tested against its interaction with trials.")
    same = f"Trials with the same levels{differ} count as repetitions."
    return " ".join(["Design: split plot.", *strata, same])


def check_design(frame: Any, factors: Sequence[str], response: str, subject: str | None) -> None:
    """Check that the design is balanced, has enough trials, and that the response varies."""
    values = frame[VALUE]
    if not values.map(math.isfinite).all() or values.nunique() < 2:
        raise InputError(
            f"analysis of variance: {response} is not finite, or the same, in every trial"
        )
    if values.abs().max() > LARGEST:
        raise InputError(
            f"analysis of variance: expected {response} of at most {LARGEST:g}, got "
            f"{values.abs().max():g}"
        )
    cells = math.prod(frame[column].nunique() for column in factors)
    sizes = frame.groupby(factors).size()
    if len(sizes) < cells or sizes.nunique() > 1:
        raise InputError(
            "analysis of variance: expected the same number of trials for each combination of "
            f"levels, got {sizes.min() if len(sizes) == cells else 0} to {sizes.max()}"
        )
    if subject is None and sizes.min() < 2:
        raise InputError(
            "analysis of variance: expected at least 2 trials for each combination of levels, for "
            "example with repetitions = 2 in the plan of the series, got 1"
        )
    if subject and frame[subject].nunique() < 2:
        raise InputError(f"analysis of variance: expected at least 2 of {subject}, got 1")
    # the rest of rounding would become the error variance
    if frame.groupby(factors)[VALUE].var(ddof=0).max() < NO_VARIANCE * values.var(ddof=0):
        raise InputError(
            f"analysis of variance: {response} is the same in all trials with the same levels: "
            "expected variation between trials"
        )
    if subject and (frame.groupby([subject, *factors]).ngroups < cells * frame[subject].nunique()):
        raise InputError(
            "analysis of variance: expected each subject to have all combinations of levels"
        )


def sums_of_squares(frame: Any, factors: Sequence[str]) -> dict[tuple[str, ...], tuple[float, int]]:
    """Return the sum of squares and the degrees of freedom of each effect and of the residual.

    The key of an effect is the tuple of its factors. The key of the residual is the empty tuple.
    The data frame has a column for each factor, and the response in the column `VALUE`.
    """
    from statsmodels.formula.api import ols
    from statsmodels.stats.anova import anova_lm

    formula = f"{VALUE} ~ {' * '.join(f'C({name})' for name in factors)}"
    with np.errstate(divide="ignore", invalid="ignore"):  # of F for a residual of zero
        table = anova_lm(ols(formula, frame).fit())
    return {
        () if term == "Residual" else tuple(part[2:-1] for part in term.split(":")): (
            float(row["sum_sq"]),
            int(row["df"]),
        )
        for term, row in table.iterrows()
    }


Tests = dict[tuple[str, ...], tuple[int, int, float, float]]
"""F test of each effect: degrees of freedom of the effect and of the error term, F, and p. The key
of an effect is the tuple of its factors."""


def split_plot(
    frame: Any,
    factors: Sequence[str],
    squares: Mapping[tuple[str, ...], tuple[float, int]],
    within: str,
) -> Tests:
    """Return the F tests of a split-plot design: only the factor `within` varies within a trial."""
    from scipy.special import fdtrc

    between = [name for name in factors if name != within]
    trials = frame.groupby([*between, "trial"], as_index=False)[VALUE].mean()
    repeats = len(frame) / len(trials)
    if between:
        whole, whole_degrees = sums_of_squares(trials, between)[()]
    else:
        whole, whole_degrees = float(trials[VALUE].var(ddof=0)) * len(trials), len(trials) - 1
    whole *= repeats
    rest, rest_degrees = squares[()]
    tests: Tests = {}
    for effect, (square, degrees) in squares.items():
        if not effect:
            continue
        error, error_degrees = (
            (rest - whole, rest_degrees - whole_degrees)
            if within in effect
            else (whole, whole_degrees)
        )
        f = (square / degrees) / (error / error_degrees) if error > 0.0 else math.inf
        tests[effect] = (degrees, error_degrees, f, float(fdtrc(degrees, error_degrees, f)))
    return tests


def repeated_measures(frame: Any, factors: Sequence[str]) -> Tests:
    """Return the F tests of a design in which each subject does all trials.

    The trials of a subject that have the same levels of all factors are averaged.
    """
    from statsmodels.stats.anova import AnovaRM

    model = AnovaRM(frame, VALUE, "subject", within=list(factors), aggregate_func="mean")
    table = model.fit().anova_table
    return {
        tuple(effect.split(":")): (
            int(row["Num DF"]),
            int(row["Den DF"]),
            float(row["F Value"]),
            float(row["Pr > F"]),
        )
        for effect, row in table.iterrows()
    }


LARGE_DEPTH_RATIO = 1.1
"""Ratio of the larger to the smaller depth above which a warning is given. The depths of repeated
trials differ by a few percent."""


def depth_note(rows: Sequence[Compared], factors: Sequence[str]) -> str:
    """Return a warning if the depth of the palpation differs between the levels of a factor.

    The stiffness of many specimens increases with the depth. The analysis of variance then counts
    this difference as an effect of the factor. The text is empty up to `LARGE_DEPTH_RATIO`.
    """
    ratios = {name: depth_ratio(rows, name, factors) for name in factors}
    large = {name: ratio for name, ratio in ratios.items() if ratio > LARGE_DEPTH_RATIO}
    if not large:
        return ""
    names = " and ".join(f"{name} (by up to {ratio - 1.0:.0%})" for name, ratio in large.items())
    return (
        f"The depth of the palpation differs between the levels of {names}. If the stiffness of "
        "the specimen depends on the depth, this is part of the effect."
    )


def depth_ratio(rows: Sequence[Compared], factor: str, factors: Sequence[str]) -> float:
    """Return the largest ratio of the depths of the palpation at two levels of a factor.

    Only recordings with the same levels of all other factors are compared. The depth at a level is
    the median of the depths of the recordings with this level. The result is 1 if there are no
    depths to compare.
    """
    others = [name for name in factors if name != factor]
    depths: dict[tuple[str, ...], dict[str, list[float]]] = {}
    for row in rows:
        if row.result.depth:
            (level,) = row.levels([factor])
            depths.setdefault(row.levels(others), {}).setdefault(level, []).append(row.result.depth)
    medians = [[median(found) for found in one.values()] for one in depths.values()]
    return max((max(one) / min(one) for one in medians), default=1.0)


def effects_table(effects: Iterable[Mapping[str, Any]], response: str, design: str) -> TextTable:
    """Return the table of an analysis of variance, with one row for each effect."""
    headings = (f"effect on {response}", "F", "df", "p", "eta^2", "partial eta^2")
    return TextTable(headings, effect_cells(effects), 1, [("", design)])


def effect_cells(effects: Iterable[Mapping[str, Any]]) -> list[list[str]]:
    """Return the cells of the table of `effects_table`, one row for each effect."""
    return [
        [
            effect["source"].replace(" x ", " \N{MULTIPLICATION SIGN} "),
            f"{effect['f']:.1f}" if effect["f"] < 1000.0 else f"{effect['f']:.0f}",
            f"{effect['degrees']}, {effect['error_degrees']}",
            "< 0.001" if effect["p"] < 0.001 else f"{effect['p']:.3f}",
            f"{effect['eta_squared']:.3f}",
            f"{effect['partial_eta_squared']:.3f}",
        ]
        for effect in effects
    ]


def effects_of(
    rows: Sequence[Compared], factors: Sequence[str], planned: Sequence[str], response: str
) -> tuple[list[dict[str, Any]], str]:
    """Analysis of variance of one result (`response`) of the estimators in compared recordings.

    The fixed factors are `factors` and the estimator. The subject is a random factor if there are
    several subjects. `planned` are all factors of the series to which the recordings belong. Also
    returns a text on the design, with a warning about different depths if there are any.
    """
    table = [
        {
            **dict(zip(factors, row.levels(factors), strict=True)),
            SUBJECT: row.factors.get(SUBJECT),
            "file": row.file,
            ESTIMATOR: name,
            response: getattr(one, response),
        }
        for row in rows
        for name, one in row.estimates.items()
    ]
    subjects = {row.factors.get(SUBJECT) for row in rows}
    random = SUBJECT if len(subjects) > 1 and None not in subjects else None
    between = [name for name in factors if name != SUBJECT]
    found = analysis_of_variance(table, response, between, "file", random)
    pooled = [
        name
        for name in planned
        if name not in (*factors, random) and len({row.factors.get(name) for row in rows}) > 1
    ]
    notes = [design_text(found, pooled, random)]
    if response in ("k", "b") and (note := depth_note(rows, between)):
        notes.append(note)
    return [effect._asdict() for effect in found], " ".join(notes)
