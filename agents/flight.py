"""What a critic sees of a flight and of a trim: besides the observation the landing, which closed forms foresee."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.envs.columns import STATE
from sledenv.scenarios.scenario import Context
from sledenv.simulation.bodies import Body
from sledenv.simulation.support import support_heights

Floats = NDArray[np.float32]

_TIMES: Final = np.arange(1, 65, dtype=np.float32) * np.float32(0.02)  # [s] after the take-off, of the places looked at
_PLACES: Final = np.array(  # [m] from the landing, at which a critic is told the ground
    [-1.6, -1.2, -0.8, -0.5, -0.25, 0.25, 0.5, 0.8, 1.2, 1.6, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0],
    np.float32,
)
_TILT: Final = 0.1  # [rad] at which a body touches with an end
_TURNS: Final = (2, 4, 6, 8, 12, 16)  # harmonics of the pose at the landing
_SHAPE: Final = Context._fields.index("shape")
_CONTEXT: Final = 4  # of the context: angle, friction, restitution and speed
MOST: Final = 10.0  # of an input


class Ground(NamedTuple):
    """Pieces of the ground around places, n rows; it is level before the first and behind the last."""

    begin: Floats  # [m] from the place, (n, k)
    end: Floats  # (n, k)
    rise: Floats  # slope of each, (n, k)
    height: Floats  # [m] where the first begins, over the ground under the mass centre, (n,)

    def at(self, x: Floats) -> tuple[Floats, Floats]:
        """Return heights [m] and slopes at distances [m] from the place, shapes (n, m)."""
        heights, slopes = np.repeat(self.height[:, np.newaxis], x.shape[1], axis=1), np.zeros_like(x)
        for piece in range(self.begin.shape[1]):
            begin, end, rise = (part[:, piece : piece + 1] for part in self[:3])
            heights += rise * (np.clip(x, begin, end) - begin)
            slopes += rise * ((x >= begin) & (x < end))
        return heights, slopes


class Landings(NamedTuple):
    """Where flights end whatever the trim, n rows: the mass centre flies a parabola."""

    inputs: Floats  # of a network, (n, width)
    ground: Ground
    time: Floats  # [s] after the take-off, (n,)
    x: Floats  # [m] of the mass centre, from where it took off, (n,)
    y: Floats  # [m] over the ground there, (n,)
    pitch: Floats  # [rad] of the ground under it, (n,)
    pose: Floats  # [rad] of the body, if its rider lends no spin, (n,)
    spin: Floats  # [rad/s], likewise, (n,)
    body: NDArray[np.intp]  # which of the bodies it is, (n,)


class Flights:
    """Turns observations and trims into the inputs of a network.

    What follows a flight is decided where it lands: by the pose and the spin there, which the trim sets, and by the
    ground from there on. A network that is told only where the flight begins has to learn the flight first. It is given
    the landing of a point at the height of a body that lies: time, place, velocity across and along the ground there,
    and heights and slopes of the ground around. A trim is told by the pose and spin that it lands with, and by how high
    both ends of the body are over the ground then.

    Parameters
    ----------
    problem : Problem
        A ride.

    Attributes
    ----------
    width, trim_width : int
        Numbers of inputs of a flight and of a trim.
    """

    def __init__(self, problem: Problem) -> None:
        task, rider = problem.task, problem.scenario.rider
        for group in ("context", "state"):
            if group not in task.groups:
                raise ValueError(f"columns = {task.groups!r}: must have {group!r} to foresee landings from")
        self._task = task
        self._gravity = problem.scenario.slope_section.gravity_m_s2
        self._most = 0.0 if rider is None else rider.trim_rad_s
        self._way = np.float32(problem.scenario.slope_section.length_m + task.settings.run_out)
        self._run_out = np.float32(task.settings.run_out)
        self._ends = np.array([_ends(body) for body in task.bodies], np.float32)
        self._lying = np.array([support_heights(body, np.zeros(1))[0] for body in task.bodies], np.float32)
        self.width = 2 * len(_PLACES) + 23
        self.trim_width = 4 + 2 * len(_TURNS) + 6

    def land(self, observations: Floats) -> Landings:
        """Foresee the landings of flights, observations of shape (n, k)."""
        seen = {name: column.astype(np.float32) for name, column in self._task.columns.values(observations).items()}
        to_line, height, sine, cosine, u, v, spin, lent, supplied = (seen[one.name] for one in STATE[:9])
        left = (to_line + self._run_out) / self._way
        supplied = supplied / np.float32(self._task.columns.scales.speed**2)
        spin, start = spin - lent, np.arctan2(sine, cosine)
        contexts = self._task.contexts_seen(observations)
        along, across = (
            (self._gravity * part(contexts[:, 0])).astype(np.float32)[:, np.newaxis] for part in (np.sin, np.cos)
        )
        body = contexts[:, _SHAPE].astype(int)
        ground, lying = self._ground(seen, len(observations)), self._lying[body]

        x, y = (u[:, np.newaxis] + 0.5 * along * _TIMES) * _TIMES, (v[:, np.newaxis] - 0.5 * across * _TIMES) * _TIMES
        heights, slopes = ground.at(x)
        clear = (height[:, np.newaxis] + y - heights) / np.sqrt(1.0 + slopes**2) - lying[:, np.newaxis]
        falls = v[:, np.newaxis] - across * _TIMES < slopes * (u[:, np.newaxis] + along * _TIMES)  # towards the ground
        lands = (clear <= 0.0) & falls
        lands[:, -1] = True
        rows, late = np.arange(len(x)), lands.argmax(axis=1)
        early = np.maximum(late - 1, 0)
        over, under = clear[rows, early], clear[rows, late]
        crossed = (over > 0.0) & (under < 0.0)
        share = np.where(crossed, over / np.where(crossed, over - under, 1.0), 1.0)
        time = _TIMES[early] + share * (_TIMES[late] - _TIMES[early])

        along, across = along[:, 0], across[:, 0]
        x, y = (u + 0.5 * along * time) * time, height + (v - 0.5 * across * time) * time
        u_landing, v_landing = u + along * time, v - across * time
        heights, slopes = ground.at(x[:, np.newaxis] + np.r_[np.float32(0.0), _PLACES])
        pitch, pose = np.arctan(slopes[:, 0]), start + spin * time
        below, _ = ground.at(self._ends[body, :, 0])
        columns = [
            *observations[:, :_CONTEXT].T,
            *(2.0 * left - 1.0, left * self._way / 10.0, height - 0.25, 3.0 * sine, u / 3.0 - 3.0, v, spin, lent),
            *(3.0 * np.sqrt(np.maximum(supplied, 0.0)), 3.0 * time, x / 3.0, 3.0 * pitch),
            v_landing * np.cos(pitch) - u_landing * np.sin(pitch),
            (u_landing * np.cos(pitch) + v_landing * np.sin(pitch)) / 3.0 - 3.0,
            *(pose - pitch, 3.0 * clear[:, 0], 3.0 * below[:, 0], 3.0 * below[:, 1], 3.0 * heights[:, 0]),
            *(2.0 * (heights[:, 1:] - heights[:, :1])).T,
            *(3.0 * np.arctan(slopes[:, 1:])).T,
        ]
        inputs = np.clip(np.stack(columns, axis=1, dtype=np.float32), -MOST, MOST)
        return Landings(inputs, ground, time, x, y, pitch, pose, spin, body)

    def trimmed(self, landings: Landings, trims: Floats) -> Floats:
        """Return what a network sees of trims in [-1, 1] of shape (n, m), shape (n, m, trim_width)."""
        columns: list[NDArray[np.floating]]
        of = landings
        time, x, y, pitch, pose, spin = (
            part[:, np.newaxis] for part in (of.time, of.x, of.y, of.pitch, of.pose, of.spin)
        )
        lent = np.float32(self._most) * trims
        angle = pose + lent * time
        columns = [angle - pitch, 0.5 * (spin + lent), trims, angle]
        columns += [part(turns * (angle - pitch)) for turns in _TURNS for part in (np.sin, np.cos)]
        cosine, sine = np.cos(angle), np.sin(angle)
        for ahead, up in self._ends[of.body].transpose(1, 2, 0)[..., np.newaxis]:
            heights, slopes = of.ground.at(x + ahead * cosine - up * sine)
            below, clear = np.arctan(slopes), y + ahead * sine + up * cosine - heights
            columns += [4.0 * clear, 3.0 * (below - pitch), 3.0 * (below - angle)]
        return np.stack(columns, axis=-1, dtype=np.float32)

    def _ground(self, seen: dict[str, Floats], count: int) -> Ground:
        """Return the ground that is seen around places."""
        names = [name.removesuffix("_there") for name in seen if name.endswith("_there")]
        x, y, there = (
            np.stack([seen[f"{name}_{entry}"] for name in names], axis=1) if names else np.zeros((count, 0), np.float32)
            for entry in ("x", "y", "there")
        )
        is_one = there > 0.5
        pieces = is_one[:, 1:] & is_one[:, :-1]
        lengths = np.where(pieces, np.diff(x, axis=1), 1.0)
        rise = np.where(pieces, np.diff(y, axis=1), 0.0) / np.maximum(lengths, 1e-4)
        first = is_one.argmax(axis=1)[:, np.newaxis] if names else np.zeros((count, 0), int)
        height = np.take_along_axis(y, first, axis=1).sum(axis=1)
        return Ground(x[:, :-1], np.where(pieces, x[:, 1:], x[:, :-1]), rise.astype(np.float32), height)


def _ends(body: Body) -> list[tuple[float, float]]:
    """Return the points with which a body touches a plane when tilted either way, [m] ahead and up in its axes."""
    ends = []
    for tilt in (_TILT, -_TILT):
        low, height, high = support_heights(body, np.array([tilt - 1e-4, tilt, tilt + 1e-4])).tolist()
        beside, cosine, sine = (low - high) / 2e-4, np.cos(tilt), np.sin(tilt)
        ends.append((beside * cosine - height * sine, -beside * sine - height * cosine))
    return ends
