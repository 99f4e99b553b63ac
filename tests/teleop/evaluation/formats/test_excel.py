from __future__ import annotations

import pytest

from teleop.errors import InputError
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.reading.signals import read_signals

openpyxl = pytest.importorskip("openpyxl")
pytest.importorskip("python_calamine")


def write(path, motion, sheets=("Probe 1",), spoil=lambda rows: None):
    book = openpyxl.Workbook()
    book.active.title = "Parameter"
    book.active.append(["Prüfgeschwindigkeit", 10.0, "mm/min"])
    for name in sheets:
        sheet = book.create_sheet(name)
        rows = list(
            zip(motion.t.tolist(), (motion.x * 1e3).tolist(), motion.f.tolist(), strict=True)
        )
        rows = [list(row) for row in rows]
        spoil(rows)
        for row in (["Gel", None, None, "Filter 20 Hz"], [], ["Zeit", "Standardweg", "Kraft"]):
            sheet.append(row)
        for row in (["s", "mm", "N"], *rows):
            sheet.append(row)
    book.save(path)
    return path


def test_a_sheet_with_a_preamble_and_a_row_of_units_is_read(tmp_path, motion):
    signals = motion.same(read_signals(write(tmp_path / "data.xlsx", motion)))
    assert signals.position_name == "Standardweg"
    assert signals.force_filter == "Gel Filter 20 Hz"


def test_sheets_are_blocks(tmp_path, motion, refused):
    path = write(tmp_path / "data.xlsx", motion, ("Probe 1", "Probe 2"))
    message = refused("estimate", path)
    assert "2 tables, expected --block N: expected one of: 1 'Probe 1', 200 samples" in message
    motion.same(read_signals(path, wanted=Wanted(block=2)))


@pytest.mark.parametrize(("value", "shown"), [(None, "empty"), ("broken", "'broken'")])
def test_a_bad_cell_is_named_with_its_sheet_and_row(tmp_path, motion, value, shown):
    path = write(tmp_path / "data.xlsx", motion, spoil=lambda rows: rows[4].__setitem__(2, value))
    with pytest.raises(InputError, match=f"sheet 'Probe 1', row 9: 'Kraft .N.' is {shown}"):
        read_signals(path)


def test_text_in_a_file_that_ends_in_xls_is_read_as_text(tmp_path, motion):
    path = tmp_path / "data.xls"
    rows = zip(motion.t, motion.x, motion.f, strict=True)
    lines = [f"{t!r}\t{x!r}\t{f!r}" for t, x, f in ((float(v) for v in row) for row in rows)]
    path.write_text("\n".join(["Time (s)\tExtension (m)\tLoad (N)", *lines]))
    motion.same(read_signals(path))


def test_a_missing_library_and_a_damaged_file_are_reported_in_one_line(
    tmp_path, motion, refused, without
):
    path = write(tmp_path / "data.xlsx", motion)
    path.write_bytes(path.read_bytes()[:2000])
    assert "data.xlsx: cannot be read as a spreadsheet" in refused("estimate", path)
    without("python_calamine")
    assert "Excel needs python-calamine: expected pip install 'telepalpation[formats]'" in refused(
        "estimate", path
    )
