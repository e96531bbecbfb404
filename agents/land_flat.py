"""Land upright, and rolling where friction would hold a sled: what closed forms say without any simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.kernel.geometry import support_heights

Floats = NDArray[np.float64]

_TURN: Final = 2.0 * np.pi
_HALVINGS: Final = 60  # of the time of flight: down to rounding


class Agent:
    """Puts the mass centre straight below the centre of the arc at the first touch: the normal impulse has no arm then.

    A body that touches with phi = 0 has fallen by D = drop + s(phi_0) - s(0), s being the support height, and has taken
    t for it with D = fall t + G t^2 / 2, G = g cos(beta). It is upright there if phi_0 + omega t = 0 up to whole turns.
    Where friction holds what slides, f > tan(beta), it should not slip: u + s(0) omega = 0, u = speed + g sin(beta) t.
    Elsewhere it gains speed by sliding, and a spin would cost energy: omega = 0. The agent solves these for what it
    controls, as far as the bounds allow; if that is the spin alone, being upright comes first. What it leaves out is a
    touch in another pose on the way, and all contacts after the first.
    """

    def __init__(self, problem: Problem) -> None:
        self._task = problem.task
        self._gravity = problem.scenario.slope_section.gravity_m_s2
        control = problem.scenario.control
        self._orientations = np.radians(control.orientation_deg)
        self._spins = np.array(control.spin_rad_s)

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Nothing to learn."""
        return cls(problem)

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Nothing to load."""
        return cls(problem)

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        angle, friction, _, speed, drop, fall, orientation, spin = self._task.contexts_seen(observations).T
        body, control = self._task.body, self._task.control
        upright = body.radius - body.eccentricity
        normal, along = self._gravity * np.cos(angle), self._gravity * np.sin(angle)

        def fallen(height: Floats) -> Floats:
            return _fallen(np.maximum(height, 0.0), fall, normal)

        def wanted(time: Floats) -> Floats:
            rolling = -(speed + along * time) / upright
            return np.asarray(np.clip(np.where(friction > np.tan(angle), rolling, 0.0), *self._spins))

        if control == "spin":
            time = fallen(drop + support_heights(body, np.ascontiguousarray(orientation)) - upright)
            return _scaled((_spin(orientation, time, wanted(time), self._spins), self._spins))
        # The pose decides how far the body falls, and the time that it falls decides the pose.
        low, high = np.zeros_like(drop), fallen(drop + body.radius + body.eccentricity)
        for _ in range(_HALVINGS):
            time = 0.5 * (low + high)
            chosen = wanted(time) if control == "both" else spin
            late = fallen(drop + support_heights(body, -chosen * time) - upright) > time
            low, high = np.where(late, time, low), np.where(late, high, time)
        pose = _turned(-chosen * time, self._orientations), self._orientations
        return _scaled(pose, (chosen, self._spins)) if control == "both" else _scaled(pose)


def _fallen(height: Floats, fall: Floats, gravity: Floats) -> Floats:
    """Time [s] after which a body has fallen by a height >= 0 [m]; 0 if it never falls."""
    root = fall + np.sqrt(np.square(fall) + 2.0 * gravity * height)
    return np.divide(2.0 * height, root, out=np.zeros_like(height), where=root > 0.0)


def _turned(angle: Floats, bounds: Floats) -> Floats:
    """Add the whole turns that bring angles nearest to the middle of the bounds."""
    turns: Floats = np.rint((angle - bounds.mean()) / _TURN)
    return angle - _TURN * turns


def _spin(orientation: Floats, time: Floats, wanted: Floats, bounds: Floats) -> Floats:
    """Return the spins [rad/s] that end upright, up to whole turns, and are nearest to those wanted."""
    turns = -orientation / _TURN
    with np.errstate(divide="ignore", invalid="ignore"):
        nearest = np.rint(wanted * time / _TURN - turns)
        least, most = np.ceil(bounds[0] * time / _TURN - turns), np.floor(bounds[1] * time / _TURN - turns)
        spins = _TURN * (turns + np.clip(nearest, least, np.maximum(least, most))) / time
    return np.where(time > 0.0, np.clip(spins, *bounds), wanted)


def _scaled(*columns: tuple[Floats, Floats]) -> NDArray[np.float32]:
    """Return actions in [-1, 1] of values and their bounds; what lies outside ends there."""
    scaled = [2.0 * (values - low) / (high - low) - 1.0 for values, (low, high) in columns]
    return np.asarray(np.clip(np.stack(scaled, axis=-1), -1.0, 1.0), np.float32)
