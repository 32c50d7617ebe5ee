"""The bench as the controller sees it: devices opened by URL, examined, found on their ports."""

from picoradar.instrument.bench.bench import Bench
from picoradar.instrument.bench.doctor import Finding, examine
from picoradar.instrument.bench.interlock_check import check_interlock
from picoradar.instrument.bench.opening import DeviceMaker, make_bench, named_backend
from picoradar.instrument.bench.reachable import reachable_bench

__all__ = [
    "Bench",
    "DeviceMaker",
    "Finding",
    "check_interlock",
    "examine",
    "make_bench",
    "named_backend",
    "reachable_bench",
]
