"""A recording of any length is evaluated in blocks, with the results of an evaluation in one."""

from __future__ import annotations

import csv
import math
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.metrics import RisingValue
from estimation.summary import summarise
from teleop.cli import main
from teleop.evaluation import evaluate as evaluation
from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.evaluate import evaluate
from teleop.evaluation.online.conditioned import within
from teleop.evaluation.online.contact_bank import contact_at
from teleop.evaluation.reading import recorded as kept_parts
from teleop.evaluation.reading import samples
from teleop.evaluation.reading.recorded import (
    RecordedSamples,
    Sections,
    recorded_settings,
    recorded_signals,
)
from teleop.evaluation.reading.samples import Samples, is_replayed
from teleop.evaluation.settings import AveragedPart
from teleop.output.fit_figures import fit_figure
from teleop.recording import recovery, stream
from teleop.recording.mcap_reader import read_intact
from teleop.recording.recording import load
from teleop.recording.recovery import messages, write_contents
from teleop.trial.recorded_trial import recorded_part


@pytest.fixture(scope="module")
def trials(tmp_path_factory):
    """Return recordings of two durations, whose chunks have 200 ticks."""
    folder = tmp_path_factory.mktemp("trials")
    paths = {}
    for duration in (3, 8):
        recorded = folder / f"recorded-{duration}.mcap"
        arguments = ["--clock", "virtual", "--condition", "autonomous", "--seed", "3"]
        arguments += ["--duration", str(duration), "--record", str(recorded)]
        assert main(["run", *arguments]) == 0
        paths[duration] = folder / f"{duration}.mcap"
        contents = read_intact(recorded)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(recovery, "CHUNK", 200)
            write_contents(paths[duration], contents, messages(recorded))
    return paths


@pytest.fixture
def small(monkeypatch):
    """Make all blocks and sections short, so that a recording of seconds is long."""
    monkeypatch.setattr(kept_parts, "SECTION", 0.256)
    monkeypatch.setattr(kept_parts, "SECTIONS", 8)
    monkeypatch.setattr(samples, "LONGEST_SINGLE_BLOCK", 512)
    monkeypatch.setattr(samples, "BLOCK", 512)
    monkeypatch.setattr(kept_parts, "LAST", 1000)
    monkeypatch.setattr(stream, "BLOCK", 300)


def settings_of(path, *estimators):
    recording = load(path)
    settings = replace(recorded_settings(recording), averaged=recorded_part(recording))
    return replace(settings, estimators=estimators) if estimators else settings


def test_the_blocks_of_a_recording_are_all_its_samples(trials, small):
    recording = load(trials[3])
    whole, online = recorded_signals(recording), recording.estimated().estimates()
    blocks = list(RecordedSamples(trials[3], is_replayed).blocks())
    assert len(blocks) > 4
    for channel in ("t", "x", "f", "dt"):
        joined = np.concatenate([getattr(block.signals, channel) for block in blocks])
        np.testing.assert_array_equal(joined, getattr(whole, channel))
    for name, series in online.items():
        for i in range(2):
            joined = np.concatenate([block.recorded[name][i] for block in blocks])
            np.testing.assert_array_equal(joined, series[i])


def test_of_a_long_recording_evenly_spaced_sections_are_kept(trials, small):
    whole = recorded_signals(load(trials[8]))
    read = RecordedSamples(trials[8], is_replayed)
    kept = read.signals
    assert read.count == len(whole.t)
    assert 4 * 256 < len(kept.t) <= 8 * 256
    assert not read.is_whole
    np.testing.assert_array_equal(kept.gaps, np.arange(256, len(kept.t), 256))
    assert len(set(np.round(np.diff(kept.t[::256]), 9))) == 1
    places = np.searchsorted(whole.t, kept.t)
    for channel in ("t", "x", "f"):
        np.testing.assert_array_equal(getattr(kept, channel), getattr(whole, channel)[places])
    np.testing.assert_allclose(kept.dt[1:], np.diff(kept.t), atol=1e-9)
    assert kept.t[-1] > 0.75 * whole.t[-1]


@pytest.mark.parametrize("rate", [500.0, 1000.0, 4000.0])
def test_the_sections_have_the_same_duration_at_any_rate(rate, monkeypatch):
    monkeypatch.setattr(kept_parts, "SECTION", 1.0)
    t = np.arange(0.0, 30.0, 1.0 / rate)
    sections = Sections()
    for part in np.array_split(np.stack([t, t, t, np.full(len(t), 1.0 / rate)]), 13, axis=1):
        sections.add(part)
    kept, _, _, _ = sections.samples()
    assert len(kept) == 4 * rate
    np.testing.assert_allclose(kept[:: round(rate)], [0.0, 8.0, 16.0, 24.0])
    assert sections.starts == [round(rate), 2 * round(rate), 3 * round(rate)]


