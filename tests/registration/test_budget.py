"""The error budget: each error's row against the change it makes, and what of it the points show."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration import ErrorBudget
from picoradar.registration.trust.budget import Seen, Socket, error_columns, mirror_axes

CENTRE = np.array([3.0, -2.0, 900.0])


def seen(count: int = 50) -> Seen:
    """Points before a scanner at the origin whose z is the optical axis, on a surface that looks all ways."""
    rng = np.random.default_rng(3)
    places = CENTRE + rng.uniform(-30.0, 30.0, (count, 3))
    normals = rng.normal(size=(count, 3)) * [1.0, 1.0, 0.2] - [0.0, 0.0, 1.5]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    beams = places / np.linalg.norm(places, axis=1, keepdims=True)
    socket = Socket(CENTRE, 26.0, np.array([0.0, 0.0, -1.0]), np.zeros((0, 3)))
    return Seen(places, normals, beams, places, np.eye(3), CENTRE, [socket])


def residuals(points: np.ndarray, at: Seen, model: np.ndarray | None = None) -> np.ndarray:
    """Across the planes of the model's points, which are the places of `at` if not given."""
    return np.asarray(np.einsum("ij,ij->i", at.normals, points - (at.places if model is None else model)))


def with_mirrors(points: np.ndarray, scale: float, skew: float) -> np.ndarray:
    """Points as they come out at the same range when both mirror angles are wrong."""
    tangent = points[:, :2] / points[:, 2:]
    wrong = np.column_stack([tangent * (1.0 + scale), np.ones(len(points))])
    wrong[:, 1] += skew * tangent[:, 0]
    far = np.linalg.norm(points, axis=1, keepdims=True)
    return np.asarray(wrong / np.linalg.norm(wrong, axis=1, keepdims=True) * far)


def test_each_column_is_the_change_that_its_error_makes() -> None:
    at, small = seen(), 1e-4
    steepness = -np.einsum("ij,ij->i", at.normals, at.beams)
    changed = {
        "range": residuals(at.places + small * at.beams, at),
        "mirror scale": residuals(with_mirrors(at.places, small, 0.0), at),
        "mirror skew": residuals(with_mirrors(at.places, 0.0, small), at),
        "walk": residuals(at.places + small * (1.0 / np.maximum(steepness, 0.1) - 1.0)[:, None] * at.beams, at),
        "model offset": residuals(at.places, at, at.places + small * at.normals),
        "model scale": residuals(at.places, at, CENTRE + (1.0 + small) * (at.places - CENTRE)),
    }
    columns = error_columns(at, list(changed))
    for column, (name, change) in zip(columns.T, changed.items(), strict=True):
        np.testing.assert_allclose(small * column, change, atol=2e-6, err_msg=name)


def test_cartilage_covers_what_lies_on_the_sphere_of_a_socket() -> None:
    at = seen(400)
    off = np.abs(np.linalg.norm(at.places - CENTRE, axis=1) - 26.0)
    np.testing.assert_array_equal(error_columns(at, ["cartilage"])[:, 0], (off < 1.0).astype(float))
    assert 0 < (off < 1.0).sum() < 400


def test_the_optical_axis_is_the_scanners_or_the_mean_beam() -> None:
    ahead = np.tile([0.1, 0.0, 0.995], (3, 1))
    turn = registration.se3.rotation_from_vector(np.array([0.3, 0.2, -0.5]))
    np.testing.assert_allclose(mirror_axes(ahead, turn), turn)
    aside = np.tile([0.6, 0.0, 0.8], (3, 1))
    axes = mirror_axes(aside, turn)
    np.testing.assert_allclose(axes[:, 2], turn @ [0.6, 0.0, 0.8])
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)


