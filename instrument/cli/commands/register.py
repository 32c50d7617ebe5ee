"""``picoradar register``: a recording or a point file to a mesh."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from picoradar.instrument.cli import output
from picoradar.instrument.cli.options import Json, parse_numbers
from picoradar.instrument.cli.register_inputs import read_budget, read_regions, read_start, read_targets
from picoradar.instrument.cli.register_options import (
    Budget,
    Fiducials,
    FleMm,
    LandmarksFile,
    Method,
    ModelOffset,
    Noise,
    Origin,
    RangeBias,
    RegionsFile,
    SigmaModel,
    Start,
    TargetsFile,
    ToleranceOption,
)
from picoradar.instrument.errors import BadInput
from picoradar.instrument.events import JsonObject

if TYPE_CHECKING:
    from picoradar.instrument.calibration import ZeroCheck
    from picoradar.instrument.files.points import PointFile
    from picoradar.registration import ErrorBudget, Registration, Target, Tolerance


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(
        epilog="Examples: picoradar register scan.db hip.stl --landmarks clicks.json\n\n"
        "picoradar register cloud.csv hip.stl --scanner-origin 0,0,0 --range-bias-mm 0.4 --json\n\n"
        "picoradar register --fiducials pairs.json --fle-mm 1.5 --targets places.json"
    )(register)


def register(
    cloud: Annotated[Path | None, typer.Argument(help="Recording, or points as .ply .csv .xyz .npz (mm).")] = None,
    model: Annotated[Path | None, typer.Argument(help="Mesh as .stl .ply .obj .glb .vtp (mm).")] = None,
    landmarks: LandmarksFile = None,
    targets: TargetsFile = None,
    exclude: RegionsFile = None,
    scanner_origin: Origin = None,
    noise_mm: Noise = None,
    range_bias_mm: RangeBias = None,
    sigma_model_mm: SigmaModel = None,
    model_offset_mm: ModelOffset = None,
    budget: Budget = None,
    fiducials: Fiducials = None,
    fle_mm: FleMm = None,
    tolerance: ToleranceOption = None,
    method: Method = "robust",
    start: Start = "any",
    json: Json = False,
) -> None:
    """Find the pose of a scanned cloud in a model, and say how far to trust it."""
    import picoradar.registration as reg
    from picoradar.instrument.cli import zero
    from picoradar.instrument.cli.commands.fiducials import Pairs, register_fiducials
    from picoradar.instrument.files.points import read_points

    chosen, allowed = checked_method(method), parse_tolerance(tolerance)
    begin, places, regions = read_start(start, landmarks), read_targets(targets), read_regions(exclude)
    if fiducials is not None:
        register_fiducials(Pairs(fiducials, fle_mm, alone=cloud is None), places, allowed, json=json)
        return
    cloud, model = _both(cloud, model)
    stated = read_budget(budget)
    points = read_points(cloud)
    check, known = zero.check_of_points(cloud, points), range_error_taken(cloud, points, range_bias_mm, stated)
    began = time.perf_counter()
    prepared = reg.load_model(model)
    prepared_at = time.perf_counter()
    result = reg.register(
        points.points,
        prepared,
        start=begin,
        origin=_origin(points, scanner_origin),
        covariance=points.covariance,
        response_mv=points.response_mv,
        grid=points.grid,
        method=chosen,
        targets=places,
        noise_mm=noise_mm,
        range_bias_mm=known["sd_mm"],
        sigma_model_mm=sigma_model_mm,
        model_offset_mm=model_offset_mm,
        budget=stated,
        exclude=regions,
        tolerance=allowed,
        objections=zero.objections(check),
    )
    times = {"prepare_ms": (prepared_at - began) * 1e3, "register_ms": (time.perf_counter() - prepared_at) * 1e3}
    about = {"range_error": known, "zero_check": zero.described(check)}
    _tell(result, None if not json else {**describe(result, allowed, **times), **about}, check, known)


def _tell(result: Registration, contract: JsonObject | None, check: ZeroCheck | None, known: JsonObject) -> None:
    """Print a registration as JSON, where its contract is given, or for people; end by its verdict."""
    if contract is not None:
        output.print_json(contract)
    else:
        show(result, check, known)
    if result.verdict == "fail":
        raise typer.Exit(output.EXIT_NOT_ACCEPTED)


def _both(cloud: Path | None, model: Path | None) -> tuple[Path, Path]:
    if cloud is None or model is None:
        raise BadInput("a cloud and a model are needed, or --fiducials FILE alone; see picoradar register --help")
    return cloud, model


def range_error_taken(
    cloud: Path, points: PointFile, said_mm: float | None, budget: ErrorBudget | None = None
) -> JsonObject:
    """Return material, bias and standard deviation of the common range error, and where the last is from.

    As said, as the budget has it, or as the points' file knows it.
    """
    known, in_budget = points.about.range_error, None if budget is None else budget.range_bias_mm
    sd_mm, source = points.range_bias_mm, None if known is None else cloud.name
    if said_mm is not None:
        sd_mm, source = said_mm, "--range-bias-mm"
    elif in_budget is not None:
        sd_mm, source = in_budget, "--budget"
    return {
        "material": None if known is None else known.material,
        "bias_mm": None if known is None else known.bias_mm,
        "sd_mm": sd_mm,
        "source": source,
    }


def _origin(points: PointFile, said: str | None) -> Sequence[float]:
    """Get where the beams came from: as said, as the file has it, or the scanner frame's own origin."""
    if said is not None:
        return parse_numbers(said, 3, "--scanner-origin", "x,y,z in mm")
    return (0.0, 0.0, 0.0) if points.origin is None else points.origin.tolist()


