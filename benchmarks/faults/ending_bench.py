"""A served bench at speed 1 with an observer inside: what light there is, and what each barrier does, every 20 ms.

Used by `endings`. The observer writes lines of JSON into a file; it is the bench that looks, not the controller.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

from benchmarks.faults.watch import LEAST_V
from picoradar.drivers.bridge.sbp import Gate
from picoradar.instrument.cli.commands.sim import host_settings
from picoradar.instrument.cli.simulated import Simulated
from picoradar.instrument.settings import Settings, override, to_toml
from picoradar.sim.faults import Fault, arm
from picoradar.sim.server import BenchServer

LOOK_S = 0.02
AWAY_S = 4.0


def main(folder: Path, speed: float = 1.0) -> None:
    """Serve until the file ``stop`` is there; the file ``cut`` cuts the delay generator's cable for a while."""
    wanted = override(Settings(), {"simulation": {"target": "plate", "ambient_degc": 23.0}})
    simulated = Simulated(wanted, None)
    bench = simulated.bench
    with BenchServer(bench, folder, speed=speed) as server, (folder / "seen.jsonl").open("w", buffering=1) as seen:
        settings = host_settings(wanted, server.addresses(), speed, folder)
        (folder / "settings.toml").write_text(to_toml(settings), encoding="utf-8")

        def look() -> None:
            gate = bench.bridge.gate.state is Gate.ON
            rate_hz, volts, output = bench.trigger.rate_hz, bench.genesys.output_v(), bench.genesys.supply.is_on
            lit = gate and rate_hz > 0 and volts > LEAST_V
            entry = {"at_s": time.monotonic(), "lit": lit, "gate": gate, "triggers": rate_hz > 0, "output": output}
            seen.write(json.dumps(entry) + "\n")
            if (folder / "cut").exists():
                (folder / "cut").unlink()
                away = {"kind": "unplugged", "link": "dg645", "at": {"time_s": bench.clock.now()}, "lasts_s": AWAY_S}
                arm(bench, [Fault.model_validate(away)])
            bench.clock.call_at(bench.clock.now() + LOOK_S, look)

        look()
        (folder / "ready").touch()
        server.serve((folder / "stop").exists)
    simulated.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
