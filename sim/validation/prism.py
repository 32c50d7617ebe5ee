"""Calibration prism: figures 4.12 to 4.16, evaluated along the beam, after registration, and as a splatted surface."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from picoradar.sim.validation.bench import Bench, FloatArray
from picoradar.sim.validation.figures import Check, Kind, Part, axes

DISTANCE_MM = 900.0
COLUMNS, ROWS = 81, 41  # 0.5 mm and 1 mm in the base: 1 mm and 1 mm in height and along the ridge
MARGIN_MM = 0.6  # the whole spot, 0.5 mm of radius and 0.1 mm of pointing error, is on the body
DENSITY = 4  # the registration takes a model this many times as fine, so that points do not lock onto points
ITERATIONS = 60
START_DEG, START_MM = 4.0, 14.0
SUPPRESSION_RUNS, SUPPRESSION_DEG, SUPPRESSION_MM = 6, 2.5, 1.4  # table 4.3
SPLAT_MM = 1.0
SPLAT_THICKNESS_MM = 0.5  # put in: the dissertation does not state it, and it is the mean distance (within 0.05 mm)
PRISM_REASON = (
    "the simulated prism is exact, without a coat of paint of 0.1 mm, tolerances or a jig; and the dissertation "
    "takes its distances to a splatted surface, of a thickness that it does not state"
)
ZERO_READINGS = 400


def prism(seed: int) -> Part:
    """Scan the prism of section 4.1.1 at 90 cm with 8 averages and evaluate it as section 4.2.1 does."""
    model = _model()
    measured, along_mm = _scan(seed, model)
    (poses, rms_mm, largest_mm), model_from_scan = _register(measured, _model(DENSITY), seed)
    final = measured @ model_from_scan[:3, :3].T + model_from_scan[:3, 3]
    residual_mm = np.abs(_above_faces(final))
    splatted_mm = _splatted_distance(final, model)

    checks = [*_checks(along_mm, residual_mm), *_splat_checks(splatted_mm)]

    pictures = {}
    figure, ax = axes("x (mm)", "y (mm)", (-22, 22), (-22, 22))
    cloud = ax.scatter(measured[:, 0], measured[:, 1], c=measured[:, 2], s=2, cmap="viridis_r")
    figure.colorbar(cloud, label="z (mm)")
    pictures["fig_4_12"] = ("4.12: scanned points of the prism", figure)
    turns = np.array([np.degrees(Rotation.from_matrix(p[:3, :3]).as_rotvec()) for p in poses])
    shifts = np.array([p[:3, :3] @ model.mean(axis=0) + p[:3, 3] - model.mean(axis=0) for p in poses])
    figure, ax = axes("Iteration", "Rotation (deg), translation (mm)", (0, ITERATIONS), (-15, 15))
    for k, axis in enumerate("xyz"):
        ax.plot(turns[:, k], f"C{k}-", label=f"rotation {axis}")
        ax.plot(shifts[:, k], f"C{k}--", label=f"translation {axis}")
    ax.legend(fontsize=7, ncols=2)
    pictures["fig_4_13"] = ("4.13: rotation and translation during registration", figure)
    for stem, caption, label, values in (
        ("fig_4_14", "4.14: rms during registration", "RMS (mm)", rms_mm),
        ("fig_4_15", "4.15: largest residual during registration", "MRE (mm)", largest_mm),
    ):
        figure, ax = axes("Iteration", label, (0, ITERATIONS), (0, float(max(values)) * 1.05))
        ax.plot(values)
        pictures[stem] = (caption, figure)
    figure, ax = axes("Distance (mm)", "Points", (0, 2), (0, 900))
    bins = np.linspace(0, 2, 41).tolist()
    ax.hist(np.abs(along_mm), bins, histtype="step", label="along the beam")
    ax.hist(residual_mm, bins, histtype="step", label="registered points to the model")
    ax.hist(splatted_mm, bins, histtype="step", label="splatted surface to the model")
    ax.axvline(1.0, color="r", lw=0.8)
    ax.set_ylim(auto=True)
    ax.legend(fontsize=8)
    pictures["fig_4_16"] = ("4.16: distances of measured and model prism, by three evaluations", figure)
    return Part(checks, pictures)


def _checks(along_mm: FloatArray, residual_mm: FloatArray) -> list[Check]:
    """Points against the model, along the beam and after registration."""
    within, largest_mm = float(np.mean(residual_mm < 1.0)), float(residual_mm.max())
    along, mean_mm = float(np.abs(along_mm).max()), float(residual_mm.mean())
    other: tuple[Kind, str] = ("known difference", PRISM_REASON)
    return [
        Check("points within 1 mm after registration (share, fig 4.16)", "0.97", within, 0.99, 1, *other),
        Check("largest residual after registration (mm, fig 4.15)", "1.3", largest_mm, 0.4, 0.75, *other),
        Check("mean distance of registered points, not splatted (mm)", "0.52", mean_mm, 0.09, 0.14, *other),
        Check("largest error along the beam (mm)", "not stated", along, 0.9, 1.7, "predicted"),
        Check("mean error along the beam (mm)", "not stated", float(along_mm.mean()), -0.1, 0.1, "put in"),
    ]


def _splat_checks(splatted_mm: FloatArray) -> list[Check]:
    mean_mm, deviation_mm = float(splatted_mm.mean()), float(splatted_mm.std())
    name = f"mean distance of a surface splatted {SPLAT_THICKNESS_MM:g} mm thick (mm, fig 4.16)"
    return [
        Check(name, "0.52", mean_mm, 0.42, 0.55, "put in"),
        Check("its deviation (mm, fig 4.16)", "0.14", deviation_mm, 0.1, 0.18, "predicted"),
    ]


def _model(density: int = 1) -> FloatArray:
    """Points on the two faces in the scanner frame, (3321, 3) at density 1: ridge 40 mm nearer than the base."""
    half = 20.0 - MARGIN_MM
    columns, rows = ((count - 1) * density + 1 for count in (COLUMNS, ROWS))
    x, y = np.meshgrid(np.linspace(-half, half, columns), np.linspace(-half, half, rows))
    z = DISTANCE_MM - 20.0 + 2.0 * np.abs(x)
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()])


def _above_faces(points: FloatArray) -> FloatArray:
    """Height of points above the nearer face, mm."""
    return np.asarray((DISTANCE_MM - 20.0 + 2.0 * np.abs(points[:, 0]) - points[:, 2]) / np.sqrt(5.0))


def _scan(seed: int, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Send the beam to each place; get the points and their errors along the beam."""
    plate = Bench(seed, target="plate", distance_mm=1000.0)
    readings = [plate.interval_mm() for _ in range(ZERO_READINGS)]
    zero_mm = float(np.mean([truth.range_mm - interval for interval, truth in readings]))

    bench = Bench(seed, target="prism", distance_mm=DISTANCE_MM)
    points, errors = [], []
    for place in places:
        x_rad, y_rad = _angles_to(bench, place)
        bench.aim(x_rad, y_rad)
        interval_mm, _ = bench.interval_mm()
        beam = bench.ideal_beam(x_rad, y_rad)
        path_mm = interval_mm + zero_mm + bench.settings.mirror_separation_mm - beam.path_mm
        hits = bench.scene.cast(beam.origin[None], beam.direction[None])
        points.append(beam.origin + path_mm * beam.direction)
        errors.append(path_mm - hits.distance_mm[0])
    seen = np.isfinite(errors)
    return np.array(points)[seen], np.array(errors)[seen]


