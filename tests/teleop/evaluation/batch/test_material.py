"""The interval of the elastic modulus contains the error of the contact point."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.errors import InputError
from teleop.evaluation.batch.material import Indenter, elastic_modulus
from teleop.evaluation.batch.stiffness_result import StiffnessResult

DEPTH = 2e-3
SPHERE, CONE = Indenter("sphere", radius=5e-3), Indenter("cone", angle=0.8)


def result(k_error: float, depth_error: float) -> StiffnessResult:
    return StiffnessResult(
        500.0, 500.0 - k_error, 500.0 + k_error, depth=DEPTH, depth_error=depth_error
    )


def relative_interval(
    indenter: Indenter, k_error: float, depth_error: float
) -> tuple[float, float]:
    found = elastic_modulus(result(k_error, depth_error), indenter, True)
    modulus = found["modulus_pa"]
    return 1.0 - found["modulus_low_pa"] / modulus, found["modulus_high_pa"] / modulus - 1.0


@given(st.floats(0.0, 50.0), st.floats(0.0, 1e-4))
def test_the_modulus_of_a_sphere_changes_with_the_root_of_the_depth(
    k_error: float, depth_error: float
) -> None:
    expected = math.hypot(k_error / 500.0, 0.5 * depth_error / DEPTH)
    assert relative_interval(SPHERE, k_error, depth_error) == pytest.approx(
        (expected, expected), rel=0.05, abs=1e-9
    )


@given(st.floats(0.0, 50.0), st.floats(0.0, 5e-5))
def test_the_modulus_of_a_cone_changes_with_the_depth(k_error: float, depth_error: float) -> None:
    expected = math.hypot(k_error / 500.0, depth_error / DEPTH)
    assert relative_interval(CONE, k_error, depth_error) == pytest.approx(
        (expected, expected), rel=0.05, abs=1e-9
    )


def test_the_modulus_of_a_flat_punch_does_not_depend_on_the_contact_point() -> None:
    flat = Indenter("flat", radius=5e-3)
    assert relative_interval(flat, 50.0, 1e-3) == pytest.approx((0.1, 0.1))


def test_a_contact_point_with_an_error_above_the_depth_gives_no_modulus_of_a_sphere() -> None:
    with pytest.raises(InputError, match="contact point"):
        elastic_modulus(result(1.0, 1.1 * DEPTH), SPHERE, True)


def test_a_layer_changes_the_effect_of_the_depth() -> None:
    layer = Indenter("sphere", radius=5e-3, thickness=5e-3)
    assert relative_interval(layer, 0.0, 1e-4)[1] > relative_interval(SPHERE, 0.0, 1e-4)[1]
