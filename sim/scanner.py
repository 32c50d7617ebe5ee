"""`MirrorPair`: two galvanometer mirrors, from the analogue command to the ray that leaves them."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drivers.clock import Clock
from sim.noise import Noise
from sim.settings import SimulationSettings

Vector = NDArray[np.float64]

REMEMBERED_COMMANDS = 256
FULL_FIELD_DEG = 40.0


class Beam(NamedTuple):
    """A ray that leaves the scanner: ``origin`` (3,) mm on mirror 2, unit ``direction`` (3,), and
    ``path_mm``, the length from mirror 1 to mirror 2."""

    origin: Vector
    direction: Vector
    path_mm: float


class _Motion(NamedTuple):
    """Both axes (2,) from a command on: where they were sent, and what is still missing, in commands (-1..1)."""

    since_s: float
    target: Vector
    servo: Vector
    servo_rate: Vector
    creep: Vector


class MirrorPair:
    """Two mirrors; implements `sim.wires.Mirrors`.

    A step goes through a critically damped servo, but for a small share of it that creeps in: at 40 mm of
    fly-back half a millimetre is missing when the servo has arrived (dissertation, section 2.6.2).

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    settings : SimulationSettings
        Field, separation and errors of the scanner.
    noise : Noise
        Source of the error of each return.
    """

    def __init__(self, clock: Clock, settings: SimulationSettings, noise: Noise) -> None:
        self._clock = clock
        self._settings = settings
        self._noise = noise
        shares = noise.stream("scanner.linearity").uniform(-1.0, 1.0, (4, 2))
        shares /= np.abs(shares).sum(axis=0)
        self._linearity_deg = settings.linearity_percent / 100 * FULL_FIELD_DEG * shares
        rest = np.zeros(2)
        self._history = deque([_Motion(-math.inf, rest, rest, rest, rest)], maxlen=REMEMBERED_COMMANDS)

    def command(self, x: float, y: float) -> None:
        """Take a new command now; ``x`` and ``y`` in -1..+1 of the analogue span.

        Raises
        ------
        ValueError
            When a command is outside the span: the amplifier's input range ends there.
        """
        if not (-1.0 <= x <= 1.0 and -1.0 <= y <= 1.0):
            raise ValueError(f"scanner command ({x}, {y}) outside -1..+1 of the analogue span")
        wanted = np.array([x, y])
        last = self._history[-1]
        step = wanted - last.target
        if not step.any():
            return
        now_s = self._clock.now()
        servo, rate, creep = self._missing(last, now_s)
        share = self._settings.creep_share
        self._history.append(_Motion(now_s, wanted, servo + (1 - share) * step, rate, creep + share * step))

    def position(self, t_s: float) -> Vector:
        """Get where both mirrors (2,) stand at the moment ``t_s``, in commands (-1..1)."""
        at = max(0, bisect_right(self._history, t_s, key=lambda motion: motion.since_s) - 1)
        motion = self._history[at]
        servo, _, creep = self._missing(motion, t_s)
        return motion.target - servo - creep

    def angles_rad(self, t_s: float, *key: int) -> Vector:
        """Get the true optical angles (2,) of both mirrors at ``t_s``; ``key`` names the error of this return."""
        s = self._settings
        scale = np.array([1.0 + s.x_scale_error, 1.0 + s.y_scale_error])
        offset = np.array([s.x_offset_deg, s.y_offset_deg])
        error = self._noise.stream("scanner.repeatability", *key).normal(0.0, 1.0, 2) * s.repeatability_deg
        angles_deg = self.position(t_s) * (s.field_deg / 2) * scale + offset + error
        if s.linearity_percent > 0:
            # A smooth curve over the full field, within the maker's limit: sum of Chebyshev polynomials.
            places = angles_deg / (FULL_FIELD_DEG / 2)
            angles_deg += np.polynomial.chebyshev.chebval(places, self._linearity_deg, tensor=False)
        return np.asarray(np.radians(angles_deg))

    def beam(self, t_s: float, *key: int) -> Beam:
        """Get the ray that leaves the mirrors at the moment ``t_s`` (scanner frame, see `trace`)."""
        return self.ray(self.angles_rad(t_s, *key))

    def ray(self, angles_rad: Vector) -> Beam:
        """Get the ray for true optical angles (2,)."""
        x_rad, y_rad = angles_rad
        turn_rad = math.radians(self._settings.non_orthogonality_deg)
        return trace(float(x_rad) / 2, float(y_rad) / 2, self._settings.mirror_separation_mm, turn_rad)

    def _missing(self, motion: _Motion, t_s: float) -> tuple[Vector, Vector, Vector]:
        """Way still to go (servo, its rate, creep) at ``t_s``; the free motion r'' + 2 r'/T + r/T^2 = 0."""
        if motion.since_s == -math.inf:
            return motion.servo, motion.servo_rate, motion.creep
        elapsed_s = max(0.0, t_s - motion.since_s)
        servo_s, creep_s = self._settings.servo_time_ms * 1e-3, self._settings.creep_time_ms * 1e-3
        decay = math.exp(-elapsed_s / servo_s)
        slope = motion.servo_rate + motion.servo / servo_s
        servo = (motion.servo + slope * elapsed_s) * decay
        rate = slope * decay - servo / servo_s
        return servo, rate, motion.creep * math.exp(-elapsed_s / creep_s)


def trace(x_turn_rad: float, y_turn_rad: float, separation_mm: float, axis_turn_rad: float = 0.0) -> Beam:
    """Reflect the laser beam at two mirror planes.

    The beam flies along +x to mirror 1 at (0, -separation, 0), which turns about z (at rest its normal is
    (-1, 1, 0)), then to mirror 2, which contains the origin and turns about x (at rest (0, -1, 1)). Both mirror
    planes contain their axes. A positive turn deflects the beam to +x or +y.

    Parameters
    ----------
    x_turn_rad, y_turn_rad : float
        Mechanical turns of mirror 1 and mirror 2.
    separation_mm : float
        Distance between the axes.
    axis_turn_rad : float, optional
        Turn of mirror 2's axis about z: zero when the axes are orthogonal to the beams.

    Returns
    -------
    Beam
        The ray after mirror 2.
    """
    half = math.sqrt(0.5)
    first_normal = _turned((-half, half, 0.0), (0.0, 0.0, 1.0), -x_turn_rad)
    along, across = math.cos(axis_turn_rad), math.sin(axis_turn_rad)
    second_normal = _turned((across * half, -along * half, half), (along, across, 0.0), -y_turn_rad)

    first_hit = (0.0, -separation_mm, 0.0)
    between = _reflected((1.0, 0.0, 0.0), first_normal)
    path_mm = -_dot(first_hit, second_normal) / _dot(between, second_normal)
    second_hit = np.array(first_hit) + path_mm * np.array(between)
    return Beam(second_hit, np.array(_reflected(between, second_normal)), path_mm)


# Plain tuples: for single vectors they are several times as fast as arrays.
_Triple = tuple[float, float, float]


def _dot(a: _Triple, b: _Triple) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _reflected(direction: _Triple, normal: _Triple) -> _Triple:
    twice = 2.0 * _dot(direction, normal)
    return direction[0] - twice * normal[0], direction[1] - twice * normal[1], direction[2] - twice * normal[2]


def _turned(vector: _Triple, axis: _Triple, angle_rad: float) -> _Triple:
    """Turn ``vector`` about the unit ``axis`` across it (Rodrigues)."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    (a, b, d), (x, y, z) = axis, vector
    return c * x + s * (b * z - d * y), c * y + s * (d * x - a * z), c * z + s * (a * y - b * x)
