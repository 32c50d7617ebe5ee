"""`Optics`: laser, mirrors, target, photodiode and A/D put together, as the sampling bridge's firmware sees them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drivers.clock import Clock
from sim.noise import Noise
from sim.receiver import Echo, Receiver
from sim.sampler import add_pulse, digitise
from sim.scanner import MirrorPair
from sim.scene import Scene, backscatter
from sim.settings import SimulationSettings
from sim.thermal import DiodeBlock
from sim.transmitter import LaserPulse, Transmitter
from sim.wires import Acquisition, Supply, TriggerLine

LIGHT_MM_PER_PS = 0.299792458
TEMPERATURE_GRID_DEGC = 0.01
SURFACE_ROUGHNESS_RAD = 0.52
NOMINAL_DRIVE_V = 290.0
NOMINAL_DIODE_DEGC = 23.0


class Truth(NamedTuple):
    """What one measurement should have given.

    Attributes
    ----------
    range_mm : float
        From mirror 1's axis to the target less the mirror separation; inf where the beam misses.
    response_mv : float
        Peak of the echo at the photodiode; 0 without one.
    angles_rad : (2,) float array
        Optical angles of the two mirrors.
    point_mm : (3,) float array
        Where the beam meets the target (scanner frame); NaN where it misses.
    """

    range_mm: float
    response_mv: float
    angles_rad: NDArray[np.float64]
    point_mm: NDArray[np.float64]


class Optics:
    """Everything between the trigger and the A/D codes; implements `sim.wires.SignalSource`.

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    settings : SimulationSettings
        All physical parameters.
    noise : Noise
        Streams, keyed by what is measured.
    trigger : TriggerLine
        Laser triggers before the gate.
    supply : Supply
        Drive voltage.
    block : DiodeBlock
        Gives the diode's temperature, takes its heat.
    mirrors : MirrorPair
        Where the beam goes.
    scene : Scene
        What it hits.

    Attributes
    ----------
    truth : dict
        `Truth` of every record measured with light so far, by (run id, repetition, record number).
    """

    def __init__(
        self,
        clock: Clock,
        settings: SimulationSettings,
        noise: Noise,
        trigger: TriggerLine,
        supply: Supply,
        block: DiodeBlock,
        mirrors: MirrorPair,
        scene: Scene,
    ) -> None:
        self._clock = clock
        self._settings = settings
        self._noise = noise
        self._trigger = trigger
        self._supply = supply
        self._block = block
        self._mirrors = mirrors
        self._scene = scene
        self._transmitter = Transmitter(settings)
        self._receiver = Receiver(settings)
        self._nominal_pj = self._transmitter.pulse(NOMINAL_DRIVE_V, NOMINAL_DIODE_DEGC).energy_pj
        self._clipped = False
        self.truth: dict[tuple[int, int, int], Truth] = {}
        block.heated_by(self._block_heat_w)

    @property
    def clipped(self) -> bool:
        """Get whether any single sample of the last window was clipped (code 0 or 255)."""
        return self._clipped

    @property
    def scanner_from_model(self) -> NDArray[np.float64]:
        """Get the true pose (4, 4) of the target."""
        return self._scene.scanner_from_model

    def acquire(self, wanted: Acquisition) -> NDArray[np.uint32]:
        """Take one window; see `sim.wires.SignalSource.acquire`.

        All numbers come from streams keyed by ``wanted.key``, and the diode's temperature is taken on a grid of
        10 mK, so the same measurement under the same conditions gives the same codes whenever it is made.
        """
        s = self._settings
        instants_ps = wanted.delay_ps + s.strobe_lag_ps + wanted.step_ps * np.arange(wanted.samples, dtype=np.float64)
        signal_mv = np.zeros((wanted.sweeps, wanted.samples), dtype=np.float32)
        variance_mv2 = np.full(wanted.samples, s.amplifier_noise_mv**2, dtype=np.float32)
        if wanted.gate_open and self._trigger.rate_hz > 0:
            self._add_light(wanted, instants_ps, signal_mv, variance_mv2)
        noise = self._noise.stream("receiver", *wanted.key).standard_normal(signal_mv.shape, dtype=np.float32)
        noise *= np.sqrt(variance_mv2)
        signal_mv += noise
        sums, self._clipped = digitise(signal_mv, s)
        return sums

    def _add_light(
        self,
        wanted: Acquisition,
        instants_ps: NDArray[np.float64],
        signal_mv: NDArray[np.float32],
        variance_mv2: NDArray[np.float32],
    ) -> None:
        s = self._settings
        diode_degc = round(self._block.temperature_degc() / TEMPERATURE_GRID_DEGC) * TEMPERATURE_GRID_DEGC
        pulse = self._transmitter.pulse(self._supply.output_v(), diode_degc)
        reference = self._receiver.reference(pulse.energy_pj / self._nominal_pj, pulse.fwhm_ps)
        pulses = [(pulse.delay_ps + s.reference_path_mm / LIGHT_MM_PER_PS, reference)]

        truth, echo = self._look(wanted, pulse)
        self.truth[wanted.key[:3]] = truth
        if echo is not None:
            path_mm = s.transmitter_path_mm + truth.range_mm + s.mirror_separation_mm
            pulses.append((pulse.delay_ps + 2 * path_mm / LIGHT_MM_PER_PS, echo))

        jitter = self._noise.stream("sampler.jitter", *wanted.key)
        for arrival_ps, shape in pulses:
            add_pulse(signal_mv, instants_ps, arrival_ps, shape, jitter, s.trigger_jitter_ps)
        # Shot noise and energy noise act shot by shot, and each sample is a shot: independent, so variances add.
        mean_mv = np.maximum(signal_mv.mean(axis=0), 0.0)
        variance_mv2 += self._receiver.shot_noise_mv(pulse.fwhm_ps) * mean_mv + (s.pulse_energy_noise * mean_mv) ** 2

    def _look(self, wanted: Acquisition, pulse: LaserPulse) -> tuple[Truth, Echo | None]:
        """Follow the beam to the target and back; the middle of the first sweep stands for the whole record."""
        s = self._settings
        middle_s = wanted.start_s + (wanted.settle_shots + wanted.samples / 2) / wanted.prf_hz
        angles = self._mirrors.angles_rad(middle_s, *wanted.key[:3])
        beam = self._mirrors.ray(angles)
        hits = self._scene.cast(beam.origin[None], beam.direction[None])
        distance_mm = float(hits.distance_mm[0])
        if not math.isfinite(distance_mm):
            return Truth(math.inf, 0.0, angles, np.full(3, math.nan)), None
        range_mm = beam.path_mm + distance_mm - s.mirror_separation_mm
        relative = float(hits.reflectance[0] * backscatter(hits.cosine, SURFACE_ROUGHNESS_RAD)[0])
        collected = relative * (s.aperture_diameter_mm / (2 * (range_mm + s.mirror_separation_mm))) ** 2
        light_pj = pulse.energy_pj * s.exit_transmission * s.receiver_transmission * collected
        echo = self._receiver.echo(self._receiver.charge_fc(light_pj), pulse.fwhm_ps)
        return Truth(range_mm, echo.response_mv, angles, beam.origin + distance_mm * beam.direction), echo

    def _block_heat_w(self) -> float:
        power_w = self._transmitter.electrical_power_w(self._supply.output_v(), self._trigger.rate_hz)
        return self._settings.pulser_heat_share * power_w
