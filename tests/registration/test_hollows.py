"""Hollows of bodies made of caps of spheres: which are sockets, and how many of them count."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from picoradar.registration.model import Place, Surface, sphere_centres
from picoradar.registration.model.hollows import Socket, find_sockets
from picoradar.registration.model.views import as_scanned, opening
from picoradar.registration.settings import HollowSettings, PreparationSettings, SphereSettings, ViewSettings

SETTINGS = HollowSettings()
Mesh = tuple[np.ndarray, np.ndarray]


def bowl(
    radius_mm: float, half_deg: float = 80.0, at: tuple[float, float, float] = (0.0, 0.0, 0.0), *, spokes: int = 48
) -> Mesh:
    """The lower cap of a sphere about a point, which opens to +z; its normals point to the centre."""
    rings = 20 if spokes == 48 else 3
    theta = np.radians(half_deg) * np.arange(1, rings + 1) / rings
    phi = 2.0 * np.pi * np.arange(spokes) / spokes
    ring = np.stack([np.cos(phi), np.sin(phi)], axis=1)
    around = [np.column_stack([np.sin(t) * ring, np.full(spokes, -np.cos(t))]) for t in theta]
    vertices = radius_mm * np.concatenate([[[0.0, 0.0, -1.0]], *around]) + at
    k, after = np.arange(spokes), (np.arange(spokes) + 1) % spokes
    faces = [np.stack([np.zeros(spokes, int), 1 + k, 1 + after], 1)]
    for first in 1 + spokes * np.arange(rings - 1):
        a, b, c, d = first + k, first + after, first + spokes + after, first + spokes + k
        faces += [np.stack([a, d, c], 1), np.stack([a, c, b], 1)]
    return vertices, np.concatenate(faces)


def sockets_of(*parts: Mesh, turned_out: bool = False) -> list[Socket]:
    first = np.cumsum([0, *(len(v) for v, _ in parts)])
    faces = np.concatenate([f + k for (_, f), k in zip(parts, first[:-1], strict=True)])
    surface = Surface(np.concatenate([v for v, _ in parts]), faces[:, ::-1] if turned_out else faces)
    return find_sockets(surface, SETTINGS)


def cap_area(radius_mm: float, half_deg: float) -> float:
    return float(2.0 * np.pi * radius_mm**2 * (1.0 - np.cos(np.radians(half_deg))))


@pytest.mark.parametrize("radius_mm", [15.0, 25.0, 36.0])
def test_a_bowl_is_a_socket_with_its_centre_radius_axis_and_area(radius_mm: float) -> None:
    (found,) = sockets_of(bowl(radius_mm, at=(10.0, -20.0, 30.0)))
    np.testing.assert_allclose(found.centre, [10.0, -20.0, 30.0], atol=0.02 * radius_mm)
    assert found.radius_mm == pytest.approx(radius_mm, rel=0.02)
    np.testing.assert_allclose(found.axis, [0.0, 0.0, 1.0], atol=0.01)
    assert found.area_mm2 == pytest.approx(cap_area(radius_mm, 80.0), rel=0.02)


def test_a_ball_is_none() -> None:
    assert sockets_of(bowl(25.0), turned_out=True) == []


@pytest.mark.parametrize(("radius_mm", "count"), [(10.9, 0), (11.6, 1), (43.0, 1), (44.5, 0)])
def test_a_socket_may_be_a_fifth_smaller_or_larger_than_those_looked_for(radius_mm: float, count: int) -> None:
    """From 14 to 36.5 mm."""
    assert len(sockets_of(bowl(radius_mm))) == count


@pytest.mark.parametrize(("half_deg", "count"), [(52.0, 1), (59.0, 2)])
def test_a_second_hollow_counts_from_half_the_area_of_the_largest_on(half_deg: float, count: int) -> None:
    """The larger has a half angle of 80 deg; half of its area has one of 54 deg."""
    found = sockets_of(bowl(25.0), bowl(25.0, half_deg, at=(200.0, 0.0, 0.0)))
    assert len(found) == count
    assert found[0].area_mm2 == pytest.approx(cap_area(25.0, 80.0), rel=0.02)


def test_three_hollows_count_the_largest_first() -> None:
    found = sockets_of(*(bowl(25.0, 80.0 - 3.0 * k, at=(100.0 * k, 0.0, 0.0)) for k in range(4)))
    assert [round(socket.centre[0]) for socket in found] == [0, 100, 200]


@pytest.mark.parametrize(("apart_mm", "count"), [(8.0, 1), (18.0, 2)])
def test_hollows_with_centres_nearer_than_half_a_radius_are_one(apart_mm: float, count: int) -> None:
    """Two bowls of one axis, one above the other."""
    assert len(sockets_of(bowl(25.0), bowl(25.0, at=(0.0, 0.0, apart_mm)))) == count


@pytest.mark.parametrize(("spokes", "count"), [(5, 0), (7, 1)])
def test_fewer_than_thirty_faces_on_a_sphere_are_chance(spokes: int, count: int) -> None:
    """Three rings: five faces a spoke."""
    assert len(sockets_of(bowl(15.0, spokes=spokes))) == count


def test_a_hollow_that_nothing_opens_keeps_the_axis_of_its_own() -> None:
    """A few free directions of four hundred may point anywhere; those of a bowl show its opening."""
    ball = bowl(25.0, 179.9)
    socket = Socket(np.zeros(3), 25.0, np.array([0.6, 0.0, 0.8]), 1.0)
    np.testing.assert_array_equal(opening(Surface(*ball), socket, ViewSettings()), socket.axis)
    np.testing.assert_allclose(opening(Surface(*bowl(25.0)), socket, ViewSettings()), [0.0, 0.0, 1.0], atol=0.02)


def test_the_sphere_that_a_scan_shows_is_near_that_of_the_socket() -> None:
    """Else another hollow was seen: the socket's own fit stands in."""
    socket = Socket(np.array([3.0, 0.0, 0.0]), 25.0, np.array([0.0, 0.0, 1.0]), 1.0)  # 3 mm beside the bowl
    surface, usual = Surface(*bowl(25.0)), PreparationSettings()
    centre, radius_mm = as_scanned(surface, socket, socket.axis, usual)
    np.testing.assert_allclose(centre, 0.0, atol=0.3)
    assert radius_mm == 25.0
    strict = replace(usual, view=replace(usual.view, max_centre_shift_radii=0.1))
    assert as_scanned(surface, socket, socket.axis, strict) == (socket.centre, 25.0)


