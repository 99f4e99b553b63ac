from __future__ import annotations

import re

import numpy as np
import pytest
from matplotlib.figure import Figure

from estimation import METHODS, MatchedFilter, identify, paper_preset
from estimation.estimator import LEVEL_95, Estimates
from estimation.presentation import short_text

DT = 2e-3


def recording(seconds=4.0, b=15.0, k=2100.0, noise=0.0, seed=0):
    """Return position and force of a palpation at 500 Hz."""
    t = np.arange(0.0, seconds, DT)
    x = 5e-3 - 3e-3 * np.cos(2 * np.pi * t) + 1e-3 * np.sin(2 * np.pi * 2.6 * t)
    force = k * x + b * np.gradient(x, DT)
    return x, force + np.random.default_rng(seed).normal(0.0, noise, t.size)


@pytest.fixture(scope="module")
def found():
    return identify(*recording(noise=0.1), DT, ["rls", "spectral"], "stiffening")


def test_recovers_damping_and_stiffness():
    found = identify(*recording(), DT)
    assert [*found.estimates] == ["rls", "ai", "me"]
    for name in ("rls", "me"):
        assert found.estimates[name].k[-1] == pytest.approx(2100.0, rel=0.002)
        assert found.estimates[name].b[-1] == pytest.approx(15.0, rel=0.03)


def test_is_the_matched_filter_and_the_presets_bank():
    x, f = recording(noise=0.1)
    found = identify(x, f, DT, ["rls"], bandwidth=20.0, force_lag=5e-3)
    regression = MatchedFilter(20.0, 5e-3).run(x, f, DT)
    assert all(map(np.array_equal, found.regression, regression))
    expected = found.preset.bank().run(*regression)["rls"]
    assert np.array_equal(found.estimates["rls"].k, expected.k)
    assert found.bank["rls"].estimate.k == expected.k[-1]
    assert found.preset.correlation == pytest.approx(1.0 / (0.5 * np.pi * 20.0 * DT))
    np.testing.assert_allclose(found.t, DT * np.arange(len(x)), atol=1e-12)


def test_compensates_the_lag_of_the_force_channel():
    lag, t = 0.02, np.arange(0.0, 4.0, DT)
    w = 2 * np.pi
    x = 5e-3 + 3e-3 * np.sin(w * t)
    gain, phase = 1.0 / np.hypot(1.0, w * lag), np.arctan(w * lag)
    f = 2100.0 * 5e-3 + 3e-3 * gain * (
        2100.0 * np.sin(w * t - phase) + 15.0 * w * np.cos(w * t - phase)
    )
    for given, b in ((0.0, 15.0 - 2100.0 * lag), (lag, 15.0)):
        found = identify(x, f, DT, ["rls"], bandwidth=20.0, force_lag=given)
        assert found.estimates["rls"].b[-1] == pytest.approx(b, abs=1.5)


def test_given_settings_are_used():
    found = identify(*recording(), DT, ["me"], preset=paper_preset("soft"))
    assert found.preset.grid == paper_preset("soft").grid
    assert found.preset.estimators == ("me",)
    assert found.estimates["me"].k[-1] == 2100.0


def test_accepts_uneven_sampling():
    rng = np.random.default_rng(0)
    dt = DT * (1.0 + 0.4 * rng.uniform(-1.0, 1.0, 2000))
    t = np.cumsum(dt)
    x = 5e-3 + 3e-3 * np.sin(7.0 * t)
    found = identify(x, 2100.0 * x + 15.0 * 21e-3 * np.cos(7.0 * t), dt, ["rls"])
    assert found.estimates["rls"].k[-1] == pytest.approx(2100.0, rel=0.005)
    np.testing.assert_allclose(found.t, t - t[0], atol=1e-12)


def test_intervals_have_their_nominal_coverage():
    inside = []
    for seed in range(30):
        found = identify(*recording(2.0, noise=0.1, seed=seed), DT, ["rls"], bandwidth=20.0)
        e = found.estimates["rls"]
        inside.append((abs(e.k[-1] - 2100.0), abs(e.b[-1] - 15.0)))
        inside[-1] = np.array(inside[-1]) < LEVEL_95 * np.array([e.k_std[-1], e.b_std[-1]])
    assert np.mean(inside) > 0.85


def test_all_stands_for_every_method():
    assert [*identify(*recording(1.0), DT, ["all"]).estimates] == [*METHODS]


def test_data_frame_has_signals_and_estimates_by_time(found):
    frame = found.to_dataframe()
    each = ("b", "k", "b_std", "k_std", "held")
    assert [*frame.columns] == [
        *("x", "v", "f"),
        *(f"rls_{column}" for column in (*each, "k3", "k3_std")),
        *(f"spectral_{column}" for column in each),
    ]
    assert frame.index.name == "t"
    assert np.array_equal(frame.index, found.t)
    assert np.array_equal(frame["x"], found.regression.x)
    assert np.array_equal(frame["rls_k_std"], found.estimates["rls"].k_std)
    assert np.array_equal(frame["rls_k3"], found.estimates["rls"].further["k3"].value)
    assert frame["rls_held"].dtype == bool
    assert frame.loc[2.0:3.0].shape == (501, len(frame.columns))


