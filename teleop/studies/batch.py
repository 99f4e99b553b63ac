"""Evaluate many files, in parallel, and use the results that are stored."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from teleop.errors import InputError
from teleop.evaluation.across.comparison import Compared
from teleop.studies.recordings import ComparedFile, known_factors
from teleop.studies.stored_results import StoredResults
from teleop.studies.workers import in_parallel, processors

Evaluate = Callable[[Path], Compared]
"""Function that evaluates a file. It raises InputError if this is not possible."""
Outcome = tuple[Path, Compared | str]
"""A file with its result, or with the problem why there is none."""
LEAST_FILES = 8
"""Smallest number of files for each process. For fewer files, a process takes longer to start than
it saves."""
KILLED = "its process was killed, for example for its memory"


@dataclass
class Evaluated:
    """Results of many files."""

    rows: list[Compared] = field(default_factory=list)
    """The results, in the order of the files."""
    problems: list[tuple[str, str]] = field(default_factory=list)
    """Name of each file that cannot be evaluated, and the problem."""
    reused: int = 0
    """Number of results that were stored by an earlier command."""


def evaluate_files(
    files: Sequence[ComparedFile],
    evaluate: Evaluate,
    stored: StoredResults,
    count: int | None = None,
    report: Callable[[int], None] = lambda done: None,
) -> Evaluated:
    """Evaluate files in `count` processes, by default one per processor.

    Each result is stored as soon as it is computed. `report` receives the number of files that are
    done.
    """
    found: dict[Path, Compared | str] = {}
    for file in files:
        try:
            row = stored.read(file.path)
        except InputError as error:
            found[file.path] = problem_of(file.path, error)
        else:
            if row:
                found[file.path] = row
    reused = sum(isinstance(row, Compared) for row in found.values())
    report(len(found))
    pending = [file.path for file in files if file.path not in found]
    for path, outcome in outcomes(pending, evaluate, count):
        if isinstance(outcome, Compared):
            stored.write(path, outcome)
        found[path] = outcome
        report(len(found))
    ended = Evaluated(reused=reused)
    for file in files:
        one = found[file.path]
        if isinstance(one, str):
            ended.problems.append((str(file.path), one))
        else:
            ended.rows.append(replace(one, factors=known_factors(file, one.factors)))
    return ended


def outcomes(paths: Sequence[Path], evaluate: Evaluate, count: int | None) -> Iterable[Outcome]:
    """Yield the outcome of each file, in the order of computation."""
    function = partial(evaluated, evaluate)
    size = min(count or processors(), len(paths) if count else len(paths) // LEAST_FILES)
    if size > 1:
        return in_parallel(function, ([path] for path in paths), lost, size)
    return (function([path]) for path in paths)


def evaluated(evaluate: Evaluate, paths: Sequence[Path]) -> Outcome:
    """Return the outcome of the only file in `paths`."""
    (path,) = paths
    try:
        return path, evaluate(path)
    except InputError as error:
        return path, problem_of(path, error)
    except Exception as error:  # a defect: its traceback would not name the file
        error.add_note(f"in the evaluation of {path}")
        raise


def lost(path: Path) -> Outcome:
    """Return the outcome of a file whose process is killed each time."""
    return path, KILLED


def problem_of(path: Path, error: InputError) -> str:
    """Return the text of an error as one line, without the name of the file at its beginning."""
    return str(error).removeprefix(f"{path}: ").replace("\n", "; ")
