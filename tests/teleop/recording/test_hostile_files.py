"""MCAP files of other programs, damaged files, and malicious files."""

from __future__ import annotations

import json
import struct
import zlib
from io import BytesIO

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, DataEnd, Footer, Header, Metadata
from mcap.writer import CompressionType, Writer

from estimation.estimate_columns import estimators_in
from teleop.cli import main
from teleop.errors import InputError
from teleop.evaluation.reading.recorded import MEASURED, measured
from teleop.recording import mcap_checks
from teleop.recording.mcap_checks import message_size, read_event
from teleop.recording.mcap_reader import read_intact
from teleop.recording.recording import load
from teleop.recording.stream import RecordingStream
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

DEFINITION = "float64 time  # [s] since\nfloat64 x  # [m] displacement\n"


def written(path, *records):
    """Write a file with these records."""
    data = b"\x89MCAP0\r\n"
    for record in (Header(profile="ros2", library=""), *records, DataEnd(0), Footer(0, 0, 0)):
        builder = RecordBuilder()
        record.write(builder)
        data += builder.end()
    path.write_bytes(data + b"\x89MCAP0\r\n")
    return path


def chunk(data, compression="zstd", declared=None, compressed=None):
    """Return a chunk with these records."""
    compress = {"zstd": zstandard.compress, "lz4": lz4.frame.compress}.get(compression, bytes)
    return Chunk(
        compression=compression,
        data=compress(data) if compressed is None else compressed,
        message_start_time=0,
        message_end_time=0,
        uncompressed_crc=zlib.crc32(data),
        uncompressed_size=len(data) if declared is None else declared,
    )


def ros(path, compression=CompressionType.ZSTD, name="teleop/msg/Tick", text=DEFINITION, ticks=()):
    """Write a file as another program does, with a channel /tick and a channel of events."""
    with path.open("wb") as file:
        writer = Writer(file, compression=compression)
        writer.start("ros2")
        schema = writer.register_schema(name, "ros2msg", text.encode())
        channel = writer.register_channel("/tick", "cdr", schema)
        for number, tick in enumerate(ticks, start=1):
            writer.add_message(channel, 10**9 * number, tick, 10**9 * number, number)
        writer.finish()
    return path


def tick(t, *values):
    return b"\0\1\0\0" + struct.pack(f"<{1 + len(values)}d", t, *values)


def test_the_files_of_these_tests_are_built_like_recordings(tmp_path):
    for compression in CompressionType:
        path = ros(tmp_path / "a.mcap", compression, ticks=[tick(0.0, 1.0), tick(0.1, 2.0)])
        assert load(path)["x"].tolist() == [1.0, 2.0]


@pytest.mark.parametrize("declared", [8 << 30, 1000, 60 << 20])
@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_expands_no_further_than_it_declares_and_no_further_than_the_limit(
    tmp_path, refused, monkeypatch, compression, declared
):
    """80 MB of data compress to 3 kB with zstd."""
    taken = []
    decompressors = {
        name: lambda data, most, f=f: taken.append(len(found := f(data, most))) or found
        for name, f in mcap_checks.DECOMPRESSORS.items()
    }
    monkeypatch.setattr(mcap_checks, "DECOMPRESSORS", decompressors)
    bomb = chunk(bytes(80 << 20), compression, declared)
    error = refused("estimate", written(tmp_path / "bomb.mcap", bomb))
    assert "a chunk" in error
    assert max(taken, default=0) <= min(declared, mcap_checks.LARGEST_CHUNK) + 1


def test_the_ticks_of_all_chunks_are_bounded(tmp_path, monkeypatch):
    ticks = [tick(0.001 * i, 1.0) for i in range(20)]
    path = ros(tmp_path / "a.mcap", ticks=ticks)
    monkeypatch.setattr(mcap_checks, "LARGEST_TICKS", 100)
    for read in (load, read_intact):
        with pytest.raises(InputError, match="too large for this machine's memory"):
            read(path)


