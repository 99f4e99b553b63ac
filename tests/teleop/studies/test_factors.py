"""Factors are read from the names of files, or from a table."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

import pytest

from teleop.errors import InputError
from teleop.studies.factors import read_factors


@pytest.mark.parametrize(
    ("pattern", "place", "levels"),
    [
        (
            "{subject}/{specimen}_rep{n}.csv",
            "s01/pig_liver_rep12.csv",
            {"subject": "s01", "specimen": "pig_liver", "n": "12"},
        ),
        ("{subject}/{specimen}_rep{n}.csv", "2026/s01/liver_rep1.csv", None),
        ("{subject}/{specimen}_rep{n}.csv", "s01/liver.csv", None),
        ("{s}/{s}_{n}.*", "s01/s01_3.mat", {"s": "s01", "n": "3"}),
        ("{s}/{s}_{n}.*", "s01/s02_3.mat", None),
        ("*/a+b {n}.csv", "day 1/a+b 2.csv", {"n": "2"}),
    ],
)
def test_a_pattern_states_the_levels_of_a_file(pattern, place, levels):
    assert read_factors(pattern).levels(Path("data", place), PurePosixPath(place)) == levels


def test_a_file_that_is_named_itself_is_matched_by_the_end_of_its_path():
    factors = read_factors("{subject}/{n}.csv")
    assert factors.levels(Path("/data/s01/2.csv"), None) == {"subject": "s01", "n": "2"}


def test_a_name_with_two_meanings_is_refused():
    with pytest.raises(InputError, match=r"in several ways \(a = x_y, b = z or a = x, b = y_z\)"):
        read_factors("{a}_{b}.csv").levels(Path("x_y_z.csv"), PurePosixPath("x_y_z.csv"))


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_a_table_names_files_by_the_ends_of_their_paths(tmp_path, delimiter):
    path = tmp_path / "factors.csv"
    lines = ["name,tissue,day", "s01/a.csv,liver,1", "b.csv,fat,", "ghost.csv,fat,2", ""]
    path.write_bytes(b"\xef\xbb\xbf" + "\r\n".join(lines).replace(",", delimiter).encode())
    factors = read_factors(str(path))
    first, second = tmp_path / "s01" / "a.csv", tmp_path / "b.csv"
    assert factors.levels(first, None) == {"tissue": "liver", "day": "1"}
    assert factors.levels(second, PurePosixPath("b.csv")) == {"tissue": "fat"}
    assert factors.levels(tmp_path / "a.csv", None) is None
    assert [name for name, _ in factors.check_used([first, second])] == ["ghost.csv"]
    with pytest.raises(InputError, match=r"line 3: names .* and .*: expected the name with its"):
        factors.check_used([second, tmp_path / "s02" / "b.csv"])


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "line 1: expected a header"),
        ("file\na.csv\n", "line 1: expected a header"),
        ("name,file\na.csv,x\n", "line 1: every file has the factor file"),
        ("name,x,x\na.csv,1,2\n", "line 1: expected different names"),
        ("name,x\na.csv\n", "line 2: expected 2 cells, got 1"),
        ("name,x\na.csv,1\na.csv,2\n", "line 3: a.csv is also named in line 2"),
        ("name,x\n,1\n", "line 2: expected the name of a file"),
    ],
)
def test_a_bad_table_is_refused(tmp_path, text, problem):
    path = tmp_path / "factors.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=problem):
        read_factors(str(path))


@pytest.mark.parametrize("pattern", ["{a", "a}.csv", "{}.csv", "{a b}.csv", "{{a}}.csv", "{file}"])
def test_a_bad_pattern_is_refused(pattern):
    with pytest.raises(InputError, match=r"^--factors .*: (expected names of|every file has)"):
        read_factors(pattern)
