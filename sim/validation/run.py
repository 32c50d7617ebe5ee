"""`validate`: all parts, one page."""

from __future__ import annotations

import html
from collections.abc import Callable
from pathlib import Path
from typing import TypedDict

from picoradar.sim.validation.distance import distance
from picoradar.sim.validation.figures import KINDS, Check, Part
from picoradar.sim.validation.laser import laser
from picoradar.sim.validation.prism import prism
from picoradar.sim.validation.scanning import scanning
from picoradar.sim.validation.socket import socket

SEED = 2004
PARTS: dict[str, Callable[[int], Part]] = {
    "Laser transmitter": lambda _seed: laser(),
    "Traces and distances": distance,
    "Scanner and drift": scanning,
    "Calibration prism": prism,
    "Hip socket": socket,
}

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem; color: #222 }
table { border-collapse: collapse; width: 100% } td, th { text-align: left; padding: .25rem .6rem }
tr { border-bottom: 1px solid #ddd } .pass { color: #087830 } .fail { color: #c00; font-weight: bold }
.pictures { display: flex; flex-wrap: wrap } figure { margin: .5rem; width: 30% } img { width: 100% }
figcaption { font-size: 13px }
"""


class Report(TypedDict):
    """Result of the validation, by the keys of the command."""

    figures: list[dict[str, object]]
    passed: bool
    report: str


def validate(out_dir: str | Path, seed: int = SEED, progress: Callable[[str], None] = lambda _part: None) -> Report:
    """Compare the simulator with the dissertation, figure by figure, and write a report of one page.

    Parameters
    ----------
    out_dir : str or Path
        Folder for ``report.html`` and its pictures; made if it is not there.
    seed : int, optional
        Root seed of all noise.
    progress : callable, optional
        Called with the name of each part before it begins.

    Returns
    -------
    dict
        ``figures`` (list of dict: name, dissertation, simulator, tolerance, passed, kind, reason), ``passed``,
        ``report``.
    """
    folder = Path(out_dir)
    folder.mkdir(parents=True, exist_ok=True)
    done: dict[str, Part] = {}
    for name, part in PARTS.items():
        progress(name)
        done[name] = part(seed)
        for stem, (_, figure) in done[name].pictures.items():
            figure.savefig(folder / f"{stem}.png", dpi=110)
    checks = [check for part in done.values() for check in part.checks]
    report = folder / "report.html"
    report.write_text(_page(done, seed), encoding="utf-8")
    return {
        "figures": [check.as_json() for check in checks],
        "passed": all(check.passed for check in checks),
        "report": str(report),
    }


def _page(parts: dict[str, Part], seed: int) -> str:
    checks = [check for part in parts.values() for check in part.checks]
    passed = sum(check.passed for check in checks)
    body = [
        f"<h1>Simulator against dissertation</h1><p>{passed} of {len(checks)} values pass; seed {seed}.</p>",
        "<ul>",
    ]
    for kind, meaning in KINDS.items():
        count = sum(check.kind == kind for check in checks)
        body.append(f"<li><b>{kind}</b> ({count}): {html.escape(meaning)}</li>")
    body.append("</ul>")
    for name, part in parts.items():
        rows = "".join(_row(check) for check in part.checks)
        head = (
            "<tr><th>Quantity</th><th>Dissertation</th><th>Simulator</th><th>Tolerance</th><th>Kind</th><th></th></tr>"
        )
        body.append(f"<h2>{html.escape(name)}</h2><table>{head}{rows}</table>")
        pictures = "".join(
            f'<figure><img src="{stem}.png" alt="{html.escape(caption)}">'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>"
            for stem, (caption, _) in part.pictures.items()
        )
        body.append(f'<div class="pictures">{pictures}</div>')
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Validation</title><style>{_STYLE}</style>'
        f"</head><body>{''.join(body)}</body></html>\n"
    )


def _row(check: Check) -> str:
    verdict = '<td class="pass">pass</td>' if check.passed else '<td class="fail">fail</td>'
    kind = f"{check.kind}: {check.reason}" if check.reason else check.kind
    cells = (check.name, check.dissertation, f"{check.simulator:.4g}", f"{check.low:g} to {check.high:g}", kind)
    return "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + verdict + "</tr>"
