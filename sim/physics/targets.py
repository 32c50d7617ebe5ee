"""Bodies to put in front of the scanner: hip bone, calibration bodies, or a mesh from a file; and where they stand."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.coated import coated
from picoradar.sim.physics.materials import BONE_MOIST, GRAY_PAINT, WHITE, Material, paint
from picoradar.sim.physics.mesh_file import read_mesh_file
from picoradar.sim.physics.noise import Noise
from picoradar.sim.physics.scene import FloatArray, Scene, Target
from picoradar.sim.physics.tissue import add_tissue, decorate
from picoradar.sim.settings import Pose, SimulationSettings

HIP_FILE = Path(__file__).parents[1] / "data" / "hip_right.stl"

# Sphere fit to the wall of the socket (radius 25.5 mm, rms 0.6 mm), and its opening direction: the mean normal of that
# wall. The hip model has y up and z forward; seen along the axis from outside, right is forward on a right hip.
SOCKET_CENTRE_MM = (-112.194, 17.333, -61.499)
SOCKET_AXIS = (-0.46298, -0.81403, 0.35073)

LARGEST_TILT_DEG = 15.0
AIM_SIGMA_MM = 1.5


def load_target(name: str, reflectance: float | None = None, piece: SimulationSettings | None = None) -> Target:
    """Make the body that the settings name.

    Parameters
    ----------
    name : str
        ``hip``, ``prism``, ``gray``, ``plate``, ``step``, ``sphere``, ``coated`` or the path of a mesh file in mm.
    reflectance : float, optional
        Diffuse reflectance of the whole body, then of paint; by default each body has its own material.
    piece : SimulationSettings, optional
        Material and coat of the body ``coated``; those of the defaults by default.

    Raises
    ------
    ValueError
        When it is a file that cannot be read, or holds no usable mesh in mm.
    """
    body = _BODIES.get(name)
    if name == "coated" and piece is not None:
        target = coated(piece.sample_material, piece.coat_mm)
    else:
        target = body() if body is not None else _from_file(name, name)
    return target if reflectance is None else made_of(target, paint(reflectance))


def made_of(target: Target, material: Material) -> Target:
    """Get the same body in one material."""
    return Target(target.name, target.vertices, target.faces, (material,), np.zeros(len(target.faces), dtype=np.int64))


def place_target(target: Target, distance_mm: float, pose: Pose | None, rng: np.random.Generator) -> FloatArray:
    """Put a body in front of the scanner.

    Parameters
    ----------
    target : Target
    distance_mm : float
        Distance of the body's centre (that of the socket, the front of a plate) along the beam at rest.
    pose : Pose or None
        x, y, z (mm) and turns about x, y, z (deg, in this order about fixed axes), applied to a body that faces the
        scanner with its middle in the origin; the frame of a mesh file is taken as it is.
        None puts it at ``distance_mm``: a bone with a random roll, a random tilt of up to 15 deg
        and a few mm of aiming error, as after set-up by hand; calibration bodies straight.
    rng : numpy.random.Generator

    Returns
    -------
    (4, 4) float array
        ``scanner_from_model``.
    """
    if pose is not None:
        facing = np.eye(4) if target.name not in _BODIES else _facing(target)
        return _rigid(_rotation(*np.radians(pose[3:])), np.array(pose[:3])) @ facing
    place = np.array([0.0, 0.0, distance_mm])
    if target.name in _BODIES and target.name != "hip":
        return _rigid(np.eye(3), place) @ _facing(target)
    tilt_rad = math.radians(rng.uniform(0.0, LARGEST_TILT_DEG))
    heading_rad, roll_rad = rng.uniform(-math.pi, math.pi, 2)
    about = _rotation(0.0, 0.0, heading_rad)
    turn = about @ _rotation(tilt_rad, 0.0, 0.0) @ about.T @ _rotation(0.0, 0.0, roll_rad)
    place[:2] = rng.normal(0.0, AIM_SIGMA_MM, 2)
    return _rigid(turn, place) @ _facing(target)


def build_scene(settings: SimulationSettings, noise: Noise, mark: Target | None = None) -> Scene:
    """Build the scene of the settings; random choices come from ``noise``.

    Parameters
    ----------
    settings : SimulationSettings
    noise : Noise
        Streams of the bench.
    mark : Target, optional
        Of the range zero, in the scanner's frame.

    Raises
    ------
    ValueError
        When the target cannot be used, or is to be decorated for surgery and is not the hip.
    """
    target = load_target(settings.target, settings.reflectance, settings)
    if settings.surgical or settings.tissue_share > 0:
        if settings.target != "hip":
            raise ValueError(f"target {settings.target}: surgical and tissue_share are for the hip only")
        centre, axis = np.array(SOCKET_CENTRE_MM), np.array(SOCKET_AXIS)
        if settings.surgical:
            target = decorate(target, centre, axis)
        if settings.tissue_share > 0:
            target = add_tissue(target, centre, settings.tissue_share, noise.stream("scene.tissue"))
    pose = place_target(target, settings.distance_mm, settings.target_pose, noise.stream("scene.pose"))
    return Scene(target, pose, mark)


def landmarks(name: str) -> dict[str, FloatArray]:
    """Get the named points (3,) mm of a body that a person can identify both on the model and in a scan.

    Raises
    ------
    ValueError
        When the body has none.
    """
    if name != "hip":
        raise ValueError(f"target {name} has no landmarks; only hip has")
    return {label: np.array(point) for label, point in _HIP_LANDMARKS.items()}


# On the rim of the socket as seen along its axis.
_HIP_LANDMARKS = {
    "superior rim": (-122.18, 40.24, -53.94),
    "posterior horn": (-95.61, 1.12, -70.29),
    "anterior horn": (-91.12, 14.47, -48.61),
}


def hip() -> Target:
    """Right human hip bone; source and licence in ``sim/data/README.md``."""
    return _from_file("hip", str(HIP_FILE))


def prism() -> Target:
    """Calibration prism (dissertation, section 4.1.1): base 40 x 40 mm, ridge 40 mm above it along y, gray paint."""
    vertices = [(x, y, -20.0) for x in (-20.0, 20.0) for y in (-20.0, 20.0)] + [(0.0, -20.0, 20.0), (0.0, 20.0, 20.0)]
    faces = [(0, 1, 5), (0, 5, 4), (2, 4, 5), (2, 5, 3), (0, 4, 2), (1, 3, 5), (0, 2, 3), (0, 3, 1)]
    return _body("prism", np.array(vertices), np.array(faces, dtype=np.int64), GRAY_PAINT)


def plate() -> Target:
    """White diffuse plate, 400 x 400 mm."""
    return _strips("plate", np.array([-200.0, 200.0]), np.array([0.0]), (WHITE,))


def step() -> Target:
    """Two white half plates, the one at positive x 10 mm nearer to the scanner."""
    return _strips("step", np.array([-200.0, 0.0, 200.0]), np.array([0.0, 10.0]), (WHITE, WHITE))


def gray() -> Target:
    """Plate with ten vertical strips from nearly black to white, 4 mm each (dissertation, figure 2.14)."""
    edges = np.concatenate([[-200.0], np.arange(-16.0, 17.0, 4.0), [200.0]])
    return _strips("gray", edges, np.zeros(10), tuple(paint(level) for level in np.linspace(0.07, 0.9, 10)))


def sphere() -> Target:
    """Gray sphere of 25 mm radius, 20480 faces (8 um from the ideal sphere)."""
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=5, radius=25.0)
    return _body("sphere", np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64), GRAY_PAINT)


_BODIES: dict[str, Callable[[], Target]] = {
    "hip": hip,
    "coated": coated,
    "prism": prism,
    "plate": plate,
    "step": step,
    "gray": gray,
    "sphere": sphere,
}


def _facing(target: Target) -> FloatArray:
    """Pose in which a body has its centre in the origin and faces the scanner along -z."""
    if target.name == "hip":
        middle, outward, up = np.array(SOCKET_CENTRE_MM), np.array(SOCKET_AXIS), np.array([0.0, 1.0, 0.0])
    elif target.name in _BODIES:
        middle, outward, up = np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
    else:
        middle = (target.vertices.min(axis=0) + target.vertices.max(axis=0)) / 2
        outward, up = np.array([0.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0])
    z = -outward / np.linalg.norm(outward)
    y = up - (up @ z) * z
    y /= np.linalg.norm(y)
    rotation = np.array([np.cross(y, z), y, z])
    return _rigid(rotation, -rotation @ middle)


def _rigid(rotation: FloatArray, translation: FloatArray) -> FloatArray:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = translation
    return matrix


def _rotation(x_rad: float, y_rad: float, z_rad: float) -> FloatArray:
    """Turns about the fixed axes x, then y, then z."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_euler("xyz", [x_rad, y_rad, z_rad]).as_matrix())