def test_a_record_longer_than_the_file_is_not_read(tmp_path, monkeypatch):
    """The length of a string in the record is also wrong."""
    asked = []
    read = mcap_checks.BoundedFile.read
    monkeypatch.setattr(
        mcap_checks.BoundedFile, "read", lambda s, n: asked.append(min(n, s.left)) or read(s, n)
    )
    path = ros(tmp_path / "a.mcap", ticks=[tick(0.0, 1.0)])
    data = path.read_bytes()
    head = struct.pack("<BQ", 0x0C, 1000) + struct.pack("<I", 0xFFFFFFF0) + bytes(996)
    path.write_bytes(data[:8] + head + data[8:])
    with pytest.raises(Exception, match=r"contains no ticks"):
        read_intact(path)
    assert max(asked) <= len(data) + len(head)


FOREIGN = [
    {"name": "geometry_msgs/msg/Twist", "text": "Vector3 linear\nVector3 angular"},
    {"name": "geometry_msgs/msg/Twist", "text": "float64 time\nfloat64 x"},
    {"text": "Vector3 linear\nVector3 angular"},
    {"text": "float64 time\nfloat64[] x"},
    {"text": "float64 x\nfloat64 time"},
    {"text": "float64 time\nfloat64 time"},
    {"text": "float64 time\nfloat64 x\x00"},
    {"text": "# float64 y\nfloat64 time\nfloat64 x"},
    {"text": "float64 time\n" + "".join(f"float64 x{i}\n" for i in range(5000))},
    {"text": f"float64 time\nfloat64 {'x' * 100}"},
    {"text": ""},
    {"ticks": [tick(0.0, 1.0, 2.0)]},
    {"ticks": [tick(float("nan"), 1.0)]},
    {"ticks": [tick(1e300, 1.0)]},
    {"ticks": [b"\0\0\0\0" + tick(0.0, 1.0)[4:]]},
    {"ticks": [b""]},
    {"ticks": []},
]
"""What differs from a recording of this program; each makes the file unreadable."""


@pytest.mark.parametrize(
    ("command", "foreign"),
    [
        *((command, foreign) for command in ("estimate", "recover") for foreign in FOREIGN),
        *((command, FOREIGN[0]) for command in ("report", "export", "lag")),
    ],
    ids=str,
)
def test_a_recording_of_another_program_is_refused_in_one_line(tmp_path, refused, foreign, command):
    path = ros(tmp_path / "a.mcap", **({"ticks": [tick(0.0, 1.0)]} | foreign))
    error = refused(command, path)
    assert "a.mcap" in error


@pytest.mark.parametrize("command", ["estimate", "report", "lag"])
def test_a_recording_without_a_column_that_is_needed_is_refused(tmp_path, refused, command):
    path = ros(tmp_path / "a.mcap", ticks=[tick(0.001 * i, 1.0) for i in range(20)])
    assert "the recording has no column" in refused(command, path)


@pytest.mark.parametrize("compression", ["zstd", "lz4", "brotli"])
def test_a_chunk_that_cannot_be_decompressed_is_reported(tmp_path, refused, compression):
    data = bytes(1000)
    for compressed in (b"", b"\xff" * 50, chunk(data, compression).data[:-12]):
        damaged = chunk(data, compression, compressed=compressed)
        error = refused("export", written(tmp_path / "a.mcap", damaged))
        assert "a chunk cannot be decompressed" in error or "expected zstd or lz4" in error


@pytest.mark.parametrize(
    "document",
    [
        "[" * 100_000,
        '{"a":' * 100_000,
        '{"a":' * 300 + "1" + "}" * 300,
        "[" * 300 + "]" * 300,
        "1" * 5000,
        '{"a": ' + "1" * 5000 + "}",
        "[]",
        "null",
    ],
    ids=lambda document: document[:12],
)
def test_settings_that_are_not_valid_json_are_reported(tmp_path, refused, document):
    path = ros(tmp_path / "a.mcap", ticks=[tick(0.0, 1.0)])
    record = RecordBuilder()
    Metadata(name="settings", metadata={"json": document}).write(record)
    data = path.read_bytes()
    path.write_bytes(data[:8] + record.end() + data[8:])
    assert "its settings cannot be read" in refused("export", path)
    with pytest.raises(ValueError, match=r"."):
        read_event(document.encode())