@pytest.mark.parametrize(
    ("entries", "finding"),
    [
        ({"model_offset_mm": -0.1}, "model_offset_mm is -0.1"),
        ({"mirror_scale": 0.3}, "0 to 0.2"),
        ({"range_bias_mm": float("nan")}, "never measured"),
        ({"model_correlation_mm": 0.0}, "model_correlation_mm is 0"),
    ],
)
def test_what_is_no_standard_deviation_is_refused(entries: dict[str, float], finding: str) -> None:
    with pytest.raises(registration.RegistrationError, match=finding):
        ErrorBudget.from_mapping(entries)


def grown(model: registration.Model, by_mm: float) -> registration.Model:
    """The model with its surface moved out, as another threshold does."""
    return registration.prepare_model(model.vertices + by_mm * model.normals, model.faces)


def off(found: registration.Registration, scan: Any, targets: np.ndarray) -> np.ndarray:
    moved = found.model_from_scanner @ np.linalg.inv(scan.truth)
    return np.asarray(np.linalg.norm(registration.se3.transform(moved, targets) - targets, axis=1))


TARGETS = np.array([[0.0, 0.0, 0.0], [26.0, 0.0, 0.0], [0.0, 26.0, 0.0]])


@pytest.mark.parametrize("by_mm", [0.4, -0.4])
def test_a_model_of_another_threshold_is_found_out(
    socket: registration.Model, scan_of: Callable[..., Any], by_mm: float
) -> None:
    """Said as a budget it is taken into the pose; unsaid it is named, and no pass."""
    wrong, scan = grown(socket, by_mm), scan_of(socket, 4, n=50)
    unsaid = registration.register(scan.points, wrong, start=scan.truth, targets=TARGETS, range_bias_mm=0.1)
    said = registration.register(
        scan.points, wrong, start=scan.truth, targets=TARGETS, range_bias_mm=0.1, model_offset_mm=0.4
    )
    assert unsaid.verdict != "pass"
    assert any("--model-offset-mm" in reason for reason in unsaid.reasons), unsaid.reasons
    assert off(said, scan, TARGETS).max() < 0.5 * off(unsaid, scan, TARGETS).max()
    assert (off(said, scan, TARGETS) < [target.stated_mm for target in said.targets]).all()


def test_an_error_that_the_points_do_not_show_counts_in_full(
    socket: registration.Model, scan_of: Callable[..., Any]
) -> None:
    """A common range error: whatever its size, the pose stays, and the target is off by it."""
    scan = scan_of(socket, 0)
    small, large = (
        registration.register(scan.points, socket, start=scan.truth, targets=TARGETS, range_bias_mm=mm)
        for mm in (0.0, 2.0)
    )
    np.testing.assert_allclose(small.model_from_scanner, large.model_from_scanner, atol=1e-9)
    for before, target in zip(small.targets, large.targets, strict=True):
        assert target.bias_parts_mm["range"] == pytest.approx(2.0, rel=0.1)
        assert target.p95_mm == pytest.approx(before.p95_mm)


def test_a_model_that_errs_in_patches_is_not_averaged_away(
    socket: registration.Model, scan_of: Callable[..., Any]
) -> None:
    """Ten times the points: about half of the error by their noise, but nearly all of that by the model."""
    few, many = scan_of(socket, 0, n=40), scan_of(socket, 0, n=126)

    def predicted(scan: Any, sigma_model_mm: float) -> float:
        budget = ErrorBudget(
            range_bias_mm=0.0, mirror_scale=0.0, mirror_skew_rad=0.0, sigma_model_mm=sigma_model_mm,
            model_correlation_mm=5.0,
        )  # fmt: skip
        found = registration.register(scan.points, socket, start=scan.truth, targets=TARGETS, budget=budget)
        return found.targets[0].rms_mm

    assert predicted(many, 0.0) < 0.6 * predicted(few, 0.0)
    assert predicted(many, 0.3) > 0.75 * predicted(few, 0.3)
    assert predicted(many, 0.3) == pytest.approx(2.0 * predicted(many, 0.15), rel=0.25)
