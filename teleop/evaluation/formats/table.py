"""Define the table that every reader of measurement files returns: columns with names and units."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from teleop.errors import InputError
from telepalpation import needs

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from estimation.arrays import Floats


class Heading(NamedTuple):
    """Name and unit of a column of a measurement file."""

    name: str
    unit: str | None = None
    """Unit of the values in the file; None if the file does not state it."""

    @property
    def title(self) -> str:
        """Name and unit as one text, such as `Force [N]`."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


Pick = Callable[[Sequence[Heading]], Collection[int]]
"""Function that returns the indices of the columns to load; empty if the table is not usable."""


@dataclass(frozen=True)
class Places:
    """Return the file and place of a sample, for messages. A function of the index of the sample.

    It is a class, because a table is passed between processes, and Python cannot pass a closure.
    """

    before: str
    """Text before the number of the place, such as `file.csv, line `."""
    numbers: Sequence[int] | NDArray[np.int64]
    """Number of the place of each sample."""
    after: str = ""
    """Text after the number."""

    def __call__(self, i: int) -> str:
        """Return the file and place of the sample with index `i`."""
        return f"{self.before}{self.numbers[i]}{self.after}"


@dataclass
class Table:
    """A table of a measurement file.

    It contains the headings of all columns, but the values only of the columns that were chosen to
    be loaded (see `Pick`).
    """

    where: str
    """File and place of the header, for messages."""
    headings: Sequence[Heading]
    """Name and unit of each column."""
    columns: dict[int, Floats]
    """The loaded columns, by the index of the column: arrays of shape (n,) in the units of the
    file."""
    samples: int
    """Number of samples n."""
    sample: Callable[[int], str]
    """Function that takes the index of a sample and returns its file and place, for messages."""
    title: str = ""
    """Name of the table in its file; empty if the table has no name."""
    about: dict[str, str] = field(default_factory=dict)
    """Further content of the file, by name: `force_filter`; in a file that `teleop export` wrote,
    also `settings`, `session` and `events`."""
    notes: tuple[str, ...] = ()
    """Texts that describe the changes that the reader made to the data."""
    problem: InputError | None = None
    """Error to raise if this table is selected; None if the samples are valid."""


def missing(library: str, what: str) -> InputError:
    """Return the error to raise if the library for a file format is not installed."""
    return InputError(needs(what, library, "formats"))


@contextlib.contextmanager
def reading(path: Path, what: str) -> Iterator[None]:
    """Context manager that converts exceptions of a library to `InputError`.

    The library reads a file in the block of the `with` statement. MemoryError is not converted.
    """
    try:
        yield
    except (InputError, MemoryError):
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.errno:
            raise
        why = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: cannot be read as {what}: {why}") from error


def stated_filter(lines: Iterable[str]) -> str:
    """Return the first line that describes a filter, for example `Low-pass filter: 10 Hz`.

    The line must contain a word for a filter and a frequency in Hz. If another line states the
    order, as in `Low-pass filter order: 3`, this line comes first in the result. The result is
    empty if no line has a frequency.
    """
    stated = [line for line in lines if FILTER.search(line)]
    for line in stated:
        if FREQUENCY.search(line):
            name = before(line)
            orders = [one for one in stated if before(one) == name and not FREQUENCY.search(one)]
            order = [one for one in orders if re.search(r"\border\b", one, re.IGNORECASE)][:1]
            return "; ".join(
                " ".join(one.replace("\t", " ").strip(" #;,\"'").split()) for one in [*order, line]
            )
    return ""


def before(line: str) -> str:
    """Return the text up to the word for a filter."""
    found = FILTER.search(line)
    return line[: found.end()].casefold() if found else ""


FILTER = re.compile(r"filter|filtre|low[- ]?pass|tiefpass|滤波", re.IGNORECASE)
FREQUENCY = re.compile(r"\d.*Hz|Hz.*\d", re.IGNORECASE)
