"""`write_report`: a folder that a person opens and sees at a glance whether the scan can be used."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from picoradar.instrument.events import JsonObject
from picoradar.instrument.files.export import export
from picoradar.instrument.recording import Cloud, Recording, plain
from picoradar.instrument.report import content
from picoradar.instrument.report.cloud_view import draw_cloud
from picoradar.instrument.report.overlay import draw_overlay
from picoradar.instrument.report.page import Page, Picture
from picoradar.instrument.report.registered import RegisteredScan, Surface
from picoradar.instrument.report.residuals import draw_convergence, draw_histogram
from picoradar.instrument.report.style import save
from picoradar.instrument.report.two_echoes import draw_two_echoes
from picoradar.instrument.report.waveform import draw_waveform

if TYPE_CHECKING:
    from picoradar.registration import Registration


def write_report(
    folder: str | os.PathLike[str],
    *,
    recording: Recording,
    cloud: Cloud | None = None,
    registered: RegisteredScan | None = None,
    summary: JsonObject,
) -> Path:
    """Write ``report.html`` (self-contained), its pictures, ``cloud.ply`` and ``result.json`` into a folder.

    Parameters
    ----------
    folder : path
        Made if it is not there; older files of a report in it are replaced.
    recording : Recording
    cloud : Cloud, optional
        Its points, where they are in memory; read from the recording otherwise.
    registered : RegisteredScan, optional
    summary : mapping
        The whole result, as the command prints it with ``--json``.

    Returns
    -------
    Path
        Of ``report.html``.

    Raises
    ------
    ValueError
        If the registration is not of this recording's points.
    RecordingError
        If a line of the recording is damaged.
    ExportError, OSError
        If the folder cannot be written to.
    """
    target = Path(folder)
    target.mkdir(mode=0o700, parents=True, exist_ok=True)
    cloud = recording.cloud() if cloud is None else cloud
    points = int(cloud.has_range.sum())
    if registered is not None and (count := len(registered.registration.residuals)) != points:
        raise ValueError(f"the registration has {count} points, the recording {points}")
    export(recording, target / "cloud.ply", zero_check=_zero_check(summary))
    result = json.dumps(plain(summary), indent=2, sort_keys=True, allow_nan=False, ensure_ascii=False)
    (target / "result.json").write_text(result + "\n", encoding="utf-8")
    page = Page(
        title=f"picoradar: report on {recording.path.name}",
        banners=content.banners(recording, registered),
        figures=content.figures(cloud, registered),
        pictures=_pictures(target, recording, cloud, registered),
        facts=content.facts(recording, cloud, registered, summary),
        details=[
            ("Result (as in result.json)", result),
            ("Settings, calibration and versions", json.dumps(recording.header, indent=2, sort_keys=True)),
        ],
        footer=f"picoradar {recording.header['versions']['picoradar']}: research software, not a certified device.",
    )
    file = target / "report.html"
    file.write_text(page.html(), encoding="utf-8")
    return file


def _pictures(target: Path, recording: Recording, cloud: Cloud, registered: RegisteredScan | None) -> list[Picture]:
    points = cloud.with_range()
    pictures = []
    if registered is not None and len(points):
        if registered.model is not None:
            pictures.append(_overlay(target, points, registered.registration, registered.model))
        pictures.append(_histogram(target, registered.registration))
    if len(points):
        pictures.append(_cloud(target, cloud))
        pictures += _two_echoes(target, points)
        pictures += _waveform(target, recording, cloud)
    if registered is not None and registered.registration.history:
        pictures.append(_convergence(target, registered.registration))
    return pictures


def _zero_check(summary: JsonObject) -> JsonObject | None:
    """Return what the check of the range zero has found, where the command says it of its scan."""
    scan = summary.get("scan")
    check = scan.get("zero_check") if isinstance(scan, Mapping) else None
    return dict(check) if isinstance(check, Mapping) else None


def _overlay(target: Path, points: Cloud, registration: Registration, model: Surface) -> Picture:
    figure = draw_overlay(points.points_mm, registration.residuals, model, registration.model_from_scanner)
    caption = (
        "Each measured point on the model of the bone, coloured and shaped by its distance from the surface: "
        "blue squares under 1 mm, green pentagons 1 to 3 mm, red triangles over 3 mm. "
        "Red in one patch means that something other than bone was measured there; red on one side, a wrong pose."
    )
    return Picture(save(figure, target / "overlay.png"), "Scan on the model", caption)


def _histogram(target: Path, registration: Registration) -> Picture:
    caption = (
        "How far the points lie from the model. A narrow heap about zero is a good fit; a heap beside zero is a common "
        "range error; long tails are points that do not belong to the bone."
    )
    return Picture(save(draw_histogram(registration.residuals), target / "residuals.png"), "Residuals", caption)


def _convergence(target: Path, registration: Registration) -> Picture:
    caption = "How the residuals shrank from iteration to iteration, and where they came to rest."
    return Picture(save(draw_convergence(registration.history), target / "convergence.png"), "Convergence", caption)


def _cloud(target: Path, cloud: Cloud) -> Picture:
    caption = (
        "The measured points as the scanner sees them. Left: the shape, as range. Right: how bright each echo was: "
        "below 25 mV the range is less certain."
    )
    return Picture(save(draw_cloud(cloud), target / "cloud.png"), "Point cloud", caption)


def _two_echoes(target: Path, points: Cloud) -> list[Picture]:
    """Draw the places with two echoes, if there are any."""
    if not points.two_echoes.any():
        return []
    caption = (
        "Places whose spot sees two surfaces that are told apart: an edge, a hole, something in front of the target. "
        "The point of the cloud is that of the first echo. Left: where, and how far behind it the last echo is. Right: "
        "how bright each of the two was."
    )
    return [Picture(save(draw_two_echoes(points), target / "two-echoes.png"), "Places with two echoes", caption)]


def _waveform(target: Path, recording: Recording, cloud: Cloud) -> list[Picture]:
    """Draw the trace of the point with a range that is nearest to the middle of the cloud, if traces were kept."""
    middle = np.median(cloud.grid[cloud.has_range], axis=0)
    distance = np.where(cloud.has_range, np.abs(cloud.grid - middle).sum(axis=1), np.inf)
    row, column = map(int, cloud.grid[int(np.argmin(distance))])
    line = recording.line(row)
    if line.traces is None:
        return []
    trace = line.traces.mv[int(np.flatnonzero(line.columns == column)[0])]
    title = f"one record: line {row}, column {column}, mean of {line.sweeps} sweeps"
    caption = (
        "The two pulses of one record: the reference straight from the laser, and the echo from the target. "
        "The marked points, at half of each pulse's own peak, are the time-significant points; their distance gives "
        "the range."
    )
    figure = draw_waveform(line.traces.times_ps, trace, title)
    return [Picture(save(figure, target / "waveform.png"), "Waveform", caption)]
