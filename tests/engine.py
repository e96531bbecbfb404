"""A body, a ground and a work space as single kernels read them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from sledenv.kernel import contacts, geometry, outline
from sledenv.kernel.params import Incline
from sledenv.simulation.bodies import Body
from tests.compiled import compiled

build_pieces, complete, add = compiled(geometry.build_pieces), compiled(outline.complete), compiled(contacts.add)


class Spring(NamedTuple):
    """Numbers of a contact beside its features."""

    depth: float = 1e-3  # [m]
    closing: float = 3e4  # [N/m]
    opening: float = 1e4  # [N/m]
    friction: float = 0.3  # [-]
    arm: float = 0.0  # [m]


def record_of(body: Body) -> Any:
    """Record of a body."""
    return body.record.copy()[0]


def pieces_of(
    vertices: Sequence[tuple[float, float]] | np.ndarray, rounding: float | Sequence[float] | np.ndarray = 0.0
) -> np.ndarray:
    """Pieces of a profile with its bends; of a plane, where it has no vertices."""
    places = np.reshape(np.asarray(vertices, dtype=float), (-1, 2))
    places = np.ascontiguousarray(np.column_stack([places, np.broadcast_to(rounding, len(places))]))
    pieces = np.zeros(len(places) + 1, geometry.PIECE)
    build_pieces(places, pieces)
    return pieces


def incline(angle: float, gravity: float = 9.81) -> Incline:
    return Incline(gravity * math.sin(angle), gravity * math.cos(angle), math.inf, gravity, 0.0)


def new_space() -> Any:
    """Work space without contacts, on a ground without zones."""
    space = np.zeros(1, contacts.SPACE)[0]
    space["ground"]["count"], space["ground"]["begin"][0], space["ground"]["begin"][1] = 1.0, -math.inf, math.inf
    return space


def put(space: Any, place: Sequence[float], velocity: Sequence[float]) -> None:
    """Write where the body is [m, rad] and how it moves [m/s, rad/s]."""
    motion = space["motion"]
    motion["t"] = 0.0
    motion["x"], motion["y"], motion["phi"] = place
    motion["u"], motion["v"], motion["omega"] = velocity
    motion["sine"], motion["cosine"] = math.sin(place[2]), math.cos(place[2])


def touch(body: Any, pieces: np.ndarray, space: Any, features: tuple[int, int, int], spring: Spring) -> Any:
    """Add a contact of a kind, an arc and a piece, whatever the distance of the two is; return it."""
    add(body, pieces, space, *features)
    contact = space["contacts"]["at"][int(space["contacts"]["count"]) - 1]
    contact["gap"] = -spring.depth
    geometry.place(body, pieces, space["motion"], contact)
    contact["closing"], contact["opening"] = spring.closing, spring.opening
    contact["friction"], contact["rolling_arm"] = spring.friction, spring.arm
    return contact


def rows_of(space: Any) -> list[np.ndarray]:
    """Rows that u, v and omega are multiplied by in gap rate and slip: two of each contact."""
    rows = []
    for c in range(int(space["contacts"]["count"])):
        contact = space["contacts"]["at"][c]
        nx, ny, ln, lt = (float(contact[name]) for name in ("nx", "ny", "normal_lever", "tangent_lever"))
        rows += [np.array([nx, ny, ln]), np.array([ny, -nx, lt])]
    return rows
