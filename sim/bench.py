"""`SimulatedBench`: all simulated devices wired to the physics, in process, on a virtual clock."""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Self

import numpy as np

from picoradar.drivers.clock import VirtualClock
from picoradar.sim import ports as _handlers  # registers sim:// with pyserial  # noqa: F401
from picoradar.sim.firmware.bridge import SamplingBridgeFirmware
from picoradar.sim.firmware.dg645 import Dg645Firmware
from picoradar.sim.firmware.genesys import GenesysFirmware
from picoradar.sim.firmware.helios import HeliosFirmware
from picoradar.sim.firmware.mecom import TecFirmware
from picoradar.sim.firmware.oscilloscope import OscilloscopeFirmware
from picoradar.sim.firmware.tc200 import Tc200Firmware
from picoradar.sim.operator import clicks, scale_reading
from picoradar.sim.physics import (
    CurrentMonitor,
    DiodeBlock,
    LaserMonitor,
    MirrorPair,
    Noise,
    Optics,
    Scene,
    Target,
    build_scene,
    landmarks,
    load_target,
    place_target,
    zero_mark,
)
from picoradar.sim.ports import SerialFirmware, SerialWire, new_bench_name, publish, withdraw
from picoradar.sim.settings import Pose, SimulationSettings
from picoradar.sim.taps import HeatPumpTap, MirrorsTap, SerialTap, SignalTap, UsbTap
from picoradar.sim.truth import BenchTruth
from picoradar.sim.usb import SimUsbBackend, UsbFirmware
from picoradar.sim.wires import InterlockChain, TriggerLine

TUNED = {3010: 1000.0, 3011: 2.0}  # Kp in % of the current limit per K, Ti in s


