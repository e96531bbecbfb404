"""Pairs of features that may come to touch within a step: those near enough are looked at exactly.

In flight these are all touches that may come: the first of them ends the step, and the list of contacts has one.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.arithmetic import sign_of, wrap
from sledenv.kernel.contacts import ORDER
from sledenv.kernel.expansion import COSINE, PHI, SINE, X, Y, measure_reach, place_in_body, value
from sledenv.kernel.geometry import (
    ARC_BEND,
    ARC_PIECE,
    AT_JOIN,
    ON_ARC,
    SAME_PLACE,
    SIDE_BEND,
    along_piece,
    arc_number,
    can_touch,
    centre_of_part,
    faces_arc,
    faces_dip,
    first_piece,
    over_bend,
    part_of_bend,
    reach_along,
)
from sledenv.kernel.guards import AT_END, NOTHING, TIED, TOUCH, first_term, is_rounding, shorten_to_first_root
from sledenv.kernel.outline import arc_at, from_middle, same_arc
from sledenv.kernel.records import MOST_CONTACTS
from sledenv.kernel.zeros import first_zero

LIFTED: Final = 1e-12  # of the speed: rate of a gap that has just been let go by a rigid contact,
LIFTED_LATER: Final = 1e-9  # and of the accelerations: the acceleration with which it starts


@kernel
def _approach(nx: float, ny: float, cx: float, cy: float, space: np.void) -> float:
    """How far [m] a place in the frame of the body can go against a direction of the ground within the step."""
    s, late, gs, gc = space["series"], space["late"], ny * cx - nx * cy, nx * cx + ny * cy
    rate = nx * s["x"][1] + ny * s["y"][1] + gs * s["sine"][1] + gc * s["cosine"][1]
    later = abs(nx) * late[X] + abs(ny) * late[Y] + abs(gs) * late[SINE] + abs(gc) * late[COSINE]
    return max(-rate * space["event"]["time"], 0.0) + later  # type: ignore[no-any-return]


@kernel
def _foot(body: np.void, piece: np.void, a: int, t: float, s: np.void) -> float:
    """Place [m] along a piece of the foot of an arc at a time of the step."""
    sine, cosine = value(s["sine"], t), value(s["cosine"], t)
    cx, cy = body["cx"][a], body["cy"][a]
    return along_piece(piece, value(s["x"], t) + cosine * cx - sine * cy, value(s["y"], t) + sine * cx + cosine * cy)


@kernel
def _from_bend(body: np.void, piece: np.void, a: int, t: float, s: np.void) -> tuple[float, float]:
    """Place [m] of the centre of an arc at a time of the step, seen from the centre of a bend."""
    sine, cosine = value(s["sine"], t), value(s["cosine"], t)
    cx, cy = body["cx"][a], body["cy"][a]
    return (
        value(s["x"], t) + cosine * cx - sine * cy - piece["qx"],
        value(s["y"], t) + sine * cx + cosine * cy - piece["qy"],
    )


@kernel
def _in_reach(
    body: np.void, pieces: np.ndarray, kind: int, a: int, j: int, t: float, margin: float, space: np.void
) -> bool:
    """Whether a pair whose gap closes at a time of the step lies before each other then, ``margin`` [m] inside.

    For a bend ``space["terms"]`` holds its place in the frame of the body.
    """
    s, piece = space["series"], pieces[j]
    if kind == ARC_PIECE:
        low, high = reach_along(body, pieces, a, j)
        return bool(low + margin <= _foot(body, piece, a, t, s) <= high - margin)
    bx, by = value(space["terms"][0], t), value(space["terms"][1], t)
    if kind == ARC_BEND:
        ex, ey = _from_bend(body, piece, a, t, s)
        if not over_bend(pieces, j, ex, ey, -margin):
            return False
        return faces_arc(body, a, bx, by) if piece["bend"] > 0 else faces_dip(body, piece, a, bx, by)
    along = body["oy"][a] * (bx - body["sx"][a]) - body["ox"][a] * (by - body["sy"][a])
    near = AT_END * body["size"]
    return bool(-near <= along <= body["length"][a] + near)


@kernel
def _watch_entry(body: np.void, pieces: np.ndarray, kind: int, a: int, j: int, space: np.void) -> None:
    """Let the step end where an arc that is under a piece, or in a bend, comes over it: it is looked at again then."""
    s, poly, near = space["series"], space["poly"], AT_END * body["size"]
    low, high, cx, cy = 0.0, 0.0, body["cx"][a], body["cy"][a]
    if kind == ARC_PIECE:
        low, high = reach_along(body, pieces, a, j)
    for end in range(2):
        piece, place = pieces[j], low if end == 0 else high
        x, y = piece["x"], piece["y"]
        if kind == ARC_BEND:
            x, y = piece["qx"], piece["qy"]
            if end == 0:
                piece = pieces[j - 1]
        if not abs(place) < math.inf:
            continue
        tx, ty, out = piece["tx"], piece["ty"], -1.0 if end == 0 else 1.0
        for k in range(ORDER + 1):
            poly[k] = tx * s["x"][k] + ty * s["y"][k]
            poly[k] = out * (poly[k] + (tx * cx + ty * cy) * s["cosine"][k] + (ty * cx - tx * cy) * s["sine"][k])
        poly[0] -= out * (tx * x + ty * y + place)
        poly[0] += 2.0 * near  # it is looked at again where it is in by as much as counts
        if poly[0] >= near:
            shorten_to_first_root(space, 0, NOTHING, 0, 0)


@kernel
def _watch_opening(space: np.void) -> None:
    """Let the step end where a gap opens that is closed without touching: to look again then."""
    poly = space["poly"]
    for k in range(ORDER + 1):
        poly[k] = -poly[k]
    shorten_to_first_root(space, 0, NOTHING, 0, 0)


@kernel
def _touch_now(body: np.void, pieces: np.ndarray, kind: int, a: int, j: int, gap: float, space: np.void) -> None:
    """Look at a pair that is closed without touching, because it has come into each other's reach inside each other.

    It touches at once if it closes, or else it is looked at again when it does.
    """
    poly, event = space["poly"], space["event"]
    margin, inside = 0.0, gap < -SAME_PLACE * body["size"]
    if inside and space["contacts"]["count"] == MOST_CONTACTS:
        return  # it may be one of two that have become one to make room: others hold the body there
    if inside and (kind == ARC_PIECE or pieces[j]["radius"] > 0.0):
        margin = AT_END * body["size"]  # a foot at an end is about to leave, or has just left
    if not _in_reach(body, pieces, kind, a, j, 0.0, margin, space):
        if kind == ARC_BEND and inside:
            _watch_opening(space)
        if kind == ARC_PIECE or (kind == ARC_BEND and pieces[j]["radius"] > 0.0):
            _watch_entry(body, pieces, kind, a, j, space)
        return
    first = first_term(body, space)
    if inside and first == 3 and is_rounding(body, poly[3], 3, space):
        return  # contacts that stay hold it as deep as it is
    if poly[first] < 0.0:
        if event["time"] > 0.0 or event["code"] == NOTHING:
            event["time"], event["code"], event["who"], event["side"], event["piece"] = 0.0, TOUCH, kind, a, j
    elif first == 1:
        for k in range(ORDER):
            poly[k] = (k + 1) * poly[k + 1]
        poly[ORDER] = 0.0
        shorten_to_first_root(space, 0, NOTHING, 0, 0)


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
    if space["lifted"] != 0 and abs(gap) <= near:
        zeros = _zeros_of_lifted(body, space)
    if gap <= near and zeros == 0:
        zeros = first_term(body, space)
        if gap < -near or poly[zeros] < 0.0:
            _touch_now(body, pieces, kind, a, j, gap, space)
            return
    t = first_zero(poly, event["time"], zeros, space["stack"])
    if not (t < event["time"] * (1.0 - TIED) or (event["code"] == NOTHING and t < event["time"])):
        return
    if _in_reach(body, pieces, kind, a, j, t, 0.0, space):
        event["time"], event["code"], event["who"], event["side"], event["piece"] = t, TOUCH, kind, a, j
    elif motion["t"] + t > motion["t"]:  # from there on it is looked at anew
        event["time"], event["code"] = t, NOTHING


@kernel
def touches_beside(body: np.void, contacts: np.void, a: int, j: int) -> bool:
    """Whether an arc touches a piece, or another one of its circle or that joins it smoothly: one lowest point.

    An arc that touches a round bend at an end of the piece comes to the piece from there.
    """
    arcs = int(body["arcs"])
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        b = contact["arc"]
        if contact["kind"] == ARC_BEND and a == b and contact["radius"] > 0.0 and 0 <= contact["piece"] - j <= 1:
            return True
        if contact["kind"] != ARC_PIECE or contact["piece"] != j:
            continue
        if same_arc(body, a, b) or (b == (a + 1) % arcs and body["smooth"][a] != 0.0):
            return True
        if a == (b + 1) % arcs and body["smooth"][b] != 0.0:
            return True
    return False


@kernel
def _watch_arc(body: np.void, pieces: np.ndarray, a: int, j: int, base: float, space: np.void) -> None:
    """Watch an arc come down on a piece, over which the mass centre is at ``base`` [m]."""
    if touches_beside(body, space["contacts"], a, j):
        return
    s, reach, piece, poly = space["series"], space["reach"], pieces[j], space["poly"]
    cx, cy, tx, ty = body["cx"][a], body["cy"][a], piece["tx"], piece["ty"]
    gs, gc = tx * cx + ty * cy, tx * cy - ty * cx
    sine, cosine = s["sine"][0], s["cosine"][0]
    gap = base + gs * sine + gc * cosine - body["r"][a]
    if gap - _approach(-ty, tx, cx, cy, space) >= 0.0:
        return
    foot = along_piece(piece, s["x"][0] + cosine * cx - sine * cy, s["y"][0] + sine * cx + cosine * cy)
    span = reach[X] + reach[Y] + body["h"][a] * (reach[SINE] + reach[COSINE])
    low, high = reach_along(body, pieces, a, j)
    if foot + span < low or foot - span > high:
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
    move = _approach(-piece["ty"], piece["tx"], 0.0, 0.0, space)
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
                shorten_to_first_root(space, 0, NOTHING, 0, 0)
    _watch_arc(body, pieces, arc, j, base, space)
    falling, rising = int(body["falling"][lowest]), int(body["rising"][lowest])
    if falling >= 0:
        _watch_arc(body, pieces, arc_number(body, falling), j, base, space)
    if rising >= 0 and rising != falling:
        _watch_arc(body, pieces, arc_number(body, rising), j, base, space)


@kernel
def _nearest_feature(body: np.void, bx: float, by: float) -> tuple[float, int, float, float]:
    """Gap [m] of a place in the frame of the body to the feature nearest to it, its code, and the normal towards it.

    The code is that of an arc, or -1 less that of a side.
    """
    best, code, nx, ny, near = -math.inf, 0, 0.0, 0.0, AT_JOIN * body["size"]
    for i in range(int(body["arcs"])):
        if body["length"][i] > 0.0:
            px, py, ox, oy = bx - body["sx"][i], by - body["sy"][i], body["ox"][i], body["oy"][i]
            gap, along = ox * px + oy * py, oy * px - ox * py
            if gap > best and -near <= along <= body["length"][i] + near:
                best, code, nx, ny = gap, -1 - i, ox, oy
        ex, ey = bx - body["cx"][i], by - body["cy"][i]
        out = math.sqrt(ex * ex + ey * ey)
        gap = out - body["r"][i]
        if gap > best and faces_arc(body, i, bx, by):
            best, code, nx, ny = gap, i, ex, ey
            if out > 0.0:
                nx, ny = ex / out, ey / out
    return best, code, nx, ny


@kernel
def _stays_outside(px: float, py: float, nx: float, ny: float, gap: float, space: np.void) -> bool:
    """Whether a bend at (px, py) [m] from the mass centre is kept off the body for the step by its nearest feature.

    The body is convex: in its own frame all of it lies behind the line across the normal (nx, ny) to that feature.
    """
    s, reach, late, t = space["series"], space["reach"], space["late"], space["event"]["time"]
    x, y = s["sine"][1] * py + s["cosine"][1] * px, s["cosine"][1] * py - s["sine"][1] * px
    x -= s["cosine"][0] * s["x"][1] + s["sine"][0] * s["y"][1]
    y -= s["cosine"][0] * s["y"][1] - s["sine"][0] * s["x"][1]
    turning = reach[SINE] + reach[COSINE]
    later = late[X] + late[Y] + (reach[X] + reach[Y]) * turning + (abs(px) + abs(py)) * (late[SINE] + late[COSINE])
    return bool(gap + min((nx * x + ny * y) * t, 0.0) > 2.0 * later)


@kernel
def _watch_inside(body: np.void, code: int, space: np.void) -> None:
    """Let the step end where a crest that is at the body or inside, and touches nothing, leaves the nearest feature.

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
            shorten_to_first_root(space, 0, NOTHING, 0, 0)