@pytest.mark.parametrize(("off_mm", "turn_deg", "shared"), [(9.0, 2.0, True), (11.0, 2.0, False), (9.0, 40.0, False)])
def test_starts_that_look_at_one_place_from_one_side_share_a_view(
    off_mm: float, turn_deg: float, *, shared: bool
) -> None:
    """Cells of 20 mm, and 120 directions some 18 deg apart."""
    settings, turn = ViewSettings(), np.radians(turn_deg)
    one = Place.of(np.zeros(3), np.array([0.0, 0.0, 1.0]), 41.0, settings)
    other = Place.of(np.array([off_mm, 0, 0]), np.array([np.sin(turn), 0.0, np.cos(turn)]), 41.0, settings)
    assert (one == other) == shared


def test_two_spheres_in_a_cloud_have_two_centres_and_one_has_one() -> None:
    """Forty of eight hundred hypotheses are settled, and those that end at one place count once."""
    one, other = bowl(25.0)[0], bowl(25.0, at=(40.0, 0.0, 0.0))[0]
    up = np.array([0.0, 0.0, 1.0])
    cloud = np.concatenate([one, other])
    cloud += np.random.default_rng(0).normal(0.0, 0.3, cloud.shape)
    found = sphere_centres(cloud, up, 25.0, SphereSettings())
    assert 2 <= len(found) <= 3
    assert sorted(round(centre[0]) for centre in found[:2]) == [0, 40]
    assert len(sphere_centres(one, up, 25.0, SphereSettings())) == 1
