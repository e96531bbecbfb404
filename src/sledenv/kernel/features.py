"""How a contact goes on with another feature of the body or of the ground, and how two become one."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel import guards
from sledenv.kernel.contacts import drop, write_surface
from sledenv.kernel.geometry import ARC_CREST, ARC_PIECE, SIDE_CREST, beyond, place, velocities

SAME_NORMAL: Final = 1e-9  # [rad] two normals nearer than this are one


@kernel
def _next_feature(body: np.void, pieces: np.ndarray, phi: float, contact: np.void, side: int) -> tuple[int, int, int]:
    """Kind, arc and piece with which a contact goes on that has come to an end of its feature."""
    a, j, arcs = contact["arc"], contact["piece"], np.int64(body["arcs"])
    before, after = (a - 1) % arcs, (a + 1) % arcs
    if side in (guards.FOOT_BEGIN, guards.FOOT_END):
        out = beyond(body, a, phi - pieces[j]["tilt"])
        # On to the crest where the run of dips ends, to which the piece belongs.
        if side == guards.FOOT_END:
            j += 1
            while pieces[j]["turn"] > 0.0:
                j += 1
        else:
            while pieces[j]["turn"] > 0.0:
                j -= 1
        # Where a side ends at the arc, the side slides over the crest.
        if out < 0 and body["smooth"][before] == 0.0:
            return SIDE_CREST, before, j
        if out > 0 and body["smooth"][a] == 0.0:
            return SIDE_CREST, a, j
        return ARC_CREST, a, j
    if side == guards.ARC_LOW:
        return ARC_PIECE, before, j
    if side == guards.ARC_HIGH:
        return ARC_PIECE, after, j
    if side == guards.CONE_BEGIN:
        return ARC_PIECE, a, j - 1
    if side == guards.CONE_END:
        return ARC_PIECE, a, j
    if side == guards.CREST_LOW:
        return (ARC_CREST if body["smooth"][before] != 0.0 else SIDE_CREST), before, j
    if side == guards.CREST_HIGH:
        return (ARC_CREST, after, j) if body["smooth"][a] != 0.0 else (SIDE_CREST, a, j)
    if side == guards.SIDE_BEGIN:
        return ARC_CREST, a, j
    return ARC_CREST, after, j


@kernel
def _beyond_centre(body: np.void, piece: np.void, motion: np.void, a: int, nx: float, ny: float) -> bool:
    """Whether a crest lies as deep in the body as the centre of an arc, or deeper, seen along a normal."""
    s, c, cx, cy = motion["sine"], motion["cosine"], body["cx"][a], body["cy"][a]
    x, y = motion["x"] + c * cx - s * cy - piece["x"], motion["y"] + s * cx + c * cy - piece["y"]
    return bool(not nx * x + ny * y > 0.0)


@kernel
def _past_centre(
    body: np.void, pieces: np.ndarray, phi: float, a: int, j: int, sense: int
) -> tuple[int, int, int]:
    """Kind, arc and piece with which a contact goes on where a crest would pass behind the centre of an arc.

    There the normal has no place on the arc to stay: it goes on, in its ``sense`` of turn, to the end of the arc or to
    the normal of the piece across the crest, whichever comes first.
    """
    arcs = np.int64(body["arcs"])
    edge = a if sense > 0 else (a - 1) % arcs
    across = j if sense > 0 else j - 1
    if arcs == 1 or beyond(body, a, phi - pieces[across]["tilt"]) != sense:
        return ARC_PIECE, a, across
    if body["smooth"][edge] == 0.0:
        return SIDE_CREST, edge, j
    return ARC_CREST, (a + sense) % arcs, j


@kernel
def pass_on(body: np.void, pieces: np.ndarray, space: np.void, c: int, side: int) -> bool:
    """Let a contact go on with the feature behind an end of its own; return whether it can.

    Gap, gap rate and slip go on, but where the normal jumps, rate and slip are formed anew. A contact cannot go on
    where the normal would turn over.
    """
    contacts, motion = space["contacts"], space["motion"]
    contact = contacts["at"][c]
    kind, a, j = _next_feature(body, pieces, motion["phi"], contact, side)
    place(body, pieces, motion, contact)
    nx, ny = contact["nx"], contact["ny"]
    sense = 1 if side in (guards.FOOT_END, guards.CREST_HIGH, guards.SIDE_END) else -1
    for _ in range(np.int64(body["arcs"])):
        if kind == ARC_CREST and _beyond_centre(body, pieces[j], motion, a, nx, ny):
            kind, a, j = _past_centre(body, pieces, motion["phi"], a, j, sense)
    contact["kind"], contact["arc"], contact["piece"] = kind, a, j
    place(body, pieces, motion, contact)
    write_surface(body, space["ground"], contact)
    if abs(nx * contact["ny"] - ny * contact["nx"]) > SAME_NORMAL:
        contact["gap_rate"], contact["slip"] = velocities(motion, contact)
    if not nx * contact["nx"] + ny * contact["ny"] > 0.0:
        return False
    _merge(contacts, c)
    return True


@kernel
def _merge(contacts: np.void, c: int) -> None:
    """Let a contact and another one of the same features go on as one.

    Its spring is pressed so deep that it stores what both have stored: nothing is won or lost. A crest touches once.
    """
    contact = contacts["at"][c]
    for q in range(contacts["count"]):
        other = contacts["at"][q]
        same = other["kind"] == contact["kind"] and other["arc"] == contact["arc"]
        crest = other["kind"] != ARC_PIECE and contact["kind"] != ARC_PIECE
        if q == c or other["piece"] != contact["piece"] or not (same or crest):
            continue
        gone, kept = (c, q) if contact["gap"] > other["gap"] else (q, c)
        one, two = contacts["at"][gone], contacts["at"][kept]
        stored = one["closing"] * one["gap"] * one["gap"] + two["closing"] * two["gap"] * two["gap"]
        two["gap"] = -math.sqrt(stored / two["closing"])
        drop(contacts, gone)
        return
