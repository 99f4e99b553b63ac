"""Tables and texts fit the terminal, and lose nothing on a narrow one."""

from __future__ import annotations

import math
import re
import shlex

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.cli import main
from teleop.output.console import number, plain_console, print_table, small
from teleop.output.next_command import broken
from teleop.output.result_tables import further_reasons, print_together, use_text, with_half
from teleop.output.table_files import TextTable, markdown_text
from teleop.printable import wrapped


def printed(capsys, monkeypatch, environment, *arguments):
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert main([*arguments]) == 0
    return re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out)


@pytest.fixture
def stiff(tmp_path):
    t = np.arange(0.0, 4.0, 0.01)
    rows = "".join(f"{s:.2f},{np.sin(s * 6):.5f},{2e9 * np.sin(s * 6):.1f}\n" for s in t)
    path = tmp_path / "stiff.csv"
    path.write_text("Time [s],Position [mm],Force [N]\n" + rows)
    return str(path)


@pytest.mark.parametrize("environment", [{"COLUMNS": "40"}, {"TERM": "dumb", "FORCE_COLOR": "1"}])
def test_no_word_or_number_is_lost_on_a_narrow_or_dumb_terminal(
    environment, monkeypatch, capsys, stiff
):
    arguments = ["estimate", stiff, "--estimators", "all"]
    wide = printed(capsys, monkeypatch, {"COLUMNS": "200"}, *arguments)
    narrow = printed(capsys, monkeypatch, environment, *arguments)
    assert {*narrow.split()} >= {word for word in wide.split() if "─" not in word} - {
        "rms/window",
    }
    assert "…" not in narrow


@pytest.mark.parametrize("columns", [80, 120])
def test_the_tables_of_all_estimators_fit_a_terminal(columns, monkeypatch, capsys, tmp_path):
    chosen = ["--estimators", "all", "--model", "stiffening"]
    command = ["run", "--clock", "virtual", "--rate", "100", "--duration", "3"]
    command += [*chosen, "--record", "trial.mcap"]
    environment = {"COLUMNS": str(columns)}
    monkeypatch.chdir(tmp_path)
    for arguments in (command, ["estimate", "trial.mcap"]):
        text = printed(capsys, monkeypatch, environment, *arguments)
        for line in text.splitlines():
            assert len(line) <= columns or " " not in line.strip(), line
    assert "rls_conditional at the end: k3" in text
    assert re.search(
        r"hc_log at the end: K \S+ ± \S+ N/m\^n, B \S+ ± \S+ N s/m", " ".join(text.split())
    )


def test_long_names_are_numbered_where_a_table_would_not_fit(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "60")
    names = ["a" * 70, "b" * 20]
    print_table(plain_console(), "", ["", "k [N/m]"], [[names[0], "1"], [names[1], "2"]])
    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert "  1       1" in lines
    assert lines[-1] == f"  2: {names[1]}"
    assert names[0] in lines[-2]


def test_the_loss_tangent_has_the_digits_of_its_interval(capsys):
    row = {
        "file": "sine.csv",
        "frequency_hz": 0.2,
        "storage_n_per_m": 940593.0,
        "storage_interval_n_per_m": 81.0,
        "loss_n_per_m": 83787.0,
        "loss_interval_n_per_m": 67.0,
        "tan_delta": 0.0890788,
        "tan_delta_interval": 0.0000712,
    }
    alone = {"file": "sine.csv", "k": 1.0, "b": 1.0, "rms": 1.0}
    together = {"k": 1.0, "b": 1.0, "rms": 1.0, "ratios": {}, "insufficient": False, "reasons": []}
    print_together({**together, "alone": [alone], "complex_stiffness": [row]})
    assert "0.089079 ± 0.000071" in capsys.readouterr().out


@given(st.lists(st.text("abc", min_size=1, max_size=30)), st.integers(1, 60), st.integers(0, 4))
def test_lines_are_broken_between_words_only(words, width, indent):
    text = " " * indent + " ".join(words)
    lines = wrapped(text, width).split("\n")
    assert " ".join(lines).split() == words
    for line in lines:
        assert len(line) <= max(width, indent + 1) or len(line.split()) <= 1


UNITS = ["N", "mm", "N/m", "N s/m", "mm/s", "s", "ms", "Hz", "%"]


@given(
    st.lists(st.tuples(st.text("abc", min_size=1, max_size=9), st.sampled_from(UNITS)), min_size=1),
    st.integers(18, 60),
)
def test_no_line_is_broken_between_a_number_and_its_unit(parts, width):
    text = ", ".join(f"{word} 2.5 {unit}" for word, unit in parts)
    lines = wrapped(text, width).split("\n")
    assert " ".join(lines) == text
    for line in lines:
        assert len(line) <= width
        assert not line.endswith("2.5")
        assert line.split(" ")[0] not in (*UNITS, *(f"{unit}," for unit in UNITS), "s/m,", "s/m")