def test_a_recording_that_fits_into_the_sections_is_kept_whole(trials):
    whole = recorded_signals(load(trials[3]))
    read = RecordedSamples(trials[3], is_replayed)
    assert read.is_whole
    for ours, theirs in zip(read.signals, whole, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    for name, column in load(trials[3], is_replayed).columns.items():
        np.testing.assert_array_equal(read.recording[name], column)


def test_the_result_states_that_it_is_that_of_sections(trials, small):
    text = "in evenly spaced sections"
    read = RecordedSamples(trials[8], is_replayed)
    reasons = evaluate(read, settings_of(trials[8])).summary()["result"]["reasons"]
    assert [one for one in reasons if text in one and f"{read.count} samples" in one]
    whole = evaluate(recorded_signals(load(trials[8])), settings_of(trials[8]))
    assert not any(text in one for one in whole.summary()["result"]["reasons"])


def test_a_long_recording_is_averaged_and_fitted_only_in_the_averaged_part(trials, small):
    part = AveragedPart(start=2.5, end=6.0, left_out="start and end")
    read = RecordedSamples(trials[8], is_replayed)
    found = evaluate(read, replace(settings_of(trials[8]), averaged=part))
    assert found.online.as_recorded
    first, last = found.analysis.record.t[[0, -1]]
    assert 2.5 <= first < 4.6
    assert 4.5 < last < 6.0
    fitted = int(np.sum(part.contains(read.signals.t)))
    summary = found.summary()
    assert 256 < fitted < len(read.signals.t)
    assert f"those of {fitted} of" in " ".join(summary["result"]["reasons"])
    assert (summary["left_out"], summary["samples_used"]) == ("start and end", read.count)
    inside = part.contains(found.t)
    for name, series in found.estimates.items():
        expected = summarise(
            found.t[inside],
            found.regression.part(inside),
            series.part(inside),
            found.bank[name],
            found.misfit[name][inside],
        )
        for key in ("b", "k", "e_f", "one_step_rms", "k_end", "rise_time_s", "held", "misfit"):
            value = getattr(found.summaries()[name], key)
            assert value == pytest.approx(getattr(expected, key), rel=1e-10), (name, key)
    last = {"k": found.expected.k[inside][-1], "b": found.expected.b[inside][-1]}
    assert summary["expected_intervals"] == last


def test_a_part_without_samples_of_the_estimators_has_no_averages(trials, monkeypatch):
    signals, settings = recorded_signals(load(trials[3])), settings_of(trials[3])
    fit = replace(settings, averaged=AveragedPart())
    monkeypatch.setattr(evaluation, "within", lambda signals, part: signals)
    whole = evaluate(signals, fit)
    found = evaluate(signals, replace(fit, averaged=AveragedPart(start=5.0)))
    for name, summary in found.summaries().items():
        assert math.isnan(summary.k)
        assert summary.held == 1.0
        np.testing.assert_array_equal(found.estimates[name].k, whole.estimates[name].k)
    assert math.isnan(found.summary()["expected_intervals"]["k"])


def test_before_the_analysed_part_the_contact_is_that_at_its_start(trials):
    signals = recorded_signals(load(trials[3]))
    analysis = analyse(within(signals, AveragedPart(start=2.0)))
    analysis = replace(analysis, phases=replace(analysis.phases, free_force=0.0))
    assert analysis.phases.contact.all()
    assert contact_at(analysis, signals.t, np.zeros(len(signals.t))).all()


def test_the_figure_of_the_fit_has_no_line_between_the_sections(trials, small):
    read = RecordedSamples(trials[8], is_replayed)
    figure = fit_figure("trial", evaluate(read, settings_of(trials[8])))
    t, f = next(line.get_data() for line in figure.axes[1].lines if line.get_label() == "measured")
    for start in read.signals.t[list(read.signals.gaps)]:
        assert np.isnan(f[np.abs(t - start) < 0.03]).any()


def test_the_last_ticks_of_a_long_recording_are_kept(trials, small):
    kept = RecordedSamples(trials[8], is_replayed).recording
    whole = load(trials[8])
    assert 1000 <= len(kept) < 1000 + 2 * stream.BLOCK
    for name, column in kept.columns.items():
        np.testing.assert_array_equal(column, whole[name][-len(column) :])


def test_estimates_in_blocks_are_those_of_the_run(trials, small):
    path = trials[8]
    found = evaluate(RecordedSamples(path, is_replayed), settings_of(path))
    assert found.online.as_recorded
    online = load(path).estimated()
    for name, series in online.estimates().items():
        np.testing.assert_array_equal(found.estimates[name].k, series.k)
        np.testing.assert_array_equal(found.misfit[name], online.misfit(name))


def test_a_changed_recorded_estimate_is_noticed(trials):
    whole = load(trials[3])
    estimates = whole.estimated().estimates()
    same = Samples(recorded_signals(whole), estimates)
    assert evaluate(same, settings_of(trials[3])).online.as_recorded
    estimates["me"].k[-1] += 1.0
    other = Samples(recorded_signals(whole), estimates)
    assert not evaluate(other, settings_of(trials[3])).online.as_recorded


@pytest.mark.parametrize("names", [("rls", "ai", "me"), ("rls", "kalman", "hc_log")])
def test_summaries_do_not_depend_on_the_size_of_the_blocks(trials, monkeypatch, names):
    signals, settings = recorded_signals(load(trials[3])), settings_of(trials[3], *names)
    one = evaluate(signals, settings)
    monkeypatch.setattr(samples, "LONGEST_SINGLE_BLOCK", 0)
    monkeypatch.setattr(samples, "BLOCK", 77)
    some = evaluate(signals, settings, most=300.0)
    assert len(some.t) < 150
    assert (some.t[0], some.t[-1]) == (one.t[0], one.t[-1])
    places = np.searchsorted(one.t, some.t)
    for name, series in some.estimates.items():
        np.testing.assert_array_equal(series.k, one.estimates[name].k[places])
    for name, summary in one.summaries().items():
        for key, value in summary._asdict().items():
            if isinstance(value, float):
                found = getattr(some.summaries()[name], key)
                assert found == pytest.approx(value, rel=1e-10, nan_ok=True), (name, key)
    for name, row in one.online.comparisons.items():
        assert some.online.comparisons[name] == pytest.approx(row, rel=1e-10, nan_ok=True)
    for key in ("samples_used", "longest_gap_s", "jitter", "least_squares", "from_s", "to_s"):
        assert some.summary()[key] == one.summary()[key]


def test_a_table_of_a_long_recording_has_all_samples(trials, small, tmp_path):
    out = tmp_path / "table.csv"
    assert main(["estimate", str(trials[8]), "--out", str(out), "--json"]) == 0
    whole = load(trials[8]).estimated()
    with out.open() as file:
        heading, *rows = csv.reader(file)
    table = np.array(rows, dtype=np.float64)
    k = [name.split(" ")[0] for name in heading].index("rls_k")
    np.testing.assert_array_equal(table[:, 0], whole["time"])
    np.testing.assert_array_equal(table[:, k], whole["rls_k"])


def test_memory_does_not_depend_on_the_duration(trials, small, monkeypatch):
    monkeypatch.setattr("teleop.evaluation.evaluate.KEPT", 2000)
    command = ["estimate", "--estimators", "ai", "--json"]
    for path in trials.values():  # libraries are imported, and `analysis_by_record` stores
        assert main([*command, str(path)]) == 0

    def peak(duration):
        tracemalloc.start()
        assert main([*command, str(trials[duration])]) == 0
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    short = peak(3)
    # Again if it is too large: the threads of pytest-xdist allocate too.
    assert peak(8) < 1.25 * short or peak(8) < 1.25 * short


@given(
    st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=30),
    st.lists(st.integers(1, 10), max_size=5),
)
def test_the_rise_time_in_blocks_is_that_of_its_definition(values, sizes):
    t, k = np.arange(len(values)) * 0.1, np.array(values)
    rising = RisingValue()
    for part_t, part_k in zip(
        np.split(t, np.cumsum(sizes)), np.split(k, np.cumsum(sizes)), strict=True
    ):
        rising.add(part_t, part_k)
    average = math.fsum(values) / len(values)
    if abs(average) < 1e-6:
        return
    levels = k / average
    first = int(np.argmax(levels >= 0.1))
    last = first + int(np.argmax(levels[first:] >= 0.9))
    margin = np.min(np.abs(np.concatenate([levels - 0.1, levels - 0.9])))
    if margin > 1e-9:
        assert rising.time == pytest.approx(t[last] - t[first])
