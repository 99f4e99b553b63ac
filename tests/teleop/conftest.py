from __future__ import annotations

import io

import pytest

from teleop.cli import main


@pytest.fixture
def refused(capsys):
    """Return a function that runs a command which must fail with one line, and returns the line."""

    def run(*arguments):
        capsys.readouterr()
        assert main([str(argument) for argument in arguments]) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.count("\n") == 1
        assert err.startswith("teleop: ")
        assert "Traceback" not in err
        return err

    return run


@pytest.fixture
def undrawn(monkeypatch):
    """Leave the figure out of the reports of faults: `test_black_box.py` tests it."""
    monkeypatch.setattr("teleop.output.fault_report.draw_fault_report", lambda *arguments: None)


@pytest.fixture
def without_drawings(monkeypatch):
    """Write figures without drawing them, in tests of the texts beside them."""

    def save(figure, file, **options):
        drawing = f"<svg>{200 * ' '}</svg>"
        file.write(drawing if isinstance(file, io.TextIOBase) else drawing.encode())

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", save)
