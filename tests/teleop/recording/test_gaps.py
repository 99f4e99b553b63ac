"""Gaps in a recording are reported, and estimates do not use differences across them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation import MatchedFilter
from teleop.cli import main
from teleop.errors import InputError
from teleop.evaluation.evaluate import evaluate
from teleop.evaluation.online.conditioned import PiecewiseConditioner
from teleop.evaluation.reading.recorded import RecordedSamples, recorded_settings, recorded_signals
from teleop.evaluation.reading.samples import is_replayed
from teleop.evaluation.reading.signals import Signals, periods, read_signals
from teleop.evaluation.settings import EstimateSettings
from teleop.recording.gaps import GapFinder, missing_text, missing_ticks
from teleop.recording.recorder import Recorder
from teleop.recording.recording import load
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.stream import StreamReader
from teleop.trial.run import run_trial


def ticks_without(lost, count=200, skipped=()):
    """Return time, dt and dropped of a recording with missing ticks and skipped periods."""
    dt = 1e-3 * (1.0 + np.isin(np.arange(count), list(skipped)) * 7)
    t = np.cumsum(dt) - 0.05
    kept = ~np.isin(np.arange(count), list(lost))
    return t[kept], dt[kept], np.cumsum(~kept)[kept].astype(float), t, kept


@given(lost=st.sets(st.integers(0, 199), max_size=199), skipped=st.sets(st.integers(1, 199)))
def test_every_missing_tick_is_in_one_gap_between_recorded_ticks(lost, skipped):
    t, dt, dropped, whole, kept = ticks_without(lost, skipped=skipped)
    gaps = missing_ticks(t, dt, dropped, len(lost))
    assert sum(gap.ticks for gap in gaps) == len(lost)
    inside = np.zeros(len(whole), dtype=bool)
    for gap in gaps:
        start = -np.inf if gap.start is None else gap.start
        inside |= (whole > start) & (whole < (np.inf if gap.end is None else gap.end))
    np.testing.assert_array_equal(inside, ~kept)
    assert bool(missing_text(gaps)) == bool(lost)


def test_the_ticks_of_a_black_box_have_no_gap_though_the_recorder_dropped_some():
    t, dt, *_ = ticks_without(())
    assert missing_ticks(t, dt, np.arange(200.0)) == ()


def test_many_gaps_are_listed_in_one_line():
    t, dt, dropped, *_ = ticks_without(range(1, 190, 10))
    text = missing_text(missing_ticks(t, dt, dropped))
    assert text.startswith("19 ticks are missing from the recording: 1 from -0.049 to -0.047 s, ")
    assert text.endswith(" and 15 more gaps")


def linear(hole=(3.1, 5.47), period=1e-3):
    """Return a 1 Hz motion on k = 2000 N/m, b = 20 N s/m, with a gap in the samples."""
    t = np.arange(0.0, 8.0, period)
    w = 2.0 * np.pi
    x, v = 4e-3 - 3e-3 * np.cos(w * t), 3e-3 * w * np.sin(w * t)
    f = 2000.0 * x + 20.0 * v + np.random.default_rng(0).normal(0.0, 0.02, t.size)
    kept = (t <= hole[0]) | (t >= hole[1])
    t, x, f = t[kept], x[kept], f[kept]
    gaps = tuple((1 + np.flatnonzero(np.diff(t) > 0.01)).tolist())
    return Signals(t, x, f, periods(t), "slave_position", gaps)


CONDITIONING = ("matched", "svf", "foaw", "difference")


@pytest.mark.parametrize("conditioning", CONDITIONING)
def test_conditioned_signals_after_a_gap_do_not_depend_on_those_before_it(conditioning):
    signals = linear(period=2e-3)
    start = signals.gaps[0]
    moved = signals._replace(x=signals.x.copy(), f=signals.f.copy())
    moved.x[:start] *= 3.0
    moved.f[:start] -= 5.0
    settings = EstimateSettings(
        datum="file", preset="paper", conditioning=conditioning, whole=True, resolution=1e-6
    )
    one, other = evaluate(signals, settings), evaluate(moved, settings)
    after = one.t > signals.t[start]
    for channel in range(3):
        np.testing.assert_array_equal(
            one.regression[channel][after], other.regression[channel][after]
        )


@pytest.mark.parametrize("conditioning", CONDITIONING)
def test_velocity_has_settled_where_the_estimators_are_given_it_after_a_gap(conditioning):
    settings = EstimateSettings(
        datum="file", preset="paper", conditioning=conditioning, whole=True, resolution=1e-6
    )
    holed, whole = (evaluate(linear(hole), settings) for hole in ((3.1, 5.25), (9.0, 9.0)))
    after = holed.t > 5.2
    same = np.isin(np.round(whole.t * 1e3), np.round(holed.t[after] * 1e3))
    np.testing.assert_allclose(holed.regression.v[after], whole.regression.v[same], atol=4e-4)


def test_estimators_receive_the_duration_of_a_gap():
    signals = linear()
    evaluation = evaluate(signals, EstimateSettings(datum="file", preset="paper", whole=True))
    t, dt = evaluation.t, evaluation.regression.dt
    np.testing.assert_allclose(dt[1:], np.diff(t), atol=1e-12)
    settling = MatchedFilter(20.0).settling
    assert dt.max() == pytest.approx(5.47 - 3.1 + settling, abs=1.5e-3)
    assert evaluation.gaps == (pytest.approx((3.1, 5.47)),)


@pytest.mark.parametrize("end", [5.1, 5.47, 5.8])
def test_a_gap_does_not_shift_the_estimates_after_it(end):
    evaluation = evaluate(
        linear((3.1, end)), EstimateSettings(datum="file", preset="paper", whole=True)
    )
    later = evaluation.t > end + 0.3
    np.testing.assert_allclose(evaluation.estimates["rls"].k[later], 2000.0, atol=15.0)


@pytest.mark.parametrize("conditioning", CONDITIONING)
def test_a_gap_of_any_length_does_not_change_the_settings_that_follow_the_data(conditioning):
    signals, settings = (
        linear(period=2e-3),
        EstimateSettings(datum="file", conditioning=conditioning, resolution=1e-6),
    )
    t = signals.t + 3600.0 * (signals.t > 4.0)
    long = signals._replace(t=t, dt=periods(t))
    short, long = evaluate(signals, settings), evaluate(long, settings)
    assert 5.0 < long.bandwidth < 50.0
    assert long.bandwidth == pytest.approx(short.bandwidth)
    assert len(long.t) == len(short.t)
    np.testing.assert_allclose(long.estimates["rls"].k[-1], 2000.0, atol=15.0)
    np.testing.assert_allclose(long.estimates["rls"].b[-1], 20.0, atol=2.0)


def test_signals_without_a_gap_are_conditioned_as_one():
    signals = linear((9.0, 9.0))
    given, settled = PiecewiseConditioner(MatchedFilter(20.0)).run(*signals[:4], ())
    assert settled.all()
    for ours, theirs in zip(given, MatchedFilter(20.0).run(*signals[1:4]), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_gaps_that_leave_no_settled_sample_are_refused():
    whole = linear((9.0, 9.0))
    signals = Signals(*(column[:600] for column in whole[:4]), whole.position_name)
    every = signals._replace(gaps=tuple(range(0, len(signals.t), 20)))
    with pytest.raises(InputError, match="far enough from a gap for the filters to settle"):
        evaluate(every, EstimateSettings(datum="file", preset="paper", whole=True))


@pytest.mark.usefixtures("without_drawings")
def test_a_gap_in_a_table_is_reported(tmp_path, capsys):
    path = tmp_path / "a.csv"
    t, x, f, *_ = linear(period=2e-3)
    lines = [f"{a:.4f},{b:.9f},{c:.6f}" for a, b, c in zip(t, x, f, strict=True)]
    path.write_text("\n".join(["Time [s],Displacement [m],Force [N]", *lines]))
    assert read_signals(path).gaps == (1551,)
    assert main(["estimate", str(path), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["gaps"] == [{"from_s": 3.1, "to_s": 5.47}]
    assert summary["jitter"] < 1e-6
    assert main(["estimate", str(path)]) == 0
    assert "no samples from 3.100 to 5.470 s" in capsys.readouterr().out
    assert main(["report", str(path)]) == 0
    assert "No samples from 3.100 to 5.470 s" in (tmp_path / "a.html").read_text()
    with pytest.raises(InputError, match=r"a gap from 3\.1 to 5\.47 s"):
        measure_lag_of(path)


def measure_lag_of(path):
    from teleop.commands.lag import lag

    lag(path)


class LateRing:
    """A ring in which some records are overwritten before a reader can read them."""

    def __init__(self, ring, lost):
        self._ring, self._lost = ring, lost

    def __getattr__(self, name):
        return getattr(self._ring, name)

    def read(self, first, end):
        while first < end and first in self._lost:
            first += 1
        return self._ring.read(first, end)


class LateReader(StreamReader):
    """A reader that is too late for some ticks."""

    def __init__(self, reader, lost):
        vars(self).update(vars(reader), ticks=LateRing(reader.ticks, lost))
        self._ends = {number - 1 for number in lost if number - 1 not in lost}

    def read(self):
        """Return the next ticks until those that are lost."""
        ticks = (end - self.position for end in self._ends if end > self.position)
        return super().read(min(ticks, default=1 << 14))


@pytest.fixture
def slow(monkeypatch):
    """Makes the recorder miss some ticks, by their number from 0."""

    def during(*numbers):
        lost = {number + 1 for number in numbers}
        monkeypatch.setattr(
            "teleop.trial.readers.Recorder",
            lambda session, reader, send: Recorder(session, LateReader(reader, lost), send),
        )

    return during


SETTINGS = TrialSettings(clock="virtual", duration=1.5)


def test_a_run_reports_dropped_ticks_as_such(slow, tmp_path):
    slow(*range(1000, 1300))
    trial = run_trial(SETTINGS, tmp_path / "a.mcap")
    summary = trial.summary()
    assert summary["loop"]["longest_gap_s"] == pytest.approx(1e-3)
    assert summary["loop"]["mean_rate_hz"] == pytest.approx(1000.0)
    first = trial.recording["time"][0]
    (gap,) = summary["recording"]["missing_ticks"]
    assert gap["ticks"] == 300
    assert gap["from_s"] == pytest.approx(first + 0.999)
    assert gap["to_s"] == pytest.approx(first + 1.3)
    assert not summary["recording"]["complete"]
    assert summary["recording"]["problem"] is None


@pytest.mark.usefixtures("without_drawings")
def test_a_command_names_the_missing_ticks_and_does_not_advise_to_recover(slow, tmp_path, capsys):
    slow(*range(1000, 1500), *range(1700, 1800))
    path = tmp_path / "a.mcap"
    assert main(["run", "--clock", "virtual", "--duration", "2", "--record", str(path)]) == 2
    out, err = capsys.readouterr()
    text = "600 ticks are missing from the recording: 500 from "
    assert text in out
    assert err.startswith(f"teleop: {path}: {text}")
    assert err.count("\n") == 1
    for word in ("stalled", "busy", "teleop recover", "hold its rate"):
        assert word not in out + err
    assert main(["recover", str(path)]) == 0
    out, _ = capsys.readouterr()
    assert "nothing to recover" in out
    assert text in out
    for options in ([], ["--json", "--overwrite"]):
        assert main(["export", str(path), *options]) == 0
        out, err = capsys.readouterr()
        assert text in err or len(json.loads(out)["missing_ticks"]) == 2
    assert main(["report", str(path)]) == 0
    assert text in path.with_suffix(".html").read_text()
    capsys.readouterr()
    assert main(["estimate", str(path)]) == 0
    out = capsys.readouterr().out
    assert f"the estimates are not those of the run: {text}" in out
    assert "no samples from" in out
    assert "exactly those" not in out


def test_ticks_that_were_dropped_last_are_reported(slow, tmp_path):
    slow(*range(1200, 2000))
    path = tmp_path / "a.mcap"
    trial = run_trial(SETTINGS, path)
    recording = load(path)
    assert len(recording) == 1200
    (gap,) = recording.gaps
    assert gap.start == recording["time"][-1]
    assert gap.end is None
    assert gap.ticks == trial.outcome.dropped
    assert "after" in trial.incomplete


def test_ticks_that_were_dropped_first_are_reported(slow, tmp_path, capsys):
    slow(*range(20))
    path = tmp_path / "a.mcap"
    run_trial(SETTINGS, path)
    recording = load(path)
    assert recording.gaps == ((None, recording["time"][0], 20),)
    assert main(["estimate", str(path)]) == 0
    assert f"20 ticks are missing from the recording: 20 before {recording['time'][0]:.3f} s" in (
        capsys.readouterr().out
    )


def test_the_estimates_of_a_run_with_missing_ticks_are_not_claimed_to_be_reproduced(slow, tmp_path):
    path = tmp_path / "a.mcap"
    slow(*range(1200, 1202))
    run_trial(SETTINGS, path)
    recording = load(path)
    signals = recorded_signals(recording)
    np.testing.assert_allclose(signals.dt[1:], np.diff(signals.t), atol=1e-9)
    samples = RecordedSamples(path, is_replayed)
    evaluation = evaluate(samples, recorded_settings(recording))
    assert not evaluation.online.as_recorded
    assert evaluation.gaps == tuple(gap[:2] for gap in recording.gaps)
    before = evaluation.t < recording.gaps[0].end
    online = recording.estimated()
    for name, estimates in evaluation.estimates.items():
        np.testing.assert_array_equal(estimates.k[before], online[f"{name}_k"][: before.sum()])
    whole = replace(recording, gaps=())
    assert len(recorded_signals(whole).gaps) == 0


@given(st.lists(st.integers(0, 200), max_size=5), st.integers(0, 2**32 - 1))
def test_the_gaps_of_blocks_are_those_of_the_whole_recording(cuts, seed):
    rng = np.random.default_rng(seed)
    kept = np.flatnonzero(rng.random(250) > 0.2)[:200]
    t, dt = kept * 1e-3, np.full(len(kept), 1e-3)
    dropped = kept - np.arange(len(kept)).astype(float)
    finder = GapFinder()
    for block in np.split(np.arange(len(kept)), sorted(cuts)):
        finder.add(t[block], dt[block], dropped[block])
    assert finder.gaps(300) == missing_ticks(t, dt, dropped, 300)
