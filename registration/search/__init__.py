"""The global search: where starts come from, successive halving that thins them out, and the minima that remain."""

from picoradar.registration.search.cone import ANYWHERE, Cone
from picoradar.registration.search.global_search import Search
from picoradar.registration.search.landmarks import Landmarks
from picoradar.registration.search.minima import Candidate, difference, same_minimum
from picoradar.registration.search.start import Start, checked_start, landmarks_of

__all__ = [
    "ANYWHERE",
    "Candidate",
    "Cone",
    "Landmarks",
    "Search",
    "Start",
    "checked_start",
    "difference",
    "landmarks_of",
    "same_minimum",
]
