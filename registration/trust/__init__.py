"""How far to trust a pose: covariance, evidence, verdict, and the result that carries them."""

from picoradar.registration.trust.assess import RegistrationRequest, TargetsLike, named_targets
from picoradar.registration.trust.budget import ErrorBudget, Socket
from picoradar.registration.trust.covariance import Target
from picoradar.registration.trust.evidence import Objection, Tolerance
from picoradar.registration.trust.fit import Assessed, taken_off
from picoradar.registration.trust.result import Registration

__all__ = [
    "Assessed",
    "ErrorBudget",
    "Objection",
    "Registration",
    "RegistrationRequest",
    "Socket",
    "Target",
    "TargetsLike",
    "Tolerance",
    "named_targets",
    "taken_off",
]
