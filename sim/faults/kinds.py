"""`KINDS`: every kind of fault by its name."""

from __future__ import annotations

from picoradar.sim.faults.kind import Kind
from picoradar.sim.faults.physics_kinds import PHYSICS_KINDS
from picoradar.sim.faults.serial_kinds import SERIAL_KINDS
from picoradar.sim.faults.signal_kinds import SIGNAL_KINDS
from picoradar.sim.faults.usb_kinds import USB_KINDS

KINDS: dict[str, Kind] = {**SERIAL_KINDS, **USB_KINDS, **SIGNAL_KINDS, **PHYSICS_KINDS}
