"""Options of ``picoradar register``, some of which other commands take, too."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Method = Annotated[str, typer.Option(help="robust, or dissertation (ICP of the thesis; needs landmarks or a pose).")]
Start = Annotated[
    str,
    typer.Option(
        help="any, landmarks, or a JSON file with a 4x4 model_from_scanner or with the directions that the scanner may "
        'look from: {"towards": [x,y,z], "half_angle_deg": 20}, model frame.'
    ),
]

RangeBias = Annotated[
    float | None,
    typer.Option(
        help="SD of a range error common to all points, mm; by default what the recording, or its export, says."
    ),
]
ToleranceOption = Annotated[
    str | None,
    typer.Option(
        "--tolerance", help="Largest error that the verdict allows: DEG,MM of rotation and at the targets (1,1)."
    ),
]

TargetsFile = Annotated[
    Path | None, typer.Option("--targets", help='JSON list of {"position": [x,y,z], "name": ...}, model frame, mm.')
]
LandmarksFile = Annotated[
    Path | None,
    typer.Option("--landmarks", help='JSON list of {"scanner": [x,y,z], "model": [x,y,z], "name": ...}.'),
]
RegionsFile = Annotated[
    Path | None, typer.Option("--exclude", help='JSON list of {"center": [x,y,z], "radius_mm": r}, model frame.')
]
Origin = Annotated[str | None, typer.Option("--scanner-origin", help="Where the beams came from: x,y,z in mm.")]
Noise = Annotated[float | None, typer.Option(help="Range noise of a point, mm; estimated when not given.")]
SigmaModel = Annotated[
    float | None, typer.Option(help="SD of the model's surface, mm: random over it (facets 0.02, a CT of 1 mm 0.1).")
]
ModelOffset = Annotated[
    float | None, typer.Option(help="SD of the model being too large or small all over, mm: threshold of the CT.")
]
Fiducials = Annotated[
    Path | None, typer.Option(help="Pairs of points as for --landmarks, registered alone, without a cloud and a model.")
]
FleMm = Annotated[
    float | None, typer.Option(help="Localisation error of a fiducial pair, mm rms; what the pairs show by default.")
]
Budget = Annotated[
    Path | None,
    typer.Option(help='JSON with these and other standard deviations of what remains: {"mirror_scale": 0.001, ...}.'),
]
