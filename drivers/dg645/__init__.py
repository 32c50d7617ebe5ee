"""The delay generator SRS DG645: pulse repetition frequency, trigger on and off, amplitudes and delays."""

from picoradar.drivers.dg645.driver import DG645
from picoradar.drivers.dg645.wire import QUEUE_LENGTH, Channel, Inhibit, InstrumentStatus, Output, TriggerSource

__all__ = [
    "DG645",
    "QUEUE_LENGTH",
    "Channel",
    "Inhibit",
    "InstrumentStatus",
    "Output",
    "TriggerSource",
]
