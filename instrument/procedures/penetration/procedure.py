"""`penetration`: the range error on bone or tissue, from a flat piece with gray paint on one half.

Light enters the bare half and comes back late; paint lets hardly any in. So the bare half seems to stand behind the
painted one, by the bias of the material and the thickness of the paint (docs/range-error.md). Each way of ranging has
a bias of its own and is measured by itself.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import (
    ZERO_MATERIAL,
    Calibration,
    Material,
    Ranging,
    Stretch,
    jacobian,
    true_angles,
)
from picoradar.instrument.errors import BadInput
from picoradar.instrument.procedures.penetration.report import Piece, described
from picoradar.instrument.procedures.penetration.step import Half, Lean, Step, fit_lean, step_between
from picoradar.instrument.procedures.penetration.stretch import PoseEchoes, echoes_of, stretch_of_piece
from picoradar.instrument.procedures.station.findings import lost_readings, refused
from picoradar.instrument.procedures.station.measured import Measured
from picoradar.instrument.procedures.station.outcome import Outcome
from picoradar.instrument.procedures.station.stage import Placing
from picoradar.instrument.procedures.station.station import Station
from picoradar.instrument.recording import Cloud

NAME = "penetration"
MATERIAL, COAT_MM = "bone", 0.1
DISTANCE_MM = 900.0
TILTS_DEG = (0.0, 45.0, 60.0)  # about the long side: as obliquely as the wall of a socket is seen
STEP_MM, AVERAGES = 1.0, 8
HALF_LENGTH_MM, HALF_WIDTH_MM = 17.0, 7.0  # scanned of a piece of 40 x 20 mm
EDGE_MM = 4.0  # left out on both sides of the edge: light in bone is seen 3 mm beside its beam

# Standard deviations of one piece, mm (1 sigma; the sheet on light in tissue, half-coated sample)
COAT_THICKNESS_SD_MM = 0.02  # micrometer or profilometer
COAT_BIAS_SD_MM = 0.03  # gray paint itself reads 0.065 +- 0.02 mm too far, as do the cards of the range zero: the rest
WALK_SD_MM = 0.05  # bare and painted half differ in amplitude: 0.03 to 0.1
PAINT_BIAS_MM = 0.065  # of opaque gray paint against a surface that lets no light in

# Deviation of the bias between two pieces of the same material, as a share of it. Between pieces scattering varies by
# 20 %, absorption by 40 %, the index by 0.03; that moves the bias of bone by 8 %, of cartilage by 11 %, of wet
# cancellous bone, which absorbs most, by 15 %. Two pieces differ by the square root of two of that: 0.4 mm for bone.
SPREAD = {"bone": 0.08, "cartilage": 0.11, "cancellous": 0.15, "fat": 0.05, "muscle": 0.08}
OTHER_SPREAD = 0.15

MISPLACED_MM = 40.0
ROUGH_MM = 1.0  # rms of the painted half about a plane: more is no flat piece
NEAREST_MM, FARTHEST_MM = -0.3, 9.0  # of the bias: nothing reads nearer than paint, no tissue farther (fat: 8.5 mm)
ALIKE = 0.03  # difference of the halves' brightness below which they may be of one material
REMEDY = (
    "Put the piece up flat, the long side across, with the painted half on the left as seen from the scanner (negative "
    "x) and the edge straight ahead, and run this again."
)


def run(
    station: Station,
    *,
    material: str = MATERIAL,
    coat_mm: float = COAT_MM,
    tilts_deg: Sequence[float] = TILTS_DEG,
    step_mm: float = STEP_MM,
) -> Outcome:
    """Scan both halves at several tilts, and take the bias of the material from the steps between them.

    Parameters
    ----------
    station : Station
    material : str
        Of the piece: the name that a scan is ranged by later (``--material``).
    coat_mm : float
        Thickness of the paint, measured.
    tilts_deg : sequence of float
        Turns of the piece about its long side.
    step_mm : float
        Distance of neighbouring points.

    Raises
    ------
    BadInput
        When the material is the paint that everything is measured against, or has no name.
    """
    if material in ("", ZERO_MATERIAL):
        raise BadInput(f"material {material!r}: name what lies under the {ZERO_MATERIAL}, for example bone")
    poses: dict[float, dict[Ranging, Step]] = {}
    echoes: list[PoseEchoes] = []
    for number, tilt_deg in enumerate(tilts_deg):
        station.progress(number / len(tilts_deg), f"piece turned by {tilt_deg:g} deg")
        asked = Placing("coated", DISTANCE_MM, (tilt_deg, 0.0))
        reported_mm = station.stage.place(asked)
        sweep, clouds = _measured(station, tilt_deg, step_mm)
        halves, lost = _halves(clouds, station.calibration, str(asked))
        if lost:
            return refused(NAME, lost, REMEDY)
        lean = fit_lean(halves["template" if "template" in halves else "half-maximum"][0])
        if wrong := _no_piece(lean, reported_mm):
            return refused(NAME, f"The {asked} {wrong}", REMEDY)
        poses[tilt_deg] = {ranging: step_between(*both, lean) for ranging, both in halves.items()}
        if "template" in clouds:
            echoes.append(echoes_of(sweep, _sides(clouds["template"]), station.calibration))
    station.progress(1.0, "evaluating")
    piece = Piece(material, coat_mm, poses)
    stretch = stretch_of_piece(echoes) if echoes else None
    entries = {ranging: _material(station, piece, ranging, stretch) for ranging in poses[tilts_deg[0]]}
    if wrong := _no_halves(entries, poses[tilts_deg[0]]["half-maximum"]):
        return refused(NAME, wrong, REMEDY)
    before = station.calibration
    materials = {**before.materials, material: entries}
    after = type(before).model_validate(before.model_copy(update={"materials": materials}).model_dump())
    return described(NAME, piece, after, PAINT_BIAS_MM)


def _measured(station: Station, tilt_deg: float, step_mm: float) -> tuple[Measured, dict[Ranging, Cloud]]:
    """Scan the piece in each way that the radar can range; all points, also those without a range, and the whole
    traces."""
    name, calibration = f"tilt-{tilt_deg:02.0f}", station.calibration
    scan = functools.partial(
        station.scan,
        rows=1 + 2 * round(HALF_WIDTH_MM * math.cos(math.radians(tilt_deg)) / step_mm),
        columns=1 + 2 * round(HALF_LENGTH_MM / step_mm),
        step_mm=step_mm,
        distance_mm=DISTANCE_MM,
        averages=AVERAGES,
    )
    sweep = scan(name)
    found: dict[Ranging, Cloud] = {"half-maximum": sweep.reprocessed("half-maximum", calibration)}
    if calibration.templates is not None:
        found["template"] = sweep.reprocessed("template", calibration)
    if calibration.templates is not None and station.has_windows:
        found["window"] = scan(f"{name}-window", in_windows=True).cloud
    return sweep, found


def _sides(cloud: Cloud) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which points are on the painted half, and which on the bare one."""
    across_mm = np.tan(cloud.angles_rad[:, 0]) * DISTANCE_MM
    return across_mm < -EDGE_MM, across_mm > EDGE_MM


