"""`SimulatedBench`: all simulated devices wired to the physics, in process, on a virtual clock."""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self

import numpy as np

from drivers.clock import VirtualClock
from sim import handlers as _handlers  # makes sim:// known to pyserial  # noqa: F401
from sim.firmware.dg645 import Dg645Firmware
from sim.firmware.genesys import GenesysFirmware
from sim.firmware.helios import HeliosFirmware
from sim.firmware.mecom import TecFirmware
from sim.firmware.sampling_bridge import SamplingBridgeFirmware
from sim.noise import Noise
from sim.operator import clicks
from sim.optics import Optics
from sim.ports import SerialWire, new_bench_name, publish, withdraw
from sim.scanner import MirrorPair
from sim.scene import Scene
from sim.settings import SimulationSettings
from sim.targets import landmarks, load_target, place_target
from sim.thermal import DiodeBlock
from sim.truth import BenchTruth
from sim.usb.backend import SimUsbBackend
from sim.wires import InterlockChain, TriggerLine

TUNED = {3010: 1000.0, 3011: 2.0}  # Kp in % of the current limit per K, Ti in s


class SimulatedBench:
    """Five devices and the light between them; reached by unchanged drivers through `urls` and `usb_backend`.

    Parameters
    ----------
    settings : SimulationSettings or mapping, optional
        Physical parameters; a mapping is checked first.
    target : str, optional
        What stands before the scanner; overrides the settings.
    seed : int
        Root seed: same seed, same data.
    clock : VirtualClock, optional
        Time of the bench; a new one by default.

    Attributes
    ----------
    urls : dict
        URL of each serial device by its name (``dg645``, ``genesys``, ``tec``).
    usb_backend : SimUsbBackend
        pyusb backend that finds the USB devices.
    truth : BenchTruth
        What the code under test must not know.

    Raises
    ------
    ValueError
        When a parameter is out of range or the target cannot be used.
    """

    def __init__(
        self,
        settings: SimulationSettings | Mapping[str, Any] | None = None,
        *,
        target: str | None = None,
        seed: int = 1,
        clock: VirtualClock | None = None,
    ) -> None:
        checked = settings if isinstance(settings, SimulationSettings) else SimulationSettings(**dict(settings or {}))
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
        self.target = load_target(checked.target, checked.reflectance)
        pose = place_target(self.target, checked.distance_mm, checked.target_pose, self.noise.stream("scene.pose"))
        self.scene = Scene(self.target, pose)

        self.dg645 = Dg645Firmware(self.clock, self.trigger, self.interlock)
        self.genesys = GenesysFirmware(self.clock, self.interlock)
        self.tec = TecFirmware(self.clock, self.block)
        self._tune(self.tec)
        self.optics = Optics(
            self.clock, checked, self.noise, self.trigger, self.genesys, self.block, self.mirrors, self.scene
        )
        self.helios = HeliosFirmware(self.clock, self.mirrors)
        self.bridge = SamplingBridgeFirmware(self.clock, self.trigger, self.interlock, self.optics)
        self.truth = BenchTruth(self.optics)

        name = new_bench_name()
        self.wires = {
            device: SerialWire(firmware, self.clock)
            for device, firmware in (("dg645", self.dg645), ("genesys", self.genesys), ("tec", self.tec))
        }
        self.urls = {device: publish(name, device, wire) for device, wire in self.wires.items()}
        self.usb_backend = SimUsbBackend(self.clock, [self.helios, self.bridge])

    def clicked_landmarks(self) -> list[dict[str, Any]]:
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
        """Leave the temperature controller as its own tuning leaves it on this diode block, kept in its flash."""
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