@given(
    st.lists(st.text(st.characters(codec="ascii", exclude_categories=["Cc"]), max_size=20)),
    st.integers(20, 100),
)
def test_a_broken_command_is_read_by_a_shell_as_the_same_words(words, width):
    command = ["teleop", "compare", *words, "--out", "table.tex", "--plot", "figure.pdf"]
    lines = broken(command, "  ", width)
    assert shlex.split(" ".join(lines)) == command
    for line in lines:
        options = [word for word in shlex.split(line) if word.startswith("-")]
        assert len(line) <= width or len(options) <= 1


def test_an_option_and_its_negative_value_are_on_the_same_line():
    command = ["teleop", "lag", "--offset", "-0.001", "--out", "lag.png"]
    assert broken(command, "", 20) == ["teleop lag", "--offset -0.001", "--out lag.png"]


def test_a_cell_of_a_markdown_table_is_shown_as_it_is():
    table = TextTable(["file"], [["a*b*_c_|`d`<br>"]], 1)
    assert r"| a\*b\*\_c\_\|\`d\`\<br\> |" in markdown_text(table)


def test_a_command_to_copy_is_on_one_line_if_it_fits(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    command = "teleop run --config my-trial.toml"
    for columns, expected in (
        ("80", f"my-trial.toml: run it with: {command}\n"),
        ("30", "my-trial.toml: run it with:\n  teleop run \\\n  --config my-trial.toml\n"),
    ):
        monkeypatch.setenv("COLUMNS", columns)
        assert main(["config", "init", "my-trial.toml", "--overwrite"]) == 0
        assert capsys.readouterr().out == expected


@pytest.mark.parametrize("columns", range(24, 34))
def test_no_line_of_a_table_is_wider_than_the_terminal(columns, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(columns))
    print_table(plain_console(), "title", ["", "k [N/m]", "b [N s/m]"], [["rls", "2000", "-12.5"]])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= columns
    assert "  rls" in "\n".join(lines)


def test_numbers_replace_the_longest_of_several_columns_with_text(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "60")
    liver, kidney = "porcine-liver-left-lobe-sample-17b", "bovine-kidney-cortex-sample-03-day2"
    rows = [
        ["free", liver, "rls", "2000 \u00b1 10"],
        ["", "", "ai", "2100 \u00b1 10"],
        ["", kidney, "rls", "3000 \u00b1 10"],
        ["mimic", liver, "rls", "2000 \u00b1 10"],
    ]
    print_table(plain_console(), "", ["condition", "specimen", "method", "k [N/m]"], rows, 3)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 60
    assert lines[-2:] == [f"  specimen 1: {liver}", f"  specimen 2: {kidney}"]
    body = [line.split() for line in lines if "\u00b1" in line]
    assert [row[:2] for row in body] == [
        ["free", "1"],
        ["ai", "2100"],
        ["2", "rls"],
        ["mimic", "1"],
    ]


@pytest.mark.parametrize(
    ("value", "half", "text"),
    [
        (8074.0, 8700.0, "8100 \u00b1 8700"),
        (1.418e6, 9.6e4, "1418000 \u00b1 96000"),
        (-0.3, 35.0, "0 \u00b1 35"),
        (-0.0005048, 0.0013, "-0.0005 \u00b1 0.0013"),
        (12.345, math.nan, "12.35"),
        (1000.0, 1e-13, "1000.00 \u00b1 0.01"),
        (1234.5678, 1e-3, "1234.57 \u00b1 0.01"),
        (2.4e12, 1.2e12, "(2.4 \u00b1 1.2)e12"),
        (1.49e-5, 8.9e-6, "(1.49 \u00b1 0.89)e-5"),
        (-2.4e-4, 8.5e-4, "(-2.4 \u00b1 8.5)e-4"),
    ],
)
def test_a_value_has_the_digits_of_its_interval_but_not_more_than_six(value, half, text):
    assert with_half(value, half) == text


def test_a_number_that_rounds_to_zero_has_no_sign():
    assert number(-0.3, 0) == "0"
    assert number(-0.04, 1) == "0.0"
    assert number(-0.06, 1) == "-0.1"


@given(st.floats(1e-4, 1e5), st.integers(3, 4))
def test_numbers_of_a_column_have_the_same_precision_with_zeros_at_the_end(value, digits):
    text = small(value, digits)
    assert float(text) == pytest.approx(value, rel=0.5001 * 10.0 ** (1 - digits))
    assert len(text.lstrip("0.").replace(".", "")) >= digits


def test_a_value_without_interval_keeps_its_zeros():
    assert [with_half(value, math.nan) for value in (-47.4, 161.0, 1.33)] == [
        "-47.40",
        "161.0",
        "1.330",
    ]


RESULT = {"identifiable": True, "reasons": ["one", "two"], "b_reason": ""}


def test_the_first_line_says_in_words_what_can_be_used_and_why_not():
    assert use_text(RESULT) == "k and b can be used"
    assert further_reasons(RESULT) == ["one", "two"]
    without_b = {**RESULT, "b_reason": "two"}
    assert use_text(without_b) == "k can be used; b cannot, because two"
    assert further_reasons(without_b) == ["one"]
    without = {**RESULT, "identifiable": False}
    assert use_text(without) == "k and b cannot be used, because one"
    assert further_reasons(without) == ["two"]
