"""Define the names, units and order of the columns of a table of estimates."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from estimation.compiled import Floats
from estimation.estimator import Estimate, Estimates, Estimator, Series

MISFIT = "_misfit"
"""Suffix of the name of a column that contains the misfit of an estimator."""


class Column(NamedTuple):
    """Description of a column of a table."""

    name: str
    unit: str
    """Unit, for example `N/m`; `-` if the quantity has no unit."""
    meaning: str
    """Meaning of the column, as a short phrase."""


def estimate_columns(bank: Mapping[str, Estimator]) -> list[Column]:
    """Return the descriptions of the columns that contain the estimates of a bank.

    The columns of each estimator are, in this order: b, k, the standard deviations of b and k,
    whether the estimate is held, the parameters besides b and k, and the standard deviations of
    these parameters.
    """
    columns = []
    for name, estimator in bank.items():
        parameters = list(zip(estimator.names, estimator.units, strict=True))
        values = [Column(f"{name}_{p}", unit, f"{p}, by {name}") for p, unit in parameters]
        deviations = [
            Column(f"{name}_{p}_std", unit, f"standard deviation of {p}; NaN if it is not computed")
            for p, unit in parameters
        ]
        held = Column(f"{name}_held", "-", "1 while the estimate is held")
        columns += [*values[:2], *deviations[:2], held, *values[2:], *deviations[2:]]
    return columns


def misfit_columns(names: Iterable[str]) -> list[Column]:
    """Return the descriptions of the columns that contain the misfits (`estimation.misfit`)."""
    meaning = "systematic force error divided by the force, by"
    return [Column(f"{name}{MISFIT}", "-", f"{meaning} {name}") for name in names]


def misfit_in(columns: Mapping[str, Floats], estimator: str) -> Floats:
    """Return the misfit of an estimator from a table, shape (n,); NaN if it is not in the table."""
    missing = np.full(len(columns[f"{estimator}_b"]), np.nan)
    return columns.get(f"{estimator}{MISFIT}", missing)


def estimate_row(estimates: Mapping[str, Estimate]) -> list[float]:
    """Return the estimates after one sample, in the order of `estimate_columns`."""
    row: list[float] = []
    for estimate in estimates.values():
        row += estimate[:5]
        row += estimate.further
    return row


def estimate_arrays(estimates: Mapping[str, Estimates]) -> Iterator[Floats]:
    """Yield the estimates in the order of `estimate_columns`, as arrays of shape (n,)."""
    for e in estimates.values():
        yield from (e.b, e.k, e.b_std, e.k_std, e.held.astype(float))
        yield from (series.value for series in e.further.values())
        yield from (series.std for series in e.further.values())


def estimators_in(columns: Mapping[str, Floats]) -> list[str]:
    """Return the names of the estimators that have columns in a table of estimates."""
    return [name[:-2] for name in columns if name.endswith("_b")]


def estimates_in(columns: Mapping[str, Floats], estimator: str) -> Estimates:
    """Return the estimates of an estimator from a table whose columns have the shape (n,).

    A standard deviation that is not in the table is NaN.
    """
    b, k = columns[f"{estimator}_b"], columns[f"{estimator}_k"]
    missing = np.full(len(b), np.nan)
    return Estimates(
        b,
        k,
        columns.get(f"{estimator}_b_std", missing),
        columns.get(f"{estimator}_k_std", missing),
        columns.get(f"{estimator}_held", missing) == 1.0,
        further_in(columns, f"{estimator}_"),
    )


def further_in(columns: Mapping[str, Floats], prefix: str) -> dict[str, Series]:
    """Return the estimates of the parameters besides b and k, by the name of the parameter.

    `prefix` is the name of the estimator and an underscore. The name of a parameter contains no
    underscore. So `rls_sift_k3` is a column of `rls_sift` and not of `rls`.
    """
    names = [name.removeprefix(prefix) for name in columns if name.startswith(prefix)]
    parameters = [name.removesuffix("_std") for name in names if name.endswith("_std")]
    return {
        name: Series(columns[prefix + name], columns[f"{prefix}{name}_std"])
        for name in parameters
        if name not in ("b", "k") and "_" not in name
    }
