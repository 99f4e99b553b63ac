from __future__ import annotations

import errno
import json
import random
import re
import struct

import numpy as np
import pytest
from mcap.records import Channel, Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from teleop.cli import main
from teleop.errors import InputError
from teleop.recording import mcap_checks
from teleop.recording.mcap_reader import read_intact
from teleop.recording.mcap_writer import TICKS, Disk, McapFile
from teleop.recording.recording import load, load_intact
from teleop.streams.message import FIELD

RECORD = struct.Struct("<BQ")
"""Head of a record: opcode and length."""
MAGIC = 8
FLUSHED = 50
"""Number of ticks in a chunk."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a recording of a trial in many chunks, as a run in real time writes it."""
    folder = tmp_path_factory.mktemp("trial")
    command = ["run", "--clock", "virtual", "--duration", "0.3", "--rate", "500"]
    assert main([*command, "--record", f"{folder}/a.mcap"]) == 0
    contents = read_intact(folder / "a.mcap")
    path = folder / "whole.mcap"
    fields = FIELD.findall(contents.definition)
    file = McapFile(path, fields, contents.definition, contents.metadata)
    file.begin(contents.start)
    events = contents.events[1:]
    size = 4 + 8 * len(fields)
    for number, place in enumerate(range(0, len(contents.messages), size)):
        message = bytes(contents.messages[place : place + size])
        (t,) = struct.unpack_from("<4xd", message)
        while events and events[0]["time"] < t:
            file.event(events.pop(0))
        file.tick(message, t)
        if number % FLUSHED == FLUSHED - 1:
            file.flush()
    for event in events:
        file.event(event)
    file.close()
    return path


@pytest.fixture(scope="module")
def recording(whole):
    return load(whole)


@pytest.fixture(scope="module")
def records(whole):
    """Yield position, opcode and end of each record."""
    data = whole.read_bytes()
    found, place = [], MAGIC
    while place < len(data) - MAGIC:
        opcode, length = RECORD.unpack_from(data, place)
        found.append((place, opcode, place + RECORD.size + length))
        place = found[-1][2]
    return found


@pytest.fixture(scope="module")
def first_tick_chunk(records):
    """Return the end of the first chunk with ticks."""
    return [end for _, opcode, end in records if opcode == 6][1]


@pytest.fixture
def cut(whole, tmp_path):
    def cut(length):
        path = tmp_path / f"cut-{length}.mcap"
        path.write_bytes(whole.read_bytes()[:length])
        return path

    return cut


def ticks_before(path):
    """Return the ticks in the complete chunks of a file, read by the MCAP library only."""
    count, ticks = 0, None
    size = path.stat().st_size
    with path.open("rb") as file:
        records = StreamReader(file, emit_chunks=True).records
        while True:
            try:
                record = next(records)
            except Exception:
                return count
            if not isinstance(record, Chunk) or file.tell() > size:
                continue
            try:
                parts = breakup_chunk(record, validate_crc=True)
            except Exception:
                return count
            ticks = next(
                (p.id for p in parts if isinstance(p, Channel) and p.topic == TICKS), ticks
            )
            count += sum(isinstance(p, Message) and p.channel_id == ticks for p in parts)


def bits(column):
    return column.view(np.uint64)


def assert_prefix(part, recording):
    assert list(part.columns) == list(recording.columns)
    for name, column in part.columns.items():
        assert np.array_equal(bits(column), bits(recording[name][: len(part)])), name
    assert part.events == recording.events[: len(part.events)]


def assert_equal(a, b):
    assert_prefix(a, b)
    assert len(a) == len(b)
    assert (a.units, a.events, a.session, a.settings) == (b.units, b.events, b.session, b.settings)


def log_times(path):
    with path.open("rb") as file:
        return sorted(
            (message.channel_id, message.sequence, message.log_time)
            for message in StreamReader(file).records
            if isinstance(message, Message)
        )


