"""The packages' public names: all there, imported on first use only."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

PACKAGES = ("picoradar", "picoradar.drivers", "picoradar.instrument", "picoradar.sim", "picoradar.sim.faults")


@pytest.mark.parametrize("name", PACKAGES)
def test_every_public_name_is_there(name: str) -> None:
    package = importlib.import_module(name)
    assert set(package.__all__) <= set(dir(package))
    for public in package.__all__:
        assert getattr(package, public) is not None
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nothing'"):
        package.nothing  # noqa: B018 (asking is the test)


def test_importing_a_package_loads_nothing_heavy() -> None:
    lines = [f"import {name}" for name in PACKAGES]
    script = "\n".join([*lines, "import sys", "print([m for m in ('numpy', 'pydantic', 'scipy') if m in sys.modules])"])
    done = subprocess.run([sys.executable, "-I", "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_program_of_ones_own_needs_the_packages_only() -> None:
    from picoradar.drivers import DG645, Pulser, SerialLink, VirtualClock
    from picoradar.instrument import Settings, make_bench
    from picoradar.sim import SimulatedBench

    with SimulatedBench(target="plate") as bench:
        clock: VirtualClock = bench.clock
        generator = DG645(SerialLink(bench.urls["dg645"], clock, device="DG645", baud=9600))
        generator.open()
        assert generator.identify().model == "DG645"
        generator.close()
        links = Settings().links.model_copy(update=dict(bench.urls))
        assert isinstance(make_bench(links, clock, bench.usb_backend).pulser, Pulser)
