"""`MirrorPair`: two galvanometer mirrors, from the analogue command to the ray that leaves them."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from picoradar.drivers.clock import Clock
from picoradar.sim.physics.noise import Noise
from picoradar.sim.settings import SimulationSettings

Vector = NDArray[np.float64]

REMEMBERED_COMMANDS = 256
FULL_FIELD_DEG = 40.0


class Beam(NamedTuple):
    """A ray that leaves the scanner: ``origin`` (3,) mm on mirror 2, unit ``direction`` (3,), and
    ``path_mm``, the length from mirror 1 to mirror 2."""

    origin: Vector
    direction: Vector
    path_mm: float


class _Axis(NamedTuple):
    """One axis after a command: target, and remaining deviations of servo and creep, in commands (-1..1)."""

    target: float
    servo: float
    servo_rate: float
    creep: float


class _Motion(NamedTuple):
    """Both axes after a command."""

    since_s: float
    axes: tuple[_Axis, _Axis]


class MirrorPair:
    """Two mirrors; implements `picoradar.sim.wires.Mirrors`.

    A step passes through a critically damped servo, except for a small share that creeps in: after 40 mm of
    fly-back half a millimetre is missing when the servo has settled (dissertation, section 2.6.2).

    Parameters
    ----------
    clock : Clock
        Time of the bench.
    settings : SimulationSettings
        Field, separation and errors of the scanner.
    noise : Noise
        Source of the random error of each return.
    """

    def __init__(self, clock: Clock, settings: SimulationSettings, noise: Noise) -> None:
        self._clock = clock
        self._settings = settings
        self._noise = noise
        shares = noise.stream("scanner.linearity").uniform(-1.0, 1.0, (4, 2))
        shares /= np.abs(shares).sum(axis=0)
        self._linearity_deg = settings.linearity_percent / 100 * FULL_FIELD_DEG * shares
        s = settings
        self._gain_deg = (s.field_deg / 2 * (1.0 + s.x_scale_error), s.field_deg / 2 * (1.0 + s.y_scale_error))
        self._offset_deg = (s.x_offset_deg, s.y_offset_deg)
        rest = _Axis(0.0, 0.0, 0.0, 0.0)
        self._history = deque([_Motion(-math.inf, (rest, rest))], maxlen=REMEMBERED_COMMANDS)

    @property
    def commanded(self) -> tuple[float, float]:
        """Get the last command (x, y), in -1..1 of the analogue span."""
        x, y = self._history[-1].axes
        return x.target, y.target

    def command(self, x: float, y: float) -> None:
        """Take a new command now; ``x`` and ``y`` in -1..+1 of the analogue span.

        Parameters
        ----------
        x, y : float
            Command of each axis.

        Raises
        ------
        ValueError
            When a command is outside the span: the amplifier's input range ends there.
        """
        if not (-1.0 <= x <= 1.0 and -1.0 <= y <= 1.0):
            raise ValueError(f"scanner command ({x}, {y}) outside -1..+1 of the analogue span")
        if (x, y) == self.commanded:
            return
        last = self._history[-1]
        now_s = self._clock.now()
        share = self._settings.creep_share
        axes = []
        for axis, wanted in zip(last.axes, (x, y), strict=True):
            left = self._later(axis, now_s - last.since_s)
            step = wanted - axis.target
            axes.append(_Axis(wanted, left.servo + (1 - share) * step, left.servo_rate, left.creep + share * step))
        self._history.append(_Motion(now_s, (axes[0], axes[1])))

    def position(self, t_s: float) -> tuple[float, float]:
        """Get the position of both mirrors at the time ``t_s``, in commands (-1..1)."""
        motion = self._history[-1]
        if motion.since_s > t_s:
            motion = next((m for m in reversed(self._history) if m.since_s <= t_s), self._history[0])
        x, y = (self._later(axis, t_s - motion.since_s) for axis in motion.axes)
        return x.target - x.servo - x.creep, y.target - y.servo - y.creep

    def angles_rad(self, t_s: float, *key: int) -> Vector:
        """Get the true optical angles (2,) of both mirrors at ``t_s``; ``key`` selects this return's random error."""
        x, y = self.position(t_s)
        angles_deg = self._noise.stream("scanner.repeatability", *key).standard_normal(2)
        angles_deg *= self._settings.repeatability_deg
        angles_deg += (x * self._gain_deg[0] + self._offset_deg[0], y * self._gain_deg[1] + self._offset_deg[1])
        if self._settings.linearity_percent > 0:
            # A smooth curve over the full field, within the manufacturer's limit: sum of Chebyshev polynomials.
            places = angles_deg / (FULL_FIELD_DEG / 2)
            angles_deg += np.polynomial.chebyshev.chebval(places, self._linearity_deg, tensor=False)
        return np.asarray(np.radians(angles_deg))

    def beam(self, t_s: float, *key: int) -> Beam:
        """Get the ray that leaves the mirrors at the time ``t_s`` (scanner frame, see `trace`)."""
        return self.ray(self.angles_rad(t_s, *key))

    def ray(self, angles_rad: Vector) -> Beam:
        """Get the ray for true optical angles (2,)."""
        x_rad, y_rad = angles_rad
        turn_rad = math.radians(self._settings.non_orthogonality_deg)
        return trace(float(x_rad) / 2, float(y_rad) / 2, self._settings.mirror_separation_mm, turn_rad)

    def _later(self, axis: _Axis, elapsed_s: float) -> _Axis:
        """Remaining deviation some time after a command: the free motion r'' + 2 r'/T + r/T^2 = 0, and the creep."""
        elapsed_s = max(0.0, elapsed_s)
        servo_s, creep_s = self._settings.servo_time_ms * 1e-3, self._settings.creep_time_ms * 1e-3
        decay = math.exp(-elapsed_s / servo_s)
        if decay == 0.0:
            return _Axis(axis.target, 0.0, 0.0, axis.creep * math.exp(-elapsed_s / creep_s))
        slope = axis.servo_rate + axis.servo / servo_s
        servo = (axis.servo + slope * elapsed_s) * decay
        rate = slope * decay - servo / servo_s
        return _Axis(axis.target, servo, rate, axis.creep * math.exp(-elapsed_s / creep_s))


def trace(x_turn_rad: float, y_turn_rad: float, separation_mm: float, axis_turn_rad: float = 0.0) -> Beam:
    """Reflect the laser beam at two mirror planes.

    The beam travels along +x to mirror 1 at (0, -separation, 0), which turns about z (at rest its normal is
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


# Plain tuples: several times as fast as arrays for single vectors.
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
