"""The simulated bench for other programs: ptys, ``socket://`` ports and forwarded USB, served by one thread."""

from picoradar.sim.server.bench_server import Addresses, BenchServer
from picoradar.sim.server.folder_lock import FolderInUse

__all__ = ["Addresses", "BenchServer", "FolderInUse"]
