"""Convert dataclasses of numbers to numpy records, and copy records back into dataclasses.

A numpy record is an element of a structured array: its fields have names and types. Code compiled
by numba uses records, because it cannot use dataclasses.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


def to_record(values: Any) -> NDArray[np.void]:
    """Convert a dataclass to a numpy record; return an array of shape (1,) with this record.

    Each field of the dataclass is a number, a vector, a matrix, or another such dataclass.
    """
    record = np.zeros(1, record_type(values))
    _fill(record[0], values)
    return record


def update_from(record: np.void, values: Any) -> None:
    """Copy the values of a numpy record into the fields of the dataclass `values`."""
    for field in fields(values):
        value = getattr(values, field.name)
        if is_dataclass(value):
            update_from(record[field.name], value)
        else:
            setattr(values, field.name, record[field.name].tolist())


def numbers(values: Any) -> NDArray[np.float64]:
    """Return all n numbers in the fields of a dataclass as one array, shape (n,)."""
    parts = []
    for field in fields(values):
        value = getattr(values, field.name)
        parts.append(numbers(value) if is_dataclass(value) else np.ravel(value))
    return np.concatenate(parts).astype(np.float64)


def record_type(values: Any) -> np.dtype[np.void]:
    """Return a structured numpy type with the field names, types and shapes of a dataclass."""
    return np.dtype(
        [(field.name, *_type_of(getattr(values, field.name))) for field in fields(values)],
        align=True,
    )


def _type_of(value: Any) -> tuple[Any, tuple[int, ...]]:
    if is_dataclass(value):
        return record_type(value), ()
    array = np.asarray(value)
    return array.dtype, array.shape


def _fill(record: Any, values: Any) -> None:
    for field in fields(values):
        value = getattr(values, field.name)
        if is_dataclass(value):
            _fill(record[field.name], value)
        else:
            record[field.name] = value