def test_plot_has_both_parameters_with_units_and_a_name_for_each_line(found):
    figure = found.plot("single")
    assert isinstance(figure, Figure)
    assert figure.get_figwidth() == 3.5
    stiffness, damping, *_ = figure.axes
    assert stiffness.get_ylabel() == r"stiffness $\hat k$ [kN/m]"
    assert damping.get_ylabel() == r"damping $\hat b$ [N s/m]"
    assert damping.get_xlabel() == "time [s]"
    assert [line.get_label() for line in stiffness.lines] == ["rls", "spectral"]
    for axes, parameter, scale in ((stiffness, "k", 1e-3), (damping, "b", 1.0)):
        low, high = axes.get_ylim()
        assert low < scale * getattr(found.estimates["rls"], parameter)[-1] < high


def test_the_force_is_plotted_with_its_prediction(found):
    names = [text.get_text() for text in found.plot_force().legends[0].get_texts()]
    assert names == ["predicted by rls", "measured", "least squares of the model"]


def test_the_text_of_a_result_is_one_short_line_with_the_estimates_at_the_end(found):
    text = repr(found)
    assert "\n" not in text
    assert len(text) < 200
    last = found.estimates["rls"]
    half = 1.96 * last.k_std[-1]
    k, stated = map(float, re.search(r"rls k = (\S+) \u00b1 (\S+) N/m", text).groups())
    assert k == pytest.approx(last.k[-1], abs=half)
    assert stated == pytest.approx(half, rel=0.1)


def test_of_many_estimators_the_text_names_three():
    x, f = recording(1.0)
    assert "18 further estimators" in repr(identify(x, f, DT, "all"))


def test_an_estimator_without_an_estimate_is_named_as_such():
    nothing = np.zeros(3)
    held = Estimates(nothing, nothing, nothing, nothing, np.ones(3, dtype=bool))
    assert short_text("Found", "3 samples", {"rls": held}) == "Found(3 samples; rls no estimate)"


def test_a_notebook_shows_a_table_and_a_picture(found):
    table = found._repr_html_()
    assert table.startswith("<table>")
    assert table.count("<tr>") == 3
    assert found.plot()._repr_png_().startswith(b"\x89PNG")


X, F = recording(1.0)
SAMPLES = [
    ((X, F[1:], DT), r"f has shape \(499,\), but x has \(500,\)"),
    ((X, F, np.full(3, DT)), r"dt has shape \(3,\), but x has \(500,\)"),
    ((X[None], F, DT), r"samples must be one-dimensional, x has shape \(1, 500\)"),
    ((np.append(X[1:], np.nan), F, DT), r"x\[499\] is nan, expected a finite number"),
    ((X, np.append(F[1:], np.inf), DT), r"f\[499\] is inf, expected a finite number"),
    ((X, F, 0.0), r"dt\[0\] is 0.0, expected a positive number"),
    ((X, F, np.append(np.full(499, DT), -1.0)), r"dt\[499\] is -1.0, expected a positive number"),
]


def refused(message, *arguments, **settings):
    """Check that the data are refused with this message in one line."""
    with pytest.raises(ValueError, match=message) as caught:
        identify(*arguments, **settings)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("samples", "message"), SAMPLES)
def test_a_bad_sample_is_named(samples, message):
    refused(message, *samples, bandwidth=20.0)


@pytest.mark.parametrize(("samples", "message"), SAMPLES)
def test_a_bad_sample_is_named_without_a_bandwidth_too(samples, message):
    refused(message, *samples)


@pytest.mark.parametrize(
    ("samples", "message"),
    [
        (([], [], DT), "at least four samples"),
        ((X[:3], F[:3], DT), "at least four samples"),
        ((0.0 * X, F, DT), "a motion"),
        ((X, 0.0 * F, DT), "cannot estimate: the force is zero in all samples"),
    ],
)
def test_data_without_information_is_refused(samples, message):
    refused(message, *samples)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"estimators": ["rsl"]}, "estimator 'rsl': did you mean rls\\? expected all, or some"),
        ({"estimators": ["rls", "rls"]}, "estimator 'rls' is given twice"),
        ({"estimators": []}, "no estimator is given"),
        ({"model": "maxwell"}, "model 'maxwell': expected one of kelvin-voigt"),
        ({"bandwidth": 0.0}, "bandwidth must be positive"),
        ({"force_lag": -1.0}, "lag must be >= 0"),
    ],
)
def test_a_bad_setting_is_named(settings, message):
    refused(message, X, F, DT, **settings)
