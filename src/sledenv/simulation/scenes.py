"""Scenes: all that is given of many descents, one row per lane, and pools of bodies, zones and ground under them."""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel.params import SCENE, ZONE_FIELDS, State
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.support import resting_heights

Floats = NDArray[np.float64]
Lanes = NDArray[np.intp]

NO_ZONES: Final = np.empty((0, ZONE_FIELDS))  # nobody writes to it
_NOTHING: Final = np.empty((0, 0))
_SETTLE: Final = 1e-5  # of sqrt(gravity * size): approach speed below which an impact of rigid surfaces is plastic
_DOUBLES: Final = list(SCENE.names or ())
_POOLS: Final = {"bodies": ("body", ""), "pieces": ("ground", "ground_end"), "zones": ("zones", "zones_end")}


def columns(first: str, last: str) -> slice:
    """Return where the fields of a scene from one to another are in ``Scenes.table``."""
    return slice(_DOUBLES.index(first), _DOUBLES.index(last) + 1)


def settle_speed(gravity: Any, size: Any) -> Any:
    """Speed [m/s] of approach below which an impact of rigid surfaces is plastic unless something else is asked for."""
    return _SETTLE * np.sqrt(gravity * size)


_LAUNCH: Final = columns(State._fields[0], State._fields[-1])
_GROUND: Final = columns("ground", "ground_end")


class Scenes(NamedTuple):
    """All that N descents are given.

    Whoever makes them checks them: :mod:`sledenv.simulation.checks` what users give, a scenario what it draws.
    """

    rows: np.ndarray  # of kernel.params.SCENE, shape (N,), which says what its fields are, in which units
    bodies: np.ndarray  # of kernel.outline.BODY: a pool, as the next two are, of which rows say what they have
    pieces: np.ndarray  # of kernel.geometry.PIECE
    zones: Floats  # fields of Zone, shape (z, 7); NaN for None
    # What a scenario has drawn them from: fields of its Context and errors of the launch, (N, k); (N, 0) by hand.
    drawn: Floats = _NOTHING
    # How many places each lane has of its own in each pool, one lane behind the other; 0 of a pool that is shared.
    rooms: tuple[int, ...] = (0, 0, 0)

    @property
    def given(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, Floats]:
        """Rows and pools, as the kernel takes them."""
        return self[:4]

    @property
    def table(self) -> Floats:
        """The rows as numbers, shape (N, fields of SCENE): a view."""
        return self.rows.view(np.float64).reshape(len(self.rows), len(_DOUBLES))

    def own_rows(self) -> np.ndarray:
        """Return a copy of the rows; whole, as field by field takes ten times as long."""
        return self.table.copy().view(SCENE)[:, 0]

    @property
    def launches(self) -> Floats:
        """States at launch, shape (N, 6), columns as in :class:`sledenv.State`: a view."""
        return self.table[:, _LAUNCH]

    @property
    def body(self) -> Lanes:
        """Place of the body of each lane among ``bodies``, shape (N,)."""
        return self.rows["body"].astype(np.intp)

    def of_body(self, name: str) -> np.ndarray:
        """Return a field of the body of each lane, shape (N, ...)."""
        column: np.ndarray = self.bodies[name][self.body]
        return column

    @property
    def is_plane(self) -> bool:
        """Whether no lane has a profile."""
        return len(self.pieces) == 1 or not np.count_nonzero(self.rows["ground_end"] - self.rows["ground"] > 1.0)

    def resting_heights(self, x: Floats, phi: Floats) -> Floats:
        """Return the heights [m] at which bodies touch the ground at places [m] and orientations [rad], shapes (N,)."""
        return resting_heights(self.bodies, x, phi, Grounds(self.pieces, self.table[:, _GROUND]), self.rows["body"])

    def grounds(self) -> list[np.ndarray]:
        """Return the vertices of the ground of each lane, records with ``x``, ``y`` and ``radius`` [m] among others."""
        begins, ends = (self.rows[name].astype(np.intp).tolist() for name in ("ground", "ground_end"))
        return [self.pieces[begin + 1 : end] for begin, end in zip(begins, ends, strict=True)]

    def take(self, lanes: slice | Lanes) -> Self:
        """Return those of some lanes, which share the pools; a lane may be taken many times."""
        return self._replace(
            rows=self.rows[lanes] if isinstance(lanes, slice) else self.rows.take(lanes),
            drawn=self.drawn[lanes] if self.drawn.size else self.drawn,
            rooms=(0, 0, 0),
        )

    def put(self, lanes: Lanes, others: Self) -> Self:
        """Return these with others in some lanes, no two alike.

        Where each lane has places of its own in a pool, which it has since an earlier call, they are written to.
        """
        if not len(lanes):
            return self
        rows, drawn, pools, rooms = self.own_rows(), self.drawn, {}, list(self.rooms)
        new = others.own_rows()
        for k, name in enumerate(_POOLS):
            if not (self.rooms[k] == 0 and _alike(getattr(self, name), getattr(others, name))):
                pools[name], rooms[k] = self._joined(name, rooms[k], lanes, others, rows)
                _shift(new, name, rooms[k] * lanes - new[_POOLS[name][0]])
        self._replace(rows=rows).table[lanes] = others._replace(rows=new).table
        if drawn.size:
            drawn = drawn.copy()
            drawn[lanes] = others.drawn
        return self._replace(rows=rows, drawn=drawn, rooms=tuple(rooms), **pools)

    def _joined(self, name: str, room: int, lanes: Lanes, others: Self, rows: np.ndarray) -> tuple[np.ndarray, int]:
        """Return a pool with places for each lane, those of others in some, and how many a lane has; rows point there.

        Rows of lanes that others take the place of are left as they are.
        """
        pool, (first, _) = getattr(self, name), _POOLS[name]
        wanted = _counts(others.rows, name)
        if not room or wanted.max(initial=0) > room:
            counts = _counts(rows, name)
            counts[lanes] = wanted
            room = max(room, int(counts.max(initial=0)))
            pool = _gathered(pool, rows[first], counts, room)
            _shift(rows, name, room * np.arange(len(rows)) - rows[first])
        if room:
            theirs = _gathered(getattr(others, name), others.rows[first], wanted, room)
            _slots(pool, room)[lanes] = _slots(theirs, room)
        return pool, room


