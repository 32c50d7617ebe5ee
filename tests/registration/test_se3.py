"""Rotation vectors and matrices are each other's inverses, from nothing to half a turn."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from picoradar.registration.se3 import rotation_from_vector, vector_from_rotation

ANGLES = st.one_of(st.floats(0.0, np.pi), st.floats(-12.0, 0.0).map(lambda e: np.pi - 10.0**e))
AXES = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda a: float(np.linalg.norm(a)) > 0.1)


@given(angle=ANGLES, axis=AXES)
def test_the_logarithm_undoes_the_exponential(angle: float, axis: tuple[float, float, float]) -> None:
    rotation = rotation_from_vector(angle * np.array(axis) / np.linalg.norm(axis))
    vector = vector_from_rotation(rotation)
    assert np.linalg.norm(vector) == pytest.approx(angle, abs=1e-7)
    np.testing.assert_allclose(rotation_from_vector(vector), rotation, atol=1e-12)


@pytest.mark.parametrize("axis", np.eye(3).tolist())
def test_half_turns_about_the_axes(axis: list[float]) -> None:
    half_turn = 2.0 * np.outer(axis, axis) - np.eye(3)
    np.testing.assert_allclose(np.abs(vector_from_rotation(half_turn)), np.pi * np.array(axis), atol=1e-12)
