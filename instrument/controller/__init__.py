"""The controller: a state machine that owns the devices, interlocks as data, and the safe shutdown."""

from picoradar.instrument.controller.connection import switch_off
from picoradar.instrument.controller.controller import Controller
from picoradar.instrument.controller.job import STATE_EVENT, Between, LineStore, ScanJob, ScanOutcome, Sink
from picoradar.instrument.controller.laser_class import EDITION, PulseTrain, classify
from picoradar.instrument.controller.requests import Request
from picoradar.instrument.controller.safety import SafeState, make_safe
from picoradar.instrument.controller.states import STATES, TRANSITIONS, State, allowed_verbs, diagram
from picoradar.instrument.controller.subscribers import Subscription

__all__ = [
    "EDITION",
    "STATES",
    "STATE_EVENT",
    "TRANSITIONS",
    "Between",
    "Controller",
    "LineStore",
    "PulseTrain",
    "Request",
    "SafeState",
    "ScanJob",
    "ScanOutcome",
    "Sink",
    "State",
    "Subscription",
    "allowed_verbs",
    "classify",
    "diagram",
    "make_safe",
    "switch_off",
]
