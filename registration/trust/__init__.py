"""How far to trust a pose: covariance, evidence, verdict, and the result that carries them."""

from picoradar.registration.trust.assess import RegistrationRequest, named_targets
from picoradar.registration.trust.covariance import Target
from picoradar.registration.trust.result import Registration
from picoradar.registration.trust.verdict import Objection, Tolerance

__all__ = [
    "Objection",
    "Registration",
    "RegistrationRequest",
    "Target",
    "Tolerance",
    "named_targets",
]
