from __future__ import annotations

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from estimation import Bank, Gate, GateSettings, paper_preset
from estimation.checks import checked_samples
from estimation.compiled import Samples, compiled_sweep, interpreted_sweep

SETTINGS = GateSettings(force=0.5, speed=2e-3, window=0.02)
DT = 1e-3


def samples(v, f) -> Samples:
    """Return samples of a velocity and a force, each constant or an array."""
    v, f = np.broadcast_arrays(np.asarray(v, dtype=float), np.asarray(f, dtype=float))
    return checked_samples(np.zeros(v.shape), v, f, DT)


def steady(v: float, f: float) -> bool:
    """Return whether the gate is open after a constant sample for ten windows."""
    return bool(Gate(SETTINGS).run(samples(np.full(200, v), f))[-1])


@pytest.mark.parametrize(
    ("v", "f", "is_open"),
    [
        (0.01, 5.0, True),
        (-0.01, -5.0, True),
        (0.01, 0.0, False),
        (0.01, 0.49, False),
        (0.0, 5.0, False),
        (1.9e-3, 5.0, False),
        (2.1e-3, 0.51, True),
        (0.0, 0.0, False),
    ],
)
def test_is_open_only_in_contact_and_motion(v, f, is_open):
    assert steady(v, f) is is_open


def test_averages_squares_over_the_window():
    rng = np.random.default_rng(0)
    v, f = rng.normal(0.0, 3e-3, 500), rng.normal(0.0, 0.8, 500)
    dt = 1e-3 * rng.uniform(0.5, 1.5, 500)
    speed = force = 0.0
    expected = []
    for n in range(500):
        new = dt[n] / (SETTINGS.window + dt[n])
        speed = (1.0 - new) * speed + new * v[n] ** 2
        force = (1.0 - new) * force + new * f[n] ** 2
        contact = min(force, f[n] ** 2)
        expected.append(speed > SETTINGS.speed**2 and contact > SETTINGS.force**2)
    got = Gate(SETTINGS).run(checked_samples(np.zeros(500), v, f, dt))
    assert np.array_equal(got, expected)
    assert 0 < got.sum() < 500


def test_a_turning_point_does_not_close_the_gate():
    t = np.arange(0.0, 2.0, DT)
    is_open = Gate(SETTINGS).run(samples(25e-3 * np.cos(2 * np.pi * t), 10.0))
    assert is_open[50:].all()


def test_closes_when_contact_or_motion_ends_and_opens_again():
    t = np.arange(0.0, 6.0, DT)
    contact = (t % 3.0) < 2.0
    moving = (t % 3.0) < 1.0
    is_open = Gate(SETTINGS).run(samples(25e-3 * moving, 10.0 * contact))
    assert is_open[100:1000].all()
    assert not is_open[1300:3000].any()
    assert is_open[3100:4000].all()
    assert not is_open[4300:].any()


def test_update_and_run_agree_whether_compiled_or_not():
    rng = np.random.default_rng(1)
    given = samples(rng.normal(0.0, 3e-3, 400), rng.normal(0.0, 0.8, 400))
    online, batch = Gate(SETTINGS), Gate(SETTINGS)
    expected, contacts = [], []
    for phi, f, dt in zip(given.phi.tolist(), given.f.tolist(), given.dt.tolist(), strict=True):
        expected.append(online.update(phi, f, dt))
        contacts.append(online.contact)
    assert batch.run(given).tolist() == expected
    assert batch.contacts.tolist() == contacts
    assert 0 < sum(contacts) < 400
    pytest.importorskip("numba", reason="needs the `fast` extra")
    law, start = batch._law, Gate(SETTINGS)._state
    assert np.array_equal(
        compiled_sweep(law, deepcopy(start), given),
        interpreted_sweep(law, deepcopy(start), given),
        equal_nan=True,
    )