@kernel
def _square_distance(cx: float, cy: float, factor: float, bx: np.ndarray, by: np.ndarray, poly: np.ndarray) -> None:
    """Write ``factor`` times the series of the squared distance of a bend from a centre, in the frame of the body."""
    x, y = bx[0], by[0]
    bx[0], by[0] = x - cx, y - cy
    for k in range(ORDER + 1):
        total = 0.0
        for i in range(k + 1):
            total += bx[i] * bx[k - i] + by[i] * by[k - i]
        poly[k] = factor * total
    bx[0], by[0] = x, y


@kernel
def _watch_feature(
    body: np.void, pieces: np.ndarray, kind: int, a: int, j: int, gap: float, nearest: bool, space: np.void
) -> None:
    """Watch a crest come to a feature; ``nearest``: it is the one nearest to it. The gap is ``space["poly"]``.

    A crest that lies behind another feature, and so outside the body, may come before it: then it is looked at again.
    """
    if nearest or gap >= -SAME_PLACE * body["size"]:
        _watch_touch(body, pieces, kind, a, j, gap, space)
    else:
        _watch_opening(space)


@kernel
def _write_place_in_body(x: float, y: float, space: np.void) -> None:
    """Write the series of a place of the ground in the frame of the body."""
    for k in range(ORDER + 1):
        place_in_body(x, y, space["series"], space["terms"][0], space["terms"][1], k)