def _body(name: str, vertices: FloatArray, faces: NDArray[np.int64], material: Material) -> Target:
    return Target(name, vertices, faces, (material,), np.zeros(len(faces), dtype=np.int64))


def _strips(name: str, edges_mm: FloatArray, heights_mm: FloatArray, materials: tuple[Material, ...]) -> Target:
    """Strips along y between ``edges_mm``, each at its height above z = 0 and of its material."""
    vertices: list[tuple[float, float, float]] = []
    faces: list[tuple[int, int, int]] = []
    for left, right, height in zip(edges_mm[:-1], edges_mm[1:], heights_mm, strict=True):
        n = len(vertices)
        vertices += [(left, -200.0, height), (right, -200.0, height), (right, 200.0, height), (left, 200.0, height)]
        faces += [(n, n + 1, n + 2), (n, n + 2, n + 3)]
    return Target(
        name, np.array(vertices), np.array(faces, dtype=np.int64), materials, np.repeat(np.arange(len(materials)), 2)
    )


def _from_file(name: str, path: str) -> Target:
    if not Path(path).is_file():
        known = ", ".join(_BODIES)
        raise ValueError(f"target {path}: neither a body of the bench ({known}) nor a mesh file")
    return _body(name, *read_mesh_file(path), BONE_MOIST)
