"""What may come to touch within a step: pairs of features that do not touch yet, those near enough looked at exactly.

In flight these are all touches that may come: the first of them ends the step, and the list of contacts has one.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.arithmetic import wrap
from sledenv.kernel.contacts import ORDER
from sledenv.kernel.expansion import place_of_crest, value
from sledenv.kernel.geometry import (
    ARC_CREST,
    ARC_PIECE,
    AT_JOIN,
    SAME_PLACE,
    SIDE_CREST,
    along_piece,
    arc_number,
    faces_arc,
    first_piece,
    in_cone,
)
from sledenv.kernel.guards import AT_END, BORN, NOTHING, TIED, first_term, look
from sledenv.kernel.outline import arc_at, from_middle, same_arc
from sledenv.kernel.zeros import first_zero

X, Y, SINE, COSINE, PHI = range(5)  # of ``space["reach"]``
LIFTED: Final = 1e-12  # of the speed: rate of a gap that has just been let go by a rigid contact,
LIFTED_LATER: Final = 1e-9  # and of the accelerations: the acceleration with which it starts


@kernel
def _measure_reach(space: np.void) -> None:
    """Write how far x, y, sine, cosine and phi can move within the step."""
    s, reach = space["series"], space["reach"]
    x = y = sine = cosine = phi = 0.0
    power = t = space["event"]["time"]
    for k in range(1, ORDER + 1):
        x += abs(s["x"][k]) * power
        y += abs(s["y"][k]) * power
        sine += abs(s["sine"][k]) * power
        cosine += abs(s["cosine"][k]) * power
        phi += abs(s["phi"][k]) * power
        power *= t
    reach[X], reach[Y], reach[SINE], reach[COSINE], reach[PHI] = x, y, sine, cosine, phi


@kernel
def _foot(body: np.void, piece: np.void, a: int, t: float, s: np.void) -> float:
    """Place [m] along a piece of the foot of an arc at a time of the step."""
    sine, cosine = value(s["sine"], t), value(s["cosine"], t)
    cx, cy = body["cx"][a], body["cy"][a]
    return along_piece(piece, value(s["x"], t) + cosine * cx - sine * cy, value(s["y"], t) + sine * cx + cosine * cy)


@kernel
def _in_reach(body: np.void, pieces: np.ndarray, kind: int, a: int, j: int, t: float, space: np.void) -> bool:
    """Whether a pair whose gap closes at a time of the step lies before each other then.

    For a crest ``space["terms"]`` holds its place in the frame of the body.
    """
    s, piece = space["series"], pieces[j]
    if kind == ARC_PIECE:
        return bool(piece["run_low"] <= _foot(body, piece, a, t, s) <= piece["run_high"])
    bx, by = value(space["terms"][0], t), value(space["terms"][1], t)
    if kind == ARC_CREST:
        return faces_arc(body, a, bx, by) and in_cone(body, pieces, a, j, bx, by, value(s["phi"], t))
    along = body["oy"][a] * (bx - body["sx"][a]) - body["ox"][a] * (by - body["sy"][a])
    near = AT_END * body["size"]
    return bool(-near <= along <= body["length"][a] + near)


@kernel
def _watch_entry(body: np.void, piece: np.void, a: int, space: np.void) -> None:
    """Let the step end where the foot of an arc that is under a piece comes over it: it is looked at again then."""
    s, poly, near = space["series"], space["poly"], AT_END * body["size"]
    foot = _foot(body, piece, a, 0.0, s)
    side = -1.0 if foot < piece["run_low"] else 1.0
    out = side * (foot - (piece["run_low"] if side < 0.0 else piece["run_high"]))
    if out < near:
        return
    tx, ty, cx, cy = piece["tx"], piece["ty"], body["cx"][a], body["cy"][a]
    for k in range(1, ORDER + 1):
        poly[k] = tx * s["x"][k] + ty * s["y"][k]
        poly[k] = side * (poly[k] + (tx * cx + ty * cy) * s["cosine"][k] + (ty * cx - tx * cy) * s["sine"][k])
    poly[0] = out
    look(space, 0, NOTHING, 0, 0)


@kernel
def _touch_now(body: np.void, pieces: np.ndarray, kind: int, a: int, j: int, gap: float, space: np.void) -> None:
    """Look at a pair that is closed without touching, because it has come into each other's reach inside each other.

    It touches at once if it closes, or else it is looked at again when it does.
    """
    poly, event, near = space["poly"], space["event"], SAME_PLACE * body["size"]
    piece, reached = pieces[j], _in_reach(body, pieces, kind, a, j, 0.0, space)
    if kind == ARC_PIECE and reached and gap < -near:  # a foot at a crest is about to leave, or has just left
        foot, margin = _foot(body, piece, a, 0.0, space["series"]), AT_END * body["size"]
        reached = piece["run_low"] + margin < foot < piece["run_high"] - margin
    if not reached:
        if kind == ARC_PIECE:
            _watch_entry(body, piece, a, space)
        return
    first = first_term(body, space)
    if poly[first] < 0.0:
        if event["time"] > 0.0 or event["code"] == NOTHING:
            event["time"], event["code"], event["who"], event["side"], event["piece"] = 0.0, BORN, kind, a, j
    elif first == 1:
        for k in range(ORDER):
            poly[k] = (k + 1) * poly[k + 1]
        poly[ORDER] = 0.0
        look(space, 0, NOTHING, 0, 0)


@kernel
def _zeros_of_lifted(body: np.void, space: np.void) -> int:
    """Leading coefficients to pass over of a gap that a rigid contact has just let go, as its load is zero; or 0.

    It starts without rate, and often without acceleration: docs/physics.md (6.2).
    """
    poly, s, omega = space["poly"], space["series"], space["motion"]["omega"]
    fast = max(abs(space["motion"]["u"]), abs(space["motion"]["v"]), body["size"] * abs(omega))
    if abs(poly[1]) > LIFTED * fast:
        return 0
    slight = LIFTED_LATER * (abs(s["u"][1]) + abs(s["v"][1]) + body["size"] * omega * omega)
    if poly[2] > slight:
        return 2
    return 3 if poly[2] >= -slight and poly[3] > 0.0 else 0


@kernel
def _watch_touch(body: np.void, pieces: np.ndarray, kind: int, a: int, j: int, gap: float, space: np.void) -> None:
    """Let the step end where a pair comes to touch whose gap is ``space["poly"]``; ``gap`` [m] is that at its begin."""
    poly, event, motion, near = space["poly"], space["event"], space["motion"], SAME_PLACE * body["size"]
    zeros = 0
    if space["lifted"] != 0.0 and abs(gap) <= near:
        zeros = _zeros_of_lifted(body, space)
    if gap <= near and zeros == 0:
        zeros = first_term(body, space)
        if gap < -near or poly[zeros] < 0.0:
            _touch_now(body, pieces, kind, a, j, gap, space)
            return
    t = first_zero(poly, event["time"], zeros, space["stack"])
    if not (t < event["time"] * (1.0 - TIED) or (event["code"] == NOTHING and t < event["time"])):
        return
    if _in_reach(body, pieces, kind, a, j, t, space):
        event["time"], event["code"], event["who"], event["side"], event["piece"] = t, BORN, kind, a, j
    elif motion["t"] + t > motion["t"]:  # from there on it is looked at anew
        event["time"], event["code"] = t, NOTHING


@kernel
def touches_beside(body: np.void, contacts: np.void, a: int, j: int) -> bool:
    """Whether an arc touches a piece, or another one of its circle or that joins it smoothly: one lowest point."""
    arcs = int(body["arcs"])
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        if contact["kind"] != ARC_PIECE or contact["piece"] != j:
            continue
        b = contact["arc"]
        if same_arc(body, a, b) or (b == (a + 1) % arcs and body["smooth"][a] != 0.0):
            return True
        if a == (b + 1) % arcs and body["smooth"][b] != 0.0:
            return True
    return False


@kernel
def _watch_arc(body: np.void, pieces: np.ndarray, a: int, j: int, base: float, move: float, space: np.void) -> None:
    """Watch an arc come down on a piece, over which the mass centre is at ``base`` [m], and moves by ``move``."""
    if touches_beside(body, space["contacts"], a, j):
        return
    s, reach, piece, poly = space["series"], space["reach"], pieces[j], space["poly"]
    cx, cy, tx, ty = body["cx"][a], body["cy"][a], piece["tx"], piece["ty"]
    gs, gc = tx * cx + ty * cy, tx * cy - ty * cx
    sine, cosine = s["sine"][0], s["cosine"][0]
    gap = base + gs * sine + gc * cosine - body["r"][a]
    if gap - move - abs(gs) * reach[SINE] - abs(gc) * reach[COSINE] >= 0.0:
        return
    foot = along_piece(piece, s["x"][0] + cosine * cx - sine * cy, s["y"][0] + sine * cx + cosine * cy)
    span = reach[X] + reach[Y] + body["h"][a] * (reach[SINE] + reach[COSINE])
    if foot + span < piece["run_low"] or foot - span > piece["run_high"]:
        return
    for k in range(1, ORDER + 1):
        poly[k] = tx * s["y"][k] - ty * s["x"][k] + gs * s["sine"][k] + gc * s["cosine"][k]
    poly[0] = gap
    _watch_touch(body, pieces, ARC_PIECE, a, j, gap, space)


@kernel
def _watch_piece(body: np.void, pieces: np.ndarray, j: int, space: np.void) -> None:
    """Watch the body come down on a piece: the arc that is lowest over it, and those across its straight sides.

    The step ends where another arc becomes the lowest one.
    """
    s, reach, piece, poly = space["series"], space["reach"], pieces[j], space["poly"]
    base = piece["tx"] * (s["y"][0] - piece["y"]) - piece["ty"] * (s["x"][0] - piece["x"])
    move = abs(piece["ty"]) * reach[X] + abs(piece["tx"]) * reach[Y]
    if base - body["size"] - move >= 0.0:
        return
    if base <= 0.0 and pieces.shape[0] > 1:  # the body is behind it, on the other side of a ridge
        return
    relative = s["phi"][0] - piece["tilt"]
    omega = s["omega"][0]
    ahead = AT_END if omega > 0.0 else (-AT_END if omega < 0.0 else 0.0)
    lowest = arc_at(body, wrap(relative + ahead))
    arc = arc_number(body, lowest)
    cx, cy, tx, ty = body["cx"][arc], body["cy"][arc], piece["tx"], piece["ty"]
    gap = base + (tx * cx + ty * cy) * s["sine"][0] + (tx * cy - ty * cx) * s["cosine"][0] - body["r"][arc]
    if gap - move - body["size"] * (reach[SINE] + reach[COSINE]) >= 0.0:
        return
    if body["arcs"] > 1.0:
        turned = from_middle(body, arc, relative)
        for side in (-1, 1):
            left = body["half"][arc] - side * turned
            if AT_END < left <= reach[PHI]:
                for k in range(ORDER + 1):
                    poly[k] = -side * s["phi"][k]
                poly[0] = left
                look(space, 0, NOTHING, 0, 0)
    _watch_arc(body, pieces, arc, j, base, move, space)
    falling, rising = int(body["falling"][lowest]), int(body["rising"][lowest])
    if falling >= 0:
        _watch_arc(body, pieces, arc_number(body, falling), j, base, move, space)
    if rising >= 0 and rising != falling:
        _watch_arc(body, pieces, arc_number(body, rising), j, base, move, space)


@kernel
def _nearest_feature(body: np.void, bx: float, by: float) -> tuple[float, int]:
    """Gap [m] of a place in the frame of the body to the feature nearest to it, and its code: arc, or -1 less side."""
    best, code, near = -math.inf, 0, AT_JOIN * body["size"]
    for i in range(int(body["arcs"])):
        if body["length"][i] > 0.0:
            px, py, ox, oy = bx - body["sx"][i], by - body["sy"][i], body["ox"][i], body["oy"][i]
            gap, along = ox * px + oy * py, oy * px - ox * py
            if gap > best and -near <= along <= body["length"][i] + near:
                best, code = gap, -1 - i
        ex, ey = bx - body["cx"][i], by - body["cy"][i]
        gap = math.sqrt(ex * ex + ey * ey) - body["r"][i]
        if gap > best and faces_arc(body, i, bx, by):
            best, code = gap, i
    return best, code


@kernel
def _watch_inside(body: np.void, code: int, space: np.void) -> None:
    """Let the step end where a crest inside the body, which nothing touches, leaves the feature nearest to it.

    ``space["terms"]`` holds the series of its place in the frame of the body.
    """
    arcs, near = int(body["arcs"]), AT_END * body["size"]
    x, y, poly = space["terms"][0], space["terms"][1], space["poly"]
    if arcs == 1:
        return
    for end in range(2):
        a = -1 - code if code < 0 else code
        edge = (a - 1) % arcs if code >= 0 and end == 0 else a
        dx, dy = body["oy"][edge], -body["ox"][edge]
        begin = dx * body["cx"][a] + dy * body["cy"][a]
        if code < 0:
            begin = dx * body["sx"][a] + dy * body["sy"][a] + (body["length"][a] if end == 1 else 0.0)
        sign = 1.0 if end == 0 else -1.0
        for k in range(ORDER + 1):
            poly[k] = sign * (dx * x[k] + dy * y[k])
        poly[0] -= sign * begin
        if poly[0] > near:
            look(space, 0, NOTHING, 0, 0)


@kernel
def _square_distance(cx: float, cy: float, bx: np.ndarray, by: np.ndarray, poly: np.ndarray) -> None:
    """Write the series of the squared distance of a crest from a centre, both in the frame of the body."""
    x, y = bx[0], by[0]
    bx[0], by[0] = x - cx, y - cy
    for k in range(ORDER + 1):
        total = 0.0
        for i in range(k + 1):
            total += bx[i] * bx[k - i] + by[i] * by[k - i]
        poly[k] = total
    bx[0], by[0] = x, y


@kernel
def _watch_feature(
    body: np.void, pieces: np.ndarray, kind: int, a: int, j: int, gap: float, nearest: bool, space: np.void
) -> None:
    """Watch a crest come to a feature; ``nearest``: it is the one nearest to it. The gap is ``space["poly"]``.

    A crest that lies behind another feature, and so outside the body, may come before it: then it is looked at again.
    """
    poly = space["poly"]
    if nearest or gap >= -SAME_PLACE * body["size"]:
        _watch_touch(body, pieces, kind, a, j, gap, space)
        return
    for k in range(ORDER + 1):
        poly[k] = -poly[k]
    look(space, 0, NOTHING, 0, 0)


@kernel
def _watch_side(body: np.void, pieces: np.ndarray, i: int, j: int, far: float, nearest: bool, space: np.void) -> None:
    """Watch a crest come to a straight side, which moves by ``far`` [m] at most."""
    x, y, poly = space["terms"][0], space["terms"][1], space["poly"]
    px, py, ox, oy = x[0] - body["sx"][i], y[0] - body["sy"][i], body["ox"][i], body["oy"][i]
    gap, place, length = ox * px + oy * py, oy * px - ox * py, body["length"][i]
    if length > 0.0 and abs(gap) < far and -far < place < length + far:
        for k in range(ORDER + 1):
            poly[k] = ox * x[k] + oy * y[k]
        poly[0] = gap
        _watch_feature(body, pieces, SIDE_CREST, i, j, gap, nearest, space)


@kernel
def _watch_bend(body: np.void, pieces: np.ndarray, i: int, j: int, far: float, nearest: bool, space: np.void) -> None:
    """Watch a crest come to an arc, which moves by ``far`` [m] at most."""
    x, y, poly = space["terms"][0], space["terms"][1], space["poly"]
    ex, ey = x[0] - body["cx"][i], y[0] - body["cy"][i]
    gap = math.sqrt(ex * ex + ey * ey) - body["r"][i]
    if abs(gap) < far:
        _square_distance(body["cx"][i], body["cy"][i], x, y, poly)
        poly[0] = gap * (gap + 2.0 * body["r"][i])
        _watch_feature(body, pieces, ARC_CREST, i, j, gap, nearest, space)


@kernel
def _watch_crest(body: np.void, pieces: np.ndarray, j: int, space: np.void) -> None:
    """Watch a crest come to an arc or a side of the body, which it touches once."""
    s, reach, contacts = space["series"], space["reach"], space["contacts"]
    size, piece = body["size"], pieces[j]
    dx, dy = piece["x"] - s["x"][0], piece["y"] - s["y"][0]
    along = reach[X] + reach[Y]
    if dx * dx + dy * dy > (size + along) * (size + along):
        return
    for c in range(contacts["count"]):
        if contacts["at"][c]["kind"] != ARC_PIECE and contacts["at"][c]["piece"] == j:
            return
    sine, cosine = s["sine"][0], s["cosine"][0]
    far = along + (abs(dx) + abs(dy) + along) * (reach[SINE] + reach[COSINE]) + SAME_PLACE * size
    nearest, code = _nearest_feature(body, cosine * dx + sine * dy, cosine * dy - sine * dx)
    if nearest > far:
        return
    for k in range(ORDER + 1):
        place_of_crest(piece, s, space["terms"][0], space["terms"][1], k)
    if nearest < -far:
        far = -2.0 * nearest
    for i in range(int(body["arcs"])):
        _watch_side(body, pieces, i, j, far, code == -1 - i, space)
        _watch_bend(body, pieces, i, j, far, code == i, space)
    if nearest < -SAME_PLACE * size:
        _watch_inside(body, code, space)


@kernel
def watch_others(body: np.void, pieces: np.ndarray, space: np.void) -> None:
    """Let the step end where the first pair of features comes to touch that does not touch yet."""
    _measure_reach(space)
    reach, size, x = space["reach"], body["size"], space["series"]["x"][0]
    begin = first_piece(pieces, x - reach[X] - size)
    end = first_piece(pieces, x + reach[X] + size)
    for j in range(begin, end + 1):
        _watch_piece(body, pieces, j, space)
        if j > begin and pieces[j]["turn"] < 0.0:
            _watch_crest(body, pieces, j, space)
