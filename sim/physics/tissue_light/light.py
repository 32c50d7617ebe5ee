"""`TissueLight`: the time responses of what the rays of one beam hit."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.noise import Noise
from picoradar.sim.physics.scene import Hits, Scene
from picoradar.sim.physics.spread import TABLE_PS, Spread
from picoradar.sim.physics.tissue_light.optical import ABSORPTION_SPREAD, INDEX_SPREAD, Optical
from picoradar.sim.physics.tissue_light.response import on_grid, time_response
from picoradar.sim.settings import SimulationSettings

FloatArray = NDArray[np.float64]

ANGLE_STEP_DEG = 5.0  # responses are made for these angles of incidence: the bias changes by 1 % from one to the next
STEPS_PER_RAD = math.degrees(1.0) / ANGLE_STEP_DEG
SURFACE_STEP = 0.02  # and for these shares of surface light: 1 % of the bias
AT_ONCE: Spread = np.ones(1, dtype=np.float32)


class Inside(NamedTuple):
    """Responses of N rays: ``spreads``, of sum 1 every `TABLE_PS`, and ``gain`` (N,), the light that comes back over
    that of typical tissue."""

    spreads: tuple[Spread, ...]
    gain: FloatArray


class TissueLight:
    """Light that enters the target and comes back later, for one sample of tissue.

    Parameters
    ----------
    settings : SimulationSettings
        Field of view, surface share and sample of tissue.
    noise : Noise
        Streams of the bench; the surface share of a place comes from them.
    """

    def __init__(self, settings: SimulationSettings, noise: Noise) -> None:
        self._s = settings
        self._noise = noise
        self._sampled = lru_cache(maxsize=64)(self._make_sampled)
        self._response = lru_cache(maxsize=4096)(self._make_response)
        self._surface_share = lru_cache(maxsize=65536)(self._make_surface_share)

    def behind(self, scene: Scene, hits: Hits, origins: FloatArray, direction: FloatArray) -> Inside:
        """Get the responses of those rays of one beam that come back from the target.

        The surface share is that of the place, in the target's own frame, where the first of them hits.

        Parameters
        ----------
        scene : Scene
        hits : Hits
            Of the N rays of the beam.
        origins, direction : (N, 3) and (3,) arrays
            The rays, scanner frame.
        """
        seen = (hits.brightness > 0).nonzero()[0]
        if len(seen) == 0:
            return Inside((), np.ones(0))
        place_mm = scene.in_model(origins[seen[0]] + hits.distance_mm[seen[0]] * direction)
        share = self._surface_share(*(round(x / self._s.surface_patch_mm) for x in place_mm.tolist()))
        steps = [round(math.acos(min(cosine, 1.0)) * STEPS_PER_RAD) for cosine in hits.cosine[seen].tolist()]
        materials = scene.materials(hits.face[seen])
        found = [
            (AT_ONCE, 1.0) if m.inside is None else self._response(m.inside, n, share if m.inside.moist else 0)
            for m, n in zip(materials, steps, strict=True)
        ]
        return Inside(tuple(spread for spread, _ in found), np.array([gain for _, gain in found]))

    def _make_response(self, typical: Optical, angle_step: int, surface_step: int) -> tuple[Spread, float]:
        sight = (angle_step * ANGLE_STEP_DEG, self._s.receiver_view_mm, self._s.spot_diameter_mm / 2)
        response = time_response(self._sampled(typical), *sight)
        gain = 1.0 if self._s.tissue_sample == 0 else response.beta / time_response(typical, *sight).beta
        return on_grid(response, TABLE_PS, surface_step * SURFACE_STEP), gain

    def _make_sampled(self, typical: Optical) -> Optical:
        """Properties of a material in this sample of tissue; a function of the sample's number and the name alone."""
        if self._s.tissue_sample == 0:
            return typical
        rng = Noise(self._s.tissue_sample).stream(f"tissue.{typical.name}")
        scattering, absorption, index = self._s.tissue_spread * rng.standard_normal(3)
        return replace(
            typical,
            scattering_per_mm=typical.scattering_per_mm * math.exp(scattering),
            absorption_per_mm=typical.absorption_per_mm * math.exp(ABSORPTION_SPREAD * absorption),
            index=max(1.0, typical.index + INDEX_SPREAD * index),
        )

    def _make_surface_share(self, *patch: int) -> int:
        """Surface share of a patch in `SURFACE_STEP`: even between its limits, a function of the bench's seed."""
        low, high = self._s.surface_share
        share = self._noise.stream("tissue.surface_share", *patch).uniform(low, high)
        return round(share / SURFACE_STEP)