def test_sample_periods_too_short_for_any_machine_are_refused():
    block = {name: np.ones(3) for name in MEASURED} | {"x": np.ones(3)}
    with pytest.raises(InputError, match="paired_dt is not 1e-09 s or more"):
        measured(block | {"paired_dt": np.full(3, 1e-300)})


def test_a_recording_without_the_stiffness_of_an_estimator_lacks_the_estimator():
    assert estimators_in({"rls_b": np.zeros(1), "ai_b": np.zeros(1), "ai_k": np.zeros(1)}) == ["ai"]


def test_a_second_record_of_settings_is_reported(tmp_path, refused):
    path = ros(tmp_path / "a.mcap", ticks=[tick(0.0, 1.0)])
    record = RecordBuilder()
    Metadata(name="settings", metadata={"json": '{"bandwidth_hz": 20}'}).write(record)
    Metadata(name="settings", metadata={"json": '{"bandwidth_hz": 1}'}).write(record)
    data = path.read_bytes()
    path.write_bytes(data[:8] + record.end() + data[8:])
    assert "it contains its settings twice" in refused("export", path)


def test_a_recording_without_settings_is_not_run_again(tmp_path, refused):
    path = ros(tmp_path / "a.mcap", ticks=[tick(0.0, 1.0)])
    error = refused("run", "--config", path, "--no-record")
    assert f"{path}: the recording contains no settings" in error


@pytest.mark.parametrize(
    "changes",
    [
        {"time": None},
        {"time": "now"},
        {"time": 10**400},
        {"time": float("nan")},
        {"text": 3},
        {"fault": 3},
        {"fault": "stale"},
        {"fault": "stale", "source": [], "value": 1.0, "limit": 1.0, "since": 1.0},
        {"fault": "stale", "source": "x", "value": 10**400, "limit": 1.0, "since": 1.0},
    ],
    ids=str,
)
def test_an_invalid_event_is_refused(changes):
    good = {"time": 0.0, "text": "armed", "mode": "active", "fault": None}
    assert read_event(json.dumps(good).encode()) == good
    with pytest.raises(ValueError, match="an event|expected value"):
        read_event(json.dumps(good | changes).encode())


def test_the_size_of_a_message_follows_from_its_definition():
    assert message_size(DEFINITION) == 4 + 2 * 8


def test_a_chunk_is_decompressed_in_pieces():
    data = bytes(range(256)) * (3 * mcap_checks.PIECE // 256) + b"end"
    for compression in ("zstd", "lz4", ""):
        assert mcap_checks.chunk_data(chunk(data, compression)) == data
    assert mcap_checks.from_zstd(zstandard.compress(data), 5) == data[:5]
    assert BytesIO(mcap_checks.from_lz4(lz4.frame.compress(data), 5)).read() == data[:5]


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    """A short recorded trial."""
    path = tmp_path_factory.mktemp("trial") / "trial.mcap"
    run_trial(
        TrialSettings(clock="virtual", condition="autonomous", duration=0.8, estimators=("me",)),
        record=path,
    )
    return path


@pytest.mark.parametrize(
    ("keys", "value", "code"),
    [
        (("encoder_resolution_m",), 1e300, 2),
        (("encoder_resolution_m",), -1e308, 2),
        (("preset", "x_size"), 1e300, 2),
        (("preset", "grid", "k", "last"), 1e300, 2),
        (("preset", "forgetting_rate"), 0.0, 0),
    ],
)
def test_settings_of_any_magnitude_are_evaluated_or_refused(
    trial, capsys, monkeypatch, keys, value, code
):
    settings = RecordingStream(trial).settings
    part = settings
    for key in keys[:-1]:
        part = part[key]
    part[keys[-1]] = value
    monkeypatch.setattr(RecordingStream, "settings", settings)
    assert main(["estimate", str(trial)]) == code
    assert capsys.readouterr().err.count("\n") == (1 if code else 0)
