"""Devices that replay a transcript: they expect what the host sent, byte for byte, and send what came back.

This turns a bug report into a test: the same driver calls meet the same bytes at the same device times.
"""

from picoradar.sim.replay.bench import ReplayedBench
from picoradar.sim.replay.script import ReplayMismatch
from picoradar.sim.replay.serial_device import SerialReplay
from picoradar.sim.replay.usb_device import UsbReplay

__all__ = ["ReplayMismatch", "ReplayedBench", "SerialReplay", "UsbReplay"]
