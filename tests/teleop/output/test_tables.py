"""What the commands print does not depend on the terminal."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from teleop.cli import main


@pytest.mark.parametrize("environment", [{"COLUMNS": "40"}, {"TERM": "dumb", "FORCE_COLOR": "1"}])
def test_no_number_of_a_table_is_cut_off_on_a_narrow_or_dumb_terminal(
    environment, monkeypatch, capsys, tmp_path
):
    monkeypatch.chdir(tmp_path)
    t = np.arange(0.0, 4.0, 0.01)
    rows = "".join(f"{s:.2f},{np.sin(s * 6):.5f},{2e9 * np.sin(s * 6):.1f}\n" for s in t)
    Path("stiff.csv").write_text("Time [s],Position [mm],Force [N]\n" + rows)
    arguments = ["estimate", "stiff.csv", "--estimators", "all"]

    def cells():
        assert main(arguments) == 0
        text = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out)
        return [re.split(r"\s{2,}", line.strip()) for line in text.splitlines()]

    wide = cells()
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    narrow = cells()
    assert [row[:3] for row in narrow] == [row[:3] for row in wide]
    assert "…" not in str(narrow)
