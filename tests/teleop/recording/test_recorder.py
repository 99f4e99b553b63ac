"""The recorder process: pushed ticks are recorded, and its problems do not affect the loop."""

from __future__ import annotations

import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import scipy
from teleop.recording.process import FLUSH

from estimation import paper_preset
from teleop.errors import InputError
from teleop.recording.mcap_reader import read_intact
from teleop.recording.recorder import RecorderProcess
from teleop.recording.recording import load
from teleop.safety import Event, Fault, Mode
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.columns import Layout
from teleop.trial.run import run_trial

QUICK = TrialSettings(clock="virtual", duration=1.0)
LAYOUT = Layout(paper_preset().bank())
METADATA = {"session": {"software": "a test"}, "settings": {"json": "{}"}}


def message(t: float) -> bytes:
    return LAYOUT._struct.pack(b"\0\1\0\0", t, *range(1, len(LAYOUT.columns)))


def recorder(path, wait=True, **options):
    sink = RecorderProcess(path, LAYOUT, METADATA, duration=1.0, show=False, wait=wait, **options)
    sink.begin(10**18)
    return sink


def suspended_recorder(path):
    if not hasattr(signal, "SIGSTOP"):
        pytest.skip("needs SIGSTOP")
    sink = recorder(path, wait=False)
    sink.process.send_signal(signal.SIGSTOP)
    return sink


def test_every_tick_and_event_is_read_back_unchanged(tmp_path):
    path = tmp_path / "a.mcap"
    sink = recorder(path)
    for i in range(5000):
        sink.push(message(i * 1e-3))
    sink.event(Event(2.5, Mode.FAULT, "contact force jumped", Fault.JUMP, "contact_force", 9.0))
    outcome = sink.close()
    assert (outcome.pushed, outcome.dropped, outcome.problem) == (5000, 0, "")
    recording = load(path)
    np.testing.assert_array_equal(recording["time"], np.arange(5000) * 1e-3)
    for i, column in enumerate(LAYOUT.columns[1:], start=1):
        assert (recording[column.name] == i).all()
        assert recording.units[column.name] == column.unit
    assert recording.session == {"software": "a test"}
    fault = recording.events[-1]
    assert (fault["time"], fault["fault"], fault["mode"]) == (2.5, "impossible jump", "fault")
    assert (fault["source"], fault["value"], fault["limit"]) == ("contact_force", 9.0, None)


def test_another_library_reads_every_tick_by_name(tmp_path):
    reader = pytest.importorskip("mcap.reader")
    decoder = pytest.importorskip("mcap_ros2.decoder")
    path = tmp_path / "a.mcap"
    trial = run_trial(QUICK, path)
    with path.open("rb") as file:
        foreign = reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()])
        ticks = [(m, d) for _, _, m, d in foreign.iter_decoded_messages(topics=["/tick"])]
        metadata = {record.name: record.metadata for record in foreign.iter_metadata()}
        summary = foreign.get_summary()
    assert len(ticks) == len(trial.recording)
    for name, column in trial.recording.columns.items():
        np.testing.assert_array_equal([getattr(tick, name) for _, tick in ticks], column)
    apart = np.diff([record.log_time for record, _ in ticks])
    assert (apart == 1_000_000).all()
    zero = next(record.log_time for record, tick in ticks if tick.time >= 0.0)
    assert abs(zero - time.time_ns()) < 20e9
    assert metadata["session"]["software"].startswith("teleop ")
    assert f"numpy {np.__version__}, scipy {scipy.__version__}" in metadata["session"]["libraries"]
    assert json.loads(metadata["settings"]["json"])["seed"] == 0
    channel = next(c for c in summary.channels.values() if c.topic == "/tick")
    assert channel.metadata == trial.recording.units
    assert summary.schemas[channel.schema_id].encoding == "ros2msg"
    log = next(s for s in summary.schemas.values() if s.name == "foxglove.Log")
    assert log.encoding == "jsonschema"


def test_the_file_grows_while_the_loop_runs(tmp_path):
    path = tmp_path / "a.mcap"
    sink = recorder(path)
    for i in range(300):
        sink.push(message(i * 1e-3))
        time.sleep(1e-3)
    time.sleep(2 * FLUSH)
    kept = len(read_intact(path).messages) // LAYOUT.size
    assert kept >= 200
    sink.close()


def test_a_killed_recorder_is_reported_and_its_flushed_data_are_kept(tmp_path):
    path = tmp_path / "a.mcap"
    sink = recorder(path)
    for i in range(2000):
        sink.push(message(i * 1e-3))
    time.sleep(2 * FLUSH)
    sink.process.kill()
    sink.process.wait()
    for i in range(2000, 2100):
        sink.push(message(i * 1e-3))
    assert sink.close().problem == "the recorder was killed"
    kept = len(read_intact(path).messages) // LAYOUT.size
    assert kept >= 1800
    with pytest.raises(InputError, match=f"teleop recover {path}"):
        load(path)


