"""Files laid out as LabVIEW's "Write To Measurement File" writes them."""

from __future__ import annotations

import pytest

from teleop.errors import InputError
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.reading.signals import read_signals

FILE_HEADER = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
    "Decimal_Separator\t{decimal}\nMulti_Headings\tYes\nX_Columns\t{columns}\n"
    "Time_Pref\tRelative\nOperator\tlab\nDate\t2026/03/01\nTime\t10:15:03.5\n"
    "***End_of_Header***\t\n\t\n"
)
SEGMENT = (
    "Channels\t2\t\t\nSamples\t{n}\t{n}\t\nDate\t2026/03/01\t2026/03/01\t\n"
    "Time\t10:15:03.5\t10:15:03.5\t\nY_Unit_Label\tmm\tN\t\nX_Dimension\tTime\tTime\t\n"
    "X0\t0.0E+0\t0.0E+0\t\nDelta_X\t0.010000\t0.010000\t\n***End_of_Header***\t\t\t\n"
    "X_Value\tPosition\tForce\tComment\n"
)


def rows(motion, x_column=True):
    lines = []
    for t, x, f in zip(motion.t, motion.x, motion.f, strict=True):
        lines.append(f"{f'{t:.6f}' if x_column else ''}\t{x * 1e3:.9f}\t{f:.9f}")
    lines[0] += "\tbegin"
    return "\n".join(lines) + "\n"


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "data.lvm"
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize("columns", ["One", "No"])
@pytest.mark.parametrize("decimal", [".", ","])
def test_a_segment_is_read(write, motion, columns, decimal):
    header = FILE_HEADER.format(decimal=decimal, columns=columns)
    segment = SEGMENT.format(n=200) + rows(motion, columns == "One")
    if decimal == ",":
        segment = segment.replace(".", ",")
    motion.same(read_signals(write(header + segment)))


def test_segments_are_blocks(write, motion, refused):
    header = FILE_HEADER.format(decimal=".", columns="One")
    segment = SEGMENT.format(n=200) + rows(motion) + "\n"
    path = write(header + segment + segment)
    message = refused("estimate", path)
    assert "2 tables, expected --block N: expected one of: 1 'segment 1', 200 samples" in message
    motion.same(read_signals(path, wanted=Wanted(block=2)))


def test_a_bad_cell_is_named_with_its_line(write, motion):
    header = FILE_HEADER.format(decimal=".", columns="One")
    text = header + SEGMENT.format(n=200) + rows(motion).replace("0.010000\t", "0.010000\tx", 1)
    line = text[: text.index("\tx")].count("\n") + 1
    with pytest.raises(InputError, match=f"line {line}: 'Position .mm.' is 'x1.0"):
        read_signals(write(text))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("X0\t0.0E+0\t0.0E+0\t\n", "", "X0 is '' in the header above: expected a number"),
        ("Delta_X\t0.010000", "Delta_X\tten", "Delta_X is 'ten' in the header above"),
    ],
)
def test_a_file_without_times_and_without_their_start_or_step_is_refused(
    write, motion, refused, old, new, message
):
    text = FILE_HEADER.format(decimal=".", columns="No")
    text += SEGMENT.format(n=200).replace(old, new) + rows(motion, x_column=False)
    assert message in refused("estimate", write(text))


def test_a_file_without_segments_is_refused_in_one_line(write, refused):
    path = write(FILE_HEADER.format(decimal=".", columns="One"))
    assert "data.lvm: the file has no table of numbers" in refused("estimate", path)
