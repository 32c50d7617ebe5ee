"""The physics of the radar and of its targets, from first principles; shares no formula with the instrument."""

from picoradar.sim.physics.current_monitor import CurrentMonitor
from picoradar.sim.physics.drift import SlowDrift
from picoradar.sim.physics.footprint import bundle
from picoradar.sim.physics.laser_monitor import LaserMonitor
from picoradar.sim.physics.materials import BONE_WET, WHITE
from picoradar.sim.physics.mirrors import FULL_FIELD_DEG, Beam, MirrorPair, trace
from picoradar.sim.physics.noise import Noise
from picoradar.sim.physics.optics import LIGHT_MM_PER_PS, Optics
from picoradar.sim.physics.receiver import Receiver
from picoradar.sim.physics.scene import FloatArray, Scene, Target
from picoradar.sim.physics.spread import TABLE_PS
from picoradar.sim.physics.targets import (
    HIP_FILE,
    SOCKET_AXIS,
    SOCKET_CENTRE_MM,
    build_scene,
    hip,
    landmarks,
    load_target,
    place_target,
)
from picoradar.sim.physics.thermal import DiodeBlock
from picoradar.sim.physics.tissue import FOSSA_MM, add_tissue, decorate
from picoradar.sim.physics.transmitter import OPERATING_DEGC, OPERATING_V, LaserPulse, Transmitter
from picoradar.sim.physics.true_result import Truth
from picoradar.sim.physics.zero_mark import zero_mark

__all__ = [
    "BONE_WET",
    "FOSSA_MM",
    "FULL_FIELD_DEG",
    "HIP_FILE",
    "LIGHT_MM_PER_PS",
    "OPERATING_DEGC",
    "OPERATING_V",
    "SOCKET_AXIS",
    "SOCKET_CENTRE_MM",
    "TABLE_PS",
    "WHITE",
    "Beam",
    "CurrentMonitor",
    "DiodeBlock",
    "FloatArray",
    "LaserMonitor",
    "LaserPulse",
    "MirrorPair",
    "Noise",
    "Optics",
    "Receiver",
    "Scene",
    "SlowDrift",
    "Target",
    "Transmitter",
    "Truth",
    "add_tissue",
    "build_scene",
    "bundle",
    "decorate",
    "hip",
    "landmarks",
    "load_target",
    "place_target",
    "trace",
    "zero_mark",
]
