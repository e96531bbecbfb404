"""How a contact goes on with another feature of the body or of the ground, and how two become one."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel import guards
from sledenv.kernel.contacts import drop, write_surface
from sledenv.kernel.geometry import (
    ARC_BEND,
    ARC_PIECE,
    ON_ARC,
    ON_BEGIN,
    SIDE_BEND,
    bends_beside,
    beyond,
    part_of_bend,
    place,
    velocities,
)

SAME_NORMAL: Final = 1e-9  # [rad] two normals nearer than this are one


@kernel
def _next_feature(body: np.void, pieces: np.ndarray, phi: float, contact: np.void, side: int) -> tuple[int, int, int]:
    """Kind, arc and piece with which a contact goes on that has come to an end of its feature."""
    a, j, arcs = contact["arc"], contact["piece"], np.int64(body["arcs"])
    before, after = (a - 1) % arcs, (a + 1) % arcs
    if side in (guards.FOOT_BEGIN, guards.FOOT_END):
        out = beyond(body, a, phi - pieces[j]["tilt"])
        low, high = bends_beside(body, pieces, a, j)
        j, beside = (high, high - 1) if side == guards.FOOT_END else (low, low)
        if pieces[j]["bend"] < 0 and beside != contact["piece"]:  # over the piece there it may not be at the dip yet
            return ARC_PIECE, a, beside
        # Where a side ends at the arc, the side slides over the crest.
        if out < 0 and body["smooth"][before] == 0.0 and pieces[j]["bend"] > 0:
            return SIDE_BEND, before, j
        if out > 0 and body["smooth"][a] == 0.0 and pieces[j]["bend"] > 0:
            return SIDE_BEND, a, j
        return ARC_BEND, a, j
    if side == guards.ARC_LOW:
        return ARC_PIECE, before, j
    if side == guards.ARC_HIGH:
        return ARC_PIECE, after, j
    if side == guards.BEND_BEGIN:
        return ARC_PIECE, a, j - 1
    if side == guards.BEND_END:
        return ARC_PIECE, a, j
    if side == guards.OF_ARC_LOW:
        return (ARC_BEND if body["smooth"][before] != 0.0 else SIDE_BEND), before, j
    if side == guards.OF_ARC_HIGH:
        return (ARC_BEND, after, j) if body["smooth"][a] != 0.0 else (SIDE_BEND, a, j)
    if side in (guards.SIDE_BEGIN, guards.SIDE_END):
        arc = a if side == guards.SIDE_BEGIN else after
        if pieces[j]["radius"] > 0.0 and contact["bend_part"] != ON_ARC:  # the end of the side is over a piece
            return ARC_PIECE, arc, j - 1 if contact["bend_part"] == ON_BEGIN else j
        return ARC_BEND, arc, j
    return SIDE_BEND, a, j


@kernel
def _beyond_centre(body: np.void, bend: np.void, motion: np.void, a: int, nx: float, ny: float) -> bool:
    """Whether the centre of a bend lies as deep in the body as that of an arc, or deeper, seen along a normal."""
    s, c, cx, cy = motion["sine"], motion["cosine"], body["cx"][a], body["cy"][a]
    x, y = motion["x"] + c * cx - s * cy - bend["qx"], motion["y"] + s * cx + c * cy - bend["qy"]
    return bool(not bend["bend"] * (nx * x + ny * y) > 0.0)


@kernel
def _past_centre(body: np.void, pieces: np.ndarray, phi: float, a: int, j: int, sense: int) -> tuple[int, int, int]:
    """Kind, arc and piece with which a contact goes on where a crest would pass behind the centre of an arc.

    There the normal has no place on the arc to stay: it goes on, in its ``sense`` of turn, to the end of the arc or to
    the normal of the piece across the crest, whichever comes first.
    """
    arcs = int(body["arcs"])
    edge = a if sense > 0 else (a - 1) % arcs
    across = j if sense > 0 else j - 1
    if arcs == 1 or beyond(body, a, phi - pieces[across]["tilt"]) != sense:
        return ARC_PIECE, a, across
    if body["smooth"][edge] == 0.0:
        return SIDE_BEND, edge, j
    return ARC_BEND, (a + sense) % arcs, j


@kernel
def pass_on(body: np.void, pieces: np.ndarray, space: np.void, c: int, side: int) -> bool:
    """Let a contact go on with the feature behind an end of its own; return whether it can.

    Gap, gap rate and slip go on, but where the normal jumps, rate and slip are formed anew. A contact cannot go on
    where the normal would turn over, as where a crest that is deep in the body slips out of it at a corner.
    """
    contacts, motion = space["contacts"], space["motion"]
    contact, phi = contacts["at"][c], motion["phi"]
    kind, a, j = _next_feature(body, pieces, phi, contact, side)
    place(body, pieces, motion, contact)
    nx, ny = contact["nx"], contact["ny"]
    sense = 1 if side in (guards.FOOT_END, guards.OF_ARC_HIGH, guards.SIDE_END) else -1
    back = kind == SIDE_BEND and side in (guards.FOOT_BEGIN, guards.FOOT_END) and (a == contact["arc"]) != (sense > 0)
    if back and _beyond_centre(body, pieces[j], motion, contact["arc"], nx, ny):
        kind, a = ARC_BEND, contact["arc"]  # and past its centre, for the side ends before the crest
    for _ in range(np.int64(body["arcs"])):
        if kind == ARC_BEND and pieces[j]["bend"] > 0 and _beyond_centre(body, pieces[j], motion, a, nx, ny):
            kind, a, j = _past_centre(body, pieces, phi, a, j, sense)
    part = ON_ARC
    if kind == SIDE_BEND and side in (guards.NORMAL_BEGIN, guards.NORMAL_END):
        part = contact["bend_part"] + (1 if side == guards.NORMAL_END else -1)
    elif kind == SIDE_BEND:
        part = part_of_bend(body, pieces, a, j, motion["sine"], motion["cosine"])
    contact["kind"], contact["arc"], contact["piece"], contact["bend_part"] = kind, a, j, part
    place(body, pieces, motion, contact)
    write_surface(body, space["ground"], contact)
    if abs(nx * contact["ny"] - ny * contact["nx"]) > SAME_NORMAL:
        contact["gap_rate"], contact["slip"] = velocities(motion, contact)
    return _merge(pieces, contacts, c) or nx * contact["nx"] + ny * contact["ny"] > 0.0


@kernel
def _become_one(contacts: np.void, one: int, two: int) -> None:
    """Let two contacts go on as the deeper of both, whose spring stores what both have: nothing is won or lost."""
    gone, kept = (one, two) if contacts["at"][one]["gap"] > contacts["at"][two]["gap"] else (two, one)
    less, more = contacts["at"][gone], contacts["at"][kept]
    stored = less["closing"] * less["gap"] * less["gap"] + more["closing"] * more["gap"] * more["gap"]
    more["gap"] = -math.sqrt(stored / more["closing"])
    drop(contacts, gone)


@kernel
def make_room(body: np.void, pieces: np.ndarray, contacts: np.void) -> bool:
    """Let the two contacts of one arc on one run of dips that are nearest to each other be one, if there are two.

    On ground that is cut much finer than an arc is pressed in, it lies on many pieces at once.
    """
    nearest, one, two = math.inf, -1, -1
    for c in range(contacts["count"]):
        first = contacts["at"][c]
        for q in range(c + 1, contacts["count"]):
            second = contacts["at"][q]
            if first["kind"] != ARC_PIECE or second["kind"] != ARC_PIECE or first["arc"] != second["arc"]:
                continue
            before, behind = bends_beside(body, pieces, first["arc"], first["piece"])
            apart = abs(first["nx"] * second["ny"] - first["ny"] * second["nx"])
            if before <= second["piece"] < behind and apart < nearest:
                nearest, one, two = apart, c, q
    if one < 0:
        return False
    _become_one(contacts, one, two)
    return True


@kernel
def _merge(pieces: np.ndarray, contacts: np.void, c: int) -> bool:
    """Let a contact and another one of the same features go on as one, if there is one; a crest touches once."""
    contact = contacts["at"][c]
    for q in range(contacts["count"]):
        other = contacts["at"][q]
        if q == c or other["piece"] != contact["piece"]:
            continue
        if other["kind"] != contact["kind"] or other["arc"] != contact["arc"]:
            on_crest = other["kind"] != ARC_PIECE and contact["kind"] != ARC_PIECE
            if not (on_crest and pieces[contact["piece"]]["bend"] > 0):
                continue
        _become_one(contacts, c, q)
        return True
    return False
