"""Print the simulated Table I beside the paper's, and whether the paper's claims are confirmed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rich import box

from estimation.quantities import FORCE_ERROR
from teleop.output.console import TrimmedTable, plain_console, terminal_width
from teleop.printable import wrapped
from teleop.studies.paper.table1 import TABLE_1


def print_reproduction(summary: Mapping[str, Any]) -> None:
    """Print Table I beside the paper's, one table for each cube, and the claims."""
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
    print_claims(summary["claims"])


def print_claims(claims: Iterable[Mapping[str, Any]]) -> None:
    """Print each claim, whether it holds or fails, and the evidence for it."""
    console = plain_console()
    for claim in claims:
        mark, style = ("holds:", "green") if claim["holds"] else ("fails:", "yellow")
        console.print(mark, style=style, end="  ")
        indent = " " * len(f"{mark}  ")
        lines = wrapped(claim["claim"], terminal_width() - len(indent)).split("\n")
        console.print(f"\n{indent}".join([*lines, claim["evidence"]]))
