"""One run of the radar from the command line: bench opened, diode warm, scan recorded, everything off again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from picoradar.drivers.clock import ScaledClock
from picoradar.drivers.interfaces import Identity, TemperatureStatus
from picoradar.drivers.links import Transcript
from picoradar.instrument.acquisition import (
    RasterPlan,
    refuse_enormous_lines,
)
from picoradar.instrument.bench import make_bench
from picoradar.instrument.calibration import Calibration
from picoradar.instrument.cli import output, signals
from picoradar.instrument.cli.simulated import Simulated, shipped_calibration
from picoradar.instrument.controller import Controller
from picoradar.instrument.errors import BadInput, InterlockTripped, Interrupted
from picoradar.instrument.settings import Settings


@dataclass
class Session:
    """An open bench with its controller.

    Attributes
    ----------
    settings : Settings
    controller : Controller
        Connected; the diode is cold.
    identities : dict
        Who answered.
    calibration : Calibration
        In force for this session.
    simulated : Simulated or None
        The simulated bench behind the links, if it is one.
    """

    settings: Settings
    controller: Controller
    identities: dict[str, Identity]
    calibration: Calibration
    simulated: Simulated | None


@contextmanager
def session(
    settings: Settings,
    speed: float | None,
    transcript: Transcript | None = None,
    *,
    faults: Path | None = None,
    calibration: Calibration | None = None,
) -> Iterator[Session]:
    """Open the bench of the settings; leave it safe and closed, however it ends.

    While the session is open, each signal that ends a program (Ctrl-C, a closed terminal, ...) asks the controller to
    end safely; a second one is an emergency off.

    Raises
    ------
    Interrupted
        When a signal came, after the safe shutdown, however the work itself ended.
    """
    calibration = calibration_of(settings) if calibration is None else calibration
    refuse_enormous_lines(settings.scan.columns, settings.sampler.samples)  # before anything is switched
    RasterPlan.of(settings, calibration)  # refuses what does not fit into the scanner's span
    if faults is not None and settings.bench != "simulated":
        raise BadInput("--faults declares faults of the simulated bench; this settings file has real devices")
    simulated = Simulated(settings, speed, faults) if settings.bench == "simulated" else None
    try:
        if simulated is None:
            bench = make_bench(settings.links, ScaledClock(settings.links.speed), transcript=transcript)
        else:
            bench = make_bench(simulated.links, simulated.clock, simulated.usb_backend, transcript)
        controller = Controller(bench, settings)
        with signals.asking(controller) as came, _closing(controller, came):
            yield Session(settings, controller, controller.connect(), calibration, simulated)
    finally:
        if simulated is not None:
            simulated.close()


@contextmanager
def _closing(controller: Controller, came: list[str]) -> Iterator[None]:
    """Leave the radar safe and closed; whatever a signal has led to becomes `Interrupted`."""
    try:
        yield
    except InterlockTripped as tripped:
        if not came or not controller.safe.laser_off_verified:
            raise
        notes = getattr(tripped, "__notes__", [])
        raise Interrupted(
            "; ".join([f"interrupted ({', '.join(came)}): {tripped}", str(controller.safe), *notes])
        ) from tripped
    finally:
        if controller.state != "fault":
            controller.shut_down()
        if controller.state == "fault":
            controller.acknowledge()
    if came:
        raise Interrupted(f"interrupted ({', '.join(came)}) when the work was done already; {controller.safe}")


def calibration_of(settings: Settings) -> Calibration:
    """Load the calibration that the settings name, or the one that was measured on the simulated bench.

    Raises
    ------
    BadInput
        When real devices are to be used without one, or the file cannot be used.
    """
    if settings.calibration:
        return Calibration.load(Path(settings.calibration))
    if settings.bench != "simulated":
        raise BadInput("settings: calibration is empty; real devices need the calibration file of this radar")
    with resources.as_file(shipped_calibration(settings)) as path:
        return Calibration.load(path)


def warm_up(run: Session) -> None:
    """Warm the diode up, with a bar from where it starts to its target."""
    target = run.settings.diode.target_degc
    with output.progress() as bar:
        task = bar.add_task("warm-up", total=100, note="")
        first: list[float] = []

        def show(status: TemperatureStatus) -> None:
            first[:1] = first[:1] or [status.temperature_degc]
            way = abs(target - first[0]) or 1.0
            done = 99 * (1 - min(1.0, abs(target - status.temperature_degc) / way))
            bar.update(task, completed=100 if status.stable else done, note=f"{status.temperature_degc:.2f} degC")

        run.controller.warm_up(show)
