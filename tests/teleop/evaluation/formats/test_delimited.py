from __future__ import annotations

import numpy as np
import pytest

from teleop.errors import InputError
from teleop.evaluation.formats.units import quantity
from teleop.evaluation.reading.signals import read_signals
from teleop.files import new_file
from teleop.recording.export_formats import TableFile

GOOD = "Time [s],Position [mm],Force [gf]\n0.0,1.0,100\n0.01,1.5,150\n0.03,2.0,200\n"


@pytest.fixture
def write(tmp_path):
    def write(text, name="data.csv"):
        path = tmp_path / name
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return path

    return write


def test_reads_in_si_units_and_keeps_the_jitter(write):
    recording = read_signals(write(GOOD))
    np.testing.assert_allclose(recording.t, [0.0, 0.01, 0.03])
    np.testing.assert_allclose(recording.x, [1e-3, 1.5e-3, 2e-3])
    np.testing.assert_allclose(recording.f, [0.980665, 1.4709975, 1.96133])
    np.testing.assert_allclose(recording.dt, [0.015, 0.01, 0.02])


@pytest.mark.parametrize(
    ("unit", "size"),
    [("m", 1.0), ("mm", 1e-3), ("um", 1e-6), ("\u00b5m", 1e-6), ("\u03bcm", 1e-6)],
)
def test_knows_units_of_position(write, unit, size):
    recording = read_signals(write(GOOD.replace("mm", unit)))
    np.testing.assert_allclose(recording.x, np.array([1.0, 1.5, 2.0]) * size)


@pytest.mark.parametrize(
    ("unit", "size"),
    [("N", 1.0), ("mN", 1e-3), ("nN", 1e-9), ("gf", 9.80665e-3), ("kgf", 9.80665)],
)
def test_knows_units_of_force(write, unit, size):
    recording = read_signals(write(GOOD.replace("gf", unit)))
    np.testing.assert_allclose(recording.f, np.array([100.0, 150.0, 200.0]) * size)


@pytest.mark.parametrize(("unit", "size"), [("s", 1.0), ("ms", 1e-3)])
def test_knows_units_of_time(write, unit, size):
    recording = read_signals(write(GOOD.replace("Time [s]", f"Time [{unit}]")))
    np.testing.assert_allclose(recording.t, np.array([0.0, 0.01, 0.03]) * size)


@pytest.mark.parametrize(
    "text",
    [
        GOOD.replace(",", "\t"),
        GOOD.replace(",", ";"),
        GOOD.replace(",", ";").replace(".", ","),
        "\ufeff" + GOOD,
        GOOD.replace("\n", "\r\n"),
        "\n" + GOOD + "\n\n",
        "# made by hand\n" + GOOD,
        GOOD.replace("Time [s]", "TIME (s)").replace("Position [mm]", "displacement (mm)"),
        '"Time [s]","Position [mm]","Force [gf]"\n' + GOOD.partition("\n")[2],
        "Force [gf],note,Position [mm],Time [s]\n100,a,1,0\n150,b,1.5,.01\n200,,2,.03\n",
    ],
    ids=[
        "tsv",
        "semicolon",
        "decimal comma",
        "bom",
        "crlf",
        "blank lines",
        "comments",
        "names",
        "quotes",
        "order",
    ],
)
def test_takes_what_instruments_write(write, text):
    recording = read_signals(write(text))
    np.testing.assert_allclose(recording.t, [0.0, 0.01, 0.03])
    np.testing.assert_allclose(recording.x, [1e-3, 1.5e-3, 2e-3])


def test_columns_can_be_named_and_given_a_unit(write):
    path = write("s,stage,Load [N],Force [N]\n0,1,5,9\n1,2,6,9\n2,4,7,9\n")
    recording = read_signals(path, position="stage=um", force="Load", time="s=ms")
    np.testing.assert_allclose(recording.x, [1e-6, 2e-6, 4e-6])
    np.testing.assert_allclose(recording.f, [5, 6, 7])
    np.testing.assert_allclose(recording.t, [0, 1e-3, 2e-3])
    assert read_signals(path, "stage=um", "Load [N]", "s=s").f[0] == 5


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "data.csv: the file is empty"),
        (" \n\n", "data.csv: the file is empty"),
        (
            GOOD.replace("Force [gf]", "Temperature [K]"),
            "line 1: no force column: expected one named force",
        ),
        (GOOD.replace("gf", "bar"), "'Force' has unknown unit 'bar': expected N, mN, kN, gf, kgf"),
        (GOOD.replace(" [gf]", ""), "'Force' has no unit: expected a header such as 'Force .N.'"),
        (GOOD.replace("1.5", "abc"), "line 3: 'Position .mm.' is 'abc', expected a number"),
        (GOOD.replace("1.5", "nan"), "line 3: 'Position .mm.' is nan, expected a finite number"),
        (GOOD.replace("1.5", "-inf"), "line 3: 'Position .mm.' is -inf, expected a finite"),
        (GOOD.replace("1.5", ""), "line 3: 'Position .mm.' is empty, expected a finite"),
        (GOOD.replace("0.01,1.5,150", "0.01,1.5"), "line 3: 2 cells, expected 3"),
        (GOOD.replace("0.03", "0.005"), "line 4: time decreases, from 0.01 s to 0.005 s"),
        (GOOD.replace("0.03", "0.01"), "line 4: time repeats, from 0.01 s to 0.01 s"),
        (GOOD.rsplit("\n", 2)[0], "2 samples: expected at least 3"),
        (GOOD.partition("\n")[0], "0 samples: expected at least 3"),
        (GOOD.partition("\n")[2], "line 1: no time column"),
        (GOOD.replace("Time [s]", "Force [N]"), "no time column"),
        (
            GOOD.replace("Time [s],Position", "Time [s],Force [gf],Position"),
            "2 columns are named 'force'",
        ),
        (b"\xff\xfe\x00binary", "not a text file"),
        (GOOD.replace("1.5,", "1,5,"), "line 3: 4 cells, expected 3"),
    ],
)
def test_bad_content_is_reported_in_one_line_with_its_place(write, text, message):
    with pytest.raises(InputError, match=message) as caught:
        read_signals(write(text))
    assert "\n" not in str(caught.value)
    assert "data.csv" in str(caught.value)


