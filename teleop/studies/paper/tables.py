"""Print the simulated Table I beside the paper's, and whether the paper's claims are confirmed."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import Any

from rich import box

from estimation.quantities import FORCE_ERROR
from teleop.output.console import TrimmedTable, plain_console
from teleop.studies.paper.table1 import TABLE_1


def print_reproduction(summary: Mapping[str, Any]) -> None:
    """Print the simulated Table I beside the paper's, and whether each claim is true.

    One table is printed for each cube. A claim is a statement of the paper about its results, or a
    statement about the agreement with the paper.

    Parameters
    ----------
    summary
        Results of the reproduction, from `Reproduction.summary`.
    """
    console = plain_console()
    for cube in ("soft", "medium", "hard"):
        table = TrimmedTable(
            title=f"Table I, {cube} cube (paper; * calibrated)",
            title_justify="left",
            box=box.SIMPLE_HEAD,
            title_style="bold",
        )
        table.add_column("", justify="left", no_wrap=True)
        for quantity in TABLE_1:
            for heading in (quantity.heading, "(paper)"):
                table.add_column(heading, justify="right", no_wrap=True)
        for row in summary["trials"]:
            if row["cube"] != cube:
                continue
            paper, mark = row["paper"], "*" if row["calibrated"] else " "
            cells = []
            for one in TABLE_1:
                marked = mark if one is not FORCE_ERROR else ""
                cells += [
                    one.number(row[one.symbol]) + marked,
                    f"({one.number(paper[one.symbol])})",
                ]
            table.add_row(f"{row['condition']} {row['estimator']}", *cells)
        console.print(table)
    for claim in summary["claims"]:
        style = "green" if claim["holds"] else "yellow"
        console.print("holds:   " if claim["holds"] else "does not:", style=style, end=" ")
        indent = " " * 10
        text = fill(claim["claim"], console.width, initial_indent=indent, subsequent_indent=indent)
        console.print(f"{text.lstrip()}\n{indent}{claim['evidence']}")
