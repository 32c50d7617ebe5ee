"""A raster scan in windows (SBP 1.1): a whole line runs without the host, with just enough shots at each place.

The galvo controller plays one path a line. A marked point at each place starts the record there (advance input). The
window over the reference comes first, while the mirrors still settle: it does not depend on them. Where an echo is lost
the place is taken again with a wide window, in a short path of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from picoradar.drivers.bridge import sbp
from picoradar.drivers.clock import Clock
from picoradar.drivers.interfaces import Galvo, Identity, Sampler, WindowRecord
from picoradar.instrument.acquisition.galvo_path import Stop, lay_path
from picoradar.instrument.acquisition.points import to_scan_line
from picoradar.instrument.acquisition.sweep import POINT_BYTES, RasterScan
from picoradar.instrument.acquisition.window_ranging import CodeScale, range_line, range_windows
from picoradar.instrument.calibration import Calibration
from picoradar.instrument.controller import Between
from picoradar.instrument.errors import BadInput
from picoradar.instrument.line import LineWindows, ScanLine
from picoradar.instrument.ranging import Place, PlanSettings, Window, WindowPlanner
from picoradar.instrument.settings import Settings

IntArray = NDArray[np.int64]

LOOK_S = 6e-3  # on the place that is watched: record and settling


@runtime_checkable
class PathGalvo(Galvo, Protocol):
    """A galvo controller that plays a path by itself, once the whole of it is there."""

    def play(self, xy: ArrayLike, marked: ArrayLike, rate_hz: int) -> None:
        """Play (n, 2) codes once at ``rate_hz`` points a second, with the marker line high where marked."""


@runtime_checkable
class WindowSampler(Sampler, Protocol):
    """A sampler that takes records in windows, each at an edge of its advance input."""

    @property
    def supports_windows(self) -> bool:
        """Get whether the device has windows."""

    def configure_windows(self, *, prf_hz: float, settle_shots: int, on_advance: bool = False) -> None:
        """Set that records are taken in windows."""

    def take_windows(
        self, run_id: int, table: Sequence[Sequence[sbp.Window]], *, begin: Callable[[], None] | None = None
    ) -> Iterator[WindowRecord]:
        """Take one record for each row of the table; ``begin`` starts the path once the run waits."""


def can_window(galvo: Galvo, sampler: Sampler) -> bool:
    """Get whether these devices can scan in windows; they must be open."""
    return isinstance(galvo, PathGalvo) and isinstance(sampler, WindowSampler) and sampler.supports_windows


class WindowScan(RasterScan):
    """The raster of the settings in ``window`` mode, ranged by the template estimator.

    The run id of a line is its row + 1, and the record number the column; places taken again are records of the run
    ``rows + row + 1``. A look at the place that is watched for motion is the last record of its line.

    Parameters
    ----------
    settings, calibration, clock, rows
        As `RasterScan`. The calibration needs templates and the place of the reference.

    Raises
    ------
    BadInput
        When the calibration lacks what windows need.
    """

    mode = "window"

    def __init__(
        self, settings: Settings, calibration: Calibration, clock: Clock, rows: Sequence[int] | None = None
    ) -> None:
        super().__init__(settings, calibration, clock, rows)
        scan = settings.scan
        plan = PlanSettings(
            wanted_sd_mm=scan.wanted_sd_mm,
            settle_shots=settings.scanner.window_settle_shots,
            free_shots=int(settings.scanner.window_settle_ms * 1e-3 * settings.pulser.prf_hz),
        )
        self._planner = WindowPlanner(calibration, scan.columns, plan)
        self._planner.line()  # makes the tables of the pulse shapes now, which takes a moment, and not under light

    @property
    def line_bytes(self) -> int:
        """Get the most that one line takes on the disk (its samples not compressed, every place taken again)."""
        samples = 0
        if self.settings.scan.keep_traces:
            (wide,) = self._planner.wide([0])
            samples = 2 * (wide.reference.samples + wide.echo.samples)
        return self.settings.scan.columns * (POINT_BYTES + 2 * samples)

    def header(
        self, identities: Mapping[str, Identity], *, seed: int | None, zero_code: float, mv_per_code: float
    ) -> dict[str, Any]:
        """Get the header of the recording; windows are ranged by the template estimator whatever the settings say."""
        header = super().header(identities, seed=seed, zero_code=zero_code, mv_per_code=mv_per_code)
        return {**header, "raster": {**header["raster"], "estimator": "template"}}

    def configure(self, sampler: Sampler) -> None:
        """Tell the sampler that records are taken in windows, at the edges of its advance input."""
        scanner = self.settings.scanner
        _windows_of(sampler).configure_windows(
            prf_hz=self.settings.pulser.prf_hz, settle_shots=scanner.window_settle_shots, on_advance=True
        )

    def memory(self) -> dict[str, Any]:
        """Get what the next line is planned from."""
        return {**super().memory(), **self._planner.memory()}

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Go on as if the lines before had just been taken."""
        super().recall(memory)
        self._planner.recall(memory)

    def take_line(self, row: int, galvo: Galvo, sampler: Sampler, between: Between) -> ScanLine:
        """Take one line with the laser on, and again those of its places whose echo was not in its window."""
        plan = self.raster.line(row)
        began_s = self.clock.now()
        galvo.move(int(plan.lead_in[0]), int(plan.lead_in[1]))  # settles while the line is planned and sent
        places = self._planner.line()
        scanner = self.settings.scanner
        stops = [self._stop(*stop, scanner.window_settle_ms) for stop in zip(plan.codes, places, strict=True)]
        look = self._look_at()
        if look is not None:
            stops.append(self._stop(*look, scanner.window_flyback_ms))
        seen = [*places, *([look[1]] if look else [])]
        taken, scale = self._take(row + 1, plan.lead_in, stops, seen, began_s, galvo, sampler, between)
        first, last = taken[: len(places)], taken[len(places) :]
        self._count_shots(places)
        windows = LineWindows.of(plan.columns, first, _forms(places), retaken=False)
        ranges = range_windows(windows, scale, self.calibration)
        lost = self._planner.lost(places, ranges)
        if lost.size:
            wide = self._planner.wide(lost)
            stops = [self._stop(*stop, scanner.window_settle_ms) for stop in zip(plan.codes[lost], wide, strict=True)]
            run_id, left_s = self.settings.scan.rows + row + 1, self.clock.now()
            again, _ = self._take(run_id, plan.codes[lost[0]], stops, wide, left_s, galvo, sampler, between)
            self._count_shots(wide)
            windows = windows.followed_by(LineWindows.of(plan.columns[lost], again, _forms(wide), retaken=True))
            ranges = range_line(plan.columns, windows, scale, self.calibration)
        self._planner.learn(ranges)  # before the footprint is judged: half a spot on a rim is planned as it is seen
        ranges = self._mixed(row, ranges)
        looked = None
        if look is not None:
            looked = range_windows(LineWindows.of([0], last, _forms([look[1]]), retaken=False), scale, self.calibration)
        ranges = self._watched(row, ranges, looked)
        self._note_reference(ranges)
        return to_scan_line(
            row, plan.columns, plan.angles_rad, ranges, self.calibration,
            windows=windows if self.settings.scan.keep_traces else None,
            sweeps=max(p.echo.sweeps for p in places), began_s=began_s,
        )  # fmt: skip

    def _count_shots(self, places: Sequence[Place]) -> None:
        self.shots += sum(place.shots(0) for place in places)

    def _look_at(self) -> tuple[IntArray, Place] | None:
        """Return codes and windows of the place that is watched, if it is its turn."""
        if self._watch.place is None or not self._watch.due:
            return None
        row, column = self._watch.place
        echo_ps, response_mv = self._watch.seen
        return self.raster.line(row).codes[column], self._planner.look(echo_ps, response_mv)

    def _stop(self, codes: IntArray, place: Place, settle_ms: float) -> Stop:
        """Return the stop of a path at a place; the reference is taken while the mirrors settle."""
        settle_shots, prf_hz = self.settings.scanner.window_settle_shots, self.settings.pulser.prf_hz
        wait_s = max(0.0, settle_ms * 1e-3 - place.reference.shots(settle_shots) / prf_hz)
        return Stop(codes, wait_s, place.shots(settle_shots) / prf_hz)

    def _take(
        self,
        run_id: int,
        lead_in: IntArray,
        stops: Sequence[Stop],
        places: Sequence[Place],
        left_s: float,
        galvo: Galvo,
        sampler: Sampler,
        between: Between,
    ) -> tuple[list[WindowRecord], CodeScale]:
        """Take one record at each stop; the mirrors have been on their way to the lead-in since ``left_s``."""
        if not isinstance(galvo, PathGalvo):
            raise BadInput("this galvo controller plays no paths; scan in mode sweep")
        between()
        lead_s = max(0.0, self.settings.scanner.window_flyback_ms * 1e-3 - (self.clock.now() - left_s))
        path = lay_path(lead_in, lead_s, stops)
        table = [[_entry(place.reference), _entry(place.echo)] for place in places]
        records = list(_windows_of(sampler).take_windows(run_id, table, begin=lambda: galvo.play(*path)))
        first = records[0].windows[0]
        return records, CodeScale(first.zero_code, first.mv_per_code)

    def _times_s(self) -> tuple[float, float]:
        """Get how long a look at the watched place takes, and a line at least."""
        scanner = self.settings.scanner
        fly_s = scanner.window_flyback_ms * 1e-3
        free_s = 2 * scanner.window_settle_ms * 1e-3  # settling, and about as long on the echo
        return fly_s + LOOK_S, fly_s + self.settings.scan.columns * free_s


def _windows_of(sampler: Sampler) -> WindowSampler:
    if not isinstance(sampler, WindowSampler):
        raise BadInput("this sampler takes no windows; scan in mode sweep")
    return sampler


def _entry(window: Window) -> sbp.Window:
    """Turn a window of the plan into an entry of the device's table (integer femtoseconds)."""
    return sbp.Window(round(window.start_ps * 1000), round(window.step_ps * 1000), window.samples, window.sweeps)


def _forms(places: Sequence[Place]) -> list[list[tuple[int, int]]]:
    """Return start and step (fs) of the windows of places, as the device is told."""
    entries = [(_entry(place.reference), _entry(place.echo)) for place in places]
    return [[(entry.start_fs, entry.step_fs) for entry in pair] for pair in entries]
