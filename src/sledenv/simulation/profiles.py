"""The profile of a slope: a polyline of heights over its plane, checked, and without the vertices that do not turn."""

from __future__ import annotations

import functools
import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel.entries import run_lay
from sledenv.kernel.geometry import PIECE
from sledenv.simulation.rules import FINITE, checked

Floats = NDArray[np.float64]
Profile = tuple[tuple[float, float], ...]  # vertices x, y [m]

MOST_VERTICES: Final = 16384
STEEPEST: Final = math.radians(80.0)  # of a piece, to the plane
STRAIGHT: Final = (
    1e-13  # sine of the turn of a vertex that is none, if rounding of its place does not make a larger one
)
_ROUNDED: Final = 4.0 * 2.0**-52  # of the coordinates

_PAIRS: Final = "must be a sequence of pairs (x, y) of numbers, or an array of shape (n, 2)"


def laid(vertices: Floats) -> np.ndarray:
    """Return what the kernel reads of a ground with such vertices, shape (n, 2), none of a plane: its n + 1 pieces."""
    return _laid(vertices) if len(vertices) else _plane()


def _laid(vertices: Floats) -> np.ndarray:
    pieces = np.zeros(len(vertices) + 1, PIECE)
    run_lay(vertices, pieces)
    return pieces


@functools.cache
def _plane() -> np.ndarray:
    """Return the piece of a plane, which nobody writes to."""
    return _laid(np.empty((0, 2)))


def checked_profile(given: Any) -> Profile:
    """Return the vertices of a profile, those without a turn left out, or raise an error.

    A profile that is straight and lies in the plane is none. One that is straight and lies higher or lower keeps its
    first and its last vertex.

    Raises
    ------
    TypeError, ValueError
        Naming the vertex, its value and what is allowed: see :class:`sledenv.Slope`.
    """
    if isinstance(given, tuple) and not given:
        return ()
    vertices = _numbers(given)
    with np.errstate(all="ignore"):  # of numbers too large to be squared
        return _checked_vertices(vertices)


def _checked_vertices(vertices: Floats) -> Profile:
    """As :func:`checked_profile`, of finite numbers of shape (n, 2)."""
    if not len(vertices):
        return ()
    if not 2 <= len(vertices) <= MOST_VERTICES:
        raise ValueError(f"Slope.profile holds {len(vertices)}: must hold no vertex, or 2 to {MOST_VERTICES}")
    x, y = vertices.T
    along, up = np.diff(x), np.diff(y)
    falls = ~(along > 0.0)
    if falls.any():
        k = int(np.argmax(falls)) + 1
        raise ValueError(
            f"Slope.profile[{k}].x = {float(x[k])!r}: must be > that of the vertex before, {float(x[k - 1])!r} m"
        )
    steep = ~(np.abs(up) <= math.tan(STEEPEST) * along)
    if steep.any():
        k = int(np.argmax(steep)) + 1
        reach = math.tan(STEEPEST) * float(along[k - 1])
        allowed = f"[{float(y[k - 1]) - reach!r}, {float(y[k - 1]) + reach!r}]"
        raise ValueError(
            f"Slope.profile[{k}].y = {float(y[k])!r}: must be in {allowed} m, so that the piece before it is at most "
            f"{math.degrees(STEEPEST):g} degrees steep to the plane"
        )
    kept = vertices[_turning(vertices)]
    if len(kept) < 2:
        kept = vertices[[0, -1]]
        if not kept[:, 1].any():
            return ()
    return tuple((x, y) for x, y in kept.tolist())