@pytest.mark.parametrize("seed", range(40))
def test_the_rest_of_a_truncated_file_is_a_prefix_and_is_recovered_exactly(
    whole, recording, records, first_tick_chunk, cut, capsys, seed
):
    path = cut(random.Random(seed).randrange(first_tick_chunk, whole.stat().st_size))
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"its end is missing.*teleop recover"):
        load(path)
    part = load_intact(path)
    assert_prefix(part, recording)
    assert len(part) == ticks_before(path) > 0

    capsys.readouterr()
    assert main(["recover", str(path)]) == 0
    out = path.with_name(f"{path.stem}-recovered.mcap")
    assert capsys.readouterr().out == (
        f"{out}: {len(part)} ticks, {part['time'][-1]:.3f} s, "
        "the rest was cut off (its end is missing)\n"
    )
    assert path.read_bytes() == before
    assert_equal(load(out), part)


def test_a_file_truncated_after_any_record_keeps_everything_before_it(
    recording, records, first_tick_chunk, cut
):
    for _, _, end in records:
        if end >= first_tick_chunk:
            assert read_intact(cut(end)).damage == "its end is missing"
            part = load_intact(cut(end))
            assert_prefix(part, recording)
            assert len(part) == ticks_before(cut(end))


def test_a_recovered_recording_keeps_the_times_at_which_messages_were_logged(
    whole, records, cut, tmp_path
):
    data_end = next(place for place, opcode, _ in records if opcode == 15)
    path = cut(data_end)
    assert main(["recover", str(path), "--out", str(tmp_path / "out.mcap")]) == 0
    assert log_times(tmp_path / "out.mcap") == log_times(whole)
    assert read_intact(tmp_path / "out.mcap").start == read_intact(whole).start


def test_without_an_intact_tick_an_error_is_reported_and_nothing_is_written(
    refused, whole, records, first_tick_chunk, cut
):
    for length in [0, 3, MAGIC, *(end for _, _, end in records), first_tick_chunk - 1]:
        if length < first_tick_chunk:
            path = cut(length)
            err = refused("recover", path)
            assert "contains no ticks" in err or "not an MCAP file" in err
            assert not path.with_name(f"{path.stem}-recovered.mcap").exists()
            with pytest.raises(InputError):
                load(path)


