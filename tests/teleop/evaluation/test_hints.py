"""Options and commands are named in hints, which only a terminal shows, and not in the reasons."""

from __future__ import annotations

import ast
import csv
from pathlib import Path

import numpy as np
import pytest

import teleop.evaluation
from teleop.cli import main

SOURCES = sorted(Path(teleop.evaluation.__file__).parent.rglob("*.py"))


def reason_texts(source: Path) -> list[str]:
    """Return the constant parts of the text of each `Reason` that a file constructs."""
    calls = [
        node
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Reason"
    ]
    parts = [part for call in calls for part in ast.walk(call.args[0])]
    return [part.value for part in parts if isinstance(part, ast.Constant)]


def test_no_reason_names_an_option_a_command_or_code():
    texts = [str(text) for source in SOURCES for text in reason_texts(source)]
    assert len(texts) > 20
    for text in texts:
        assert not any(word in text for word in ("--", "`", "teleop")), text


@pytest.fixture
def negative(tmp_path) -> Path:
    """Return a recording whose stiffness is negative, because one sign is inverted."""
    t = np.arange(0.0, 10.0, 5e-3)
    x = 1e-3 * np.sin(2.0 * np.pi * t)
    f = -1000.0 * x + np.random.default_rng(0).normal(0.0, 5e-3, len(t))
    path = tmp_path / "negative.csv"
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([("time [s]", "position [m]", "force [N]")])
        csv.writer(file).writerows(zip(t, x, f, strict=True))
    return path


REASON = "the sign of the force or of the position is wrong"
HINT = "--invert force or --invert position reverses one sign"


@pytest.mark.parametrize("name", ["table.tex", "table.md", "table.csv"])
def test_a_table_file_has_the_reason_and_the_terminal_also_the_hint(negative, name, capsys):
    out = negative.parent / name
    assert main(["compare", str(negative), "--by", "folder", "--out", str(out)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert REASON in printed
    assert f"hint: {HINT}" in printed
    text = out.read_text(encoding="utf-8")
    assert REASON in text
    assert "invert" not in text


@pytest.mark.usefixtures("without_drawings")
def test_the_report_has_the_reason_and_estimate_also_the_hint(negative, capsys):
    assert main(["report", str(negative)]) == 0
    page = negative.with_suffix(".html").read_text(encoding="utf-8")
    assert REASON in page
    assert "--invert" not in page
    assert main(["estimate", str(negative)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert REASON in printed
    assert f"hint: {HINT}" in printed