def test_a_line_number_counts_blank_lines(write):
    with pytest.raises(InputError, match="line 5: time repeats"):
        read_signals(write(GOOD.replace("0.01,", "\n0.01,").replace("0.03", "0.01")))


def test_a_missing_file_and_a_folder_are_reported(tmp_path):
    with pytest.raises(InputError, match="nothing.csv: no such file"):
        read_signals(tmp_path / "nothing.csv")
    with pytest.raises(InputError, match="expected a file"):
        read_signals(tmp_path)


def test_an_unknown_column_names_those_there_are(write):
    with pytest.raises(
        InputError, match="no column 'Load': expected one of 'Time', 'Position', 'Force'"
    ):
        read_signals(write(GOOD), force="Load")
    with pytest.raises(InputError, match="unknown unit 'stone'"):
        read_signals(write(GOOD.replace(" [gf]", "")), force="Force=stone")


@pytest.mark.parametrize("mu", ["\u00b5", "\u03bc"])
def test_both_characters_for_micro_are_one_unit(write, mu):
    path = write(GOOD.replace("[mm]", "").replace("Time [s]", "Time [\u00b5s]"))
    signals = read_signals(path, position=f"Position={mu}m", time=f"Time [{mu}s]")
    np.testing.assert_allclose(signals.x, [1e-6, 1.5e-6, 2e-6])
    assert quantity(f"2{mu}m", "position") == pytest.approx(2e-6)


def test_a_unit_that_contradicts_the_header_is_reported(write):
    for position in ("Position=m", "Position [m]"):
        with pytest.raises(InputError, match="is in 'mm' according to the header, not in 'm'"):
            read_signals(write(GOOD), position=position)
    with pytest.raises(InputError, match="must be three different columns"):
        read_signals(write(GOOD.replace(" [gf]", "")), position="Force=mm", force="Force=N")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD.replace("1.5", "1e300"), "line 3: a position of 1e.297 in SI units"),
        (GOOD.replace("0.01,", "1e-12,"), "times 1e-12 s apart"),
        (GOOD.replace("1.5", "1_5"), "'1_5', expected a number"),
        ("x" * 200_000 + "\n" + GOOD, "line 1"),
        (" " * 50_000 + "[" + GOOD, "data.csv"),
    ],
)
def test_hostile_content_is_reported_at_once(write, text, message):
    with pytest.raises(InputError, match=message):
        read_signals(write(text))


def test_what_is_written_is_read_back_to_the_bit(tmp_path):
    rng = np.random.default_rng(0)
    columns = {
        "Time": np.cumsum(rng.uniform(1e-3, 2e-3, 50)),
        "Displacement": rng.normal(size=50) * 1e-3,
        "Force": rng.normal(size=50),
    }
    path = tmp_path / "out.csv"
    with new_file(path) as file:
        TableFile(file).write((columns, {"Time": "s", "Displacement": "m", "Force": "N"}))
    recording = read_signals(path)
    for got, name in zip(recording[:3], columns, strict=True):
        assert np.array_equal(got, columns[name])


def test_a_table_that_cannot_be_written_is_reported(tmp_path):
    missing = tmp_path / "none" / "out.csv"
    with pytest.raises(InputError, match="no such file"), new_file(missing) as file:
        TableFile(file).write(({}, {}))


@pytest.mark.parametrize("size", [1 << 18, 1 << 24])
def test_a_line_is_read_no_further_than_its_greatest_length(tmp_path, size):
    path = tmp_path / "data.csv"
    path.write_text("Time [s],Position [mm],Force [N]\n0.0," + "1" * size)
    with pytest.raises(InputError, match=r"line 2: expected a line of at most 262144 characters"):
        read_signals(path)


def test_a_header_of_very_many_columns_is_refused_in_one_short_line(tmp_path, refused):
    path = tmp_path / "data.csv"
    path.write_text(",".join(f"column {i}" for i in range(20_000)) + "\n")
    assert len(refused("estimate", path, "--force", "x=N", "--time", "y=s")) < 2100


def test_a_file_in_mixed_encodings_is_read_line_by_line(tmp_path):
    path = tmp_path / "data.csv"
    rows = b"".join(b"%d,%d,%d\n" % (i, i, i) for i in range(5))
    path.write_bytes(b"# \xe9 Latin-1\nTime [s],Position [\xc2\xb5m],Force [N]\n" + rows)
    assert read_signals(path).x[1] == pytest.approx(1e-6)


@pytest.mark.parametrize("channel", ["position", "force"])
def test_values_whose_squares_are_zero_are_refused(tmp_path, refused, motion, channel):
    size = {"position": 1.0, "force": 1.0} | {channel: 1e-300}
    path = tmp_path / "small.csv"
    rows = zip(motion.t, motion.x * size["position"], motion.f * size["force"], strict=True)
    lines = (f"{t!r},{x!r},{f!r}\n" for t, x, f in (map(float, row) for row in rows))
    path.write_text("time [s],position [m],force [N]\n" + "".join(lines))
    assert f"every {channel} is at most" in refused("estimate", path)