@kernel
def _watch_side(
    body: np.void, pieces: np.ndarray, i: int, j: int, far: float, move: float, nearest: bool, space: np.void
) -> None:
    """Watch a crest come to a straight side, along which it moves by ``far`` [m] at most, towards it by ``move``."""
    s, piece = space["series"], pieces[j]
    sine, cosine = s["sine"][0], s["cosine"][0]
    ahead = 2.0 * AT_END * sign_of(s["omega"][0])  # where it is parallel to a piece now, the part that comes counts
    part = part_of_bend(body, pieces, i, j, sine + ahead * cosine, cosine - ahead * sine)
    x, y, poly = space["terms"][0], space["terms"][1], space["poly"]
    qx, qy, radius = centre_of_part(piece, part)
    ox, oy, length, bx, by = body["ox"][i], body["oy"][i], body["length"][i], x[0], y[0]
    if part != ON_ARC:
        dx, dy = qx - s["x"][0], qy - s["y"][0]
        bx, by = cosine * dx + sine * dy, cosine * dy - sine * dx
    px, py = bx - body["sx"][i], by - body["sy"][i]
    gap, place = ox * px + oy * py - radius, oy * px - ox * py
    if not (length > 0.0 and abs(gap) < move and -far < place < length + far):
        return
    if part != ON_ARC:
        _write_place_in_body(qx, qy, space)
    for k in range(ORDER + 1):
        poly[k] = ox * x[k] + oy * y[k]
    poly[0] = gap
    _watch_feature(body, pieces, SIDE_BEND, i, j, gap, nearest, space)
    if piece["radius"] > 0.0:  # another part of the bend comes under the side where it is parallel to a piece
        for end in range(2):
            beside = pieces[j - 1 + end]
            along_s, along_c = ox * beside["ty"] - oy * beside["tx"], ox * beside["tx"] + oy * beside["ty"]
            parallel = along_c * s["cosine"][0] + along_s * s["sine"][0]
            zeros = 1 if abs(parallel) < AT_END else 0
            sign = math.copysign(1.0, along_c * s["cosine"][zeros] + along_s * s["sine"][zeros])
            for k in range(ORDER + 1):
                poly[k] = sign * (along_c * s["cosine"][k] + along_s * s["sine"][k])
            shorten_to_first_root(space, zeros, NOTHING, 0, 0)
    if part != ON_ARC:
        _write_place_in_body(piece["qx"], piece["qy"], space)


