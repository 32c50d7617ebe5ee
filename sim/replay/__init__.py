"""A recorded transcript as devices: what the host sent is expected byte for byte, what came back is sent again.

With it a bug report becomes a test: the same driver calls meet the same bytes at the same device times.
"""

from sim.replay.bench import ReplayedBench
from sim.replay.script import ReplayMismatch
from sim.replay.serial_device import SerialReplay
from sim.replay.usb_device import UsbReplay

__all__ = ["ReplayMismatch", "ReplayedBench", "SerialReplay", "UsbReplay"]
