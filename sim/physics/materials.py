"""`Material`: how a surface scatters the laser's light back at 904 nm."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from picoradar.sim.physics.tissue_light import optical

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Material:
    """Rough diffuse surface with a specular part.

    Attributes
    ----------
    diffuse : float
        Diffuse reflectance (albedo).
    specular : float
        Brightness of the specular lobe at normal incidence, relative to a white Lambertian.
    roughness_deg : float
        Standard deviation of the slope of the diffuse facets; 0 is Lambert's law.
    gloss_deg : float
        Width (standard deviation of the facets' slope) of the specular lobe.
    inside : Optical, optional
        What light meets below the surface (`SimulationSettings.tissue_light`); None lets none in.
    """

    diffuse: float
    specular: float = 0.0
    roughness_deg: float = 30.0
    gloss_deg: float = 8.0
    inside: optical.Optical | None = None

    def coefficients(self) -> tuple[float, float, float, float]:
        """Get a, b, s, g of ``a cos + b sin^2 + s exp(-g tan^2)`` (see `backscatter`)."""
        variance = math.radians(self.roughness_deg) ** 2
        a = 1.0 - 0.5 * variance / (variance + 0.33)
        b = 0.45 * variance / (variance + 0.09)
        return self.diffuse * a, self.diffuse * b, self.specular, 0.5 / math.tan(math.radians(self.gloss_deg)) ** 2


def backscatter(cosine: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Get the backscattered light, relative to a white Lambertian at normal incidence.

    Diffuse part after Oren and Nayar (SIGGRAPH 1994), first order model, with detector and source in one place: facets
    that face the source keep a tilted rough surface bright, where a smooth one darkens as the cosine. Specular part
    after Beckmann: facets that face the source exactly.

    Parameters
    ----------
    cosine : (N,) array
        Cosine of the incidence angle, 0 to 1.
    coefficients : (N, 4) array
        `Material.coefficients` of each ray's surface.
    """
    a, b, s, g = coefficients.T
    squared = cosine * cosine
    sine_squared = 1.0 - squared
    return np.asarray(a * cosine + b * sine_squared + s * np.exp(-g * sine_squared / np.maximum(squared, 1e-9)))


BONE_MOIST = Material(0.64, specular=0.03, gloss_deg=15.0, inside=optical.CORTICAL_BONE)
BONE_WET = Material(0.64, specular=0.045, gloss_deg=15.0, inside=optical.CORTICAL_BONE)
BONE_SPONGY = Material(0.6, specular=0.045, gloss_deg=15.0, inside=optical.CANCELLOUS_BONE)
CARTILAGE = Material(0.65, specular=0.05, gloss_deg=12.0, inside=optical.CARTILAGE)
CARTILAGE_ON_BONE = replace(CARTILAGE, inside=optical.CORTICAL_BONE)  # 1 to 2 mm of it: reads as bone to 0.05 mm
SOFT_TISSUE = Material(0.48, specular=0.05, gloss_deg=15.0, inside=optical.MUSCLE)
FAT = Material(0.55, specular=0.04, roughness_deg=20.0, gloss_deg=15.0, inside=optical.FAT)
BLOOD = Material(0.22, specular=0.15, roughness_deg=10.0, gloss_deg=8.0, inside=optical.BLOOD)
CLOT = Material(0.012, roughness_deg=20.0, inside=optical.BLOOD)
STEEL = Material(0.12, specular=1.5, roughness_deg=10.0, gloss_deg=5.0)


def paint(reflectance: float) -> Material:
    """Get a diffuse paint of some gray."""
    return Material(reflectance, inside=optical.paint_inside(reflectance))


WHITE = paint(0.9)
GRAY_PAINT = paint(0.5)
