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

from estimation import paper_preset
from teleop.errors import InputError
from teleop.recording.recorder import FLUSH
from teleop.recording.recording import load, load_intact
from teleop.safety import Event, Fault, Mode
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.child_process import ChildProcess
from teleop.streams.columns import Layout
from teleop.trial.readers import outcome_of
from teleop.trial.run import run_trial

from ..streams.filled import FilledStream

QUICK = TrialSettings(clock="virtual", duration=1.0)
LAYOUT = Layout(paper_preset().bank())
METADATA = {"session": {"software": "a test"}, "settings": {"json": "{}"}}


class Recording:
    """A recorder in another process, and the stream that it reads."""

    def __init__(self, path, ticks=10_000, overwrite=False):
        self.path, self.closed = path, False
        self.stream = FilledStream(LAYOUT, ticks, shared=True)
        self.process = ChildProcess("teleop.recording.recorder", f"{path}: recording failed")
        session = {
            "path": str(path),
            "metadata": METADATA,
            "overwrite": overwrite,
            "duration": 1.0,
            **{"show": False, "hint": "", "instructions": "", "cue": None},
            "stream": self.stream.document,
            "start": 10**18,
        }
        try:
            self.process.begin(session)
        except InputError:
            self.stream.unlink()
            raise

    def push(self, *numbers, pause=0.0):
        """Write ticks at their number [ms]."""
        for number in numbers:
            self.stream.fill(self.stream.row(number * 1e-3))
            if pause:
                time.sleep(pause)

    def event(self, *parts):
        self.stream.event(Event(*parts))

    def send(self, signal_number):
        os.kill(self.process.pid, signal_number)

    def close(self, timeout=20.0):
        self.closed = True
        *_, status = self.process.finish(timeout) or [{"problem": "the recorder was killed"}]
        self.stream.unlink()
        return outcome_of(str(self.path), status)


@pytest.fixture
def recorder():
    """Return a function that starts a recorder, which is ended after the test."""
    started = []

    def start(path, **options):
        started.append(Recording(path, **options))
        return started[-1]

    yield start
    for one in started:
        if not one.closed:
            one.send(signal.SIGKILL)
            one.close()


@pytest.fixture
def suspended(recorder):
    """Return a function that starts a recorder, which is stopped at once."""
    if not hasattr(signal, "SIGSTOP"):
        pytest.skip("needs SIGSTOP")

    def start(path, **options):
        sink = recorder(path, **options)
        sink.send(signal.SIGSTOP)
        return sink

    return start


def test_every_tick_and_event_is_read_back_unchanged(tmp_path, recorder):
    path = tmp_path / "a.mcap"
    sink = recorder(path)
    sink.push(*range(5000))
    sink.event(2.5, Mode.FAULT, "contact force jumped", Fault.JUMP, "contact_force", 9.0)
    outcome = sink.close()
    assert outcome == (path, 0, "", True)
    recording = load(path)
    np.testing.assert_array_equal(recording["time"], np.arange(5000) * 1e-3)
    for i, column in enumerate(LAYOUT.schema.columns[1:], start=1):
        assert (recording[column.name] == (0 if column.name == "dropped" else i)).all()
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


def test_the_file_grows_while_the_loop_runs(tmp_path, recorder):
    path = tmp_path / "a.mcap"
    sink = recorder(path)
    sink.push(*range(300), pause=1e-3)
    time.sleep(3 * FLUSH)
    assert len(load_intact(path)) >= 200


def test_a_killed_recorder_is_reported_and_its_flushed_data_are_kept(tmp_path, recorder):
    path = tmp_path / "a.mcap"
    sink = recorder(path)
    sink.push(*range(300), pause=1e-3)
    time.sleep(3 * FLUSH)
    assert not sink.process.has_message
    sink.send(signal.SIGKILL)
    sink.push(*range(300, 400))
    assert sink.close().problem == "the recorder was killed"
    assert len(load_intact(path)) == 300
    with pytest.raises(InputError, match=f"teleop recover {path}"):
        load(path)


def test_a_suspended_recorder_loses_ticks_but_does_not_delay_the_loop(tmp_path, suspended):
    sink = suspended(tmp_path / "a.mcap", ticks=1000)
    sink.push(*range(5000))
    sink.event(9.0, Mode.FAULT, "it matters most", Fault.JUMP)
    sink.push(20_000)
    sink.send(signal.SIGCONT)
    outcome = sink.close()
    assert outcome.dropped > 3000
    assert outcome.problem == ""
    recording = load(tmp_path / "a.mcap")
    assert len(recording) == 5001 - outcome.dropped >= 1000
    assert sum(gap.ticks for gap in recording.gaps) == outcome.dropped
    assert recording.events[-1]["text"] == "it matters most"


def test_a_recorder_that_pauses_for_some_seconds_loses_no_tick(tmp_path, suspended):
    sink = suspended(tmp_path / "a.mcap")
    sink.push(*range(8000))
    sink.event(8.0, Mode.FAULT, "in the pause", Fault.JUMP)
    sink.send(signal.SIGCONT)
    sink.push(*range(8000, 8300), pause=1e-3)
    assert sink.close() == (tmp_path / "a.mcap", 0, "", True)
    recording = load(tmp_path / "a.mcap")
    np.testing.assert_array_equal(recording["time"], [i * 1e-3 for i in range(8300)])
    assert recording.events[-1]["text"] == "in the pause"


def test_a_recorder_that_hangs_does_not_block_the_end(tmp_path, suspended):
    sink = suspended(tmp_path / "a.mcap")
    sink.push(*range(100))
    sink.event(9.0, Mode.FAULT, "not recorded", Fault.JUMP)
    before = time.monotonic()
    assert sink.close(timeout=0.5).problem == "the recorder was killed"
    assert time.monotonic() - before < 10.0