@kernel
def _watch_arc_bend(
    body: np.void, pieces: np.ndarray, i: int, j: int, move: float, nearest: bool, space: np.void
) -> None:
    """Watch an arc come to a bend, towards which a body that did not turn would move by ``move`` [m] at most."""
    reach = space["reach"]
    move += body["h"][i] * (reach[SINE] + reach[COSINE])
    x, y, poly, piece = space["terms"][0], space["terms"][1], space["poly"], pieces[j]
    ex, ey, sign = x[0] - body["cx"][i], y[0] - body["cy"][i], piece["bend"]
    distance, touching = math.sqrt(ex * ex + ey * ey), piece["radius"] + sign * body["r"][i]
    gap = sign * (distance - touching)
    if not abs(gap) < move:
        return
    if sign > 0 and gap > 0.0:
        sine, cosine = space["series"]["sine"][0], space["series"]["cosine"][0]
        nx, ny = (sine * ey - cosine * ex) / distance, -(sine * ex + cosine * ey) / distance
        if gap > _approach(nx, ny, body["cx"][i], body["cy"][i], space):
            return
    _square_distance(body["cx"][i], body["cy"][i], sign / (distance + touching), x, y, poly)
    poly[0] = gap
    if sign > 0:
        _watch_feature(body, pieces, ARC_BEND, i, j, gap, nearest, space)
    else:
        _watch_touch(body, pieces, ARC_BEND, i, j, gap, space)


