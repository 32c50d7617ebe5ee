"""The one place where the instrument meets the simulator: it assembles the simulated bench for the command line."""

from __future__ import annotations

from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from picoradar.drivers.clock import VirtualClock
from picoradar.instrument.errors import BadInput
from picoradar.instrument.line import Flag
from picoradar.instrument.recording import Cloud
from picoradar.instrument.settings import Links, Settings, describe_errors

HAND_S = 1.0  # that the simulated person takes
NO_SINGLE_ECHO = Flag.MIXED | Flag.CLIPPED | Flag.OVERLAPPED | Flag.MOTION


class Simulated:
    """A simulated bench in this process, as the settings ask for it.

    Parameters
    ----------
    settings : Settings
        With ``bench = "simulated"``.
    speed : float, optional
        Factor of real time; None is as fast as the computer can.
    faults : path, optional
        Faults to inject into the bench, TOML or JSON (`picoradar.sim.faults`).

    Attributes
    ----------
    faults : list of dict
        The declared faults, for the header of the recording.

    Raises
    ------
    BadInput
        When the ``[simulation]`` table is not allowed, or the target cannot be used.
    """

    def __init__(self, settings: Settings, speed: float | None, faults: Path | None = None) -> None:
        from picoradar.sim import SimulatedBench
        from picoradar.sim.settings import SimulationSettings

        self.clock = VirtualClock(speed)
        checked = checked_simulation(settings)
        if not isinstance(checked, SimulationSettings):
            raise TypeError("checked_simulation did not return simulation settings")
        try:
            self.bench = SimulatedBench(checked, seed=settings.seed, clock=self.clock)
        except ValueError as error:
            raise BadInput(str(error)) from error
        self._scan = settings.scan
        self._links = settings.links
        self.faults: list[dict[str, object]] = []
        if faults is not None:
            self._arm(faults)

    def _arm(self, path: Path) -> None:
        from picoradar.sim.faults import arm, load_scenario

        try:
            declared = load_scenario(path)
            arm(self.bench, declared)
        except ValueError as error:
            self.bench.close()
            raise BadInput(str(error)) from error
        self.faults = [fault.as_dict() for fault in declared]

    @property
    def links(self) -> Links:
        """Get the links to the simulated devices."""
        return Links.model_validate({**self._links.model_dump(), **self.bench.urls})

    @property
    def usb_backend(self) -> object:
        """Get the pyusb backend that finds the simulated USB devices."""
        return self.bench.usb_backend

    @property
    def model_from_scanner(self) -> NDArray[np.float64]:
        """Get the true pose, 4x4."""
        return self.bench.truth.model_from_scanner

    @property
    def model(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Get vertices (V, 3) and faces (F, 3) of the target in its own frame, mm: the preoperative model."""
        return self.bench.bare_target.vertices, self.bench.bare_target.faces

    def move_interlock(self, told: str) -> None:
        """Open or close the lid, as the person at the bench is told, a moment later."""
        closed = not told.startswith("open")
        self.clock.call_at(self.clock.now() + HAND_S, lambda: setattr(self.bench.interlock, "closed", closed))

    def landmarks(self) -> list[dict[str, object]]:
        """Get three landmark pairs as clicked by a person, with a few mm of error in the scan."""
        return self.bench.clicked_landmarks()

    def truth_of(self, cloud: Cloud) -> dict[str, object]:
        """Compare the ranges of a scan with the true ones of the same shots.

        Returns
        -------
        dict
            ``range_rms_mm``, ``range_bias_mm``, ``range_max_mm`` over the ``single_echo_points`` (a mixed, clipped
            or overlapped echo has no one true range), and the true ``model_from_scanner``.
        """
        # Numbered before any point is left out: a point that was taken again counts, also when it is mixed.
        runs, records = self._measurements(cloud)
        single = cloud.has_range & ((cloud.flags & np.uint16(NO_SINGLE_ECHO)) == 0)
        error = cloud.range_mm[single] - self.bench.truth.ranges_mm(runs[single], records[single])
        error = error[np.isfinite(error)]
        some = error.size > 0
        return {
            "range_rms_mm": float(np.sqrt(np.mean(error**2))) if some else None,
            "range_bias_mm": float(error.mean()) if some else None,
            "range_max_mm": float(np.abs(error).max()) if some else None,
            "single_echo_points": int(error.size),
            "model_from_scanner": self.model_from_scanner,
        }

    def _measurements(self, found: Cloud) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Get run id and record number of each point of whole lines, as the scan modes number them."""
        rows, columns = found.rows.astype(np.int64), found.columns.astype(np.int64)
        if self._scan.mode == "sweep":
            return rows * self._scan.columns + columns + 1, np.zeros_like(rows)
        retaken = (found.flags & np.uint16(Flag.RETAKEN)) != 0
        order = np.zeros_like(rows)
        for row in np.unique(rows[retaken]):
            chosen = retaken & (rows == row)
            order[chosen] = np.arange(chosen.sum())
        return np.where(retaken, self._scan.rows, 0) + rows + 1, np.where(retaken, order, columns)

    def close(self) -> None:
        """Remove the simulated ports."""
        self.bench.close()


def checked_simulation(settings: Settings) -> BaseModel:
    """Check the ``[simulation]`` table by the simulator's own model.

    Raises
    ------
    BadInput
        Naming key, value and what is allowed.
    """
    from picoradar.sim.settings import SimulationSettings

    table = {k: v for k, v in settings.simulation.items() if v is not None}
    table.setdefault("distance_mm", settings.scan.distance_mm)
    table.setdefault("field_deg", settings.scanner.field_deg)
    table.setdefault("temperature_controller", settings.links.temperature)
    try:
        return SimulationSettings.model_validate(table)
    except ValidationError as error:
        raise BadInput("; ".join(describe_errors(error, "settings, [simulation]", ""))) from error


def shipped_calibration(settings: Settings) -> Traversable:
    """Return the calibration file that comes with the simulated bench: one for each way that light meets a target.

    Raises
    ------
    BadInput
        When the ``[simulation]`` table is not allowed.
    """
    late = checked_simulation(settings).model_dump()["tissue_light"]
    name = "simulated-clinic.json" if late else "simulated-bench.json"
    return resources.files("picoradar.instrument") / "data" / name
