"""`Optical`: what happens to light of 904 nm inside a material."""

from __future__ import annotations

from dataclasses import dataclass

ABSORPTION_SPREAD = 2.0  # absorption scatters twice as much between samples as scattering does (30-50 % to 20-25 %)
INDEX_SPREAD = 0.15  # the refractive index: 0.03 where scattering varies by 20 %


@dataclass(frozen=True)
class Optical:
    """Optical properties of the inside of a material at 904 nm.

    Attributes
    ----------
    name : str
    scattering_per_mm : float
        Reduced scattering coefficient mu_s'.
    absorption_per_mm : float
        Absorption coefficient mu_a.
    index : float
        Refractive index.
    moist : bool
        Whether the share of the light that the surface reflects varies from place to place; a dry rough paint has
        none worth counting, as its light hardly comes later.
    """

    name: str
    scattering_per_mm: float
    absorption_per_mm: float
    index: float
    moist: bool = True

    def __post_init__(self) -> None:
        if not (self.scattering_per_mm > 0 and self.absorption_per_mm >= 0 and self.index >= 1):
            raise ValueError(f"{self.name}: needs scattering above 0, absorption from 0 on and an index from 1 on")


# Middle values and their sources: docs/physics.md, "Light in tissue".
CORTICAL_BONE = Optical("cortical bone", 1.5, 0.03, 1.50)  # Jacques 2013 (two forms: 1.50, 1.24); Firbank 1993: 1.3
CANCELLOUS_BONE = Optical("cancellous bone", 1.2, 0.08, 1.40)  # bone, marrow fat, 10 % blood: estimated
CARTILAGE = Optical("cartilage", 0.8, 0.04, 1.40)  # Ebert 1998 at 850 nm; index Shvachkina 2018
FAT = Optical("fat", 1.2, 0.008, 1.44)  # Jacques 2013; Simpson 1998
MUSCLE = Optical("muscle", 0.6, 0.03, 1.37)  # Bashkatov 2011; Simpson 1998
BLOOD = Optical("blood", 1.4, 0.6, 1.38)  # Prahl's table at 150 g/l; Bosschaart 2014, Friebel 2009

PAINT_SCATTERING_PER_MM = 150.0  # white matt paint (TiO2), 20 to 300: estimated
PAINT_ABSORPTION = 0.01  # least absorption over scattering, 0.005 to 0.02: estimated


def paint_inside(reflectance: float) -> Optical:
    """Get the inside of a matt paint of some gray.

    Darker ones absorb more after Kubelka and Munk: (1 - R)^2 / 2 R = K / S with K = 2 mu_a, S = 3/4 mu_s' - mu_a/4.
    """
    ratio = (1.0 - reflectance) ** 2 / (2.0 * reflectance)
    absorption = max(PAINT_ABSORPTION, 0.75 * ratio / (2.0 + 0.25 * ratio))
    return Optical("paint", PAINT_SCATTERING_PER_MM, absorption * PAINT_SCATTERING_PER_MM, 1.5, moist=False)