class SimulatedBench:
    """All devices and the light between them; reached by unchanged drivers through `urls` and `usb_backend`.

    Parameters
    ----------
    settings : SimulationSettings or mapping, optional
        Physical parameters; a mapping is checked first.
    target : str, optional
        The target in front of the scanner; overrides the settings.
    seed : int
        Root seed: same seed, same data.
    clock : VirtualClock, optional
        Time of the bench; a new one by default.

    Attributes
    ----------
    urls : dict
        URL of each serial device by its name: ``dg645``, ``genesys``, and ``tec`` or ``tc200``.
    target, bare_target : Target
        The target in front of the scanner, and the same without tissue and instruments: the preoperative model.
        The mark of the range zero is part of neither.
    usb_backend : SimUsbBackend
        pyusb backend that finds the USB devices.
    monitor : LaserMonitor
        Fast photodetector at channel 2 of the oscilloscope, and a power meter, at the exit. (Channel 3 is at the
        resistor in the path of the laser's current.)
    truth : BenchTruth
        Hidden from the code under test.
    serial_taps, usb_taps, signal, servo, heat_pump
        Where faults install their hooks (`picoradar.sim.faults`).

    Raises
    ------
    ValueError
        When a parameter is out of range or the target cannot be used.

    Examples
    --------
    A driver talks to the simulated delay generator as to a real one:

    >>> from picoradar import SimulatedBench
    >>> from picoradar.drivers.dg645 import DG645
    >>> from picoradar.drivers.links import SerialLink
    >>> with SimulatedBench(target="plate", seed=3) as bench:
    ...     generator = DG645(SerialLink(bench.urls["dg645"], bench.clock, device="DG645", baud=9600))
    ...     generator.open()
    ...     str(generator.identify())
    'DG645, s/n 001013, ver1.02.0A'
    """

    def __init__(
        self,
        settings: SimulationSettings | Mapping[str, object] | None = None,
        *,
        target: str | None = None,
        seed: int = 1,
        clock: VirtualClock | None = None,
    ) -> None:
        checked = settings
        if not isinstance(checked, SimulationSettings):
            checked = SimulationSettings.model_validate(dict(settings or {}))
        if target is not None:
            checked = checked.model_copy(update={"target": target})
        self.settings = checked
        self.seed = seed
        self.clock = VirtualClock() if clock is None else clock
        self.noise = Noise(seed)

        self.trigger = TriggerLine()
        self.interlock = InterlockChain()
        self.block = DiodeBlock(self.clock, checked)
        self.mirrors = MirrorPair(self.clock, checked, self.noise)
        self.scene = build_scene(checked, self.noise, self._zero_mark())
        self.target = self.scene.target
        self.bare_target = load_target(checked.target, checked.reflectance, checked)

        self.dg645 = Dg645Firmware(self.clock, self.trigger, self.interlock)
        self.genesys = GenesysFirmware(self.clock, self.interlock)
        self.heat_pump = HeatPumpTap(self.block)
        self.tec = TecFirmware(self.clock, self.heat_pump)
        self._tune(self.tec)
        self.optics = Optics(checked, self.noise, self.trigger, self.genesys, self.block, self.mirrors, self.scene)
        self.signal = SignalTap(self.optics)
        self.servo = MirrorsTap(self.mirrors, self.clock, self.interlock)
        self.helios = HeliosFirmware(self.clock, self.servo)
        self.bridge = SamplingBridgeFirmware(self.clock, self.trigger, self.interlock, self.signal)
        self.helios.on_marker.append(self.bridge.advance)  # the blue line is wired to the advance input
        self.monitor = LaserMonitor(
            checked, self.noise, self.trigger, self.genesys, self.block, lambda: self.bridge.gate_open
        )
        self.oscilloscope = OscilloscopeFirmware(
            self.clock,
            self.trigger,
            self.signal,
            detector=self.monitor,
            current=CurrentMonitor(checked, self.noise, self.trigger, self.genesys, self.block),
            gate_open=lambda: self.bridge.gate_open,
        )
        self.truth = BenchTruth(self.optics)

        self._scale_readings = 0
        self._connect()

    def _connect(self) -> None:
        """Connect every firmware to its port, through a tap for injected faults."""
        controller = self.settings.temperature_controller
        serial: dict[str, SerialFirmware] = {
            "dg645": self.dg645,
            "genesys": self.genesys,
            controller: self.tec if controller == "tec" else Tc200Firmware(self.clock, self.heat_pump),
        }
        name = new_bench_name()
        self.serial_taps = {device: SerialTap(firmware) for device, firmware in serial.items()}
        self.wires = {device: SerialWire(tap, self.clock) for device, tap in self.serial_taps.items()}
        self.urls = {device: publish(name, device, wire) for device, wire in self.wires.items()}
        usb: dict[str, UsbFirmware] = {
            "helios": self.helios,
            "bridge": self.bridge,
            "oscilloscope": self.oscilloscope,
        }
        self.usb_taps = {device: UsbTap(firmware, self.clock) for device, firmware in usb.items()}
        self.usb_backend = SimUsbBackend(self.clock, self.usb_taps.values())

    def _zero_mark(self) -> Target | None:
        """Make the mark of the range zero, across the beam of its place."""
        s = self.settings
        if s.zero_mark_mm == 0:
            return None
        beam = self.mirrors.ray(np.radians(s.zero_mark_deg))
        return zero_mark(beam, s.zero_mark_mm + s.mirror_separation_mm, s.zero_mark_side_mm)

    def place(self, target: str, pose: Pose, *, reflectance: float | None = None) -> None:
        """Put another target in front of the scanner, as a person at the bench does between two measurements.

        The mark of the range zero is taken away with the first: calibration bodies may fill the whole field.

        Parameters
        ----------
        target : str
            As in the settings.
        pose : Pose
            x, y, z (mm) and turns about x, y, z (deg), scanner frame.
        reflectance : float, optional
            Of the whole target; its own by default.

        Raises
        ------
        ValueError
            When the target cannot be used.
        """
        self.target = load_target(target, reflectance, self.settings)
        self.scene = Scene(self.target, place_target(self.target, pose[2], pose, self.noise.stream("scene.pose")))
        self.optics.aim_at(self.scene)

    def read_scale(self) -> tuple[float, float]:
        """Read the position of the spot on a millimetre scale on the target (mm), as a person with a camera does."""
        self._scale_readings += 1
        key = (0, 0, self._scale_readings)
        beam = self.mirrors.beam(self.clock.now(), *key)
        distance_mm = self.scene.cast(beam.origin[None], beam.direction[None]).distance_mm[0]
        return scale_reading(beam.origin + distance_mm * beam.direction, self.noise.stream("operator.scale", *key))

    def clicked_landmarks(self) -> list[dict[str, object]]:
        """Get landmark pairs as a person would click them: ``scanner`` and ``model`` point (mm) and ``name``.

        Raises
        ------
        ValueError
            When the target has no landmarks.
        """
        named = landmarks(self.settings.target)
        rng = self.noise.stream("operator.clicks")
        points = clicks(np.array([*named.values()]), self.truth.scanner_from_model, rng)
        return [
            {"name": name, "scanner": seen.tolist(), "model": point.tolist()}
            for (name, point), seen in zip(named.items(), points, strict=True)
        ]

    @staticmethod
    def _tune(tec: TecFirmware) -> None:
        """Set the temperature controller up as its auto-tuning does for this diode block, and save it in its flash."""
        for number, value in TUNED.items():
            tec.memory.set(number, value)
        tec.memory.save()

    def close(self) -> None:
        """Take the ports away; harmless when called twice."""
        for url in self.urls.values():
            withdraw(url)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()