@kernel
def _arc_touches_bend(body: np.void, contacts: np.void, a: int, j: int) -> bool:
    """Whether an arc, or one that joins it smoothly, touches a bend; or whether the arc touches a piece beside it."""
    arcs = int(body["arcs"])
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        b = contact["arc"]
        if contact["kind"] == ARC_PIECE and a == b and 0 <= j - contact["piece"] <= 1:
            return True
        if contact["kind"] == ARC_BEND and contact["piece"] == j:
            joined = (b == (a + 1) % arcs and body["smooth"][a] != 0.0) or (
                a == (b + 1) % arcs and body["smooth"][b] != 0.0
            )
            if a == b or joined:
                return True
    return False


@kernel
def _watch_bend(body: np.void, pieces: np.ndarray, j: int, space: np.void) -> None:
    """Watch a bend come to the body: a crest to an arc or a side, which it touches once, a round dip to arcs."""
    s, reach, contacts = space["series"], space["reach"], space["contacts"]
    size, piece = body["size"], pieces[j]
    radius, sign = piece["radius"], piece["bend"]
    dx, dy = piece["qx"] - s["x"][0], piece["qy"] - s["y"][0]
    along, turning = reach[X] + reach[Y], reach[SINE] + reach[COSINE]
    out, wide = math.sqrt(dx * dx + dy * dy), size + along
    if (sign > 0 and out > radius + wide) or (sign < 0 and out + wide < radius):
        return
    if radius > 0.0:
        before = pieces[j - 1]
        if dx * before["tx"] + dy * before["ty"] > wide or dx * piece["tx"] + dy * piece["ty"] < -wide:
            return
    if sign > 0:
        for c in range(contacts["count"]):
            if contacts["at"][c]["kind"] != ARC_PIECE and contacts["at"][c]["piece"] == j:
                return
    sine, cosine = s["sine"][0], s["cosine"][0]
    bx, by = cosine * dx + sine * dy, cosine * dy - sine * dx
    along += SAME_PLACE * size
    far = along + (abs(dx) + abs(dy) + along) * turning
    move = min(far, along + (size + far) * turning)
    if sign < 0:
        written = False
        for i in range(int(body["arcs"])):
            if can_touch(body, piece, i) and not _arc_touches_bend(body, contacts, i, j):
                if not written:
                    _write_place_in_body(piece["qx"], piece["qy"], space)
                    written = True
                _watch_arc_bend(body, pieces, i, j, along, True, space)
        return
    nearest, code, nx, ny = _nearest_feature(body, bx, by)
    nearest -= radius
    if nearest > SAME_PLACE * size and _stays_outside(dx, dy, nx, ny, nearest, space):
        return
    _write_place_in_body(piece["qx"], piece["qy"], space)
    if nearest < -move:
        move = -2.0 * nearest
        far, along = max(far, move), max(along, move)
    for i in range(int(body["arcs"])):
        _watch_side(body, pieces, i, j, far, move, code == -1 - i, space)
        if radius == 0.0 or not _arc_touches_bend(body, contacts, i, j):
            _watch_arc_bend(body, pieces, i, j, along, code == i, space)
    if nearest < SAME_PLACE * size:
        _watch_inside(body, code, space)


