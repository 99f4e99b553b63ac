"""What every reader of a measurement file returns: tables of columns with names and units."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from estimation.compiled import Floats
from teleop.errors import InputError


class Heading(NamedTuple):
    """Name and unit of a column, as the file has them."""

    name: str
    unit: str | None = None

    @property
    def title(self) -> str:
        """Name and unit, such as `Force [N]`."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


Pick = Callable[[Sequence[Heading]], Collection[int]]
"""Chooses the columns that a reader loads, by their number; none where a table is of no use."""


@dataclass
class Table:
    """A table of a file, of which the picked columns are loaded."""

    where: str
    """File and place of the header, for messages."""
    headings: Sequence[Heading]
    """Of every column."""
    columns: dict[int, Floats]
    """The picked columns by number, arrays of shape (n,) in the file's units."""
    samples: int
    """Number of samples n."""
    sample: Callable[[int], str]
    """File and place of a sample, for messages."""
    title: str = ""
    """Name of the table in its file; empty where it has none."""
    about: dict[str, str] = field(default_factory=dict)
    """What the file states besides: `force_filter`, and `settings`, `session` and `events` of
    an export of ours."""
    notes: tuple[str, ...] = ()
    """What the reader did to the data, a sentence each."""
    problem: InputError | None = None
    """Why the samples cannot be used; raised if this table is chosen."""


def missing(library: str, what: str) -> InputError:
    """The one line that says what to install."""
    return InputError(f"{what} needs {library}: pip install '.[formats]'")


@contextlib.contextmanager
def reading(path: Path, what: str) -> Iterator[None]:
    """Refuse a file in one line where its library fails on it; libraries raise errors of any kind.

    Raises
    ------
    InputError
        The content cannot be read.
    OSError
        The system cannot read the file.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.errno:
            raise
        why = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: cannot be read as {what}: {why}") from error


def stated_filter(lines: Iterable[str]) -> str:
    """The first line that states a low-pass filter of the force; empty for none."""
    for line in lines:
        if FILTER.search(line) and FREQUENCY.search(line):
            return " ".join(line.replace("\t", " ").strip(" #;,\"'").split())
    return ""


FILTER = re.compile(r"filter|filtre|low[- ]?pass|tiefpass|滤波", re.IGNORECASE)
FREQUENCY = re.compile(r"\d.*Hz|Hz.*\d", re.IGNORECASE)