def _angles_to(bench: Bench, place: FloatArray) -> tuple[float, float]:
    """Optical angles whose ray passes through a place, by Newton's method on the traced ray."""
    angles = np.array([place[0] / place[2], place[1] / place[2]])
    for _ in range(3):
        beam = bench.ideal_beam(*angles)
        reached = beam.origin + (place[2] - beam.origin[2]) / beam.direction[2] * beam.direction
        angles += (place - reached)[:2] / place[2]
    return float(angles[0]), float(angles[1])


Progress = tuple[list[FloatArray], list[float], list[float]]


def _register(data: FloatArray, model: FloatArray, seed: int) -> tuple[Progress, FloatArray]:
    """Register points to points with suppression of local minima as section 3.3 does, from 4 deg and 14 mm off.

    Returns pose (model_from_data), rms and largest residual after each iteration of the first run, and the
    best pose of all runs.
    """
    rng = np.random.default_rng([seed, 413])
    first = best = _icp(data, model, _moved(np.eye(4), data, rng, START_DEG, START_MM))
    for _ in range(SUPPRESSION_RUNS):
        run = _icp(data, model, _moved(best[0][-1], data, rng, SUPPRESSION_DEG, SUPPRESSION_MM))
        if run[1][-1] < best[1][-1]:
            best = run
    return first, best[0][-1]


