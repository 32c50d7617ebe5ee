"""Picture of the registered cloud on the model, by painter's algorithm: no OpenGL, no display needed."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.report.registered import Surface
from picoradar.instrument.report.style import BONE, CLASSES, INK, ResidualClass, classes_of, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_MOST_POINTS = 20_000
_POINT_LIFT_MM = 2.0  # so that a point on the surface is not half hidden by the facets that it lies on
_RESIDUAL_LIFT = 1.5  # and one behind it, where a wrong pose has put it, not hidden at all


def draw_overlay(
    points_mm: FloatArray,
    residuals_mm: FloatArray,
    model: Surface,
    model_from_scanner: FloatArray,
) -> Figure:
    """Draw the points (N, 3) of the scanner on the model, coloured by their residuals (N,)."""
    figure = new_figure(10.0, 5.4)
    every = max(1, -(-len(points_mm) // _MOST_POINTS))
    kinds = classes_of(residuals_mm)
    scanner_from_model = np.linalg.inv(model_from_scanner)
    corners = model.vertices @ scanner_from_model[:3, :3].T + scanner_from_model[:3, 3]
    centre = points_mm.mean(axis=0)
    reach = float(np.percentile(np.linalg.norm(points_mm - centre, axis=1), 99))
    left, right = figure.subplots(1, 2)
    lift_mm = _POINT_LIFT_MM + _RESIDUAL_LIFT * np.abs(residuals_mm)
    for axes, title, turn_deg, tilt_deg, frame in (
        (left, "as seen from the scanner", 0.0, 0.0, 1.15),
        (right, "from 35 degrees to the side", 35.0, 20.0, 1.9),
    ):
        view = _view(turn_deg, tilt_deg)
        marks = _Marks(
            (points_mm[::every] - centre) @ view.T,
            lift_mm[::every],
            kinds[::every],
            float(np.clip(0.45 * reach / np.sqrt(len(points_mm) / every), 0.006 * reach, 0.03 * reach)),
        )
        _paint(axes, ((corners - centre) @ view.T)[model.faces], marks, frame * reach)
        axes.set_title(title, color=INK, fontsize=11, loc="left")
    _legend(figure, kinds)
    return figure


def _view(turn_deg: float, tilt_deg: float) -> FloatArray:
    """Return the rotation (3, 3) from the scanner frame to (right, up, away) of a viewer who looks along +z.

    The viewer then walks round the object: `turn_deg` sideways and `tilt_deg` up.
    """
    turn, tilt = np.radians([turn_deg, tilt_deg])
    from_scanner = np.diag([-1.0, 1.0, 1.0])  # looking along +z with y up, +x is at the left hand
    sideways = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    upwards = np.array([[1, 0, 0], [0, np.cos(tilt), np.sin(tilt)], [0, -np.sin(tilt), np.cos(tilt)]])
    return np.asarray(upwards @ sideways @ from_scanner)


class _Marks(NamedTuple):
    """The measured points as a viewer sees them: positions (N, 3) mm (right, up, away), how far each is lifted towards
    him (N,) mm, its class of residual (N,), and the size of a mark, mm."""

    points: FloatArray
    lifts: FloatArray
    kinds: IntArray
    size: float


def _paint(axes: Axes, triangles: FloatArray, marks: _Marks, frame: float) -> None:
    """Paint triangles (F, 3, 3) and marks from the farthest to the nearest, within +-``frame`` mm."""
    from matplotlib.collections import PolyCollection

    points, kinds = marks.points, marks.kinds
    inside = (np.abs(triangles[:, :, :2]).max(axis=2) < 1.3 * frame).any(axis=1)
    triangles = triangles[inside]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    light = np.abs(normals @ [0.25, 0.35, -0.9]) / np.maximum(lengths, 1e-12)
    shades = np.clip(0.45 + 0.58 * light, 0, 1)[:, None] * np.array(BONE)
    shapes_of = [_corners(entry, marks.size) for entry in CLASSES]
    shapes = [
        *triangles[:, :, :2],
        *(point[:2] + shapes_of[kind] for point, kind in zip(points, kinds, strict=True)),
    ]
    colours = np.array([_rgb(entry.colour) for entry in CLASSES])[kinds]
    depth = np.concatenate([triangles[:, :, 2].mean(axis=1), points[:, 2] - marks.lifts])
    order = np.argsort(-depth, kind="stable")
    filled = np.concatenate([shades, colours])[order]
    axes.add_collection(
        PolyCollection([shapes[k] for k in order], facecolors=filled, edgecolors=filled, linewidths=0.25)
    )
    axes.set_xlim(-frame, frame)
    axes.set_ylim(-frame, frame)
    axes.set_aspect("equal")
    axes.set_axis_off()
    bar = 10.0 if frame > 8 else 1.0
    axes.plot([-0.95 * frame, -0.95 * frame + bar], [-0.95 * frame] * 2, color=INK, linewidth=2)
    axes.text(-0.95 * frame, -0.93 * frame, f"{bar:g} mm", color=INK, va="bottom")


def _corners(entry: ResidualClass, size: float) -> FloatArray:
    count = entry.corners
    angles = np.pi / 2 + 2 * np.pi * np.arange(count) / count + (np.pi / 4 if count == 4 else 0.0)
    return np.asarray(entry.size * size * np.column_stack([np.cos(angles), np.sin(angles)]))


def _rgb(colour: str) -> list[float]:
    return [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]


def _legend(figure: Figure, kinds: IntArray) -> None:
    from matplotlib.lines import Line2D

    counts = np.bincount(kinds, minlength=len(CLASSES))
    handles = [
        Line2D(
            [], [], linestyle="", marker=entry.marker, color=entry.colour, markersize=9,
            label=f"{entry.words}: {count} ({100 * count / max(len(kinds), 1):.1f} %)",
        )
        for entry, count in zip(CLASSES, counts, strict=True)
    ]  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=11)