def _halves(
    clouds: Mapping[Ranging, Cloud], calibration: Calibration, asked: str
) -> tuple[dict[Ranging, tuple[Half, Half]], str]:
    """Split each cloud into its painted and its bare half; also a finding in words where too much of one is lost."""
    halves: dict[Ranging, tuple[Half, Half]] = {}
    for ranging, cloud in clouds.items():
        both = []
        for name, side in zip(("painted", "bare"), _sides(cloud), strict=True):
            found = cloud.where(side & cloud.has_range)
            if lost := lost_readings(len(found), int(side.sum()), f"the {name} half of the {asked}"):
                return {}, lost
            angles = true_angles(found.angles_rad, calibration.scanner)
            beams = jacobian(angles, found.range_mm, calibration.mirror_separation_mm)[:, :, 2]
            both.append(Half(found.points_mm, beams, found.response_mv))
        halves[ranging] = (both[0], both[1])
    return halves, ""


def _no_piece(lean: Lean, reported_mm: float) -> str:
    """Say why this cannot be the painted half of a flat piece where it was reported; empty when it can."""
    if lean.flatness_mm > ROUGH_MM:
        return f"is not flat: the points of its painted half lie {lean.flatness_mm:.2f} mm (rms) off a plane."
    if abs(lean.middle_mm - reported_mm) > MISPLACED_MM:
        return f"was found at {lean.middle_mm:.0f} mm, reported at {reported_mm:g} mm: something else stands there."
    return ""


def _no_halves(entries: Mapping[Ranging, Material], square: Step) -> str:
    """Say why these cannot be a painted and a bare half; empty when they can."""
    least, largest = min(entry.bias_mm for entry in entries.values()), max(entry.bias_mm for entry in entries.values())
    if least < NEAREST_MM:
        return f"The bare half reads {-least:.2f} mm nearer than paint: the halves are exchanged, or it is no piece."
    if largest > FARTHEST_MM:
        return f"The bare half reads {largest:.2f} mm farther than paint, more than any tissue: it is no flat piece."
    alike = abs(square.bare_mv - square.painted_mv) < ALIKE * square.painted_mv
    if alike and largest < 3.0 * max(entry.sample_sd_mm for entry in entries.values()):
        return "Both halves are equally bright and equally far: this is no half painted piece (a plain plate?)."
    return ""


def _material(station: Station, piece: Piece, ranging: Ranging, stretch: Stretch | None) -> Material:
    """Combine the poses: the mean bias, as a scan sees its target at many angles, and what is uncertain about it."""
    biases = piece.biases_mm(ranging)
    bias_mm = float(np.mean(biases))
    readings_mm = float(np.mean([steps[ranging].sd_mm for steps in piece.poses.values()]))  # one piece: no better by 3
    sample_sd_mm = math.hypot(readings_mm, float(np.std(biases)), COAT_THICKNESS_SD_MM, COAT_BIAS_SD_MM, WALK_SD_MM)
    share = math.sqrt(2.0) * SPREAD.get(piece.material, OTHER_SPREAD)
    how = f"bench procedure {NAME}: half painted piece, paint {piece.coat_mm:g} mm, {len(biases)} tilts up to"
    how += f" {max(piece.poses):g} deg at {DISTANCE_MM:g} mm, {station.stage}; another piece differs by {share:.0%}"
    if abs(bias_mm) < 2.0 * sample_sd_mm:
        how += ": of nothing, as no light was seen to enter this one"
        stretch = None
    if stretch is not None:
        places = [steps[ranging].place_sd_mm for steps in piece.poses.values()]
        stretch = stretch.model_copy(update={"place_sd_mm": float(np.sqrt(np.mean(np.square(places))))})
    return Material(
        bias_mm=bias_mm,
        sample_sd_mm=sample_sd_mm,
        transfer_sd_mm=share * abs(bias_mm),
        measured=station.date,
        method=how,
        stretch=None if ranging == "half-maximum" else stretch,  # whose fit leaves nothing that would show it
    )
