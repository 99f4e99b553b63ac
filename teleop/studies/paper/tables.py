"""Print the simulated Table I beside the paper's, and whether the paper's claims are confirmed."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import Any

from rich import box

from teleop.output.console import TrimmedTable, number, plain_console


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
        for heading in ("", "b [N s/m]", "(paper)", "k [N/m]", "(paper)", "e_f [N]", "(paper)"):
            table.add_column(heading, justify="right" if heading else "left", no_wrap=True)
        for row in summary["trials"]:
            if row["cube"] != cube:
                continue
            paper, mark = row["paper"], "*" if row["calibrated"] else " "
            table.add_row(
                f"{row['condition']} {row['estimator']}",
                number(row["b"], 1) + mark,
                f"({paper['b']:.1f})",
                number(row["k"], 0) + mark,
                f"({number(paper['k'], 0)})",
                number(row["e_f"], 2),
                f"({paper['e_f']:.2f})",
            )
        console.print(table)
    for claim in summary["claims"]:
        style = "green" if claim["holds"] else "yellow"
        console.print("holds:   " if claim["holds"] else "does not:", style=style, end=" ")
        indent = " " * 10
        text = fill(claim["claim"], console.width, initial_indent=indent, subsequent_indent=indent)
        console.print(f"{text.lstrip()}\n{indent}{claim['evidence']}")