def test_the_signals_of_the_terminal_do_not_reach_the_recorder(tmp_path, recorder):
    path = tmp_path / "a.mcap"
    sink = recorder(path)
    assert os.getpgid(sink.process.pid) != os.getpgid(0)
    sink.push(0)
    assert sink.close().problem == ""
    assert len(load(path)) == 1


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_reported_at_once(recorder, capfd):
    sink = recorder(Path("/dev/full"), overwrite=True)
    sink.push(*range(100))
    assert sink.process.wait_for_request(10.0) == {"failure": "no space left on device"}
    sink.push(*range(100, 3000))
    outcome = sink.close()
    assert outcome.problem == "no space left on device"
    assert outcome.dropped == 0
    expected = "teleop: /dev/full: no space left on device: the trial ends\n"
    assert capfd.readouterr().err == expected


def test_a_file_that_cannot_be_written_is_refused_before_anything_moves(tmp_path, recorder):
    with pytest.raises(InputError, match="recording failed: no such file"):
        recorder(tmp_path / "nowhere" / "a.mcap")


def test_an_event_of_any_length_passes_through_the_stream_whole(tmp_path, recorder):
    sink = recorder(tmp_path / "a.mcap")
    text = "\N{GREEK SMALL LETTER TAU}" * 10_000
    sink.push(0)
    sink.event(0.0, Mode.FAULT, text, Fault.RIG_FAILURE, text, math.inf)
    sink.close()
    recording = load(tmp_path / "a.mcap")
    assert recording.events[-1]["text"] == text[:400]
    assert len(recording) == 1


def run_of(sink, damage):
    sink.push(*range(100))
    time.sleep(0.2)
    damage()
    sink.push(*range(100, 200))
    return sink.close()


def test_a_recording_that_was_removed_is_reported(tmp_path, recorder):
    path = tmp_path / "a.mcap"
    outcome = run_of(recorder(path), path.unlink)
    assert outcome.problem == "the file was removed during the run"
    assert not outcome.at_path
    assert not path.exists()


def test_a_recording_whose_folder_was_removed_is_reported(tmp_path, recorder):
    path = tmp_path / "day" / "a.mcap"
    path.parent.mkdir()
    outcome = run_of(recorder(path), lambda: shutil.rmtree(path.parent))
    assert outcome.problem == "the file was removed during the run"


def test_a_recording_that_another_file_replaced_is_reported_and_the_other_file_kept(
    tmp_path, recorder
):
    path, other = tmp_path / "a.mcap", tmp_path / "b.mcap"
    other.write_bytes(b"precious")
    outcome = run_of(recorder(path), lambda: other.replace(path))
    assert outcome.problem == "the file was removed during the run"
    assert not outcome.at_path
    assert path.read_bytes() == b"precious"


def test_a_recording_that_was_moved_is_reported_and_is_complete_where_it_is(tmp_path, recorder):
    path, other = tmp_path / "a.mcap", tmp_path / "b.mcap"
    outcome = run_of(recorder(path), lambda: path.replace(other))
    assert outcome.problem == "the file was moved, or its file system was unmounted, during the run"
    assert len(load(other)) == 200


def test_a_removed_recording_is_reported_while_the_run_continues(tmp_path, recorder, capfd):
    path = tmp_path / "a.mcap"
    sink = recorder(path)
    sink.push(0)
    path.unlink()
    expected = f"teleop: {path}: the file was removed during the run: the run continues\n"
    shown = ""
    for _ in range(100):
        if shown := capfd.readouterr().err:
            break
        time.sleep(0.1)
    assert shown == expected
    sink.close()


def test_a_recording_without_a_tick_is_removed(tmp_path, recorder):
    path = tmp_path / "a.mcap"
    assert recorder(path).close().problem == ""
    assert not path.exists()
    other = tmp_path / "b.mcap"
    sink = recorder(path)
    other.write_bytes(b"precious")
    other.replace(path)
    sink.close()
    assert path.read_bytes() == b"precious"


def test_a_link_whose_target_does_not_exist_is_refused_and_stays(tmp_path, recorder):
    link, target = tmp_path / "a.mcap", tmp_path / "b.mcap"
    link.symlink_to(target)
    with pytest.raises(InputError, match="file exists"):
        recorder(link)
    assert link.is_symlink()
    assert not target.exists()


KILLED = """
import json, os, signal, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from tests.teleop.recording.test_recorder import Recording
for ticks in map(int, sys.argv[2:]):
    if not os.fork():
        sink = Recording(Path(f"{ticks}.mcap"))
        Path(f"{ticks}.json").write_text(json.dumps(sink.stream.document["files"]))
        sink.push(*range(ticks))
        os.kill(os.getpid(), signal.SIGKILL)
    assert os.WTERMSIG(os.wait()[1]) == signal.SIGKILL
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_killed_controller_loses_no_tick_and_leaves_no_memory_behind(tmp_path):
    numbers = (1, 79, 1500)
    root = Path(__file__).parents[3]
    victims = subprocess.run([sys.executable, "-c", KILLED, root, *map(str, numbers)], cwd=tmp_path)
    assert victims.returncode == 0
    for ticks in numbers:
        recording = loaded(tmp_path / f"{ticks}.mcap")
        np.testing.assert_array_equal(recording["time"], np.arange(ticks) * 1e-3)
        files = json.loads((tmp_path / f"{ticks}.json").read_text()).values()
        end = time.monotonic() + 10.0
        while any(Path(file).exists() for file in files):
            assert time.monotonic() < end
            time.sleep(0.05)


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
