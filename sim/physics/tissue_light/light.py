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
from picoradar.sim.physics.spread import AT_ONCE, TABLE_PS, Late, Spread
from picoradar.sim.physics.tissue_light.optical import ABSORPTION_SPREAD, INDEX_SPREAD, Optical
from picoradar.sim.physics.tissue_light.response import on_grid, time_response
from picoradar.sim.settings import SimulationSettings

FloatArray = NDArray[np.float64]

ANGLE_STEP_DEG = 5.0  # responses are made for these angles of incidence: the bias changes by 1 % from one to the next
STEPS_PER_RAD = math.degrees(1.0) / ANGLE_STEP_DEG


class Inside(NamedTuple):
    """Light of N rays: how it goes on arriving, and ``gain`` (N,), how much there is over that of typical tissue."""

    lates: list[Late]
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

    def behind(self, scene: Scene, hits: Hits, origins: FloatArray, directions: FloatArray) -> Inside:
        """Get the light of those rays of one beam that come back from the target.

        The surface share is that of the place, in the target's own frame, where the first of them hits.

        Parameters
        ----------
        scene : Scene
        hits : Hits
            Of the N rays of the beam.
        origins, directions : (N, 3) arrays
            The rays, scanner frame; a single direction (3,) is that of all.
        """
        seen = (hits.brightness > 0).nonzero()[0]
        if len(seen) == 0:
            return Inside([], np.ones(0))
        first = seen[0]
        direction = directions if directions.ndim == 1 else directions[first]
        place_mm = scene.in_model(origins[first] + hits.distance_mm[first] * direction)
        surface = self._surface_share(*(round(x / self._s.surface_patch_mm) for x in place_mm.tolist()))
        known: dict[tuple[int, int], tuple[Late, float]] = {}
        found = []
        numbers = scene.material_numbers(hits.face[seen])
        for number, cosine in zip(numbers.tolist(), hits.cosine[seen].tolist(), strict=True):
            kind = number, round(math.acos(min(cosine, 1.0)) * STEPS_PER_RAD)
            if kind not in known:
                known[kind] = self._of_kind(scene.material(number).inside, kind[1], surface)
            found.append(known[kind])
        lates, gain = zip(*found, strict=True)
        return Inside(list(lates), np.array(gain))

    def _of_kind(self, inside: Optical | None, angle_step: int, surface_share: float) -> tuple[Late, float]:
        """Light of a ray that meets some material at some angle, and how much there is."""
        if inside is None:
            return Late(1.0, AT_ONCE), 1.0
        spread, gain = self._response(inside, angle_step)
        return Late(surface_share if inside.moist else 0.0, spread), gain

    def _make_response(self, typical: Optical, angle_step: int) -> tuple[Spread, float]:
        """Spread of the light from the inside, and the light that comes back over that of typical tissue."""
        sight = (angle_step * ANGLE_STEP_DEG, self._s.receiver_view_mm, self._s.spot_diameter_mm / 2)
        response = time_response(self._sampled(typical), *sight)
        gain = 1.0 if self._s.tissue_sample == 0 else response.beta / time_response(typical, *sight).beta
        return Spread(on_grid(response, TABLE_PS)), gain

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

    def _make_surface_share(self, *patch: int) -> float:
        """Surface share of a patch: even between its limits, a function of the bench's seed."""
        low, high = self._s.surface_share
        return float(self._noise.stream("tissue.surface_share", *patch).uniform(low, high))
