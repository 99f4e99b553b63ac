"""A crash, a hang or a lack of memory of a foreign library ends only the process that reads."""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import time
import zipfile

import pytest
import scipy.io
from mcap.writer import CompressionType, Writer

from teleop.errors import InputError
from teleop.evaluation.formats import reader_process
from teleop.evaluation.reading.signals import read_signals

from ....forked_command import start_command

HEAD = b"PK\x03\x04"
"""First bytes of a spreadsheet."""
REASONS = {
    "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)": "ended with SIGSEGV",
    "import os; os.abort()": "ended with SIGABRT",
    "raise SystemExit(0)": "ended with exit code 0",
    "import os; os._exit(7)": "ended with exit code 7",
    "bytes(1 << 45)": "it needs more memory than",
    "import time; time.sleep(600)": "not done after 1 s",
    "def f(): f()\nf()": "maximum recursion depth exceeded",
    "print('noise')\nimport os; os.write(1, b'noise')\nraise ImportError": "needs python-calamine",
    "raise TypeError('two\\nlines')": "two lines",
}
"""What a library can do, and the text that is reported."""


@pytest.mark.skipif(os.name != "posix", reason="exit codes contain signals")
@pytest.mark.parametrize("code", REASONS, ids=lambda code: code[:30])
def test_what_a_library_does_is_one_line(tmp_path, refused, library, monkeypatch, code):
    monkeypatch.setattr(
        reader_process, "SHORTEST_LIMIT", 1.0 if "not done" in REASONS[code] else 60
    )
    library("python_calamine", code)
    path = tmp_path / "data.xlsx"
    path.write_bytes(HEAD)
    message = refused("estimate", path)
    assert REASONS[code] in message
    assert str(path) in message or "pip install" in message


@pytest.mark.skipif(os.name != "posix", reason="sends SIGINT")
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_command_that_is_stopped_ends_its_reader(tmp_path, library, ending):
    started = tmp_path / "started"
    code = f"import os, time; open({str(started)!r}, 'w').write(str(os.getpid())); time.sleep(600)"
    library("python_calamine", code)
    path = tmp_path / "data.xlsx"
    path.write_bytes(HEAD)
    process = start_command("estimate", path)
    try:
        while not (started.exists() and started.read_text()):
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(ending)
        assert process.wait() == (-signal.SIGKILL if ending == signal.SIGKILL else 130)
    finally:
        process.kill()
        process.wait()
    reader = int(started.read_text())
    checks = 0
    while is_running(reader):  # after SIGKILL, the reader notices it itself
        assert (checks := checks + 1) < 4000, "the reader only ends at its limit of time"
        time.sleep(0.01)


