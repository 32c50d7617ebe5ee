"""The simulated bench for other programs: ptys, ``socket://`` ports and forwarded USB, served by one thread."""

from picoradar.sim.server.bench_server import Addresses, BenchServer

__all__ = ["Addresses", "BenchServer"]
