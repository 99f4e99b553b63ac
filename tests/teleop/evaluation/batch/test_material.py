"""The elastic modulus of records that are computed from the laws of Hertz and Sneddon."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from teleop.cli import main
from teleop.errors import InputError
from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.material import (
    Indenter,
    contact_radius_at,
    elastic_modulus,
    fit_contact_law,
    force_law,
    hayes_factor,
)
from teleop.evaluation.reading.signals import Signals, periods

MODULUS, POISSON = 20e3, 0.5
REDUCED = MODULUS / (1.0 - POISSON**2)
SPHERE, CONE = Indenter("sphere", radius=5e-3), Indenter("cone", angle=1.0)
RATE, FREQUENCY, DEPTH = 200.0, 0.5, 2e-3


def palpation(
    indenter: Indenter, seed: int, gap: float = 1e-3, damping: float = 0.0, zero: float = 3e-4
) -> Signals:
    """A sine into a half-space. `damping` is the damping by the elastic force, at full speed."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 12.0, 1.0 / RATE)
    amplitude, phase = 0.5 * (DEPTH + gap), 2.0 * np.pi * FREQUENCY * t
    x = amplitude * (1.0 - np.cos(phase)) - gap
    d = np.maximum(x, 0.0)
    if indenter.shape == "sphere":
        f = 4.0 / 3.0 * REDUCED * math.sqrt(5e-3) * d**1.5
    else:
        f = 2.0 / math.pi * REDUCED * math.tan(1.0) * d**2
    f = f * (1.0 + damping * np.sin(phase))
    f = f + rng.normal(0.0, 3e-3 * f.max(), len(f))
    return Signals(t, x + zero, f, periods(t), "position")


@pytest.mark.parametrize(
    ("indenter", "damping"), [(SPHERE, 0.2), (CONE, 0.0)], ids=["sphere", "cone"]
)
def test_the_modulus_is_that_of_the_body(indenter: Indenter, damping: float) -> None:
    """95 % of the intervals contain the modulus: at least 3 of 5 in all but one of 800 runs."""
    held = 0
    for seed in range(5):
        found = elastic_modulus(analyse(palpation(indenter, seed, damping=damping)), indenter)
        assert found["modulus_pa"] == pytest.approx(MODULUS, rel=4e-3)
        assert found["modulus_high_pa"] - found["modulus_low_pa"] < 0.01 * MODULUS
        assert found["contact_point_m"] == pytest.approx(3e-4, abs=1e-5)
        assert found["depth_m"] == pytest.approx(DEPTH, abs=1e-5)
        held += found["modulus_low_pa"] <= MODULUS <= found["modulus_high_pa"]
    assert held >= 3


def test_a_record_that_starts_at_the_contact_point_needs_a_stated_datum() -> None:
    analysis = analyse(palpation(SPHERE, 0, gap=0.0, zero=0.0))
    assert analysis.phases.contact_point is None
    with pytest.raises(InputError, match="datum at the contact point"):
        elastic_modulus(analysis, SPHERE)
    found = elastic_modulus(analysis, SPHERE, (0.0, 0.0))
    assert found["modulus_pa"] == pytest.approx(MODULUS, rel=2e-3)
    assert found["contact_point_m"] == 0.0


def test_the_command_takes_a_stated_datum_as_the_contact_point(tmp_path, capsys) -> None:
    signals = palpation(SPHERE, 0, gap=0.0, zero=0.0)
    path = tmp_path / "sphere.csv"
    rows = zip(signals.t, signals.x * 1e3, signals.f, strict=True)
    path.write_text(
        "Time [s],Position [mm],Force [N]\n"
        + "".join(f"{t:.6f},{x:.7f},{f:.6f}\n" for t, x, f in rows)
    )
    command = ["estimate", str(path), "--indenter", "sphere", "--radius", "5mm", "--json"]
    assert main(command) == 2
    assert "has no contact point" in capsys.readouterr().err
    for datum in ("0mm,0N", "file"):
        assert main([*command, "--datum", datum]) == 0
        found = json.loads(capsys.readouterr().out)["material"]
        assert found["modulus_pa"] == pytest.approx(MODULUS, rel=2e-3)


def test_the_modulus_of_a_flat_punch_does_not_depend_on_the_contact_point() -> None:
    t = np.arange(0.0, 10.0, 0.005)
    x = 1e-3 * (1.0 - np.cos(np.pi * t))
    f = 2.0 * 5e-3 * REDUCED * x + np.random.default_rng(0).normal(0.0, 1e-3, len(t))
    flat = Indenter("flat", radius=5e-3)
    found = elastic_modulus(analyse(Signals(t, x + 0.1, f, periods(t), "position")), flat)
    assert found["modulus_pa"] == pytest.approx(MODULUS, rel=1e-3)
    assert found["modulus_low_pa"] <= MODULUS <= found["modulus_high_pa"]


def test_the_force_of_a_sphere_on_a_layer_is_that_of_dimitriadis() -> None:
    """E. K. Dimitriadis et al., Biophysical Journal 82, 2002: bonded and incompressible.

    Their series for thick layers has an error of 0.2 % at a contact radius of 0.1 thicknesses.
    """
    radius, thickness = 5e-3, 20e-3
    force = force_law(Indenter("sphere", radius, thickness=thickness), 1e-3)
    depth = np.array([1e-5, 1e-4, 1e-3])
    chi = np.sqrt(radius * depth) / thickness
    series = 1.0 + 1.133 * chi + 1.283 * chi**2 + 0.769 * chi**3 + 0.0975 * chi**4
    expected = 4.0 / 3.0 * math.sqrt(radius) * depth**1.5 * series
    np.testing.assert_allclose(force(depth), expected, rtol=3e-3)


@pytest.mark.parametrize("indenter", [SPHERE, CONE], ids=["sphere", "cone"])
def test_the_force_on_a_layer_rises_with_the_stiffness_of_the_contact_area(
    indenter: Indenter,
) -> None:
    """The increment of the force is that of a flat punch with the present contact radius."""
    layer = Indenter(indenter.shape, indenter.radius, indenter.angle, 5e-3)
    force = force_law(layer, 3e-3)
    for depth in (2e-4, 2e-3):
        a = contact_radius_at(layer, depth)
        near = depth * np.array([0.97, 1.03])
        slope = float(np.diff(force(near))[0] / np.diff(near)[0])
        assert slope == pytest.approx(2.0 * a * hayes_factor(a / 5e-3, POISSON), rel=5e-3)


def test_a_layer_gives_a_smaller_modulus_than_a_half_space() -> None:
    analysis = analyse(palpation(SPHERE, 0))
    layer = Indenter("sphere", radius=5e-3, thickness=5e-3)
    thin, thick = (fit_contact_law(analysis, one) for one in (layer, SPHERE))
    assert 0.2 < thin.modulus.value / thick.modulus.value < 0.5
    assert thin.rms > 1.5 * thick.rms