def is_running(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


PACKAGE = "http://schemas.openxmlformats.org/package/2006"
CONTENT_TYPES = (
    f'<Types xmlns="{PACKAGE}/content-types"><Default Extension="rels" ContentType="application/'
    'vnd.openxmlformats-package.relationships+xml"/><Default Extension="xml" '
    'ContentType="application/xml"/><Override PartName="/xl/workbook.xml" ContentType="'
    'application/vnd.openxmlformats-officedocument.spreadsheetml.sheet.main+xml"/></Types>'
)
MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
RELATIONS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"


def workbook(path, sheet, **files):
    """Write a workbook whose only sheet has this content."""
    parts = {
        "[Content_Types].xml": CONTENT_TYPES,
        "_rels/.rels": f'<Relationships xmlns="{PACKAGE}/relationships"><Relationship Id="r1" '
        f'Type="{RELATIONS}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{MAIN}" xmlns:r="{RELATIONS}"><sheets>'
        '<sheet name="s" sheetId="1" r:id="r1"/></sheets></workbook>',
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{PACKAGE}/relationships">'
        f'<Relationship Id="r1" Type="{RELATIONS}/worksheet" Target="worksheets/sheet1.xml"/>'
        "</Relationships>",
        "xl/worksheets/sheet1.xml": f'<worksheet xmlns="{MAIN}"><sheetData>{sheet}</sheetData>'
        "</worksheet>",
    }
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in (parts | files).items():
            file.writestr(name, content)
    return path


def test_a_workbook_with_a_cell_in_each_corner_is_refused(tmp_path, refused):
    """The library requests memory for 16384 x 1048576 cells, and ends the process."""
    corners = "A1", "XFD1048576"
    cells = "".join(f'<row><c r="{corner}"><v>1</v></c></row>' for corner in corners)
    path = workbook(tmp_path / "corners.xlsx", cells)
    assert path.stat().st_size < 2000
    message = refused("estimate", path)
    assert "corners.xlsx: cannot be read as a spreadsheet: the reader ended with" in message


def test_a_workbook_that_expands_to_more_than_the_memory_limit_is_refused(
    tmp_path, refused, monkeypatch
):
    monkeypatch.setattr(reader_process, "memory_limit", lambda size: 350 << 20)
    path = workbook(tmp_path / "bomb.xlsx", ("<row>" + "<c><v>1</v></c>" * 16384 + "</row>") * 200)
    assert path.stat().st_size < 1 << 20
    message = refused("estimate", path)
    assert "the reader ended with" in message or "it needs more memory than" in message


@pytest.mark.skipif(sys.platform != "linux", reason="the limit of memory is that of Linux")
def test_a_small_file_cannot_fill_the_memory_of_the_machine(tmp_path, refused):
    """Each dataset has 8 GB, of which nothing is written."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "never-written.h5"
    with h5py.File(path, "w") as file:
        for name in ("time [s]", "position [m]", "force [N]"):
            file.create_dataset(name, (10**9,), "f8", chunks=(1 << 20,))
    assert path.stat().st_size < 1 << 20
    assert "more memory than 2.0 GiB" in refused("estimate", path)


def test_a_large_file_may_use_half_of_the_memory_of_the_machine(monkeypatch):
    monkeypatch.setattr(reader_process, "machine_memory", lambda: 64 << 30)
    assert reader_process.memory_limit(100 << 20) == 32 << 30


def write_table(path, columns):
    """Write columns by name, in the format of the ending of the file name."""
    if path.suffix == ".parquet":
        pyarrow = pytest.importorskip("pyarrow")
        pytest.importorskip("pyarrow.parquet").write_table(pyarrow.table(columns), path)
    elif path.suffix == ".mat":
        scipy.io.savemat(path, columns, do_compression=True)
    elif path.suffix == ".h5":
        with pytest.importorskip("h5py").File(path, "w") as file:
            for name, values in columns.items():
                file.create_dataset(name, data=values, compression="gzip")
    elif path.suffix == ".tdms":
        nptdms = pytest.importorskip("nptdms")
        with nptdms.TdmsWriter(path) as file:
            channels = [nptdms.ChannelObject("g", *column) for column in columns.items()]
            file.write_segment(channels)
    elif path.suffix == ".mcap":
        with path.open("wb") as file:
            writer = Writer(file, compression=CompressionType.LZ4)
            writer.start()
            channel = writer.register_channel("/a", "json", 0)
            for i, row in enumerate(zip(*columns.values(), strict=True)):
                data = json.dumps(dict(zip(columns, row, strict=True))).encode()
                writer.add_message(channel, i * 10**7, data, i * 10**7)
            writer.finish()
    else:
        pytest.importorskip("python_calamine")
        rows = zip(*columns.values(), strict=True)
        cells = ("".join(f"<c><v>{value!r}</v></c>" for value in row) for row in rows)
        names = "".join(f'<c t="str"><v>{name}</v></c>' for name in columns)
        workbook(path, "".join(f"<row>{row}</row>" for row in (names, *cells)))


DAMAGES = {
    "truncated": lambda data, at: data[:at],
    "lying size": lambda data, at: data[:at] + b"\xff" * 8 + data[at + 8 :],
    "flipped": lambda data, at: data[:at] + bytes([data[at] ^ 255]) + data[at + 1 :],
    "repeated": lambda data, at: data[:at] + data,
}
"""How a file is damaged, at a given place."""


ENDINGS = [".parquet", ".mat", ".h5", ".tdms", ".mcap", ".xlsx"]


@pytest.mark.parametrize(("number", "ending"), [*enumerate(ENDINGS)], ids=ENDINGS)
def test_damaged_files_are_read_or_refused_in_one_line(tmp_path, number, ending):
    """A damaged number can still be a number. Each format has two of the damages."""
    t = [0.01 * i for i in range(60)]
    columns = {"time_s": t, "position_mm": [v % 0.3 for v in t], "force_N": [v % 0.2 for v in t]}
    path = tmp_path / f"whole{ending}"
    write_table(path, columns)
    assert len(read_signals(path, time="1=s" if ending == ".mcap" else None).t) == 60
    data = path.read_bytes()
    places = random.Random(ending)
    for name in list(DAMAGES)[number % 2 :: 2]:
        damage = DAMAGES[name]
        path = tmp_path / f"{name}{ending}"
        path.write_bytes(damage(data, places.randrange(8, len(data) - 8)))
        message = str(path)
        try:
            read_signals(path)
        except InputError as error:
            message = str(error)
        assert str(path) in message
        assert "\n" not in message