def _moved(
    pose: FloatArray, data: FloatArray, rng: np.random.Generator, angle_deg: float, shift_mm: float
) -> FloatArray:
    """Turn by an angle about the middle of the data and shift, both in random directions."""
    axis, direction = (v / np.linalg.norm(v) for v in rng.standard_normal((2, 3)))
    centre = pose[:3, :3] @ data.mean(axis=0) + pose[:3, 3]
    moved = np.eye(4)
    moved[:3, :3] = Rotation.from_rotvec(np.radians(angle_deg) * axis).as_matrix()
    moved[:3, 3] = centre - moved[:3, :3] @ centre + shift_mm * direction
    return moved @ pose


def _icp(data: FloatArray, model: FloatArray, pose: FloatArray) -> Progress:
    tree = cKDTree(model)
    poses, rms, largest = [], [], []
    for _ in range(ITERATIONS + 1):
        moved = data @ pose[:3, :3].T + pose[:3, 3]
        nearest = np.asarray(tree.query(moved)[1])
        distance = np.linalg.norm(moved - model[nearest], axis=1)
        poses.append(pose.copy())
        rms.append(float(np.sqrt(np.mean(distance**2))))
        largest.append(float(distance.max()))
        pose = _paired(data, model[nearest])
    return poses, rms, largest


def _paired(data: FloatArray, model: FloatArray) -> FloatArray:
    """Least-squares rigid transform model_from_data of paired points."""
    data_mean, model_mean = data.mean(axis=0), model.mean(axis=0)
    turn, _ = Rotation.align_vectors(model - model_mean, data - data_mean)
    pose = np.eye(4)
    pose[:3, :3] = turn.as_matrix()
    pose[:3, 3] = model_mean - pose[:3, :3] @ data_mean
    return pose


def _splatted_distance(points: FloatArray, model: FloatArray) -> FloatArray:
    """Distance from the model to the outer surface of the splatted points, at each model point.

    Each point spreads a Gaussian of `SPLAT_MM` into space (section 3.2.2); the surface is the level at
    which exact points of the same spacing would give a body `SPLAT_THICKNESS_MM` thick to each side.
    """
    side = np.sign(model[:, 0])
    outward = np.column_stack([2.0 * side, np.zeros(len(model)), -np.ones(len(model))]) / np.sqrt(5.0)
    inner = (np.abs(model[:, 0]) > 3.0) & (np.abs(model[:, 0]) < 17.0) & (np.abs(model[:, 1]) < 17.0)
    origins, outward = model[inner], outward[inner]
    heights = np.arange(-1.0, 3.01, 0.05)
    exact = _density(cKDTree(model), origins + SPLAT_THICKNESS_MM * outward)
    field = np.array([_density(cKDTree(points), origins + height * outward) for height in heights])
    above = field > exact.mean()
    outermost = len(heights) - 1 - np.argmax(above[::-1], axis=0)
    return np.asarray(heights[outermost][above.any(axis=0)])


def _density(tree: cKDTree, places: FloatArray) -> FloatArray:
    distance, _ = tree.query(places, k=24)
    return np.asarray(np.exp(-0.5 * (distance / SPLAT_MM) ** 2).sum(axis=1))
