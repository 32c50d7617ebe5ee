"""What the residuals of a group of fits say: more noise, another shape, a second pulse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.instrument.calibration import Stretch
from picoradar.instrument.ranging.common_shape import CommonShape, common_shape, moved_sd_ps, without
from picoradar.instrument.ranging.residual_noise import ResidualNoise
from picoradar.instrument.ranging.second_pulse import evidence
from picoradar.instrument.ranging.settings import RangingSettings
from picoradar.instrument.ranging.stretch import Stretched, stretch_in
from picoradar.instrument.ranging.template_fit import PulseFit

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class Noticed(NamedTuple):
    """Fits of R records with the covariance that their residuals ask for; where there is a second pulse (R,); and where
    the pulse has another shape (R,).

    ``poor`` (R,) are the fits of one pulse that leave more than noise does, whether or not all records do.
    ``stretched`` is the stretch of echoes, if it was asked for."""

    fit: PulseFit
    second: BoolArray
    distorted: BoolArray
    poor: BoolArray
    stretched: Stretched | None = None


def notice(
    references: Sequence[PulseFit],
    echoes: Sequence[PulseFit],
    settings: RangingSettings,
    stretch: Stretch | None = None,
) -> tuple[list[Noticed], list[Noticed]]:
    """Judge fits of references and echoes by what they leave.

    Parameters
    ----------
    references, echoes : sequences of PulseFit
        Groups of records that were taken one shortly after the other; those of a group have pieces of one form.
    settings : RangingSettings
    stretch : Stretch, optional
        How light that enters the target stretches echoes: so far, they are as they should be.

    Returns
    -------
    two lists of Noticed
        For references and echoes.
    """
    of_instrument = _common(references, settings)
    plain = [without(fit, of_instrument) for fit in (*references, *echoes)]
    stretched: list[Stretched | None] = [None] * len(plain)
    if stretch is not None:
        for k in range(len(references), len(plain)):
            stretched[k], plain[k] = stretch_in(plain[k], stretch, settings)
    alone = of_instrument is None and len(references) == 1  # then nothing is left to be found in it
    shapes = [None if alone and k == 0 else common_shape(fit, settings) for k, fit in enumerate(plain)]
    bare = [without(fit, shape) for fit, shape in zip(plain, shapes, strict=True)]
    usual = [
        left for left, shape in zip(bare, shapes, strict=True) if shape is None or shape.rms < settings.worst_residual
    ]
    noise = ResidualNoise(usual, settings)
    judged = [
        _judged(fit, (one, left), shape, noise, settings)
        for fit, one, left, shape in zip((*references, *echoes), plain, bare, shapes, strict=True)
    ]
    for k in range(len(references), len(judged)):
        judged[k] = _with_second_pulse(judged[k], plain[k], noise, settings)
        judged[k] = _with_stretch(judged[k], stretched[k], noise)
    if of_instrument is not None and of_instrument.rms > settings.worst_residual:
        judged = [one._replace(distorted=~one.second) for one in judged]
    return judged[: len(references)], judged[len(references) :]


def _common(references: Sequence[PulseFit], settings: RangingSettings) -> CommonShape | None:
    """Return the change of shape of the largest group of references: that of the instrument's pulse."""
    fitted = [fit for fit in references if fit.residuals is not None]
    return common_shape(max(fitted, key=lambda fit: len(fit.delay_ps)), settings) if fitted else None


def _judged(
    fit: PulseFit,
    shown: tuple[PulseFit, PulseFit],
    shape: CommonShape | None,
    noise: ResidualNoise,
    settings: RangingSettings,
) -> Noticed:
    """Judge a group: ``shown`` are its fits without the instrument's change of shape, and without its own, too."""
    plain, bare = shown
    if fit.residuals is None or plain.residuals is None or bare.residuals is None:
        none = np.zeros(len(fit.delay_ps), dtype=np.bool_)
        return Noticed(fit, none, none, none)
    freedom, square = bare.residuals.freedom, bare.residuals.square
    usual = noise.usual_square(fit) * freedom
    misfit = (square / usual - 1.0) * np.sqrt(freedom / 2.0)
    poor = misfit > settings.worst_misfit_sigmas
    wider = noise.refined(fit._replace(residuals=bare.residuals))
    stated_ps2 = wider.covariance[:, 0, 0]
    covariance = wider.covariance * np.where(poor, square / usual, 1.0)[:, None, None]
    distorted = poor & (fit.residual_mv > settings.worst_residual * fit.amplitude_mv)
    out = ~bare.residuals.used
    distorted |= out.sum(axis=1) > max(settings.max_outliers, settings.many_outliers * out.shape[1])
    distorted |= noise.energy_share > settings.worst_energy_share
    if shape is not None:
        moved_ps2 = moved_sd_ps(fit, shape, settings) ** 2
        distorted |= moved_ps2 > settings.common_share**2 * stated_ps2
        covariance = covariance.copy()
        covariance[:, 0, 0] += moved_ps2
    wider = wider._replace(covariance=covariance, misfit_sigmas=misfit)
    unusual = (plain.residuals.square / usual - 1.0) * np.sqrt(freedom / 2.0) > settings.worst_misfit_sigmas
    none = np.zeros(len(fit.delay_ps), dtype=np.bool_)
    return Noticed(wider, none, distorted, poor | unusual)


def _with_second_pulse(judged: Noticed, plain: PulseFit, noise: ResidualNoise, settings: RangingSettings) -> Noticed:
    """Say where a copy of the pulse stands out of the noise and explains most of what is unusual."""
    left = plain.residuals
    if left is None:
        return judged
    near, far = evidence(left, noise.deviations_covariance(left), settings)
    most = np.maximum(near, far)
    excess = left.square - noise.usual_square(plain) * left.freedom
    second = ((near > settings.near_sigmas) | (far > settings.far_sigmas)) & (
        most**2 > settings.explained_share * excess
    )
    return judged._replace(second=second, distorted=judged.distorted & ~second)


def _with_stretch(judged: Noticed, found: Stretched | None, noise: ResidualNoise) -> Noticed:
    """Add the stretch of echoes with the noise of the day; where there are two pulses it is not known."""
    if found is None:
        return judged
    unknown = np.where(judged.second, np.nan, 1.0)
    variance = found.variance * noise.usual_square(judged.fit)
    return judged._replace(stretched=Stretched(found.share * unknown, variance * unknown))
