"""LaTeX prints each text as it is in the table, with the default font encoding OT1."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.output.table_files import TextTable, latex, latex_text
from teleop.studies.anova import effects_table

PRINTED = {
    r"\textbackslash{}": "\\",
    r"\textasciitilde{}": "~",
    r"\textasciicircum{}": "^",
    r"\`{}": "`",
    **{f"\\{one}": one for one in "&%$#_{}"},
    **{f"${one}$": one for one in "|<>"},
    "$-$": "\u2212",
    r"$\pm$": "\u00b1",
    r"$\times$": "\u00d7",
    "---": "\u2014",
    "--": "\u2013",
    "''": "\u201d",
    "'": "\u2019",
    "``": "\u201c",
    "`": "\u2018",
    '"': "\u201d",
    "?`": "\u00bf",
    "!`": "\u00a1",
    "<": "\u00a1",
    ">": "\u00bf",
    "|": "\u2014",
    "{": "",
    "}": "",
}
"""What LaTeX prints for commands, ligatures and characters in OT1. The longest is first."""
TOKEN = re.compile("|".join(map(re.escape, sorted(PRINTED, key=len, reverse=True))))


def printed(source):
    """Return what LaTeX prints for a source that contains no terms of mathematics."""
    return TOKEN.sub(lambda match: PRINTED[match[0]], source)


@given(st.text(st.sampled_from("\\&%$#_{}~^`'\"|<>?!-+,.:;()[]*/ abc\u00b1\u00d7"), max_size=12))
def test_every_character_is_printed_as_itself(text):
    assert printed(latex(text)) == text.replace("'", "\u2019").replace('"', "\u201d")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("< 0.001", "$<$ 0.001"),
        ("partial eta^2", r"partial $\eta^2$"),
        ("k''/omega, besides relaxation", r"$k''/\omega$, besides relaxation"),
        ("-14.8 \u00b1 2.2", r"$-$14.8 $\pm$ 2.2"),
        ("the stiffness is negative (-12 N/m)", "the stiffness is negative ($-$12 N/m)"),
        ("a-1--b.csv", "a-1-{}-b.csv"),
        ("theta^2x", r"theta\textasciicircum{}2x"),
    ],
)
def test_comparisons_signs_and_terms_are_mathematics(text, expected):
    assert latex(text) == expected


def test_a_row_that_begins_with_a_bracket_or_an_asterisk_is_no_option_of_the_row_before():
    table = TextTable(["folder", "n"], [["a", "1"], ["[b]", "2"], ["*", "3"]], 1, [("", "[c]")])
    lines = latex_text(table).splitlines()
    assert not any(re.match(r"[\[*]|\\item \[", line) for line in lines)


def test_the_analysis_of_variance_is_printed_as_in_a_paper():
    effect = {"f": 50.0, "degrees": 2, "error_degrees": 8, "p": 1e-5}
    effect |= {"source": "cube x estimator", "eta_squared": 0.5, "partial_eta_squared": 0.9}
    text = latex_text(effects_table([effect], "k", "design"))
    assert r"& p & $\eta^2$ & partial $\eta^2$ \\" in text
    assert r"cube $\times$ estimator & 50.0 & 2, 8 & $<$ 0.001 & 0.500 & 0.900 \\" in text
