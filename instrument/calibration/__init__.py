"""Calibrations: the file, its parts, its checks, and the scanner's geometry that it describes."""

from picoradar.instrument.calibration.checks import differences, out_of_date
from picoradar.instrument.calibration.file import Calibration
from picoradar.instrument.calibration.geometry import (
    CENTRE_CODE,
    angles_and_range,
    angles_to_codes,
    asked_angles,
    codes_to_angles,
    covariance_from,
    jacobian,
    points_from,
    true_angles,
)
from picoradar.instrument.calibration.materials import ZERO_MATERIAL, Material, RangeError, Ranging
from picoradar.instrument.calibration.parts import (
    PEAK_ROOM_PS,
    GeometryUncertainty,
    ScannerErrors,
    ShotNoise,
    Templates,
    Walk,
)
from picoradar.instrument.calibration.stretch import Stretch
from picoradar.instrument.calibration.zero import (
    ZeroCheck,
    ZeroDifference,
    ZeroInterval,
    ZeroLimits,
    ZeroMark,
    ZeroPlate,
    judge_zero,
)
from picoradar.instrument.settings import METHODS, Method

__all__ = [
    "CENTRE_CODE",
    "METHODS",
    "PEAK_ROOM_PS",
    "ZERO_MATERIAL",
    "Calibration",
    "GeometryUncertainty",
    "Material",
    "Method",
    "RangeError",
    "Ranging",
    "ScannerErrors",
    "ShotNoise",
    "Stretch",
    "Templates",
    "Walk",
    "ZeroCheck",
    "ZeroDifference",
    "ZeroInterval",
    "ZeroLimits",
    "ZeroMark",
    "ZeroPlate",
    "angles_and_range",
    "angles_to_codes",
    "asked_angles",
    "codes_to_angles",
    "covariance_from",
    "differences",
    "jacobian",
    "judge_zero",
    "out_of_date",
    "points_from",
    "true_angles",
]
