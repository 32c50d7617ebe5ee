"""Report of `geometry`: the parameters with their uncertainty, what is identified, and the picture of the residuals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from picoradar.instrument.calibration import Calibration
from picoradar.instrument.procedures.geometry.plane_fit import KNOWN_SHARE, PlaneFit
from picoradar.instrument.procedures.geometry.plane_poses import Pose
from picoradar.instrument.procedures.geometry.plane_words import in_words, named
from picoradar.instrument.procedures.geometry.planes import (
    PARAMETERS,
    SIZES,
    FloatArray,
    PlaneScan,
    beams,
    fitted_plane,
    noise_of,
    points,
    values_of,
)
from picoradar.instrument.procedures.station.certainty import root_mean_square_by_noise
from picoradar.instrument.procedures.station.outcome import Outcome, Plot, Readings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RATIO_LIMIT = 1.1  # error of the points of a flat plate over the ranging noise, or what noise gives where they are few
PLANE_UNKNOWNS = 3
CUT = 4.0


def describe(
    name: str,
    scans: Sequence[PlaneScan],
    before: Calibration,
    after: Calibration,
    fit: PlaneFit,
    advice: tuple[Pose, FloatArray],
) -> Outcome:
    """Judge the fit on the pose held back (the last of the scans) and describe it."""
    judge = scans[-1]
    old = _off_plane(judge, values_of(before), before)
    new = _off_plane(judge, fit.values, before)
    ratio_before, ratio = _ratio(old), _ratio(new)
    pose, sd_with_it = advice
    figures: dict[str, float | int | str | bool | None] = {
        "plate_error_over_noise": ratio,
        "plate_error_over_noise_before": ratio_before,
        "rms_mm": fit.rms_mm,
        "sd_mm": fit.sd_mm,
        "outliers": int(np.count_nonzero(~fit.inliers)),
        "points": len(fit.inliers),
        "condition_number": fit.condition,
        "condition_number_scaled": fit.condition_scaled,
    }
    for parameter, value, sd, known in zip(PARAMETERS, fit.values, fit.sd, fit.identified, strict=True):
        figures[parameter] = float(value) if known else None
        figures[f"{parameter}_sd"] = float(sd) if known else None
    limit = max(RATIO_LIMIT, root_mean_square_by_noise(len(new[0]), PLANE_UNKNOWNS))
    passed = ratio <= limit
    findings = [
        f"On a pose of the plate that the fit has not seen, the points lie {ratio:.2f} times the ranging noise "
        f"off their plane (before: {ratio_before:.2f} times; at most {limit:.2f}).",
        *_parameters(fit),
        f"Best pose to add: {pose}; it would take {_gain(fit, sd_with_it)}.",
    ]
    use = "Use calibration.json of this folder: settings, key calibration."
    return Outcome(
        name,
        passed,
        findings,
        use if passed else f"Clean and check the plate, run gray-target, then this again; add the pose {pose}.",
        (f"{ratio:.2f}", f"error of the plate's points over the ranging noise (at most {limit:.2f})"),
        figures,
        [
            Plot(
                "residuals",
                "Distances from the plane, pose held back",
                _CAPTION,
                lambda f: _draw(f, judge, old, new),
                (9.0, 5.0),
            ),
            Plot("parameters", "How well each parameter is known", _KNOWN, lambda f: _draw_known(f, fit, sd_with_it)),
        ],
        {"points": _readings(scans, fit), "covariance": Readings(PARAMETERS, fit.covariance)},
        after,
    )


_CAPTION = (
    "Left with the calibration before, right with the new one. A pattern is an error of the scanner; what is left "
    "should be noise."
)
_KNOWN = (
    "Share of the uncertainty of an uncalibrated scanner that is left: the new calibration, and with the pose advised. "
    "Right of the dashed line the poses do not identify a parameter."
)


def _off_plane(scan: PlaneScan, values: FloatArray, before: Calibration) -> tuple[FloatArray, FloatArray]:
    """Return distances (N,) from the plane that fits best and the noise (N,) expected, both mm along the beams."""
    zero_mm = before.range_zero_mm
    plane = fitted_plane(points(scan, values, zero_mm))
    seen = beams(scan, values, plane, zero_mm)
    return seen.off_mm, noise_of(scan, seen, before.pointing_sd_rad)


def _ratio(off_and_noise: tuple[FloatArray, FloatArray]) -> float:
    """Root mean square of the distances in units of their noise, gross outliers left out."""
    normed = off_and_noise[0] / off_and_noise[1]
    scale = 1.4826 * float(np.median(np.abs(normed)))
    return float(np.sqrt(np.mean(normed[np.abs(normed) < CUT * scale] ** 2)))


def _gain(fit: PlaneFit, sd_with_it: FloatArray) -> str:
    share = sd_with_it / fit.sd
    best = int(np.argmin(share))
    return f"{100 * (1 - share[best]):.0f} % off the uncertainty of the {named(PARAMETERS[best])}"


def _parameters(fit: PlaneFit) -> list[str]:
    """Say what was found out, and what these poses cannot tell."""
    unknown = [named(name) for name, known in zip(PARAMETERS, fit.identified, strict=True) if not known]
    found = [f"{len(PARAMETERS) - len(unknown)} of {len(PARAMETERS)} parameters are identified; see the picture."]
    kept = f"These poses do not identify: {', '.join(unknown)}; kept as before."
    return [*found, kept] if unknown else found


def _readings(scans: Sequence[PlaneScan], fit: PlaneFit) -> Readings:
    rows = [
        np.column_stack([np.full(len(s.range_mm), number + 1.0), s.angles_rad, s.range_mm, s.variance_mm2])
        for number, s in enumerate(scans[:-1])
    ]
    joined = np.column_stack([np.vstack(rows), fit.residuals_mm, fit.inliers])
    columns = ("pose", "x_angle_rad", "y_angle_rad", "range_mm", "range_variance_mm2", "off_plane_mm", "inlier")
    return Readings(columns, joined)


def _draw(
    figure: Figure, scan: PlaneScan, old: tuple[FloatArray, FloatArray], new: tuple[FloatArray, FloatArray]
) -> None:
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    reach = max(4 * float(np.median(np.abs(old[0]))), 0.1)
    x, y = np.degrees(scan.angles_rad).T
    for axes, (off, _), title in zip(panels, (old, new), ("before", "after"), strict=True):
        dots = axes.scatter(x, y, c=off, s=14, marker="s", cmap="RdBu_r", vmin=-reach, vmax=reach)
        axes.set(xlabel="first mirror, deg", title=title, aspect="equal")
    panels[0].set_ylabel("second mirror, deg")
    figure.colorbar(dots, ax=panels, label="distance from the plane along the beam, mm")


def _draw_known(figure: Figure, fit: PlaneFit, sd_with_it: FloatArray) -> None:
    axes = figure.subplots()
    rows = np.arange(len(PARAMETERS))
    axes.plot(fit.sd / SIZES, rows, "o", color="tab:blue", label="these poses")
    axes.plot(sd_with_it / SIZES, rows, "|", color="tab:orange", ms=14, mew=2, label="with the pose advised")
    axes.axvline(KNOWN_SHARE, color="0.4", ls="--", lw=1)
    axes.set_yticks(rows, in_words(fit))
    axes.set(xscale="log", xlabel="standard deviation over that of an uncalibrated scanner", xlim=(1e-3, 1.5))
    axes.invert_yaxis()
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
