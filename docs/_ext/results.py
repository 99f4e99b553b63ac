"""Reads the files that the benchmarks write, for the pages that show their numbers."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results"


def table(file: str, title: str) -> dict[str, dict[str, str]]:
    """Return the rows of a printed table by their first column, each by the names of the columns.

    Columns of the same name are numbered from the second on: `worst`, `worst 2`.

    Raises
    ------
    ValueError
        The file has no table with this title.
    """
    lines = (RESULTS / file).read_text(encoding="utf-8").splitlines()
    starts = [i for i, line in enumerate(lines) if line.startswith(title)]
    if not starts:
        raise ValueError(f"{file}: no table {title!r}")
    names: list[str] = []
    rows: dict[str, dict[str, str]] = {}
    for line in lines[starts[0] + 1 :]:
        if line.startswith("┃"):
            names = unique([cell.strip() for cell in line.strip("┃").split("┃")])
        elif line.startswith("│"):
            cells = [cell.strip() for cell in line.strip("│").split("│")]
            rows[cells[0]] = dict(zip(names, cells, strict=True))
        elif line.startswith("└"):
            break
    return rows


def unique(names: Sequence[str]) -> list[str]:
    """Number repeated names."""
    return [
        f"{name} {names[: i + 1].count(name)}" if name in names[:i] else name
        for i, name in enumerate(names)
    ]


def records(file: str) -> list[dict[str, str]]:
    """Return the rows of a CSV file by the names of its columns."""
    with (RESULTS / file).open(encoding="utf-8", newline="") as opened:
        return list(csv.DictReader(opened))


def methods(model: str) -> dict[str, dict[str, float]]:
    """Return the averages of every method with this model over the paper's nine trials."""
    return {
        row["method"]: {
            name: float(value) if value else float("nan")
            for name, value in row.items()
            if name not in ("model", "method")
        }
        for row in records("methods.csv")
        if row["model"] == model
    }


def markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