def test_starts_closed_and_reset_restores_the_initial_state():
    gate = Gate(SETTINGS)
    given = samples(np.full(10, 0.01), 5.0)
    first = gate.run(given).tolist()
    assert gate.run(given)[0]
    gate.reset()
    assert gate.run(given).tolist() == first


@pytest.mark.parametrize(
    "settings", [(-1.0, 0.0, 1.0), (0.0, np.nan, 1.0), (0.0, np.inf, 1.0), (0.0, 0.0, 0.0)]
)
def test_a_setting_out_of_range_is_refused(settings):
    with pytest.raises(ValueError, match="force and a speed >= 0 and a positive window"):
        Gate(GateSettings(*settings))


# With a bank


def palpation_with_air_and_rest(palpation, rest=True):
    """Return a palpation, an optional rest in contact from 3 s, and motion in the air from 4 s."""
    x, v, f, dt = (channel.copy() for channel in palpation(seconds=6.0, noise=0.02))
    still, air = slice(3000, 4000), slice(4000, 6000)
    noise = np.random.default_rng(1).normal(0.0, 0.02, 6000)
    if rest:
        x[still], v[still] = x[3000], 0.0
        f[still] = 2100.0 * x[3000] + noise[still]
    x[air] -= 9e-3
    f[air] = noise[air]
    return x, v, f, dt


def test_a_bank_holds_gated_estimators_and_sets_held(palpation):
    bank = replace(paper_preset("soft"), estimators=("rls", "kalman", "segments")).bank()
    assert [name for name, e in bank.items() if e.gated] == ["kalman", "segments"]
    signals = palpation_with_air_and_rest(palpation)
    estimates = bank.run(*signals)
    rls, kalman, segments = estimates.values()
    assert not rls.held.any()
    assert np.array_equal(kalman.held[3300:], segments.held[3300:])
    assert not kalman.held[100:3000].any()
    assert kalman.held[3300:4000].all()
    assert kalman.held[5000:].all()
    assert np.ptp(kalman.k[3300:4000]) == 0.0
    assert kalman.k[3999] == pytest.approx(2100.0, rel=0.01)
    assert np.ptp(kalman.k_std[5000:]) == 0.0
    assert abs(rls.k[-1]) < 100.0


def test_the_estimate_held_in_the_air_is_that_of_the_contact(palpation):
    bank = replace(paper_preset("soft"), estimators=("kalman",)).bank()
    kalman = bank.run(*palpation_with_air_and_rest(palpation, rest=False))["kalman"]
    assert kalman.held[-1]
    assert kalman.k[3999] == pytest.approx(2100.0, rel=0.01)
    assert kalman.k[-1] == pytest.approx(2100.0, rel=0.05)


def test_a_bank_holds_the_same_samples_in_update_and_run(palpation):
    preset = replace(paper_preset("soft"), estimators=("rls", "kalman"))
    online, batch = preset.bank(), preset.bank()
    signals = [channel[2900:4300] for channel in palpation_with_air_and_rest(palpation)]
    expected = batch.run(*signals)
    got = [online.update(*sample) for sample in zip(*signals, strict=True)]
    for name, series in expected.items():
        assert [answer[name].held for answer in got] == series.held.tolist()
        assert [answer[name].k for answer in got] == series.k.tolist()


def test_a_bank_without_a_gate_never_holds(palpation):
    bank = replace(paper_preset("soft"), estimators=("kalman",), gate=None).bank()
    assert bank.gate is None
    assert not bank.run(*palpation_with_air_and_rest(palpation))["kalman"].held.any()


def test_resetting_a_bank_resets_its_gate(palpation):
    signals = palpation(seconds=0.2)
    bank = Bank({"rls": replace(paper_preset("soft")).bank()["rls"]}, Gate(SETTINGS))
    bank.run(*signals)
    bank.reset()
    given = checked_samples(*signals)
    assert np.array_equal(bank.gate.run(given), Gate(SETTINGS).run(given))
