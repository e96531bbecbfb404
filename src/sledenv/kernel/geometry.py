"""What touches what: the pieces of a profile, the features of a body, and how a contact of the two lies.

A contact is one of three kinds: an arc on a piece, an arc on a crest, a straight side on a crest. ``n`` is its unit
normal out of the ground, ``t`` the normal turned by -90 degrees, ``l`` the lever from the mass centre to the touching
point on the body: docs/physics.md, section 12.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.arithmetic import angle_of, sine_cosine, wrap
from sledenv.kernel.outline import from_middle

ARC_PIECE, ARC_CREST, SIDE_CREST = range(3)
SAME_PLACE: Final = 1e-12  # of the size: two places nearer than this are one
AT_JOIN: Final = 1e-11  # [rad], or of the size: features overlap by this, so that rounding leaves nothing between them

# A piece of the ground, with the vertex where it begins (of the first piece: where it ends).
PIECE: Final = np.dtype(
    [
        ("x", "f8"),  # [m] the vertex
        ("y", "f8"),
        ("tx", "f8"),  # [-] unit tangent, down the slope
        ("ty", "f8"),
        ("tilt", "f8"),  # [rad] its angle to the plane
        ("turn", "f8"),  # [-] sine of the turn at the vertex where it begins: > 0 in a dip, < 0 on a crest
        ("low", "f8"),  # [m] where it begins and ends along its tangent, seen from the vertex
        ("high", "f8"),
        # The same of the run of pieces that dips join to it: seen from the body they are one convex ground.
        ("run_low", "f8"),
        ("run_high", "f8"),
    ],
    align=True,
)


@kernel
def lay(vertices: np.ndarray, pieces: np.ndarray) -> None:
    """Write the pieces of a profile.

    Parameters
    ----------
    vertices : ndarray, shape (n, 2)
        Places along and heights over the plane of the slope [m].
    pieces : ndarray of PIECE, shape (n + 1,)
    """
    n = vertices.shape[0]
    for j in range(n + 1):
        piece = pieces[j]
        piece["x"] = piece["y"] = piece["ty"] = piece["turn"] = piece["tilt"] = 0.0
        piece["tx"], piece["low"], piece["high"] = 1.0, 0.0, math.inf
        if n > 0:
            piece["x"], piece["y"] = vertices[max(j - 1, 0), 0], vertices[max(j - 1, 0), 1]
        if 0 < j < n:
            along, up = vertices[j, 0] - vertices[j - 1, 0], vertices[j, 1] - vertices[j - 1, 1]
            length = math.sqrt(along * along + up * up)
            piece["tx"], piece["ty"], piece["high"] = along / length, up / length, length
            piece["tilt"] = angle_of(up, along)
    pieces[0]["low"] = -math.inf
    if n > 0:
        pieces[0]["high"] = 0.0
    for j in range(1, n + 1):
        a, b = pieces[j - 1], pieces[j]
        b["turn"] = a["tx"] * b["ty"] - a["ty"] * b["tx"]
    first = 0
    for j in range(n + 1):
        if j == n or pieces[j + 1]["turn"] < 0.0:  # a run ends
            for k in range(first, j + 1):
                piece = pieces[k]
                begin, end = pieces[max(first, 1) if n > 0 else 0], pieces[min(j + 1, n)]
                piece["run_low"] = piece["run_high"] = math.inf
                if first == 0:
                    piece["run_low"] = -math.inf
                elif k == first:
                    piece["run_low"] = piece["low"]
                else:
                    piece["run_low"] = along_piece(piece, begin["x"], begin["y"])
                if j < n:
                    piece["run_high"] = piece["high"] if k == j else along_piece(piece, end["x"], end["y"])
            first = j + 1


@kernel
def along_piece(piece: np.void, x: float, y: float) -> float:
    """Place [m] along a piece, seen from its vertex, of the foot of a point."""
    return piece["tx"] * (x - piece["x"]) + piece["ty"] * (y - piece["y"])  # type: ignore[no-any-return]


@kernel
def first_piece(pieces: np.ndarray, x: float) -> int:
    """Number of the piece over which a place [m] along the plane lies."""
    low, high = 0, pieces.shape[0] - 1
    while low < high:
        middle = (low + high + 1) // 2
        if pieces[middle]["x"] <= x:
            low = middle
        else:
            high = middle - 1
    return low


@kernel
def height_at(pieces: np.ndarray, x: float) -> float:
    """Height [m] of the ground at a place along the plane."""
    return _height(pieces[first_piece(pieces, x)], x)


@kernel
def heights_within(pieces: np.ndarray, x: float, reach: float) -> tuple[float, float]:
    """Lowest and highest height [m] of the ground within ``reach`` [m] of a place along the plane."""
    j = first_piece(pieces, x - reach)
    lowest = highest = _height(pieces[j], x - reach)
    while j + 1 < pieces.shape[0] and pieces[j + 1]["x"] <= x + reach:
        j += 1
        lowest, highest = min(lowest, pieces[j]["y"]), max(highest, pieces[j]["y"])
    end = _height(pieces[j], x + reach)
    return min(lowest, end), max(highest, end)


@kernel
def _height(piece: np.void, x: float) -> float:
    return float(piece["y"] + (x - piece["x"]) * (piece["ty"] / piece["tx"]))


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
def place(body: np.void, pieces: np.ndarray, motion: np.void, contact: np.void) -> None:
    """Write normal and levers of a contact where the body is, and how much deeper it is than its gap tells."""
    a = contact["arc"]
    piece = pieces[contact["piece"]]
    s, cosine = motion["sine"], motion["cosine"]
    px, py = piece["x"] - motion["x"], piece["y"] - motion["y"]
    if contact["kind"] == SIDE_CREST:
        ox, oy = body["ox"][a], body["oy"][a]
        nx, ny = -(cosine * ox - s * oy), -(s * ox + cosine * oy)
        gap = ox * (cosine * px + s * py - body["sx"][a]) + oy * (cosine * py - s * px - body["sy"][a])
        lx, ly = px + gap * nx, py + gap * ny
    else:
        cx, cy = body["cx"][a], body["cy"][a]
        rx, ry = cosine * cx - s * cy, s * cx + cosine * cy
        ex, ey = rx - px, ry - py
        if contact["kind"] == ARC_CREST:
            distance = math.sqrt(ex * ex + ey * ey)
            nx, ny = ex / distance, ey / distance
        else:
            nx, ny = -piece["ty"], piece["tx"]
            distance = nx * ex + ny * ey
        gap = distance - body["r"][a]
        lx, ly = rx - body["r"][a] * nx, ry - body["r"][a] * ny
        contact["gs"], contact["gc"] = ny * cx - nx * cy, nx * cx + ny * cy
    contact["deeper"] = contact["gap"] - gap
    contact["nx"], contact["ny"] = nx, ny
    contact["ln"], contact["lt"] = lx * ny - ly * nx, -(lx * nx + ly * ny)


@kernel
def touching_place(motion: np.void, contact: np.void) -> tuple[float, float]:
    """Place [m] of the touching point of a contact that has been placed: its lever in terms of ``ln`` and ``lt``."""
    nx, ny, ln, lt = contact["nx"], contact["ny"], contact["ln"], contact["lt"]
    return motion["x"] + ln * ny - lt * nx, motion["y"] - ln * nx - lt * ny


@kernel
def velocities(motion: np.void, contact: np.void) -> tuple[float, float]:
    """Gap rate and slip [m/s] of a contact that has been placed, from the motion of the body."""
    u, v, omega = motion["u"], motion["v"], motion["omega"]
    nx, ny = contact["nx"], contact["ny"]
    return nx * u + ny * v + contact["ln"] * omega, ny * u - nx * v + contact["lt"] * omega


@kernel
def faces_arc(body: np.void, a: int, bx: float, by: float) -> bool:
    """Whether a place in the frame of the body lies within the angle of an arc, seen from its centre."""
    angle = from_middle(body, a, angle_of(body["cx"][a] - bx, body["cy"][a] - by))
    return bool(abs(angle) <= body["half"][a] + AT_JOIN)


@kernel
def in_cone(body: np.void, pieces: np.ndarray, a: int, j: int, bx: float, by: float, phi: float) -> bool:
    """Whether the centre of an arc lies between the normals of a crest, whose place is in the frame of the body.

    ``phi`` [rad] is the orientation of the body.
    """
    ex, ey = body["cx"][a] - bx, body["cy"][a] - by
    s, c = sine_cosine(wrap(phi))
    fx, fy = c * ex - s * ey, s * ex + c * ey
    before, after = pieces[j - 1], pieces[j]
    return bool(fx * before["tx"] + fy * before["ty"] >= 0.0 and fx * after["tx"] + fy * after["ty"] <= 0.0)
