"""Pieces and bends of the ground, features of a body, and how a contact of the two lies.

A contact is one of three kinds: an arc on a piece, an arc on a bend, a straight side on a bend. ``n`` is its unit
normal out of the ground, ``t`` the normal turned by -90 degrees, ``l`` the lever from the mass centre to the touching
point on the body: docs/physics.md, section 12.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.arithmetic import angle_of
from sledenv.kernel.outline import from_middle

ARC_PIECE, ARC_BEND, SIDE_BEND = range(3)
ON_BEGIN, ON_ARC, ON_END = -1, 0, 1  # parts of a bend: the point where it begins, its arc, the point where it ends
SAME_PLACE: Final = 1e-12  # of the size: two places nearer than this are one
AT_JOIN: Final = 1e-11  # [rad], or of the size: features overlap by this, so that rounding leaves nothing between them
DEEPEST: Final = 0.25  # of the size: how deep a point of the body may be in the ground
MOST_OF_PIECE: Final = 0.49  # that a bend may take of a piece

# A piece of the ground, with the vertex where it begins (of the first piece: where it ends) and the bend there, an arc
# that touches both pieces. A crest without a radius is a bend whose places are all that of the vertex.
PIECE: Final = np.dtype(
    [
        ("x", "f8"),  # [m] the vertex
        ("y", "f8"),
        ("tx", "f8"),  # [-] unit tangent, down the slope
        ("ty", "f8"),
        ("tilt", "f8"),  # [rad] its angle to the plane
        ("low", "f8"),  # [m] where it begins and ends along its tangent, seen from the vertex
        ("high", "f8"),
        ("bend", "i8"),  # 1 of a crest, -1 of a dip with a radius, 0 of one without: there two lines are touched
        ("radius", "f8"),  # [m]
        ("qx", "f8"),  # [m] centre of the bend,
        ("qy", "f8"),
        ("bx", "f8"),  # where it begins, on the piece before,
        ("by", "f8"),
        ("ex", "f8"),  # and where it ends, on this piece
        ("ey", "f8"),
        ("before", "i8"),  # the next vertex with a bend, uphill or here; 0 if there is none,
        ("behind", "i8"),  # and downhill; the number of pieces if there is none
    ],
    align=True,
)


@kernel
def _write_bend(piece: np.void, before: np.void, radius: float) -> None:
    """Write the bend at the vertex where a piece begins."""
    x, y, tx, ty = piece["x"], piece["y"], before["tx"], before["ty"]
    turn, along = tx * piece["ty"] - ty * piece["tx"], tx * piece["tx"] + ty * piece["ty"]
    half = abs(turn) / (1.0 + along)  # tangent of half the turn
    room = MOST_OF_PIECE * min(before["high"] - before["low"], piece["high"])
    if turn == 0.0:
        radius = 0.0
    elif radius * half > room:
        radius = room / half
    sign = 1.0 if turn < 0.0 else -1.0
    piece["bend"] = 0 if radius == 0.0 and not turn < 0.0 else int(sign)
    piece["radius"] = radius
    piece["qx"] = piece["bx"] = piece["ex"] = x
    piece["qy"] = piece["by"] = piece["ey"] = y
    if radius > 0.0:
        reach = radius * half
        piece["bx"], piece["by"] = x - reach * tx, y - reach * ty
        piece["ex"], piece["ey"] = x + reach * piece["tx"], y + reach * piece["ty"]
        piece["qx"], piece["qy"] = piece["bx"] + sign * radius * ty, piece["by"] - sign * radius * tx


@kernel
def build_pieces(vertices: np.ndarray, pieces: np.ndarray) -> None:
    """Write the pieces of a profile, and the bends between them.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Places along and heights over the plane of the slope, and radii with which they are rounded [m]. A radius is
        made smaller where its bend would take more than ``MOST_OF_PIECE`` of a piece beside it.
    pieces : ndarray of PIECE, shape (n + 1,)
    """
    n = vertices.shape[0]
    for j in range(n + 1):
        piece = pieces[j]
        piece["x"] = piece["y"] = piece["ty"] = piece["tilt"] = 0.0
        piece["tx"], piece["low"], piece["high"] = 1.0, 0.0, math.inf
        if n > 0:
            piece["x"], piece["y"] = vertices[max(j - 1, 0), 0], vertices[max(j - 1, 0), 1]
        if 0 < j < n:
            along, up = vertices[j, 0] - vertices[j - 1, 0], vertices[j, 1] - vertices[j - 1, 1]
            length = math.sqrt(along * along + up * up)
            piece["tx"], piece["ty"], piece["high"] = along / length, up / length, length
            piece["tilt"] = angle_of(up, along)
    first = pieces[0]
    first["low"] = -math.inf
    if n > 0:
        first["high"] = 0.0
    first["bend"], first["radius"], first["before"] = 0, 0.0, 0
    first["qx"] = first["bx"] = first["ex"] = first["x"]
    first["qy"] = first["by"] = first["ey"] = first["y"]
    for j in range(1, n + 1):
        _write_bend(pieces[j], pieces[j - 1], vertices[j - 1, 2])
        pieces[j]["before"] = j if pieces[j]["bend"] != 0 else pieces[j - 1]["before"]
    behind = n + 1
    for j in range(n, -1, -1):
        pieces[j]["behind"] = behind
        if pieces[j]["bend"] != 0:
            behind = j
    for j in range(1, n + 1):
        if pieces[j]["radius"] > 0.0:
            pieces[j]["low"] = along_piece(pieces[j], pieces[j]["ex"], pieces[j]["ey"])
            pieces[j - 1]["high"] = along_piece(pieces[j - 1], pieces[j]["bx"], pieces[j]["by"])


@kernel
def along_piece(piece: np.void, x: float, y: float) -> float:
    """Place [m] along a piece, seen from its vertex, of the foot of a point."""
    return piece["tx"] * (x - piece["x"]) + piece["ty"] * (y - piece["y"])  # type: ignore[no-any-return]


@kernel
def can_touch(body: np.void, piece: np.void, a: int) -> bool:
    """Whether an arc can touch the bend where a piece begins: a dip only if it is rounder than the arc."""
    return bool(piece["bend"] > 0 or (piece["bend"] < 0 and body["r"][a] < piece["radius"]))


@kernel
def bends_beside(body: np.void, pieces: np.ndarray, a: int, j: int) -> tuple[int, int]:
    """The next bends to both sides of a piece that an arc can touch; 0 and the number of pieces if there are none.

    Up to there it may touch the line of the piece: seen from the arc the ground between them is convex.
    """
    low, high = int(pieces[j]["before"]), int(pieces[j]["behind"])
    while low > 0 and not can_touch(body, pieces[low], a):
        low = int(pieces[low - 1]["before"])
    while high < pieces.shape[0] and not can_touch(body, pieces[high], a):
        high = int(pieces[high]["behind"])
    return low, high


@kernel
def end_of_reach(body: np.void, pieces: np.ndarray, a: int, j: int, step: int) -> tuple[float, bool]:
    """Place [m] along a piece where its line is out of the reach of an arc, and whether a bend takes over there.

    That is at the next bend that the arc can touch, in steps of -1 or 1; or before, where the ground has risen so far
    over the line that a body pressed onto that is buried.
    """
    piece, most, height = pieces[j], DEEPEST * body["size"], 0.0
    place, b = piece["low"] if step < 0 else piece["high"], j if step < 0 else j + 1
    while 0 < b < pieces.shape[0] and not can_touch(body, pieces[b], a):
        b += step
        if not 0 < b < pieces.shape[0]:
            return step * math.inf, False
        x, y = (pieces[b]["ex"], pieces[b]["ey"]) if step < 0 else (pieces[b]["bx"], pieces[b]["by"])
        along, over = along_piece(piece, x, y), piece["tx"] * (y - piece["y"]) - piece["ty"] * (x - piece["x"])
        if step * (along - place) < 0.0:  # it turns back
            return place, False
        if over > most:
            return place + (along - place) * (most - height) / (over - height), False
        place, height = along, over
    return place, 0 < b < pieces.shape[0]


@kernel
def reach_along(body: np.void, pieces: np.ndarray, a: int, j: int) -> tuple[float, float]:
    """Places [m] along a piece between which an arc may touch its line."""
    return end_of_reach(body, pieces, a, j, -1)[0], end_of_reach(body, pieces, a, j, 1)[0]


@kernel
def first_piece(pieces: np.ndarray, x: float) -> int:
    """Number of the piece over which a place [m] along the plane lies, if no bend is there."""
    low, high = 0, pieces.shape[0] - 1
    while low < high:
        middle = (low + high + 1) // 2
        if pieces[middle]["x"] <= x:
            low = middle
        else:
            high = middle - 1
    return low


@kernel
def bend_at(pieces: np.ndarray, x: float) -> int:
    """Number of the bend with a radius on which a place [m] along the plane lies, 0 if it lies on a piece."""
    j = first_piece(pieces, x)
    if x < pieces[j]["ex"] and j > 0:
        return j
    return j + 1 if j + 1 < pieces.shape[0] and x > pieces[j + 1]["bx"] else 0


@kernel
def height_at(pieces: np.ndarray, x: float) -> float:
    """Height [m] of the ground at a place along the plane."""
    b = bend_at(pieces, x)
    if b > 0:
        bend = pieces[b]
        across = x - bend["qx"]
        return float(bend["qy"] + bend["bend"] * math.sqrt(bend["radius"] * bend["radius"] - across * across))
    piece = pieces[first_piece(pieces, x)]
    return float(piece["y"] + (x - piece["x"]) * (piece["ty"] / piece["tx"]))


@kernel
def tangent_at(pieces: np.ndarray, x: float) -> tuple[float, float]:
    """Unit tangent of the ground at a place [m] along the plane; at a vertex that of the piece behind it."""
    b = bend_at(pieces, x)
    if b == 0:
        piece = pieces[first_piece(pieces, x)]
        return piece["tx"], piece["ty"]
    bend = pieces[b]
    along = (x - bend["qx"]) / bend["radius"]
    return math.sqrt(1.0 - along * along), -bend["bend"] * along


@kernel
def heights_within(pieces: np.ndarray, x: float, reach: float) -> tuple[float, float]:
    """Lowest and highest height [m] of the ground within ``reach`` [m] of a place along the plane."""
    begin, end = height_at(pieces, x - reach), height_at(pieces, x + reach)
    lowest, highest = min(begin, end), max(begin, end)
    for j in range(max(first_piece(pieces, x - reach), 1), min(first_piece(pieces, x + reach) + 2, pieces.shape[0])):
        bend = pieces[j]
        if max(bend["bx"], x - reach) <= bend["qx"] <= min(bend["ex"], x + reach):  # level in the middle
            height = bend["qy"] + bend["bend"] * bend["radius"]
            lowest, highest = min(lowest, height), max(highest, height)
    return lowest, highest


@kernel
def arc_number(body: np.void, arc: int) -> int:
    """Number of an arc that may be listed twice: the first one of the two."""
    arcs = int(body["arcs"])
    return arc - arcs if arc >= arcs else arc


@kernel
def beyond(body: np.void, arc: int, relative: float) -> int:
    """-1 or 1 where an orientation [rad] relative to a piece lies below or above the interval of an arc, else 0."""
    d = from_middle(body, arc, relative)
    if d < -body["half"][arc]:
        return -1
    return 1 if d > body["half"][arc] else 0


@kernel
def mirrored(motion: np.void) -> int:
    """1, or -1 of the mirror image: the sign to begin with where both are tried, so that images are treated alike."""
    return -1 if motion["sine"] < 0.0 else 1


@kernel
def part_of_bend(body: np.void, pieces: np.ndarray, i: int, j: int, sine: float, cosine: float) -> int:
    """Part of a bend that a straight side touches in some orientation: its arc between the normals of the pieces."""
    if pieces[j]["radius"] == 0.0:
        return ON_ARC
    ox, oy = body["ox"][i], body["oy"][i]
    nx, ny = -(cosine * ox - sine * oy), -(sine * ox + cosine * oy)
    if nx * pieces[j - 1]["tx"] + ny * pieces[j - 1]["ty"] < 0.0:
        return ON_BEGIN
    return ON_END if nx * pieces[j]["tx"] + ny * pieces[j]["ty"] > 0.0 else ON_ARC


@kernel
def centre_of_part(piece: np.void, part: int) -> tuple[float, float, float]:
    """Centre and radius [m] of a part of the bend where a piece begins."""
    if part == ON_ARC:
        return piece["qx"], piece["qy"], piece["radius"]
    if part == ON_BEGIN:
        return piece["bx"], piece["by"], 0.0
    return piece["ex"], piece["ey"], 0.0


@kernel
def place(body: np.void, pieces: np.ndarray, motion: np.void, contact: np.void) -> None:
    """Write normal and levers of a contact where the body is, and how much deeper it is than its gap tells."""
    a = contact["arc"]
    piece = pieces[contact["piece"]]
    s, cosine = motion["sine"], motion["cosine"]
    if contact["kind"] == SIDE_BEND:
        qx, qy, radius = centre_of_part(piece, contact["bend_part"])
        contact["qx"], contact["qy"], contact["radius"], contact["bend"] = qx, qy, radius, 1.0
        px, py = qx - motion["x"], qy - motion["y"]
        ox, oy = body["ox"][a], body["oy"][a]
        nx, ny = -(cosine * ox - s * oy), -(s * ox + cosine * oy)
        away = ox * (cosine * px + s * py - body["sx"][a]) + oy * (cosine * py - s * px - body["sy"][a])
        gap = away - radius
        lx, ly = px + away * nx, py + away * ny
    else:
        cx, cy = body["cx"][a], body["cy"][a]
        rx, ry = cosine * cx - s * cy, s * cx + cosine * cy
        ex, ey = motion["x"] + rx, motion["y"] + ry
        if contact["kind"] == ARC_BEND:
            contact["qx"], contact["qy"] = piece["qx"], piece["qy"]
            contact["radius"], contact["bend"] = piece["radius"], piece["bend"]
            ex, ey = ex - piece["qx"], ey - piece["qy"]
            distance = piece["bend"] * math.sqrt(ex * ex + ey * ey)
            nx, ny = ex / distance, ey / distance
            gap = distance - piece["bend"] * piece["radius"] - body["r"][a]
        else:
            nx, ny = -piece["ty"], piece["tx"]
            gap = nx * (ex - piece["x"]) + ny * (ey - piece["y"]) - body["r"][a]
        lx, ly = rx - body["r"][a] * nx, ry - body["r"][a] * ny
        contact["gs"], contact["gc"] = ny * cx - nx * cy, nx * cx + ny * cy
    contact["depth_offset"] = contact["gap"] - gap
    contact["nx"], contact["ny"] = nx, ny
    contact["normal_lever"], contact["tangent_lever"] = lx * ny - ly * nx, -(lx * nx + ly * ny)


@kernel
def touching_place(motion: np.void, contact: np.void) -> tuple[float, float]:
    """Place [m] of the touching point of a contact that has been placed: that of the mass centre and its levers."""
    nx, ny = contact["nx"], contact["ny"]
    normal_lever, tangent_lever = contact["normal_lever"], contact["tangent_lever"]
    return (
        motion["x"] + normal_lever * ny - tangent_lever * nx,
        motion["y"] - normal_lever * nx - tangent_lever * ny,
    )


@kernel
def velocities(motion: np.void, contact: np.void) -> tuple[float, float]:
    """Gap rate and slip [m/s] of a contact that has been placed, from the motion of the body."""
    u, v, omega = motion["u"], motion["v"], motion["omega"]
    nx, ny = contact["nx"], contact["ny"]
    return nx * u + ny * v + contact["normal_lever"] * omega, ny * u - nx * v + contact["tangent_lever"] * omega


@kernel
def faces_arc(body: np.void, a: int, bx: float, by: float) -> bool:
    """Whether a place in the frame of the body lies within the angle of an arc, seen from its centre."""
    arcs = int(body["arcs"])
    if arcs == 1:
        return True
    before, ox, oy = (a - 1) % arcs, body["ox"], body["oy"]
    dx, dy = bx - body["cx"][a], by - body["cy"][a]
    near = AT_JOIN * (abs(dx) + abs(dy))
    from_low, to_high = oy[before] * dx - ox[before] * dy, ox[a] * dy - oy[a] * dx  # along the outline at both ends
    if body["half"][a] > 0.5 * math.pi:
        return bool(from_low >= -near or to_high >= -near)
    return bool(from_low >= -near and to_high >= -near)


@kernel
def faces_dip(body: np.void, piece: np.void, a: int, bx: float, by: float) -> bool:
    """Whether an arc may touch a round dip whose centre is at a place in the frame of the body.

    It faces away from there. Behind an end where a straight side begins, or an arc that is less round than the dip, it
    touches beside the other end of that.
    """
    arcs = int(body["arcs"])
    angle = angle_of(bx - body["cx"][a], by - body["cy"][a])
    turned = from_middle(body, a, angle)
    if abs(turned) <= body["half"][a] + AT_JOIN:
        return True
    edge, b = (a, (a + 1) % arcs) if turned > 0.0 else ((a - 1) % arcs, (a - 1) % arcs)
    if body["smooth"][edge] != 0.0 and can_touch(body, piece, b):
        return False
    return bool(abs(from_middle(body, b, angle)) <= body["half"][b] + AT_JOIN)


@kernel
def over_bend(pieces: np.ndarray, j: int, ex: float, ey: float, near: float) -> bool:
    """Whether a point, seen from the centre of a bend, lies between the normals of its pieces, but for ``near`` [m]."""
    before, after = pieces[j - 1], pieces[j]
    return bool(ex * before["tx"] + ey * before["ty"] >= -near and ex * after["tx"] + ey * after["ty"] <= near)
