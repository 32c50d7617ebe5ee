"""``picoradar register --fiducials``: paired points alone, without a cloud and a model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import typer

from picoradar.instrument.cli import output
from picoradar.instrument.cli.register_inputs import read_list
from picoradar.instrument.errors import BadInput
from picoradar.instrument.events import JsonObject

if TYPE_CHECKING:
    from picoradar.registration import Landmarks, Tolerance


class Pairs(NamedTuple):
    """Where the pairs are, their localisation error (mm, root mean square over three axes) where it is known, and
    whether no cloud was given beside them."""

    path: Path
    fle_mm: float | None
    alone: bool


def register_fiducials(pairs: Pairs, targets: list[JsonObject] | None, tolerance: Tolerance, *, json: bool) -> None:
    """Register pairs of points, predict the error at targets to second order, and print both.

    Raises
    ------
    BadInput
        With file and finding.
    """
    from picoradar.registration import Landmarks, RegistrationError

    if not pairs.alone:
        raise BadInput("--fiducials registers pairs alone; to begin at them with a cloud, give --landmarks")
    try:
        marks = Landmarks.from_pairs(read_list(pairs.path, "--fiducials") or [])
        result = _described(marks, targets, pairs.fle_mm, tolerance)
    except RegistrationError as error:
        raise BadInput(f"--fiducials {pairs.path}: {error}") from error
    if json:
        output.print_json(result)
    else:
        show(result)
    if result["verdict"] == "fail":
        raise typer.Exit(output.EXIT_NOT_ACCEPTED)


def _described(
    marks: Landmarks, targets: list[JsonObject] | None, fle_mm: float | None, tolerance: Tolerance
) -> JsonObject:
    from picoradar.registration import judge_pairs, paired_points, second_order
    from picoradar.registration.trust import named_targets
    from picoradar.registration.trust.covariance import quantile_mm

    judged = judge_pairs(marks.model, marks.scanner, fle_mm=fle_mm, names=marks.names)
    sigma = None if fle_mm is None else np.eye(3) * fle_mm**2 / 3.0
    found = paired_points(marks.model, marks.scanner, fixed_covariance=sigma)
    places: list[JsonObject] = []
    for name, position in named_targets(targets, found.centre):
        error = second_order(found.covariance, position - found.centre)
        p95_mm = quantile_mm(error.covariance_mm2 + np.outer(error.mean_mm, error.mean_mm))
        places.append({"name": name, "position": position.tolist(), "rms_mm": float(error.rms_mm), "p95_mm": p95_mm})
    reasons = list(judged.sentences)
    if len(marks.names) == 3 and fle_mm is None:
        reasons.append("Three pairs hardly tell their own localisation error: click more, or give --fle-mm.")
    reasons += [
        f"The error at {place['name']} reaches {place['p95_mm']:.2f} mm (95 %), limit {tolerance.target_mm:g} mm."
        for place in places
        if place["p95_mm"] > tolerance.target_mm
    ]
    return {
        "model_from_scanner": found.fixed_from_moving.tolist(),
        "verdict": "fail" if judged.sentences else "caution" if reasons else "pass",
        "reasons": reasons or ["The pairs agree, and the error at every target is within its limit."],
        "fre_mm": judged.fre_mm,
        "expected_fre_mm": None if fle_mm is None else judged.expected_fre_mm,
        "fle_mm": fle_mm if fle_mm is not None else judged.fre_mm / np.sqrt(1.0 - 2.0 / len(marks.names)),
        "pairs": [
            {"name": name, "residual_mm": float(seen), "expected_mm": float(usual)}
            for name, seen, usual in zip(marks.names, judged.residual_mm, judged.expected_mm, strict=True)
        ],
        "targets": places,
    }


def show(result: JsonObject) -> None:
    """Print it as a table."""
    usual = result["expected_fre_mm"]
    rows: dict[str, object] = {
        "verdict": result["verdict"],
        "reasons": "\n".join(result["reasons"]),
        "residuals (FRE)": f"{result['fre_mm']:.2f} mm" + ("" if usual is None else f", {usual:.2f} mm expected"),
        "localisation (FLE)": f"{result['fle_mm']:.2f} mm",
    }
    for pair in result["pairs"]:
        rows[pair["name"]] = f"{pair['residual_mm']:.2f} mm, {pair['expected_mm']:.2f} mm expected"
    for place in result["targets"]:
        rows[f"error at {place['name']}"] = f"{place['rms_mm']:.2f} mm rms, {place['p95_mm']:.2f} mm (95 %)"
    output.print_table("paired points", rows)
