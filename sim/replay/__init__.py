"""A recorded transcript as devices: what the host sent is expected byte for byte, what came back is sent again.

With it a bug report becomes a test: the same driver calls meet the same bytes at the same device times.
"""

from picoradar.sim.replay.bench import ReplayedBench
from picoradar.sim.replay.script import ReplayMismatch
from picoradar.sim.replay.serial_device import SerialReplay
from picoradar.sim.replay.usb_device import UsbReplay

__all__ = ["ReplayMismatch", "ReplayedBench", "SerialReplay", "UsbReplay"]