def test_a_complete_recording_is_not_changed(whole, recording, tmp_path, capsys):
    out = tmp_path / "out.mcap"
    assert main(["recover", str(whole), "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert text.startswith(f"{whole}: the file is intact")
    assert text.count("\n") == 1
    assert not out.exists()
    assert main(["recover", str(whole), "--out", str(out), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["out"], document["damage"]) == (None, "")
    assert document["ticks"] == len(recording)
    assert not out.exists()


def test_json_is_one_document(recording, first_tick_chunk, cut, tmp_path, capsys):
    path, out = cut(first_tick_chunk + 1), tmp_path / "out.mcap"
    assert main(["recover", str(path), "--out", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "file": str(path),
        "out": str(out),
        "ticks": FLUSHED,
        "duration_s": recording["time"][FLUSHED - 1],
        "damage": "its end is missing",
        "missing_ticks": [],
    }


def test_a_file_that_exists_is_not_overwritten(refused, first_tick_chunk, cut, tmp_path):
    path, out = cut(first_tick_chunk), tmp_path / "out.mcap"
    out.write_bytes(b"precious")
    before = path.read_bytes()
    assert "exists already" in refused("recover", path, "--out", out)
    assert "exists already" in refused("recover", path, "--out", path)
    assert out.read_bytes() == b"precious"
    assert path.read_bytes() == before


def test_a_missing_folder_and_a_full_disk_are_reported(
    refused, first_tick_chunk, cut, tmp_path, monkeypatch
):
    path, out = cut(first_tick_chunk), tmp_path / "out.mcap"
    missing = tmp_path / "none" / "out.mcap"
    assert "cannot be written" in refused("recover", path, "--out", missing)

    def full(self, data):
        self.error = self.error or OSError(errno.ENOSPC, "No space left on device")
        raise self.error

    monkeypatch.setattr(Disk, "write", full)
    err = refused("recover", path, "--out", out)
    assert "cannot be written: no space left on device" in err
    assert not out.exists()


def flipped(whole, tmp_path, place, bit):
    data = bytearray(whole.read_bytes())
    data[place] ^= bit
    path = tmp_path / "flipped.mcap"
    path.write_bytes(data)
    return path


def assert_refused_or_same(path, recording):
    """Check that a damaged file loads unchanged or is refused, and its intact part is a prefix."""
    message = ""
    try:
        loaded = load(path)
    except InputError as error:
        message = str(error)
    if not message:
        assert_equal(loaded, recording)
        return
    assert re.search(r"teleop recover|contains no ticks|not an MCAP file", message)
    try:
        contents = read_intact(path)
    except InputError:
        return
    assert contents.damage
    size = 4 + 8 * len(FIELD.findall(contents.definition))
    part = load_intact(path)
    assert len(contents.messages) == size * len(part)
    assert_prefix(part, recording)


def test_a_flipped_byte_is_refused_or_harmless(whole, recording, tmp_path):
    draw = random.Random(1)
    for _ in range(300):
        place, bit = draw.randrange(whole.stat().st_size), draw.randrange(1, 256)
        assert_refused_or_same(flipped(whole, tmp_path, place, bit), recording)


def test_a_flipped_bit_in_any_records_head_is_refused_or_harmless(
    whole, recording, records, tmp_path
):
    draw = random.Random(2)
    for start, _, _ in records:
        heads = [(start, 1 << i) for i in range(8)]
        heads += [(start + i, 1 << draw.randrange(8)) for i in draw.sample(range(1, 9), 2)]
        for place, bit in heads:
            assert_refused_or_same(flipped(whole, tmp_path, place, bit), recording)


def test_a_lost_chunk_keeps_everything_before_it(whole, recording, records, cut, tmp_path):
    """An unknown opcode hides a chunk; the ticks after it must not follow those before it."""
    chunks = [place for place, opcode, _ in records if opcode == 6]
    data_end = next(place for place, opcode, _ in records if opcode == 15)
    for place in chunks[2:-1]:
        path = flipped(whole, tmp_path, place, 0x80)
        path.write_bytes(path.read_bytes()[:data_end])
        contents = read_intact(path)
        assert "are missing before number" in contents.damage
        part = load_intact(path)
        assert_prefix(part, recording)
        assert 0 < len(part) < len(recording)
        out = tmp_path / f"{place}.mcap"
        assert main(["recover", str(path), "--out", str(out)]) == 0
        assert len(load(out)) == len(part)


def test_a_recording_whose_settings_are_damaged_keeps_its_ticks(whole, recording, tmp_path, capsys):
    place = whole.read_bytes().index(b'{"condition"')
    path = flipped(whole, tmp_path, place, 0x01)
    with pytest.raises(InputError, match=r"its settings cannot be read.*teleop recover"):
        load(path)
    out = tmp_path / "out.mcap"
    assert main(["recover", str(path), "--out", str(out)]) == 0
    assert "its settings cannot be read" in capsys.readouterr().out
    recovered = load(out)
    assert_prefix(recovered, recording)
    assert len(recovered) == len(recording)
    assert recovered.events == recording.events
    assert recovered.session == recording.session
    assert recovered.settings == {}


def test_a_recording_without_its_first_event_is_read_as_far_as_it_is_intact(
    whole, recording, records, tmp_path
):
    first = next(place for place, opcode, _ in records if opcode == 6)
    path = flipped(whole, tmp_path, first, 0x80)
    contents = read_intact(path)
    assert contents.start == read_intact(whole).start
    out = tmp_path / "out.mcap"
    assert main(["recover", str(path), "--out", str(out)]) == 0
    assert_prefix(load(out), recording)


def test_a_recording_that_is_larger_than_the_memory_is_recovered(
    whole, recording, cut, tmp_path, monkeypatch
):
    path, out = cut(whole.stat().st_size * 2 // 3), tmp_path / "out.mcap"
    with monkeypatch.context() as patch:
        patch.setattr(mcap_checks, "LARGEST_TICKS", FLUSHED)
        assert main(["recover", str(path), "--out", str(out)]) == 0
    recovered = load(out)
    assert_prefix(recovered, recording)
    assert len(recovered) > FLUSHED
