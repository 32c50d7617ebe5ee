"""Registration of paired points: closed forms, scalar weights, full covariances, and the error predicted at targets."""

from picoradar.registration.paired_points.closed_form import horn, svd
from picoradar.registration.paired_points.judging import PairsJudged, judge_pairs
from picoradar.registration.paired_points.second_order import SecondOrder, second_order
from picoradar.registration.paired_points.solve import PairedPoints, paired_points
from picoradar.registration.paired_points.weighted import parameter_covariance

__all__ = [
    "PairedPoints",
    "PairsJudged",
    "SecondOrder",
    "horn",
    "judge_pairs",
    "paired_points",
    "parameter_covariance",
    "second_order",
    "svd",
]
