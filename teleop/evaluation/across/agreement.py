r"""Compute the repeatability of results, and the agreement of two levels of a factor.

The values form a table with a row for each measured object and a column for each repetition, or for
each level of another factor, for example the operator. Three intraclass correlations compare the
variance between the objects with the total variance:

- ICC(1,1): the columns have no meaning. The total variance includes all differences between the
  values of an object.
- ICC(2,1): the columns are a random sample, for example of operators. Differences between the means
  of the columns are part of the total variance.
- ICC(3,1): only these columns are of interest, and differences between their means are left out.

The standard deviation within objects is the root of the mean variance of an object. Two values of
the same object differ by less than the repeatability coefficient, sqrt(2) times 1.96 times this
standard deviation, with a probability of 95 %.

References
----------
P. E. Shrout and J. L. Fleiss, "Intraclass correlations: uses in assessing rater reliability",
Psychological Bulletin 86(2), 1979.
K. O. McGraw and S. P. Wong, "Forming inferences about some intraclass correlation coefficients",
Psychological Methods 1(1), 1996.
J. M. Bland and D. G. Altman, "Statistical methods for assessing agreement between two methods of
clinical measurement", The Lancet 327, 1986.
A. Carkeet, "Exact parametric confidence intervals for Bland-Altman limits of agreement", Optometry
and Vision Science 92(3), 2015.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, fdtri, nctdtrit, stdtrit

from estimation.arrays import Floats
from estimation.estimator import LEVEL_95
from estimation.stiffening import Interval
from teleop.errors import InputError

WHAT = "repeatability"
FEWEST_OBJECTS = 3
"""Smallest number of objects. With fewer, the intervals are wider than all possible values."""
TREND = 0.01
"""Significance level of the test whether the differences increase with the value."""


@dataclass(frozen=True)
class Repeatability:
    """Repeatability of a result. The intervals are 95 % intervals."""

    objects: int
    """Number of objects, which have a value in each column."""
    columns: tuple[str, ...]
    """Levels of the factor whose levels are compared, for example the repetitions."""
    mean: float
    """Mean of all values, in the unit of the result, such as N/m."""
    icc: dict[str, Interval]
    """Intraclass correlations ICC(1,1), ICC(2,1) and ICC(3,1), by these names."""
    within: Interval
    """Standard deviation within objects."""
    coefficient: Interval
    """Repeatability coefficient: 95 % of the differences between two values are smaller."""


@dataclass(frozen=True)
class Agreement:
    """Agreement of two columns (Bland-Altman). The intervals are 95 % intervals."""

    columns: tuple[str, str]
    """The two levels. The difference is the value of the second minus that of the first."""
    means: tuple[float, ...]
    """Mean of the two values of each object."""
    differences: tuple[float, ...]
    """Difference of the two values of each object."""
    bias: Interval
    """Mean difference."""
    lower: Interval
    """Lower limit of agreement: bias minus 1.96 standard deviations of the differences."""
    upper: Interval
    """Upper limit of agreement."""
    increases: bool
    """Whether the magnitude of the difference increases with the value (rank correlation)."""


def repeatability(values: Floats, columns: Sequence[str]) -> Repeatability:
    """Return the repeatability of values.

    Parameters
    ----------
    values
        Values, shape (n, m), with a row for each object and a column for each repetition, for
        example stiffnesses [N/m].
    columns
        Names of the m columns.

    Returns
    -------
    Repeatability
        Intraclass correlations, and the standard deviation within objects in the unit of the
        values.

    Raises
    ------
    InputError
        There are fewer than three objects or two columns, or the values are all equal.
    """
    values = np.asarray(values, np.float64)
    n, m = values.shape
    if n < FEWEST_OBJECTS or m < 2:
        raise InputError(
            f"{WHAT}: expected at least {FEWEST_OBJECTS} objects with 2 values each, got {n} with "
            f"{m}"
        )
    total = float(np.sum((values - values.mean()) ** 2))
    if not total > 0.0:
        raise InputError(f"{WHAT}: all values are the same: expected variation between objects")
    between_square = m * float(np.sum((values.mean(1) - values.mean()) ** 2))
    column_square = n * float(np.sum((values.mean(0) - values.mean()) ** 2))
    between = between_square / (n - 1)
    column = column_square / (m - 1)
    within_degrees, error_degrees = n * (m - 1), (n - 1) * (m - 1)
    within = max(total - between_square, 0.0) / within_degrees
    error = max(total - between_square - column_square, 0.0) / error_degrees
    deviation = spread_interval(math.sqrt(within), within_degrees)
    return Repeatability(
        n,
        tuple(columns),
        float(values.mean()),
        {
            "ICC(1,1)": one_way(between, within, m, n - 1, within_degrees),
            "ICC(2,1)": two_way_random(between, column, error, n, m),
            "ICC(3,1)": one_way(between, error, m, n - 1, error_degrees),
        },
        deviation,
        Interval(*(math.sqrt(2.0) * LEVEL_95 * end for end in deviation)),
    )


def one_way(between: float, error: float, m: int, degrees: int, error_degrees: int) -> Interval:
    """Return ICC(1,1) or ICC(3,1), which differ in the mean square of the error."""
    if error == 0.0:
        return Interval(1.0, 1.0, 1.0)
    f = between / error
    low = f / upper_quantile(degrees, error_degrees)
    high = f * upper_quantile(error_degrees, degrees)
    return Interval(*((ratio - 1.0) / (ratio + m - 1.0) for ratio in (f, low, high)))


def two_way_random(between: float, column: float, error: float, n: int, m: int) -> Interval:
    """Return ICC(2,1), with the interval of Shrout and Fleiss."""
    value = (between - error) / (between + (m - 1) * error + m * (column - error) / n)
    if error == 0.0:
        return Interval(value, math.nan, math.nan)
    ratio = column / error
    numerator = (m - 1) * (n - 1) * (m * value * ratio + n * (1 + (m - 1) * value) - m * value) ** 2
    denominator = (n - 1) * (m * value * ratio) ** 2 + (n * (1 + (m - 1) * value) - m * value) ** 2
    degrees = numerator / denominator
    f = upper_quantile(n - 1, degrees)
    low = n * (between - f * error)
    low /= f * (m * column + (m * n - m - n) * error) + n * between
    f = upper_quantile(degrees, n - 1)
    high = n * (f * between - error)
    high /= m * column + (m * n - m - n) * error + n * f * between
    return Interval(value, low, high)


def upper_quantile(degrees: float, error_degrees: float) -> float:
    """Return the quantile of F that is exceeded with a probability of 2.5 %."""
    return float(fdtri(degrees, error_degrees, 0.975))


def spread_interval(deviation: float, degrees: int) -> Interval:
    """Return a standard deviation with its 95 % interval, from the chi-squared distribution."""
    low, high = (math.sqrt(degrees / float(chdtri(degrees, p))) for p in (0.025, 0.975))
    return Interval(deviation, deviation * low, deviation * high)


def agreement(first: Floats, second: Floats, columns: Sequence[str]) -> Agreement:
    """Return the agreement of two values of each object (Bland-Altman).

    The intervals of the limits of agreement are exact for normally distributed differences, also
    for few objects.

    Parameters
    ----------
    first, second
        Values of n objects, shape (n,), for example stiffnesses [N/m] by two operators.
    columns
        Names of the two.

    Returns
    -------
    Agreement
        Bias and limits of agreement of `second` minus `first`, in the unit of the values.

    Raises
    ------
    InputError
        There are fewer than three objects.
    """
    difference = np.asarray(second, np.float64) - first
    mean = 0.5 * (np.asarray(second, np.float64) + first)
    n = len(difference)
    if n < FEWEST_OBJECTS:
        raise InputError(
            f"{WHAT}: expected at least {FEWEST_OBJECTS} objects with both levels, got {n}"
        )
    bias, deviation = float(difference.mean()), float(difference.std(ddof=1))
    half = float(stdtrit(n - 1, 0.975)) * deviation / math.sqrt(n)
    centre = LEVEL_95 * math.sqrt(n)
    near, far = (
        deviation * float(nctdtrit(n - 1, centre, p)) / math.sqrt(n) for p in (0.025, 0.975)
    )
    limit = LEVEL_95 * deviation
    first_name, second_name = columns
    return Agreement(
        (first_name, second_name),
        tuple(mean.tolist()),
        tuple(difference.tolist()),
        Interval(bias, bias - half, bias + half),
        Interval(bias - limit, bias - far, bias - near),
        Interval(bias + limit, bias + near, bias + far),
        increases(mean, np.abs(difference - bias)),
    )


def increases(values: Floats, deviations: Floats) -> bool:
    """Return whether deviations increase with the values, by Spearman's rank correlation."""
    from scipy.stats import spearmanr

    if np.ptp(values) == 0.0 or np.ptp(deviations) == 0.0:
        return False
    found = spearmanr(values, deviations, alternative="greater")
    return bool(found.pvalue < TREND)


def value_table(
    values: Mapping[tuple[str, ...], Mapping[str, float]], columns: Sequence[str]
) -> tuple[list[tuple[str, ...]], Floats, list[tuple[str, ...]]]:
    """Return the objects that have a value in each column, the values, and the other objects."""
    complete = [one for one, row in values.items() if all(column in row for column in columns)]
    table = np.array([[values[one][column] for column in columns] for one in complete])
    others = [one for one in values if one not in complete]
    return complete, table.reshape(len(complete), len(columns)), others