def test_a_suspended_recorder_loses_ticks_but_does_not_delay_the_loop(tmp_path):
    sink = suspended_recorder(tmp_path / "a.mcap")
    for i in range(30_000):
        sink.push(message(i * 1e-3))
    assert sink.dropped > 10_000
    sink.event(Event(9.0, Mode.FAULT, "it matters most", Fault.JUMP))
    sink.push(message(20.0))
    sink.process.send_signal(signal.SIGCONT)
    outcome = sink.close()
    assert outcome.pushed + outcome.dropped == 30_001
    assert outcome.problem == ""
    recording = load(tmp_path / "a.mcap")
    assert len(recording) == outcome.pushed
    assert recording.events[-1]["text"] == "it matters most"


def test_a_recorder_that_pauses_for_some_seconds_loses_no_tick(tmp_path):
    sink = suspended_recorder(tmp_path / "a.mcap")
    for i in range(8000):
        sink.push(message(i * 1e-3))
    sink.event(Event(8.0, Mode.FAULT, "in the pause", Fault.JUMP))
    sink.process.send_signal(signal.SIGCONT)
    for i in range(8000, 8500):
        sink.push(message(i * 1e-3))
        time.sleep(1e-3)
    outcome = sink.close()
    assert (outcome.pushed, outcome.dropped, outcome.problem) == (8500, 0, "")
    recording = load(tmp_path / "a.mcap")
    np.testing.assert_array_equal(recording["time"], [i * 1e-3 for i in range(8500)])
    assert recording.events[-1]["text"] == "in the pause"


class Wide:
    """A layout with messages larger than PIPE_BUF, which the system may split."""

    columns = tuple(
        ({0: "time", 1: "contact"}.get(i, f"column_{i}"), "-", "a test") for i in range(1500)
    )
    estimators = ()
    size = 4 + 8 * len(columns)
    definition = "".join(f"float64 {name}  # [-] a test\n" for name, *_ in columns)


def test_a_tick_that_is_written_to_the_pipe_in_parts_is_recorded_whole(tmp_path, monkeypatch):
    monkeypatch.setattr("teleop.recording.recorder.BACKLOG", 1 << 18)
    if not hasattr(signal, "SIGSTOP"):
        pytest.skip("needs SIGSTOP")
    path = tmp_path / "a.mcap"
    sink = RecorderProcess(path, Wide(), METADATA, duration=1.0, show=False, wait=False)
    sink.begin(10**18)
    pushed = []
    for number in range(300):
        if number == 50:
            sink.process.send_signal(signal.SIGSTOP)
        if number == 250:
            sink.event(Event(0.25, Mode.FAULT, "in between", Fault.JUMP))
            sink.process.send_signal(signal.SIGCONT)
        if number > 250:
            time.sleep(2e-3)
        before = sink.dropped
        sink.push(b"\0\1\0\0" + np.full(1500, float(number)).tobytes())
        if sink.dropped == before:
            pushed.append(float(number))
    assert 0 < sink.dropped < 250
    assert sink.close().problem == ""
    recording = load(path)
    for name in ("time", "column_1499"):
        np.testing.assert_array_equal(recording[name], pushed)
    assert recording.events[-1]["text"] == "in between"


def test_a_recorder_that_hangs_does_not_block_the_end(tmp_path, monkeypatch):
    monkeypatch.setattr("teleop.recording.recorder.TIMEOUT", 0.5)
    sink = suspended_recorder(tmp_path / "a.mcap")
    for i in range(10_000):
        sink.push(message(i * 1e-3))
    sink.event(Event(9.0, Mode.FAULT, "not recorded", Fault.JUMP))
    assert sink.close().problem == "the recorder was killed"


def test_the_signals_of_the_terminal_do_not_reach_the_recorder(tmp_path):
    path = tmp_path / "a.mcap"
    sink = recorder(path)
    assert os.getpgid(sink.process.pid) != os.getpgid(0)
    sink.push(message(0.0))
    assert sink.close().problem == ""
    assert len(load(path)) == 1


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_reported_and_does_not_stop_the_run(tmp_path, capfd):
    sink = recorder(Path("/dev/full"), overwrite=True)
    for i in range(3000):
        sink.push(message(i * 1e-3))
        if i % 1000 == 0:
            time.sleep(0.1)
    outcome = sink.close()
    assert outcome.problem == "no space left on device"
    assert outcome.pushed == 3000
    expected = "teleop: /dev/full: no space left on device: the run continues\n"
    assert capfd.readouterr().err == expected


