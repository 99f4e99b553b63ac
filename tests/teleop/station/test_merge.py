"""The recordings of two stations become one, and the time of the master is known in an interval."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from teleop.cli import main
from teleop.errors import InputError
from teleop.recording.recording import load
from teleop.recording.two_stations import connection_summary, merge, write_merged
from teleop.safety import Mode
from teleop.trial.recorded_trial import trial_settings

from .network import Faults, TwoStations
from .test_two_stations import PLAIN


@pytest.fixture(scope="module")
def pair():
    pair = TwoStations(replace(PLAIN, duration=1.5), Faults(0.004), Faults(0.024), offset=3.0)
    pair.run(3000)
    return pair


@pytest.fixture(scope="module")
def recordings(pair):
    return pair.master.recording, pair.slave.recording


def test_the_interval_contains_the_true_offset_at_each_tick(pair, recordings):
    merged = merge(*recordings)
    # the clock of the slave runs by 40 ppm faster than that of the master, and is 3 s ahead
    clock = merged["station_clock"]
    true = clock - (clock - 3.0) / (1.0 + pair.slave.clock.error)
    known = np.isfinite(merged["offset_low"])
    assert known.sum() > 1500
    assert np.all(merged["offset_low"][known] - 1e-6 <= true[known])
    assert np.all(true[known] <= merged["offset_high"][known] + 1e-6)
    width = (merged["offset_high"] - merged["offset_low"])[known]
    assert np.median(width) == pytest.approx(0.028, abs=2e-3)


def test_the_columns_of_the_master_are_those_of_the_same_time(recordings):
    master, _ = recordings
    merged = merge(*recordings)
    half = 0.5 * (merged["offset_high"] - merged["offset_low"])
    at = (merged["station_clock"] - 3.0) / (1.0 + 40e-6)
    expected = np.interp(at, master["station_clock"], master["master_position"])
    error = np.abs(merged["master_position"] - expected)
    fastest = np.max(np.abs(master["commanded_master_velocity"]))
    known = np.isfinite(error)
    assert known.sum() > 1500
    assert np.all(error[known] <= half[known] * fastest * 1.05 + 2e-6)
    assert np.nanmax(merged["master_position"]) > 1e-3


def test_the_ticks_and_the_measurements_of_the_slave_stay_the_same(recordings):
    _, slave = recordings
    merged = merge(*reversed(recordings))
    for name in ("time", "slave_position", "contact_force", "rls_k", "mode"):
        assert np.array_equal(merged[name], slave[name], equal_nan=True)
    assert merged.fault is None
    texts = [event["text"] for event in merged.events]
    assert "master station: armed" in texts
    settings = trial_settings(merged)
    assert settings
    assert settings.has_master
    assert settings.has_slave


def test_recordings_that_do_not_belong_together_are_refused(recordings):
    master, slave = recordings
    with pytest.raises(InputError, match="of master, master"):
        merge(master, master)
    settings = slave.settings | {"station": slave.settings["station"] | {"session": "12"}}
    with pytest.raises(InputError, match="the same session"):
        merge(master, replace(slave, settings=settings))
    with pytest.raises(InputError, match="no station"):
        merge(master, replace(slave, settings=slave.settings | {"station": None}))


def test_the_command_writes_a_recording_that_the_other_commands_read(tmp_path, recordings, capsys):
    paths = [tmp_path / "master.mcap", tmp_path / "slave.mcap"]
    for path, recording in zip(paths, recordings, strict=True):
        write_merged(path, recording)
    out = tmp_path / "both.mcap"
    assert main(["merge", *map(str, paths), "--out", str(out)]) == 0
    assert "the time of the master is known to ± 14" in capsys.readouterr().out
    found, expected = load(out), merge(*recordings)
    assert found.units == expected.units
    for name in expected.columns:
        assert np.array_equal(found[name], expected[name], equal_nan=True)
    assert main(["merge", *map(str, paths), "--out", str(out)]) == 2


def test_the_connection_is_summarised_while_the_drives_are_armed(recordings):
    found = connection_summary(recordings[1])
    active = recordings[1].where(recordings[1]["mode"] == Mode.ACTIVE)
    assert found["round_trip_s"] == pytest.approx(np.median(active["round_trip"]))
    assert found["round_trip_s"] == pytest.approx(0.029, abs=2e-3)
    assert found["lost"] == found["rejected"] == 0
