"""How likely a fit is, but for what the last hundredths of a millimetre beside an edge decide.

A beam that passes by an edge, however narrowly, cannot have been sent back there, and makes a pose unlikelier by as
much as one that misses by far. No gradient leads from there to where it meets the body. So a fit may lack tens of nats
that a motion smaller than the noise would bring: it must not be called refuted for them.
"""

from __future__ import annotations

import numpy as np

from picoradar.registration._types import BoolArray
from picoradar.registration.model import Surface
from picoradar.registration.refine.annealing import faces_beams
from picoradar.registration.refine.beam_fit import BeamFit
from picoradar.registration.scan import Scan, log_likelihood
from picoradar.registration.se3 import transform
from picoradar.registration.settings import RobustSettings


def edge_forgiving_likelihood(
    fit: BeamFit, scan: Scan, surface: Surface, allowed: BoolArray, settings: RobustSettings
) -> float:
    """Mean log likelihood a point [eq. 11] of residuals across the surface, the smaller one of beam and closest point.

    The closest point counts where it is near enough to be noise, and on a face that the beam can have come from.

    Parameters
    ----------
    fit : BeamFit
        Of the scan.
    scan : Scan
    surface : Surface
        Closed; of the whole model.
    allowed : (N,) array of bool
        Points that may take part.
    settings : RobustSettings
    """
    rotation, met = fit.model_from_scanner[:3, :3], fit.met
    near = surface.closest(transform(fit.model_from_scanner, scan.points))
    met_sigma = fit.noise.plane_sigma(scan, rotation, met.normals)
    near_sigma = fit.noise.plane_sigma(scan, rotation, near.normals)
    residual = np.where(allowed & (met.faces >= 0), met.signed_mm, -settings.tissue.residual_inside_mm)
    forgiven = faces_beams(surface, near, scan.beams @ rotation.T, settings.edges.min_cosine)
    forgiven &= allowed & (np.abs(near.signed_mm) < settings.beam_fit.max_residual_sigma * near_sigma)
    forgiven &= np.abs(near.signed_mm) / near_sigma < np.abs(residual) / met_sigma
    residual, sigma = np.where(forgiven, near.signed_mm, residual), np.where(forgiven, near_sigma, met_sigma)
    return float(log_likelihood(residual, sigma, scan.around, settings.tissue).mean())