def test_a_file_that_cannot_be_written_is_refused_before_anything_moves(tmp_path):
    with pytest.raises(InputError, match="recording failed: no such file"):
        recorder(tmp_path / "nowhere" / "a.mcap")


def test_an_event_of_any_length_passes_through_the_pipe_whole(tmp_path):
    sink = recorder(tmp_path / "a.mcap")
    text = "\N{GREEK SMALL LETTER TAU}" * 10_000
    sink.event(Event(0.0, Mode.FAULT, text, Fault.RIG_FAILURE, text, math.inf))
    sink.push(message(0.0))
    sink.close()
    recording = load(tmp_path / "a.mcap")
    assert recording.events[-1]["text"] == text[:400]
    assert len(recording) == 1


def run_of(path, damage):
    sink = recorder(path)
    for i in range(100):
        sink.push(message(i * 1e-3))
    time.sleep(0.2)
    damage()
    for i in range(100, 200):
        sink.push(message(i * 1e-3))
    return sink.close()


def test_a_recording_that_was_removed_is_reported(tmp_path):
    path = tmp_path / "a.mcap"
    outcome = run_of(path, path.unlink)
    assert outcome.problem == "the file was removed during the run"
    assert not outcome.at_path
    assert not path.exists()


def test_a_recording_whose_folder_was_removed_is_reported(tmp_path):
    path = tmp_path / "day" / "a.mcap"
    path.parent.mkdir()
    outcome = run_of(path, lambda: shutil.rmtree(path.parent))
    assert outcome.problem == "the file was removed during the run"


def test_a_recording_that_another_file_replaced_is_reported_and_the_other_file_kept(tmp_path):
    path, other = tmp_path / "a.mcap", tmp_path / "b.mcap"
    other.write_bytes(b"precious")
    outcome = run_of(path, lambda: other.replace(path))
    assert outcome.problem == "the file was removed during the run"
    assert not outcome.at_path
    assert path.read_bytes() == b"precious"


def test_a_recording_that_was_moved_is_reported_and_is_complete_where_it_is(tmp_path):
    path, other = tmp_path / "a.mcap", tmp_path / "b.mcap"
    outcome = run_of(path, lambda: path.replace(other))
    assert outcome.problem == "the file was moved, or its file system was unmounted, during the run"
    assert len(load(other)) == 200


def test_a_removed_recording_is_reported_while_the_run_continues(tmp_path, capfd):
    path = tmp_path / "a.mcap"
    sink = recorder(path)
    sink.push(message(0.0))
    path.unlink()
    expected = f"teleop: {path}: the file was removed during the run: the run continues\n"
    shown = ""
    for _ in range(100):
        if shown := capfd.readouterr().err:
            break
        time.sleep(0.1)
    assert shown == expected
    sink.close()


def test_a_recording_without_a_tick_is_removed(tmp_path):
    path = tmp_path / "a.mcap"
    assert recorder(path).close().problem == ""
    assert not path.exists()
    other = tmp_path / "b.mcap"
    sink = recorder(path)
    other.write_bytes(b"precious")
    other.replace(path)
    sink.close()
    assert path.read_bytes() == b"precious"


def test_a_link_whose_target_does_not_exist_is_refused_and_stays(tmp_path):
    link, target = tmp_path / "a.mcap", tmp_path / "b.mcap"
    link.symlink_to(target)
    with pytest.raises(InputError, match="file exists"):
        recorder(link)
    assert link.is_symlink()
    assert not target.exists()


KILLED = """
import os, signal, sys
from pathlib import Path
from tests_recorder import recorder, message
for ticks in map(int, sys.argv[1:]):
    if not os.fork():
        sink = recorder(Path(f"{ticks}.mcap"), wait=False)
        for i in range(ticks):
            sink.push(message(i * 1e-3))
        os.kill(os.getpid(), signal.SIGKILL)
    assert os.WTERMSIG(os.wait()[1]) == signal.SIGKILL
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_killed_controller_loses_no_tick_that_it_pushed(tmp_path):
    numbers = (1, 79, 1500)
    (tmp_path / "tests_recorder.py").write_text(Path(__file__).read_text(encoding="utf-8"))
    victims = subprocess.run(
        [sys.executable, "-c", KILLED, *map(str, numbers)],
        cwd=tmp_path,
    )
    assert victims.returncode == 0
    for ticks in numbers:
        recording = loaded(tmp_path / f"{ticks}.mcap")
        np.testing.assert_array_equal(recording["time"], np.arange(ticks) * 1e-3)


def loaded(path):
    """Load a recording as soon as its recorder has written it."""
    end = time.monotonic() + 10.0
    while True:
        try:
            return load(path)
        except InputError:
            if time.monotonic() > end:
                raise
            time.sleep(0.05)