def _alike(pool: np.ndarray, other: np.ndarray) -> bool:
    """Whether two pools hold the same, such as the ground that all share."""
    return pool is other or (pool.shape == other.shape and pool.tobytes() == other.tobytes())


def _shift(rows: np.ndarray, name: str, by: np.ndarray) -> None:
    """Let rows point to other places of a pool."""
    for field in filter(None, _POOLS[name]):
        rows[field] += by


def _counts(rows: np.ndarray, name: str) -> Lanes:
    """How many records of a pool each row has."""
    first, last = _POOLS[name]
    counts: Lanes = (rows[last] - rows[first]).astype(np.intp) if last else np.ones(len(rows), np.intp)
    return counts


def _slots(pool: np.ndarray, room: int) -> np.ndarray:
    """Return a pool as one row per lane, shape (N, room), whose records are copied whole: a view."""
    return pool.reshape(len(pool), -1).view(f"V{pool.itemsize * math.prod(pool.shape[1:])}").reshape(-1, room)


def _gathered(pool: np.ndarray, places: Floats, counts: Lanes, room: int) -> np.ndarray:
    """Return a pool with a slot of some room for each row, filled up with whatever there is."""
    if not len(pool):
        return np.zeros((len(counts) * room, *pool.shape[1:]), pool.dtype)
    of = np.minimum(np.arange(room), np.maximum(counts - 1, 0)[:, np.newaxis]) + places.astype(np.intp)[:, np.newaxis]
    return pool.take(np.minimum(of, len(pool) - 1).ravel(), axis=0)
