"""Text files laid out as testing machines and programs export them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.cli import main
from teleop.errors import InputError
from teleop.evaluation.formats.columns import Wanted, split_heading
from teleop.evaluation.formats.delimited import PART
from teleop.evaluation.formats.dialect import Dialect
from teleop.evaluation.formats.numbers import NumberReader
from teleop.evaluation.formats.table import Heading
from teleop.evaluation.formats.units import canonical
from teleop.evaluation.reading.signals import read_signals

T = np.arange(40) * 0.01
X = 1.0 + 0.5 * np.sin(20.0 * T)
F = 2.0 * X + 0.3


def lines(delimiter="\t", decimal=".", quote=""):
    return "".join(
        delimiter.join(f"{quote}{value:.6f}{quote}".replace(".", decimal) for value in row) + "\n"
        for row in zip(T, X, F, strict=True)
    )


MACH_1 = (
    "<Mach-1 File>\n<INFO>\nDate:\t12.03.2024\t10:15\n"
    "Load cell:\t25 kg\tForce filter: third-order 20 Hz low-pass\n<END INFO>\n\n"
    "<Sinusoid>\nAmplitude, mm:\t0.5\nFrequency, Hz:\t1\t2\t3\n<DATA>\n"
    "Time, s\tPosition (z), mm\tFz, N\n" + lines() + "<END DATA>\n"
)
ZWICK = (
    "Prüfprotokoll;Größe\nMaßstab;1\nMaße;10;20\n\n"
    '"Prüfzeit";"Standardweg";"Standardkraft"\n"s";"mm";"N"\n' + lines(";", ",")
)
ZWICK_FRENCH = '"Temps d\u2019essai";"Course standard";"Force standard"\n"s";"mm";"N"\n' + lines(
    ";", ","
)
BLUEHILL = (
    '"Specimen label","Gel 1"\n"Rate 1","10.0","mm/min"\n\n'
    '"Time","Extension","Load"\n"(sec)","(mm)","(N)"\n' + lines(",", quote='"')
)
BLUEHILL_GBK = (
    '"试样名称","明胶 1"\n"试样直径 (mm)","20.0"\n\n'
    '"时间","压缩位移","载荷"\n"(秒)","(毫米)","(牛顿)"\n' + lines(",", quote='"')
)


@pytest.fixture
def write(tmp_path):
    def write(text, encoding="utf-8", name="data.txt"):
        path = tmp_path / name
        path.write_bytes(text.encode(encoding))
        return path

    return write


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        (MACH_1, "utf-8"),
        (ZWICK, "cp1252"),
        (ZWICK, "utf-8"),
        (ZWICK, "utf-8-sig"),
        (ZWICK, "utf-16"),
        (ZWICK, "utf-16-le"),
        (ZWICK_FRENCH, "cp1252"),
        (BLUEHILL, "ascii"),
        (BLUEHILL_GBK, "gbk"),
        (BLUEHILL_GBK, "utf-8"),
        ("Zeit [s]\tWeg in mm\tKraft/N\n" + lines(decimal=","), "utf-16"),
        ("  Time (s)   Travel (mm)  Load (N)\n" + lines("   "), "ascii"),
        ("Elapsed Time sec|Position_mm|Force_N\n" + lines("|"), "ascii"),
        ("時間(sec),変位(mm),試験力(N)\n" + lines(","), "cp932"),
        ("Time [s]\tStandard travel [mm]\tLoad [N]\t\n" + lines().replace("\n", "\t\n"), "ascii"),
        ("time,position,force\ns,mm,N\n" + lines(","), "ascii"),
        ("Time [s],Position [mm],Force [N]\n" + lines(",") + "end of the test\n", "ascii"),
        ("Time [s],Position [mm],Force [N]\n" + lines(",").replace("\n", "\r\n"), "ascii"),
        ("Time [s],Position [mm],Force [N]\n" + lines(",").replace("\n", "\r"), "ascii"),
    ],
)
def test_the_export_of_a_machine_is_read_as_it_is(write, text, encoding):
    signals = read_signals(write(text, encoding))
    np.testing.assert_allclose(signals.t, T)
    np.testing.assert_allclose(signals.x, X * 1e-3, rtol=1e-5)
    np.testing.assert_allclose(signals.f, F, rtol=1e-5)


@pytest.mark.parametrize(
    "text",
    [
        "# Time [s]  Position [mm]  Force [N]\n" + lines(" "),
        "% exported\n% Time (s), Position (mm), Force (N)\n" + lines(","),
        "Time [s],Position [mm],Force [N]\n" + lines(",") + "\nMaximum,1.5,3.3\nMean,1.0,2.3\n",
        '"Time ","Display","Load 1","Disp"\n"Sec"," ","N","mm"\n'
        + "".join(f"{t},1,{f:.6f},{x:.6f}\n" for t, x, f in zip(T, X, F, strict=True)),
        "Time,Position [mm],Force [N]\n"
        + "".join(f"9:59:{t + 5:06.3f},{x:.6f},{f:.6f}\n" for t, x, f in zip(T, X, F, strict=True)),
        "timestamp;Position [mm];Force [N]\n"
        + "".join(
            f"2026-03-01 10:00:{t:06.3f};{x:.6f};{f:.6f}\n" for t, x, f in zip(T, X, F, strict=True)
        ),
    ],
    ids=["savetxt", "percent", "footer", "numbered", "clock", "date"],
)
def test_the_layouts_of_other_programs_are_read(write, text):
    signals = read_signals(write(text))
    np.testing.assert_allclose(signals.t - signals.t[0], T, atol=1e-6)
    np.testing.assert_allclose(signals.x, X * 1e-3, rtol=1e-5)
    np.testing.assert_allclose(signals.f, F, rtol=1e-5)


def test_two_numbered_columns_are_for_the_user_to_choose_from(write, refused):
    path = write("Time [s],Position [mm],Load 1 [N],Load 2 [N]\n0,0,0,5\n1,1,1,6\n2,2,2,7\n")
    message = refused("estimate", path)
    assert "2 columns are named 'load 1', expected one, or --force with the number" in message
    assert message.rstrip().endswith("3, 4")
    assert read_signals(path, force="4").f[0] == 5.0


def test_separators_of_thousands_are_no_decimal_marks(write):
    rows = "0.0\t1,000.5\t1.0\n0.1\t999.5\t2.0\n0.2\t12,001.0\t3.0\n0.3\t2,000\t4.0\n"
    path = write("Time [s]\tPosition [um]\tForce [N]\n" + rows)
    np.testing.assert_allclose(read_signals(path).x, [1000.5e-6, 999.5e-6, 12001e-6, 2000e-6])
    with pytest.raises(InputError, match="line 3: 'Position .um.' is '9,5', expected a number"):
        read_signals(write("Time [s]\tPosition [um]\tForce [N]\n" + rows.replace("999.5", "9,5")))


@pytest.mark.parametrize(
    ("cell", "name", "unit"),
    [
        ("Time, s", "Time", "s"),
        ("Position (z), mm", "Position (z)", "mm"),
        ("Position (z)", "Position (z)", None),
        ("Force (gf)", "Force", "gf"),
        ("Weg in µm", "Weg", "µm"),
        ("Weg in \u03bcm", "Weg", "µm"),
        ("Kraft/kN", "Kraft", "kN"),
        ("time_ms", "time", "ms"),
        ("slave_position", "slave_position", None),
        ("Torque [Nm]", "Torque", "N m"),
        ("Torque (N·m)", "Torque", "N m"),
        ("Elapsed Time (sec)", "Elapsed Time", "s"),
        ("Time in the machine", "Time in the machine", None),
        ("force", "force", None),
        ("force_N", "force", "N"),
        ("position_m", "position_m", None),
        ("position_s", "position_s", None),
        ("x_m", "x_m", None),
        ("t_s", "t", "s"),
    ],
)
def test_a_heading_is_split_into_name_and_unit(cell, name, unit):
    assert split_heading(cell) == (name, unit)
    assert canonical(unit or "") == (unit or "")


def test_one_of_several_blocks_is_chosen(write, refused):
    twice = MACH_1 + MACH_1.partition("<END INFO>")[2].replace("Sinusoid", "Ramp")
    path = write(twice.replace("<DATA>\nTime", "<DATA>\nTime", 1))
    message = refused("estimate", path)
    assert "2 tables, expected --block N" in message
    assert "1 '<Sinusoid>', 40 samples of 'Time', 'Position (z)', 'Fz' (in s, mm, N)" in message
    assert "2 '<Ramp>', 40 samples" in message
    np.testing.assert_allclose(read_signals(path, wanted=Wanted(block=2)).x, X * 1e-3, rtol=1e-5)
    assert "no block 3: expected one of: 1 '<Sinusoid>'" in refused("estimate", path, "--block", 3)


def test_a_fault_in_another_block_does_not_matter(write):
    second = MACH_1.partition("<END INFO>")[2]
    path = write(MACH_1 + second.replace("0.010000", "broken"))
    assert len(read_signals(path, wanted=Wanted(block=1)).t) == 40
    with pytest.raises(InputError, match=r"line 6\d: 'Time .s.' is 'broken', expected a number"):
        read_signals(path, wanted=Wanted(block=2))


def test_samples_below_a_line_of_text_are_another_block(write):
    half = lines(",").splitlines(keepends=True)
    text = "".join(["Time [s],Position [mm],Force [N]\n", *half[:20], "pause\n", *half[20:]])
    with pytest.raises(InputError, match=r"2 tables, expected --block N.*20 samples.*'pause', 20"):
        read_signals(write(text))


def test_the_stated_filter_of_the_force_is_reported(write, capsys):
    path = write(MACH_1)
    stated = "Load cell: 25 kg Force filter: third-order 20 Hz low-pass"
    assert read_signals(path).force_filter == stated
    assert main(["estimate", str(path)]) == 0
    assert "the force is advanced by 15.9 ms" in " ".join(capsys.readouterr().out.split())
    assert main(["estimate", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["force_filter"] == stated
    assert (
        read_signals(write("# Filter: none\n" + MACH_1.partition("END INFO>")[2])).force_filter
        == ""
    )


def test_repeated_times_are_left_out_and_reported(write):
    rows = lines(",").splitlines(keepends=True)
    rows.insert(11, rows[10].replace(rows[10].split(",")[1], "77.0"))
    signals = read_signals(write("Time [s],Position [mm],Force [N]\n" + "".join(rows)))
    np.testing.assert_allclose(signals.x, X * 1e-3, rtol=1e-5)
    assert signals.notes == (
        "1 of 41 samples have the time of the previous sample and are left out",
    )


def test_a_clock_that_is_too_coarse_is_named(write):
    rows = "".join(f"{i // 2 * 0.01:.2f},{i},{i}\n" for i in range(20))
    path = write("Time [s],Position [mm],Force [N]\n" + rows)
    assert "10 of 20 samples" in read_signals(path).notes[0]
    assert "use --rate HZ" in read_signals(path).notes[0]
    assert len(read_signals(path, wanted=Wanted(rate=200.0)).t) == 20


def test_a_file_without_a_time_column_takes_a_rate(write, refused):
    path = write("Position [mm],Force [N]\n0,1\n1,2\n2,4\n")
    assert "no time column" in (message := refused("estimate", path))
    assert "--rate HZ" in message
    assert "columns: 'Position', 'Force' (in mm, N)" in message
    signals = read_signals(path, wanted=Wanted(rate=1000.0))
    np.testing.assert_allclose(signals.t, [0.0, 1e-3, 2e-3])
    assert "expected 0.001 to 1e9 Hz" in refused("estimate", path, "--rate", 0)
    assert "exclude each other" in refused("estimate", path, "--rate", 1, "--time", "Force")


def test_columns_without_a_header_are_taken_by_number(write):
    signals = read_signals(write(lines(",")), position="2=mm", force="3=N", time="1=s")
    np.testing.assert_allclose(signals.f, F, rtol=1e-5)


def test_angle_and_torque_are_taken_on_a_lever_arm(write, refused):
    path = write("Time [s],Angle [deg],Torque [mN m]\n0,0,10\n1,90,20\n2,180,40\n")
    assert "'Angle' is in 'deg': expected --lever" in refused("estimate", path)
    signals = read_signals(path, wanted=Wanted(lever=0.05))
    np.testing.assert_allclose(signals.x, np.array([0.0, 0.5, 1.0]) * np.pi * 0.05)
    np.testing.assert_allclose(signals.f, [0.2, 0.4, 0.8])
    assert "expected a length with its unit, such as 5mm" in refused(
        "estimate", path, "--lever", "5"
    )


@pytest.mark.parametrize(
    ("invert", "x", "f"), [("position", -1, 1), ("force", 1, -1), ("both", -1, -1), (None, 1, 1)]
)
def test_signs_are_inverted_as_asked(write, invert, x, f):
    path = write("Time [s],Position [m],Force [N]\n" + lines(","))
    signals = read_signals(path, wanted=Wanted(invert=invert))
    np.testing.assert_allclose(signals.x, x * X, rtol=1e-5)
    np.testing.assert_allclose(signals.f, f * F, rtol=1e-5)


@pytest.mark.parametrize(
    ("kind", "unit", "size"),
    [
        ("t", "us", 1e-6),
        ("t", "ns", 1e-9),
        ("t", "min", 60.0),
        ("x", "nm", 1e-9),
        ("f", "uN", 1e-6),
        ("f", "kN", 1e3),
        ("f", "newtons", 1.0),
        ("f", "g", 9.80665e-3),
    ],
)
def test_more_units_are_known(write, kind, unit, size):
    names = {"t": "Time [s]", "x": "Position [m]", "f": "Force [N]"}
    names[kind] = f"{names[kind].partition('[')[0]}[{unit}]"
    signals = read_signals(write(",".join(names.values()) + "\n0,0,0\n10,10,10\n20,20,20\n"))
    np.testing.assert_allclose(getattr(signals, kind), np.array([0.0, 10.0, 20.0]) * size)


@given(
    data=st.data(),
    dialect=st.sampled_from(
        [Dialect(",", ".", ","), Dialect(";", ",", "."), Dialect("\t", ","), Dialect(None)]
    ),
)
def test_lines_read_in_bulk_give_what_single_lines_give(data, dialect):
    cell = st.sampled_from(
        [
            "1",
            "2.5",
            "2,5",
            "1e3",
            "nan",
            "",
            "x",
            '"3"',
            ' "3"',
            '"3"4',
            '"5,6"',
            '"',
            "1_0",
            " 4 ",
            "#",
        ]
    )
    rows = data.draw(st.lists(st.lists(cell, min_size=2, max_size=4), min_size=1, max_size=5))
    text = [(dialect.delimiter or " ").join(row) for row in rows]
    if data.draw(st.booleans()):
        text.insert(data.draw(st.integers(0, len(text))), "")
    headings = [Heading("a"), Heading("b"), Heading("c")]

    def result(parts):
        rows = NumberReader(str, headings, (0, 2), dialect)
        place = 0
        for part in parts:
            taken = rows.feed(1 + place, part)
            place += taken
            if taken < len(part):
                break
        values = {i: repr(column.tolist()) for i, column in rows.columns().items()}
        return values, rows.numbers().tolist() if not rows.problem else None, str(rows.problem)

    class OneByOne(NumberReader):
        def _in_bulk(self, lines):
            return None

    one = OneByOne(str, headings, (0, 2), dialect)
    one.feed(1, text)
    bulk, numbers, problem = result([text])
    assert problem == str(one.problem)
    assert bulk == {i: repr(column.tolist()) for i, column in one.columns().items()}
    assert numbers is None or numbers == one.numbers().tolist()
    assert result([[line] for line in text]) == (bulk, numbers, problem)


def test_a_file_of_several_parts_is_read_as_one(write):
    n = 3 * PART // 20
    rows = "".join(f"{i * 1e-3:.6f},{i % 7}.25,{i % 5}.5\n" for i in range(n))
    path = write("Time [s],Position [mm],Force [N]\n" + rows)
    signals = read_signals(path)
    assert len(signals.t) == n
    np.testing.assert_array_equal(signals.f, np.arange(n) % 5 + 0.5)
    with pytest.raises(InputError, match=f"line {n + 1}: 'Force .N.' is 'x'"):
        read_signals(write("Time [s],Position [mm],Force [N]\n" + rows[:-4] + "x\n"))


@pytest.mark.parametrize("place", [1, 63, 64, 65, 250, 499])
def test_an_odd_line_among_many_is_found_at_its_place(write, place):
    rows = [f"{i},{i},{i * 0.5}\n" for i in range(500)]
    header = "Time [s],Position [mm],Force [N]\n"
    with_comment = [*rows[:place], "# here\n", "\n", *rows[place:]]
    np.testing.assert_array_equal(read_signals(write(header + "".join(with_comment))).t, range(500))
    rows[place] = f"{place},{place},x\n"
    with pytest.raises(InputError, match=f"line {place + 2}: 'Force .N.' is 'x'"):
        read_signals(write(header + "".join(rows)))
