"""Control characters in texts from files never reach the terminal."""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation import Estimates
from estimation.figures import estimates_figure
from teleop.cli import main
from teleop.output.console import plain_console
from teleop.output.figure_files import plain
from teleop.output.web_page import svg
from teleop.printable import one_line, print_error, printable

EVIL = "\x1b]0;gone\x07\x1b[2J\x9b31m\u202e"


@given(st.text())
def test_control_characters_are_escaped_and_other_text_is_unchanged(text):
    shown = printable(text)
    assert not re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\ud800-\udfff]", shown)
    if text.isprintable():
        assert shown == text


@given(st.text())
def test_an_error_message_is_one_line_of_bounded_length(text):
    assert len(one_line(text).splitlines()) <= 1
    assert len(one_line(1000 * text)) <= 2000


def test_a_console_shows_control_characters_in_texts_tables_and_titles(capsys):
    from teleop.output.estimate_tables import print_table

    console = plain_console()
    console.print(EVIL, style="red")
    print_table(console, EVIL, ("", EVIL), [[EVIL, EVIL]])
    out = capsys.readouterr().out
    assert out.count(r"\x1b]0;gone\x07\x1b[2J\x9b31m\u202e") == 5
    assert "\x1b" not in out


def write_sine(path, header="Time [s],Position [mm],Force [N]"):
    t = np.arange(0.0, 3.0, 0.01)
    rows = "".join(f"{a:.3f},{np.sin(9 * a):.6f},{2 * np.sin(9 * a + 0.1):.6f}\n" for a in t)
    path.write_text(f"{header}\n{rows}", encoding="utf-8")
    return path


@pytest.mark.usefixtures("without_drawings")
def test_a_files_name_and_its_columns_are_shown(tmp_path, capsys, refused):
    path = write_sine(tmp_path / f"{EVIL.replace('/', '')}.csv")
    assert main(["estimate", str(path)]) == 0
    assert main(["report", str(path)]) == 0
    out = capsys.readouterr().out
    assert "\x1b" not in out
    assert r"\x1b" in out
    path = write_sine(tmp_path / "a.csv", f"Time [s],Position [mm],Force{EVIL} [N]")
    error = refused("estimate", path, "--force", "Load")
    assert "\x1b" not in error
    assert "\x9b" not in error


@pytest.mark.parametrize(
    "content", ['[devices."x\\u001b[2J"]\nkind = "board"', "\x1b = 3", 'a = "\\u009b"']
)
def test_a_rig_files_names_are_shown(tmp_path, capsys, content):
    path = tmp_path / "rig.toml"
    path.write_text(content, encoding="utf-8")
    assert main(["rig", "check", str(path)]) == 2
    error = capsys.readouterr().err
    assert not re.search("[\x1b\x9b]", error)
    assert all(line.startswith("teleop: ") for line in error.splitlines())


@pytest.mark.usefixtures("without_drawings")
@pytest.mark.skipif(sys.platform != "linux", reason="names of files are bytes")
def test_a_file_whose_name_is_not_valid_text_is_evaluated(tmp_path, capsys):
    """The name is in Latin-1 on a system with UTF-8."""
    path, figure = (
        os.fsdecode(os.fsencode(tmp_path) + b"/\xe9\xff." + e) for e in (b"csv", b"svg")
    )
    write_sine(tmp_path / "a.csv").rename(path)
    assert main(["estimate", path, "--plot", figure, "--out", path + ".out"]) == 0
    assert main(["estimate", path, "--json"]) == 0
    assert r"\udce9\udcff" in capsys.readouterr().out


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are bytes")
def test_output_works_in_a_locale_without_utf_8(tmp_path):
    path = os.fsencode(tmp_path) + b"/\xe9.csv"
    write_sine(tmp_path / "a.csv").rename(os.fsdecode(path))
    env = {**os.environ, "LC_ALL": "POSIX", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    done = subprocess.run(
        [sys.executable, "-m", "teleop", b"report", path], env=env, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == b""


def test_a_name_that_the_font_does_not_have_is_drawn_without_a_warning(tmp_path, recwarn):
    path = write_sine(tmp_path / "\u6d4b\u8bd5.csv")
    assert main(["estimate", str(path), "--plot", str(tmp_path / "a.png")]) == 0
    assert [*recwarn] == []


def test_a_title_of_any_length_and_characters_leaves_room_for_the_figure(recwarn):
    t = np.arange(3.0)
    series = Estimates(t, t, t, t, t > 5.0)
    figure = estimates_figure(plain("\u6d4b\u8bd5 long\n" * 1000), t, t, t, {"rls": series})
    assert svg(figure).startswith("<svg")
    assert [*recwarn] == []


def test_an_error_is_broken_at_spaces_on_a_terminal_and_is_one_line_elsewhere(monkeypatch):
    for is_terminal in (True, False):
        stream = io.StringIO()
        stream.isatty, stream.fileno = lambda is_one=is_terminal: is_one, lambda: 2
        monkeypatch.setattr(sys, "stderr", stream)
        monkeypatch.setattr(os, "get_terminal_size", lambda end: os.terminal_size((40, 24)))
        print_error("estimator 'mee': did you mean me? expected all, or some of rls, ai, me")
        lines = stream.getvalue().splitlines()
        assert max(map(len, lines)) <= 40 or not is_terminal
        assert len(lines) == (2 if is_terminal else 1)
        assert " ".join(lines).endswith(
            "'mee': did you mean me? expected all, or some of rls, ai, me"
        )
