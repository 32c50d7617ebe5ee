"""`Material`: how a surface scatters the laser's light back at 904 nm."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
    """

    diffuse: float
    specular: float = 0.0
    roughness_deg: float = 30.0
    gloss_deg: float = 8.0

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


BONE_MOIST = Material(0.64, specular=0.03, gloss_deg=15.0)
BONE_WET = Material(0.64, specular=0.045, gloss_deg=15.0)
CARTILAGE = Material(0.65, specular=0.05, gloss_deg=12.0)
SOFT_TISSUE = Material(0.48, specular=0.05, gloss_deg=15.0)
FAT = Material(0.55, specular=0.04, roughness_deg=20.0, gloss_deg=15.0)
BLOOD = Material(0.22, specular=0.15, roughness_deg=10.0, gloss_deg=8.0)
CLOT = Material(0.012, roughness_deg=20.0)
STEEL = Material(0.12, specular=1.5, roughness_deg=10.0, gloss_deg=5.0)
WHITE = Material(0.9)
GRAY_PAINT = Material(0.5)


def paint(reflectance: float) -> Material:
    """Get a diffuse paint of some gray."""
    return Material(reflectance)
