"""The report folder of a procedure: page, pictures, figures, raw readings, settings, calibration."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from picoradar.instrument.events import JsonObject
from picoradar.instrument.procedures.station.outcome import Outcome, Plot
from picoradar.instrument.recording import plain, versions
from picoradar.instrument.report import Banner, Page, Picture
from picoradar.instrument.settings import Settings, to_toml

DPI = 140


def write_outcome(
    folder: Path, outcome: Outcome, *, settings: Settings, seed: int | None, simulation: BaseModel | None = None
) -> JsonObject:
    """Write everything that a procedure found into a folder that exists.

    Parameters
    ----------
    folder : Path
    outcome : Outcome
    settings : Settings
        In force.
    seed : int or None
        Of the simulated bench.
    simulation : pydantic model, optional
        What the simulated bench was made of.

    Returns
    -------
    dict
        The keys of the command's contract: ``name``, ``passed``, ``figures``, ``calibration``, ``report``.
    """
    pictures = [_draw(folder, plot) for plot in outcome.plots]
    calibration = folder / "calibration.json" if outcome.calibration is not None else None
    if calibration is not None and outcome.calibration is not None:
        outcome.calibration.save(calibration)
    for name, table in outcome.readings.items():
        header = ",".join(table.columns)
        np.savetxt(folder / f"{name}.csv", table.values, delimiter=",", header=header, comments="", fmt="%.9g")
    settings_text = to_toml(settings, simulation)
    (folder / "settings.toml").write_text(settings_text, encoding="utf-8")
    result: JsonObject = plain(
        {
            "name": outcome.name,
            "passed": outcome.passed,
            "figures": dict(outcome.figures),
            "findings": list(outcome.findings),
            "next_step": outcome.next_step,
            "calibration": calibration,
            "report": folder / "report.html",
        }
    )
    provenance = {
        "seed": seed,
        "versions": versions(),
        "settings_digest": "sha256:" + hashlib.sha256(settings_text.encode()).hexdigest(),
        "calibration_digest": outcome.calibration.digest if outcome.calibration is not None else None,
    }
    _write(folder / "figures.json", json.dumps({**result, **provenance}, indent=1) + "\n")
    _write(folder / "report.html", _page(outcome, pictures, provenance, settings_text).html())
    return result


def _write(path: Path, text: str) -> None:
    """Write a file as a whole or not at all, lest a full disk leave half a page."""
    partial = path.with_name(path.name + ".partial")
    partial.write_text(text, encoding="utf-8")
    partial.replace(path)


def _draw(folder: Path, plot: Plot) -> Picture:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=plot.size_in, layout="constrained")
    FigureCanvasAgg(figure)
    plot.draw(figure)
    path = folder / f"{plot.name}.png"
    figure.savefig(path, dpi=DPI, metadata={"Software": None})
    return Picture(path, plot.title, plot.caption)


def _page(outcome: Outcome, pictures: list[Picture], provenance: JsonObject, settings_text: str) -> Page:
    kind, symbol, word = ("pass", "✔", "PASSED") if outcome.passed else ("fail", "✘", "NOT PASSED")
    banners = [Banner(kind, symbol, word, outcome.findings), Banner("plain", "➜", "Next", [outcome.next_step])]
    shown = [(name, "could not be had" if value is None else _shown(value)) for name, value in outcome.figures.items()]
    return Page(
        title=f"picoradar bench: {outcome.name}",
        banners=banners,
        figures=[outcome.headline],
        pictures=pictures,
        facts=shown,
        details=[("Settings", settings_text), ("Seed, versions, digests", json.dumps(provenance, indent=1))],
        footer="Beside this page: recordings with all traces in raw, readings as CSV, all figures in figures.json.",
    )


def _shown(value: float | int | str | bool) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
