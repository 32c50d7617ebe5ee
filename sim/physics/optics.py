"""`Optics`: laser, mirrors, target, photodiode and A/D combined into the signal source of the sampling bridge."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.device_time import DeviceTime
from picoradar.sim.physics.drift import SlowDrift
from picoradar.sim.physics.footprint import bundle, waisted
from picoradar.sim.physics.interference import Interference
from picoradar.sim.physics.mirrors import MirrorPair
from picoradar.sim.physics.noise import Noise
from picoradar.sim.physics.pointing import Pointing
from picoradar.sim.physics.receiver import Pulse, Receiver
from picoradar.sim.physics.sampler import add_pulse, digitise, remember
from picoradar.sim.physics.scene import Scene
from picoradar.sim.physics.speckle import Speckle
from picoradar.sim.physics.thermal import DiodeBlock
from picoradar.sim.physics.tissue_light.light import TissueLight
from picoradar.sim.physics.transmitter import OPERATING_DEGC, OPERATING_V, LaserPulse, Transmitter
from picoradar.sim.physics.true_result import Truth
from picoradar.sim.physics.view import View
from picoradar.sim.settings import SimulationSettings
from picoradar.sim.wires import Acquisition, Supply, TriggerLine

LIGHT_MM_PER_PS = 0.299792458 / 1.00027  # in air; group index at 904 nm, 20 degC, 1013 hPa
TEMPERATURE_GRID_DEGC = 0.01
REMEMBERED_RECORDS = 4096
AGAIN_WITHIN_S = 60.0  # a record that is repeated later than this is taken under the conditions of that time


class _Conditions(NamedTuple):
    """Conditions of a measurement besides its noise: time, command of the mirrors, diode and view."""

    start_s: float
    commanded: tuple[float, float]
    diode_degc: float
    view: View


class Optics:
    """Everything between the trigger and the A/D codes; implements `picoradar.sim.wires.SignalSource`.

    Parameters
    ----------
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
        Direction of the beam.
    scene : Scene
        Target of the beam.

    Attributes
    ----------
    truth : dict
        `Truth` of every record measured with light so far, by (run id, repetition, record number).
    """

    def __init__(
        self,
        settings: SimulationSettings,
        noise: Noise,
        trigger: TriggerLine,
        supply: Supply,
        block: DiodeBlock,
        mirrors: MirrorPair,
        scene: Scene,
    ) -> None:
        self._settings = settings
        self._noise = noise
        self._trigger = trigger
        self._supply = supply
        self._block = block
        self._mirrors = mirrors
        self._scene = scene
        self._transmitter = Transmitter(settings)
        self._receiver = Receiver(settings)
        self._tissue = TissueLight(settings, noise) if settings.tissue_light else None
        self._drift = SlowDrift(noise, "sampler.drift", settings.drift_ps, settings.drift_time_s)
        self._time = DeviceTime(AGAIN_WITHIN_S)
        self._interference = Interference(settings, noise)
        self._pointing = Pointing(settings, noise)
        self._speckle = Speckle(settings, noise)
        self._nominal_pj = self._transmitter.pulse(OPERATING_V, OPERATING_DEGC).energy_pj
        self._reference = lru_cache(maxsize=16)(self._make_reference)
        self._clipped = False
        self._found: dict[tuple[int, ...], _Conditions] = {}
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

    def aim_at(self, scene: Scene) -> None:
        """Put another target in front of the scanner."""
        self._scene = scene
        self._found.clear()

    def acquire(self, wanted: Acquisition) -> NDArray[np.uint32]:
        """Take one window; see `picoradar.sim.wires.SignalSource.acquire`.

        Each sample of each sweep is a shot of its own, so jitter, energy noise, shot noise and amplifier noise are
        independent from sample to sample: their variances add, and one Gaussian number stands for all of them.

        All numbers come from streams keyed by ``wanted.key``, and the diode's temperature is taken on a grid of
        10 mK, so that the same measurement under the same conditions gives the same codes whenever it is made. One
        that is repeated because its data were lost counts as that same measurement, conditions included.
        """
        shot = self._time.see(wanted)
        noise = self._noise.stream("receiver", *wanted.key).standard_normal(
            (wanted.sweeps, wanted.samples), dtype=np.float32
        )
        if wanted.gate_open and self._trigger.rate_hz > 0:
            signal_mv = self._with_light(wanted, noise)
        else:
            signal_mv = np.multiply(noise, np.float32(self._receiver.dark_noise_mv), out=noise)
        self._interference.add(signal_mv, wanted, shot)
        if self._settings.memory_share > 0:
            remember(signal_mv, self._settings.memory_share, wanted.settle_shots)
        sums, self._clipped = digitise(signal_mv, self._settings)
        return sums

    def _with_light(self, wanted: Acquisition, noise: NDArray[np.float32]) -> NDArray[np.float32]:
        """Turn standard noise (sweeps, samples) into the signal of every shot, in mV; overwrites ``noise``."""
        s = self._settings
        diode_degc, view = self._conditions(wanted)
        drive_v = self._supply.output_v()
        laser = self._transmitter.pulse(drive_v, diode_degc, self._trigger.rate_hz)

        mean_mv, sigma_mv, response_mv = self._sample(wanted, view, laser)
        self.truth[wanted.key[:3]] = Truth(view.range_mm, response_mv, view.angles_rad, view.point_mm)
        if laser.misfire_share == 0 and s.lost_trigger_share == 0:
            noise *= sigma_mv
            noise += mean_mv
            return noise

        signal_mv = mean_mv + sigma_mv * noise
        weak_mv, weak_sigma_mv, _ = self._sample(wanted, view, self._transmitter.misfire(drive_v, laser.delay_ps))
        missed = self._noise.stream("laser.misfire", *wanted.key).random(noise.shape) < laser.misfire_share
        np.copyto(signal_mv, weak_mv + weak_sigma_mv * noise, where=missed)
        lost = self._noise.stream("sampler.lost_trigger", *wanted.key).random(noise.shape) < s.lost_trigger_share
        np.copyto(signal_mv, np.float32(self._receiver.dark_noise_mv) * noise, where=lost)
        return signal_mv

    def _conditions(self, wanted: Acquisition) -> tuple[float, View]:
        """Temperature of the diode and view of the spot: those of the first attempt, if the mirrors have not moved."""
        commanded = self._mirrors.commanded
        found = self._found.get(wanted.key)
        if found is None or found.commanded != commanded or not 0 <= wanted.start_s - found.start_s < AGAIN_WITHIN_S:
            diode_degc = round(self._block.temperature_degc() / TEMPERATURE_GRID_DEGC) * TEMPERATURE_GRID_DEGC
            found = _Conditions(wanted.start_s, commanded, diode_degc, self._view(wanted))
            self._found[wanted.key] = found
            if len(self._found) > REMEMBERED_RECORDS:
                del self._found[next(iter(self._found))]
        return found.diode_degc, found.view

    def _sample(
        self, wanted: Acquisition, view: View, laser: LaserPulse
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], float]:
        """Mean and standard deviation (samples,) in mV of shots of one kind, and the response of the best echo."""
        s, receiver = self._settings, self._receiver
        drift_ps = self._drift.at(self._time.slow_s(wanted))
        first_ps = wanted.delay_ps + s.strobe_lag_ps + drift_ps

        echoes = receiver.pulses(
            laser.delay_ps + 2 * view.path_mm / LIGHT_MM_PER_PS,
            receiver.charge_fc(laser.energy_pj * view.returned),
            laser.fwhm_ps,
            view.lates,
        )
        mean_mv, slope = np.zeros((2, wanted.samples), dtype=np.float32)
        for pulse in self._reference(laser) + echoes:
            add_pulse(mean_mv, slope, first_ps, wanted.step_ps, pulse)
        light_mv = np.maximum(mean_mv, np.float32(0.0))
        slope *= s.trigger_jitter_ps
        slope *= slope
        variance_mv2 = light_mv * np.float32(laser.energy_noise**2)
        variance_mv2 += np.float32(receiver.shot_noise_mv)
        variance_mv2 *= light_mv
        variance_mv2 += slope
        variance_mv2 += np.float32(receiver.dark_noise_mv**2)
        response_mv = max((echo.response_mv for echo in echoes), default=0.0)
        return mean_mv, np.sqrt(variance_mv2, out=variance_mv2), response_mv

    def _make_reference(self, laser: LaserPulse) -> list[Pulse]:
        arrival_ps = laser.delay_ps + self._settings.reference_path_mm / LIGHT_MM_PER_PS
        charge_fc = self._receiver.reference_charge_fc(laser.energy_pj / self._nominal_pj)
        return self._receiver.pulses(np.array([arrival_ps]), np.array([charge_fc]), laser.fwhm_ps)

    def _view(self, wanted: Acquisition) -> View:
        """Follow the beam to the target and back; the middle of the first sweep stands for the whole record."""
        s = self._settings
        middle_s = wanted.start_s + (wanted.settle_shots + wanted.samples / 2) / wanted.prf_hz
        angles = self._mirrors.angles_rad(middle_s, *wanted.key[:3])
        angles += self._pointing.deviation_rad(wanted, self._time)
        beam = self._mirrors.ray(angles)
        if s.focus_mm > 0:
            waist = (s.spot_diameter_mm, s.focus_mm - beam.path_mm, s.divergence_mrad)
            origins, directions = waisted(beam.origin, beam.direction, *waist)
        else:
            origins, directions = bundle(beam.origin, beam.direction, s.spot_diameter_mm), beam.direction
        nearer_mm = 0.0 if s.motion_mm == 0 else -s.motion_mm * math.sin(2 * math.pi * middle_s / s.motion_period_s)
        hits = self._scene.cast(origins, directions, nearer_mm)

        axis_mm = float(hits.distance_mm[0])
        point = beam.origin + axis_mm * beam.direction if math.isfinite(axis_mm) else np.full(3, math.nan)
        seen = hits.brightness > 0
        path_mm = beam.path_mm + hits.distance_mm[seen]
        collected = (s.aperture_diameter_mm / (2 * path_mm)) ** 2  # share of the light from a white Lambertian
        returned = hits.brightness[seen] * collected * (s.exit_transmission * s.receiver_transmission / len(origins))
        returned *= self._speckle.factors(angles, len(origins))[seen]
        lates = None
        if self._tissue is not None:
            lates, gain = self._tissue.behind(self._scene, hits, origins + (0.0, 0.0, nearer_mm), directions)
            returned *= gain
        range_mm = beam.path_mm + axis_mm - s.mirror_separation_mm
        view = View(path_mm + s.transmitter_path_mm, returned, range_mm, point, angles, lates)
        return view.seen_again(s.second_path_share, s.second_path_mm) if s.second_path_share > 0 else view

    def _block_heat_w(self) -> float:
        return self._transmitter.block_heat_w(self._supply.output_v(), self._trigger.rate_hz)
