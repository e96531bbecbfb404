"""Descents as keyframes, few enough for a page to hold thousands: thinned, rounded and packed, to be decoded there."""

from __future__ import annotations

import base64
import math
import zlib
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from sledenv.plot.shapes import drawable_rows, reach, states_at
from sledenv.simulation.bodies import Body
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import State

TOLERANCE: Final = 2e-3  # of the size of the body: what a pose is off by at most before it is rounded, and [rad]
_FINEST: Final = 1e-6  # of the length of the slope: no step of a position is smaller
_SECONDS: Final = 2e-5  # [s] step of a time, unless descents may take longer than numbers of 32 bits hold
_MOST: Final = 2**30  # steps in a number


class Steps(NamedTuple):
    """What the numbers of packed keyframes are multiples of."""

    time: float  # [s]
    position: float  # [m]
    angle: float  # [rad]
    speed: float  # [m/s]
    spin: float  # [rad/s]

    @property
    def state(self) -> np.ndarray:
        """Steps of the fields of a state, shape (6,)."""
        return np.array([self.position, self.position, self.angle, self.speed, self.speed, self.spin])


def steps_for(body: Body, length: float, max_time: float) -> Steps:
    """Return steps that are fine enough for a body on a slope of ``length`` [m] within ``max_time`` [s]."""
    position = max(0.5 * TOLERANCE * reach(body), _FINEST * (length if math.isfinite(length) else 1.0))
    return Steps(max(_SECONDS, max_time / _MOST), position, 0.5 * TOLERANCE, 2.0 * position, 2.0 * TOLERANCE)


def keyframes(descent: Descent) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of a trajectory from which :func:`sledenv.plot.shapes.states_at` gives the others back.

    Poses differ by ``TOLERANCE`` at most. The beginning and the end of every contact are kept, so that a flight, in
    which the interpolation is exact, is two rows.

    Parameters
    ----------
    descent : Descent
        Simulated with ``record="trajectory"``.

    Returns
    -------
    rows : ndarray of TRAJECTORY, shape (m,)
    touching : ndarray of bool, shape (m,)
        Whether the body is in contact from this row to the next.

    Raises
    ------
    ValueError
        If the descent has no trajectory.
    """
    rows, log = drawable_rows(descent), descent.rebounds
    times, poses = rows["t"], _columns(rows, State._fields[:3])
    begin, end = log["t_touchdown"], log["t"]
    kept = np.zeros(len(rows), np.bool_)
    kept[[0, -1]] = True
    kept[np.minimum(np.searchsorted(times, np.concatenate([begin, end])), len(rows) - 1)] = True
    allowed = TOLERANCE * np.array([reach(descent.body), reach(descent.body), 1.0])
    while True:
        at = np.flatnonzero(kept)
        error = np.abs(states_at(rows[at], times)[:, :3] - poses)
        wrong = np.flatnonzero((error > allowed).any(axis=1) & ~kept)
        if not wrong.size:
            break
        after = np.unique(np.searchsorted(at, wrong))
        kept[(at[after - 1] + at[after]) // 2] = True
    middles = 0.5 * (times[at] + times[np.append(at[1:], at[-1])])
    contact = np.searchsorted(begin, middles, side="right") - 1
    touching = (contact >= 0) & (middles < np.append(end, -math.inf)[contact])
    return rows[at], touching


def packed(
    descents: Sequence[tuple[np.ndarray, np.ndarray]], gravity: tuple[float, float], steps: Steps
) -> list[np.ndarray]:
    """Return keyframes as numbers most of which are small.

    Times are differences. Of a state, it is the difference to what the keyframe before it leads to: velocities change
    by gravity in flight and not at all in contact, positions by the mean velocity.

    Parameters
    ----------
    descents : sequence of pairs
        As :func:`keyframes` returns them.
    gravity : pair of float
        Along the slope and normal to it [m/s^2].
    steps : Steps

    Returns
    -------
    list of ndarray of int32
        How many keyframes each descent has, shape (n,); then columns of all keyframes, shape (m,): twice the steps of
        time to the next keyframe, and one more in contact; x, y, phi, u, v, omega.
    """
    counts = np.array([len(rows) for rows, _ in descents], np.int32)
    rows = np.concatenate([rows for rows, _ in descents])
    touching = np.concatenate([touching for _, touching in descents])
    first = np.zeros(len(rows), np.bool_)
    first[np.cumsum(counts) - counts] = True
    ticks = _rounded(rows["t"] / steps.time)
    ahead = np.where(np.append(first[1:], True), 0.0, np.append(ticks[1:], 0.0) - ticks)
    states = _rounded(_columns(rows, State._fields) / steps.state)
    x, y, phi, u, v, omega = (states * steps.state).T
    seconds = np.where(first, 0.0, np.append(0.0, ahead[:-1]) * steps.time)
    flying = ~np.append(True, touching[:-1])

    def before(values: np.ndarray) -> np.ndarray:
        return np.append(0.0, values[:-1])

    expected = [before(u) + flying * seconds * gravity[0], before(v) + flying * seconds * gravity[1], before(omega)]
    moved = [before(q) + seconds * (before(rate) + rate) * 0.5 for q, rate in ((x, u), (y, v), (phi, omega))]
    guessed = _rounded(np.stack([*moved, *expected], axis=-1) / steps.state)
    guessed[first] = 0.0
    columns = [2.0 * ahead + touching, *(states - guessed).T]
    return [counts, *(np.clip(column, -_MOST, _MOST).astype(np.int32) for column in columns)]


def encoded(columns: Sequence[np.ndarray]) -> str:
    """Return columns of numbers of four bytes as text: base64 of their bytes, compressed (zlib).

    The first bytes of all numbers come first, then the second ones: small numbers make long runs. Whole numbers have
    their sign in the last bit.
    """
    words = [((c << 1) ^ (c >> 31)) if c.dtype == np.int32 else c.astype("<f4") for c in columns]
    data = np.frombuffer(b"".join(np.ascontiguousarray(word).tobytes() for word in words), np.uint8)
    return base64.b64encode(zlib.compress(data.reshape(-1, 4).T.tobytes(), 9)).decode("ascii")


def _columns(rows: np.ndarray, names: Sequence[str]) -> np.ndarray:
    return np.stack([rows[name] for name in names], axis=-1)


def _rounded(values: np.ndarray) -> np.ndarray:
    """Round as Math.round of a page does."""
    return np.asarray(np.floor(values + 0.5))