@kernel
def _watch_ahead(body: np.void, pieces: np.ndarray, j: int, step: int, x: float, space: np.void) -> None:
    """Watch pieces of a run beyond an end of the body, at a place x [m], for a body that is pressed in.

    Seen from the body the run is one convex ground: it may come to the line of a piece before it is over the piece.
    """
    contacts, reach, deepest = space["contacts"], space["reach"], 0.0
    for c in range(contacts["count"]):
        deepest = max(deepest, contacts["at"][c]["depth_offset"] - contacts["at"][c]["gap"])
    deepest += reach[X] + reach[Y] + body["size"] * (reach[SINE] + reach[COSINE])
    y = pieces[j]["y"] + (x - pieces[j]["x"]) * (pieces[j]["ty"] / pieces[j]["tx"])
    while 0 < (j + 1 if step > 0 else j) < pieces.shape[0] and pieces[j + 1 if step > 0 else j]["bend"] <= 0:
        j += step
        piece = pieces[j]
        if piece["tx"] * (y - piece["y"]) - piece["ty"] * (x - piece["x"]) > deepest:
            return
        _watch_piece(body, pieces, j, space)


@kernel
def find_new_contacts(body: np.void, pieces: np.ndarray, space: np.void) -> None:
    """Let the step end where the first pair of features comes to touch that does not touch yet."""
    measure_reach(space)
    reach, size, x, last = space["reach"], body["size"], space["series"]["x"][0], pieces.shape[0] - 1
    begin, end = x - reach[X] - size, x + reach[X] + size
    first = first_piece(pieces, begin)
    if first > 0 and pieces[first]["ex"] > begin:
        first -= 1
    j = first
    while j <= last and (j == first or pieces[j]["bx"] <= end):
        _watch_piece(body, pieces, j, space)
        if j > first and pieces[j]["bend"] != 0:
            _watch_bend(body, pieces, j, space)
        j += 1
    if last > 0 and space["contacts"]["count"] > 0:
        _watch_ahead(body, pieces, first, -1, begin, space)
        _watch_ahead(body, pieces, j - 1, 1, end, space)
