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
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from teleop.errors import InputError
from teleop.evaluation.across.comparison import SUBJECT, Compared
from teleop.studies.depth_differences import depth_note

ESTIMATOR = "estimator"
"""Name of the factor `estimator`, which varies within a trial."""
VALUE = "y"
"""Name of the column of the response (dependent variable) in the data frames."""
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
    """Check that statsmodels is installed.

    Raises
    ------
    InputError
        statsmodels is not installed.
    """
    try:
        import statsmodels.formula.api  # noqa: F401
    except ImportError as error:
        raise InputError(
            "the analysis of variance needs statsmodels: expected pip install 'teleop[stats]'"
        ) from error


def analysis_of_variance(
    rows: Sequence[Mapping[str, Any]],
    response: str,
    factors: Sequence[str],
    trial: str,
    subject: str | None = None,
) -> list[Effect]:
    """Return the effects of the factors on a response, in a balanced design.

    Parameters
    ----------
    rows
        One row for each trial and estimator. A row is a dictionary of values by the name of the
        column. The columns are `estimator` and those that the other parameters name.
    response
        Name of the column of the response (dependent variable).
    factors
        Names of the columns of the factors that vary between trials.
    trial
        Name of a column with a different value for each trial.
    subject
        Name of the column that contains the subject, which is a random factor; None for a design
        without subjects.

    Returns
    -------
    The effects of the factors that have two or more levels, and of the interactions of these
    factors.

    Raises
    ------
    InputError
        The response is not finite, the design is not balanced, or it has too few trials.
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

    Parameters
    ----------
    effects
        Effects of the factors, from `analysis_of_variance`.
    pooled
        Names of factors that the analysis ignores although their levels differ between the trials,
        for example repetition. The text names these factors.
    subject
        Name of the random factor; None for a design without subjects.
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
    """Check that the design is balanced and has enough trials.

    In a balanced design, each combination of the levels of the factors has the same number of
    trials. The data frame has one row for each trial and estimator, and the response (dependent
    variable) in the column `VALUE`. `response` is the name of the response in error messages.

    Raises
    ------
    InputError
        The response is not finite, is constant or too large, or does not vary between trials with
        the same levels. The design is not balanced, or it has too few trials or subjects.
    """
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
    """Return the F tests of a split-plot design.

    Parameters
    ----------
    frame
        Data frame with one row for each trial and estimator. The column `VALUE` is the response.
    factors
        Names of the columns of the factors.
    squares
        Sum of squares and degrees of freedom of each effect, from `sums_of_squares`.
    within
        Name of the only factor that varies within a trial (the estimator). All other factors vary
        only between trials.
    """
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

    Parameters
    ----------
    frame
        Data frame with the subject in the column `subject`, and the response in the column `VALUE`.
    factors
        Names of the columns of the factors.
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


def effects_of(
    rows: Sequence[Compared], factors: Sequence[str], planned: Sequence[str], response: str
) -> tuple[list[dict[str, Any]], str]:
    """Analysis of variance of one result (`response`) of the estimators in compared recordings.

    The fixed factors are `factors` and the estimator. The subject is a random factor if there are
    several subjects. `planned` are all factors of the series to which the recordings belong.

    Returns
    -------
    effects
        One dictionary for each factor and each interaction of factors, see `Effect`.
    design
        States which factor is random, and against which variance the effects are tested, and may
        warn about different depths of palpation.
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
