"""A raster scan in windows (SBP 1.1): a whole line runs without the host, with just enough shots at each place.

The galvo controller plays one path a line. A marked point at each place starts the record there (advance input). The
window over the reference comes first, while the mirrors still settle: it does not depend on them. Where an echo is lost
the place is taken again with a wide window, in a short path of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drivers import sbp
from drivers.clock import Clock
from drivers.interfaces import Galvo, Sampler, WindowRecord
from instrument.calibration import Calibration
from instrument.controller import Between
from instrument.errors import BadInput
from instrument.ranging.ranges import Ranges
from instrument.ranging.window import Place, Window
from instrument.ranging.window_plan import PlanSettings, WindowPlanner
from instrument.ranging.windowed import estimate_places
from instrument.scan import POINT_BYTES, RasterScan
from instrument.scan_line import ScanLine
from instrument.settings import Settings

IntArray = NDArray[np.int64]

FINEST_HZ = 10_000  # points a second of a path; more would take longer to send than they save
COARSEST_HZ = 1000
LONGEST_PATH = 4000  # points that the galvo controller holds
SPARE_S = 5e-5  # four shots at 80 kHz between the end of a record and the next mark: an edge inside a record is lost


@runtime_checkable
class PathGalvo(Galvo, Protocol):
    """A galvo controller that plays a path by itself."""

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
    ``rows + row + 1``.

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
        """Get the most that one line takes on the disk; the samples of windows are not kept."""
        return self.settings.scan.columns * POINT_BYTES

    def configure(self, sampler: Sampler) -> None:
        """Tell the sampler that records are taken in windows, at the edges of its advance input."""
        scanner = self.settings.scanner
        _windows_of(sampler).configure_windows(
            prf_hz=self.settings.pulser.prf_hz, settle_shots=scanner.window_settle_shots, on_advance=True
        )

    def memory(self) -> dict[str, Any]:
        """Get what the next line is planned from."""
        return self._planner.memory()

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Go on as if the lines before had just been taken."""
        self._planner.recall(memory)

    def take_line(self, row: int, galvo: Galvo, sampler: Sampler, between: Between) -> ScanLine:
        """Take one line with the laser on, and again those of its places whose echo was not in its window."""
        plan = self.raster.line(row)
        began_s = self.clock.now()
        galvo.move(int(plan.lead_in[0]), int(plan.lead_in[1]))  # settles while the line is planned and sent
        places = self._planner.line()
        ranges = self._ranges(row + 1, (plan.lead_in, plan.codes), places, began_s, galvo, sampler, between)
        lost = self._planner.lost(places, ranges)
        if lost.size:
            wide = self._planner.wide(lost)
            again = (plan.codes[lost[0]], plan.codes[lost])
            run_id = self.settings.scan.rows + row + 1
            retaken = self._ranges(run_id, again, wide, self.clock.now(), galvo, sampler, between)
            ranges = self._planner.merged(ranges, lost, retaken)
        self._planner.learn(ranges)
        return self._scan_line(plan, ranges, None, max(p.echo.sweeps for p in places), began_s)

    def _ranges(
        self,
        run_id: int,
        path: tuple[IntArray, IntArray],
        places: Sequence[Place],
        left_s: float,
        galvo: Galvo,
        sampler: Sampler,
        between: Between,
    ) -> Ranges:
        lead_in, codes = path
        if not isinstance(galvo, PathGalvo):
            raise BadInput("this galvo controller plays no paths; scan in mode sweep")
        between()
        # The mirrors have been on their way to the lead-in since left_s; only the rest of their time is waited for.
        lead_s = max(0.0, self.settings.scanner.window_flyback_ms * 1e-3 - (self.clock.now() - left_s))
        xy, marked, rate_hz = self._path(lead_in, codes, places, lead_s)
        table = [[_entry(place.reference), _entry(place.echo)] for place in places]
        run = _windows_of(sampler).take_windows(run_id, table, begin=lambda: galvo.play(xy, marked, rate_hz))
        records = list(run)
        self.shots += sum(place.shots(0) for place in places)
        return estimate_places(
            places,
            [(r.windows[0].trace_mv, r.windows[1].trace_mv) for r in records],
            calibration=self.calibration,
            clipped=np.array([any(w.clipped for w in r.windows) for r in records]),
            shared_reference=True,
        )

    def _path(
        self, lead_in: IntArray, codes: IntArray, places: Sequence[Place], lead_s: float
    ) -> tuple[IntArray, NDArray[np.bool_], int]:
        """Lay the path of a line out: lead-in, then each place until its record is done.

        Returns
        -------
        xy : (n, 2) int array
        marked : (n,) bool array
        rate_hz : int
        """
        scanner, prf_hz = self.settings.scanner, self.settings.pulser.prf_hz
        settle_s = scanner.window_settle_ms * 1e-3
        waits_s, records_s = [], []
        for place in places:
            reference_s = place.reference.shots(scanner.window_settle_shots) / prf_hz
            waits_s.append(max(0.0, settle_s - reference_s))
            records_s.append(place.shots(scanner.window_settle_shots) / prf_hz + SPARE_S)
        total_s = lead_s + sum(waits_s) + sum(records_s)
        rate_hz = min(FINEST_HZ, int((LONGEST_PATH - 2 * len(places) - 1) / total_s))
        if rate_hz < COARSEST_HZ:
            raise BadInput(f"{len(places)} places take {total_s:.2f} s, too long for one path; scan fewer columns")
        counts = [max(1, math.ceil(lead_s * rate_hz))]
        marks = []
        for wait_s, record_s in zip(waits_s, records_s, strict=True):
            before = math.ceil(wait_s * rate_hz)
            marks.append(sum(counts) + before)
            counts.append(before + math.ceil(record_s * rate_hz))
        xy = np.repeat(np.vstack([lead_in, codes]), counts, axis=0)
        marked = np.zeros(len(xy), dtype=np.bool_)
        marked[marks] = True
        return xy, marked, rate_hz


def _windows_of(sampler: Sampler) -> WindowSampler:
    if not isinstance(sampler, WindowSampler):
        raise BadInput("this sampler takes no windows; scan in mode sweep")
    return sampler


def _entry(window: Window) -> sbp.Window:
    """Turn a window of the plan into an entry of the device's table (integer femtoseconds)."""
    return sbp.Window(round(window.start_ps * 1000), round(window.step_ps * 1000), window.samples, window.sweeps)
