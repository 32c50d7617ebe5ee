"""``picoradar laser-class``: class of a pulse train."""

from __future__ import annotations

from typing import Annotated

import typer

from picoradar.instrument.cli import output
from picoradar.instrument.cli.options import Json
from picoradar.instrument.errors import BadInput


def add_to(app: typer.Typer) -> None:
    """Register the subcommand."""
    app.command(
        "laser-class",
        epilog="Examples: picoradar laser-class --mean-power-mw 0.3\n\n"
        "picoradar laser-class --prf-hz 20000 --pulse-energy-nj 40 --json",
    )(laser_class)


def laser_class(
    wavelength_nm: Annotated[float, typer.Option(help="Wavelength, 700 to 1050 nm.")] = 904.0,
    prf_hz: Annotated[float, typer.Option(help="Pulses per second.")] = 80_000.0,
    width_ps: Annotated[float, typer.Option(help="Pulse width (FWHM), ps.")] = 44.0,
    pulse_energy_nj: Annotated[float | None, typer.Option(help="Energy of a pulse at the exit, nJ.")] = None,
    mean_power_mw: Annotated[
        float | None, typer.Option(help="Mean power at the exit, mW, in place of the energy.")
    ] = None,
    json: Json = False,
) -> None:
    """Compare a pulse train with the limits of class 1 (a calculation, not a certification)."""
    from picoradar.instrument.controller import EDITION, PulseTrain, classify

    if (pulse_energy_nj is None) == (mean_power_mw is None):
        raise BadInput("laser-class: give either --pulse-energy-nj or --mean-power-mw")
    try:
        if pulse_energy_nj is None:
            pulse_energy_nj = (mean_power_mw or 0.0) * 1e6 / prf_hz if prf_hz else 0.0
        found = classify(PulseTrain(wavelength_nm, prf_hz, pulse_energy_nj, width_ps * 1e-12))
    except ValueError as error:
        raise BadInput(f"laser-class: {error}") from error
    result = {
        "ael_mw": found.ael_mw,
        "mean_power_mw": found.mean_power_mw,
        "single_pulse_ael_nj": found.single_pulse_ael_nj,
        "class1": found.class1,
        "edition": EDITION,
        "limits": {f"{name} nJ": limit for name, limit in found.limits_nj.items()},
    }
    if json:
        output.print_json(result)
    else:
        output.print_table("class 1" if found.class1 else "NOT class 1", result)
    if not found.class1:
        raise typer.Exit(output.EXIT_NOT_ACCEPTED)