def _numbers(given: Any) -> Floats:
    """Return what is given for vertices as finite numbers, shape (n, 2), or raise TypeError or ValueError."""
    if isinstance(given, np.ma.MaskedArray):
        raise TypeError(f"Slope.profile is a masked array: {_PAIRS}, without a mask")
    if isinstance(given, np.ndarray):
        if given.ndim != 2 or given.shape[1] != 2:
            raise ValueError(f"Slope.profile has shape {given.shape}: must be (n, 2), columns x, y")
        if given.dtype.kind not in "iuf":
            raise TypeError(f"Slope.profile holds {given.dtype}: must hold numbers, columns x, y")
        given = given.astype(float)
        if np.isfinite(given).all():
            return np.asarray(given + 0.0)  # no -0.0
        given = given.tolist()
    elif not isinstance(given, tuple | list):
        raise TypeError(f"Slope.profile = {given!r}: {_PAIRS}")
    numbers = np.empty((len(given), 2))
    for k, vertex in enumerate(given):
        if not isinstance(vertex, tuple | list | np.ndarray) or np.shape(vertex) != (2,):
            raise TypeError(f"Slope.profile[{k}] = {vertex!r}: must be a pair (x, y) of numbers")
        if isinstance(vertex, np.ma.MaskedArray):
            raise TypeError(f"Slope.profile[{k}] is a masked array: {_PAIRS}, without a mask")
        for column, field in enumerate("xy"):
            numbers[k, column] = checked(f"Slope.profile[{k}]", field, vertex[column], FINITE)
    return numbers + 0.0


def _turning(vertices: Floats) -> NDArray[np.bool_]:
    """Whether the ground turns at each vertex of shape (n, 2), those left out without that it does not."""
    kept = np.ones(len(vertices), bool)
    while True:  # without a vertex, its neighbours may turn by less
        found = np.flatnonzero(kept)
        straight = _straight(vertices[found])
        if not straight.any():
            return kept
        before: list[int] = []  # the last one that stays: seen from there, small turns add up
        for k, here in enumerate(found.tolist()):
            if straight[k]:
                kept[here] = not _straight(vertices[[*before, *found[k : k + 2]]])[len(before)]
            if kept[here]:
                before = [here]


def _straight(vertices: Floats) -> NDArray[np.bool_]:
    """Whether the ground goes straight on at each vertex of shape (n, 2), up to rounding."""
    along, up = np.diff(vertices, axis=0).T
    lengths = np.r_[math.inf, np.hypot(along, up), math.inf]
    steep = np.r_[0.0, np.abs(up) / along, 0.0]
    rounded = np.abs(vertices[:, 1]) + np.maximum(steep[:-1], steep[1:]) * np.abs(vertices[:, 0])
    rounding = _ROUNDED * rounded / np.minimum(lengths[:-1], lengths[1:])
    found: NDArray[np.bool_] = np.abs(_turns(vertices)) < np.maximum(STRAIGHT, rounding)
    return found


def _turns(vertices: Floats) -> Floats:
    """Sine of the turn at each vertex, shape (n,): > 0 in a dip, < 0 on a crest."""
    along, up = tangents(vertices).T
    turns: Floats = along[:-1] * up[1:] - up[:-1] * along[1:]
    return turns


def vertices_of(profile: Profile) -> Floats:
    """Return the vertices of a profile, shape (n, 2), in C order."""
    return np.array(profile, float).reshape(len(profile), 2)


def tangents(vertices: Floats) -> Floats:
    """Unit tangents of the pieces of the ground, shape (n + 1, 2), from n vertices."""
    level = np.array([[1.0, 0.0]])
    if not len(vertices):
        return level
    pieces = np.diff(vertices, axis=0)
    return np.concatenate([level, pieces / np.hypot(*pieces.T)[:, np.newaxis], level])


def crests(vertices: Floats) -> NDArray[np.bool_]:
    """Whether each vertex is a crest, shape (n,)."""
    return _turns(vertices) < 0.0


def level_at(x: Floats, reach: Floats, vertices: Floats) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Whether the ground is level up to some reach [m] around places x [m], both of shape (N,).

    Returns
    -------
    ndarray of int, ndarray of bool, shapes (N,)
        The vertex before the first piece there that is not level, and whether there is none.
    """
    sloping = np.flatnonzero(np.abs(tangents(vertices)[1:-1, 1]) > STRAIGHT)
    first = np.searchsorted(vertices[sloping + 1, 0], x - reach, side="right")
    level: NDArray[np.bool_] = first >= np.searchsorted(vertices[sloping, 0], x + reach)
    return np.r_[sloping, 0][first], level