def describe(result: Registration, tolerance: Tolerance, *, prepare_ms: float, register_ms: float) -> JsonObject:
    """Describe a registration by the keys of the command's contract."""
    return {
        **result.to_dict(),
        "tolerance": {"rotation_deg": tolerance.rotation_deg, "target_mm": tolerance.target_mm},
        "prepare_ms": round(prepare_ms, 3),
        "register_ms": round(register_ms, 3),
    }


def parse_tolerance(text: str | None) -> Tolerance:
    """Read ``DEG,MM``; None is what registration allows by itself.

    Raises
    ------
    BadInput
        When these are not two numbers above 0.
    """
    from picoradar.registration import Tolerance

    if text is None:
        return Tolerance()
    rotation_deg, target_mm = parse_numbers(text, 2, "--tolerance", "DEG,MM, for example 1,1")
    if not (rotation_deg > 0 and target_mm > 0):
        raise BadInput(f"--tolerance {text!r}: both must be above 0; give DEG,MM, for example 1,1")
    return Tolerance(rotation_deg, target_mm)


def checked_method(text: str) -> Literal["robust", "dissertation"]:
    """Check the name of the method.

    Raises
    ------
    BadInput
    """
    if text == "robust":
        return "robust"
    if text == "dissertation":
        return "dissertation"
    raise BadInput(f"--method {text!r}: give robust or dissertation")


def show(result: Registration, check: ZeroCheck | None, known: JsonObject) -> None:
    """Print a registration for people."""
    rows: JsonObject = {
        "verdict": result.verdict,
        "why": "\n".join(result.reasons),
        "points used": f"{int(result.inliers.sum())} of {len(result.inliers)}",
        "residual rms, mm": f"{result.rms_mm:.3f}",
        "predicted rotation error, deg": f"{result.predicted_rotation_deg:.3f}",
    }
    rows["common range error"] = range_error_in_words(known)
    if check is not None and check.passed:  # else it stands in the reasons
        rows["range zero"] = check.sentence
    for target in result.targets:
        random = f"{target.rms_mm:.3f} rms, {target.p95_mm:.3f} in 95 %"
        rows[f"predicted error at {target.name}, mm"] = f"{random}; {in_words(target)}"
    for number, motion in enumerate(result.weak_directions, start=1):
        rows[f"motion {number}"] = motion
    for rival in result.rivals:
        rows["rival pose"] = f"{rival.rotation_deg:.1f} deg, {rival.translation_mm:.1f} mm away"
    rows["model_from_scanner"] = "\n".join(" ".join(f"{v:10.5f}" for v in row) for row in result.model_from_scanner)
    output.print_table("registration", rows)


def range_error_in_words(known: JsonObject) -> str:
    """Say what is taken for the range error that all points share, and where that is from."""
    if known["source"] is None:
        return "not known: neither the file nor --range-bias-mm says it"
    sd = "never measured" if known["sd_mm"] is None else f"SD {known['sd_mm']:.3f} mm"
    if known["bias_mm"] is None:
        return f"{sd} ({known['source']})"
    material = known["material"] or "material not stated"
    return f"{sd} ({known['source']}); {material}, {known['bias_mm']:.3f} mm taken off"


def in_words(target: Target) -> str:
    """Say what errors that leave no trace in the residuals add at a target."""
    if math.isnan(target.bias_mm):
        return "a common range error was never measured"
    parts = sorted(target.bias_parts_mm.items(), key=lambda part: -part[1])
    most = f", most of it {parts[0][0]}" if len(parts) > 1 else ""
    return f"with what leaves no trace (SD {target.bias_mm:.3f}{most}) {target.stated_mm:.3f}"
