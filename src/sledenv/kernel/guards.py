"""The end of a step of the contacts that there are: guards, polynomials that are positive while the mode lasts.

Each guard tells how many of its leading coefficients are zero by construction, because what it watches has just begun
or been released. Each zero that is found shortens what the other guards look at.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.arithmetic import angle_of, sign_of
from sledenv.kernel.contacts import ORDER
from sledenv.kernel.expansion import COSINE, PHI, SINE, X, Y, measure_reach
from sledenv.kernel.geometry import (
    ARC_BEND,
    ARC_PIECE,
    ON_ARC,
    ON_BEGIN,
    ON_END,
    SIDE_BEND,
    can_touch,
    end_of_reach,
    mirrored,
)
from sledenv.kernel.mode import SHALLOW, all_friction
from sledenv.kernel.outline import from_middle
from sledenv.kernel.zeros import first_zero

(
    NOTHING,
    SEPARATION,
    GAP_ZERO,
    GAP_FREE,
    SLIP_ZERO,
    SLIP_FREE,
    SPIN_ZERO,
    SPIN_FREE,
    FEATURE,
    ZONE,
    TOUCH,
    FINISH,
) = range(12)
# Ends of the feature of a contact: the side of an event FEATURE.
(
    FOOT_BEGIN,  # the foot of an arc on a piece comes to the bend before,
    FOOT_END,  # or behind
    ARC_LOW,  # a piece comes to an end of an arc that another arc joins
    ARC_HIGH,
    BEND_BEGIN,  # the normal of an arc on a bend becomes that of the piece before,
    BEND_END,  # or of the one behind
    OF_ARC_LOW,  # a bend comes to an end of an arc
    OF_ARC_HIGH,
    SIDE_BEGIN,  # or of a side
    SIDE_END,
    NORMAL_BEGIN,  # a side on a bend is parallel to the piece before,
    NORMAL_END,  # or to the one behind
) = range(12)
TIED: Final = 1e-13  # part of a time: events nearer than this are at the same time, and the first in order counts
STILL: Final = 1e-15  # of the speed: a smaller rate of a gap is zero
STEADY_RATE: Final = 1e-14  # of the acceleration: a smaller rate of that rate is zero
AT_END: Final = 1e-11  # of the size, or [rad]: a feature as near as this to its end is there,
# A crest is seen to come to an end of an arc by the sine of the angle up to there, which tells one end from the other
# only within half a turn of each. No step turns the direction to a crest by as much as the second of these.
FLAT_ARC: Final = 1.0  # [rad] half of an arc whose ends can both be watched
OUT_OF_REACH: Final = 1.8  # [rad] an end that is further away is not
RESTING: Final = 1e-6  # and stays there in a step that does not move it by more than this part of that


@kernel
def shorten_to_first_root(space: np.void, zeros: int, code: int, who: int, side: int) -> None:
    """Let the step end where the polynomial ``space["poly"]`` has its first zero, if that comes before its end."""
    event = space["event"]
    t = first_zero(space["poly"], event["time"], zeros, space["stack"])
    if t < event["time"] * (1.0 - TIED) or (event["code"] == NOTHING and t < event["time"]):
        event["time"], event["code"], event["who"], event["side"] = t, code, who, side


@kernel
def is_rounding(body: np.void, term: float, k: int, space: np.void) -> bool:
    """Whether the term of order ``k``, 2 or 3, of a gap is no more than what rounding makes of a steady one.

    The loads of contacts that stay count too: they cancel the weight up to rounding.
    """
    s, contacts, pushes = space["series"], space["contacts"], 0.0
    for c in range(contacts["count"]):
        pushes += abs(s["of"][c]["normal"][k - 2])
    turning = body["size"] * max(abs(s["sine"][k]), abs(s["cosine"][k]))
    largest = max(abs(s["x"][k]), abs(s["y"][k]), turning, pushes * body["per_mass"] / (k * (k - 1)))
    return bool(abs(term) <= STEADY_RATE * largest)


@kernel
def first_term(body: np.void, space: np.void) -> int:
    """Order of the first term of a gap that begins at zero which is more than rounding, 3 at most."""
    poly, motion = space["poly"], space["motion"]
    speed = max(abs(motion["u"]), abs(motion["v"]), body["size"] * abs(motion["omega"]))
    if abs(poly[1]) > STILL * speed:
        return 1
    return 3 if is_rounding(body, poly[2], 2, space) else 2


@kernel
def _begun(poly: np.ndarray, zeros: int) -> int:
    """Leading coefficients to pass over of a load, or a bound on one, that begins with ``zeros`` of them, or more."""
    while zeros < 3 and poly[zeros] == 0.0:
        zeros += 1
    return zeros


@kernel
def _released(poly: np.ndarray) -> int:
    """Leading coefficients to pass over of a velocity that leaves zero.

    It starts without acceleration, but for the error of the time of its release. Two are passed over if what is left
    would have the wrong sign, and more where no load is there yet to drive it.
    """
    return 1 if poly[1] > 0.0 else _begun(poly, 2)


@kernel
def watch_gap(body: np.void, contact: np.void, terms: np.void, c: int, space: np.void) -> None:
    """Watch how a contact ends, and its gap rate."""
    poly = space["poly"]
    if contact["gap_sign"] != 0:
        for k in range(ORDER + 1):
            poly[k] = -terms["gap"][k]
        zeros = first_term(body, space) if contact["gap"] == 0.0 else 0
        if zeros > 0 and not poly[zeros] > 0.0:  # it has opened at the end of the step before
            space["event"]["time"], space["event"]["code"], space["event"]["who"] = 0.0, SEPARATION, c
        else:
            shorten_to_first_root(space, zeros, SEPARATION, c, 0)
    if contact["gap_still"] != 0 and contact["gap_sign"] != 0:
        return
    if contact["gap_sign"] != 0:
        elastic = contact["closing"] == contact["opening"]
        sign = sign_of(contact["gap_rate"]) if elastic else contact["gap_sign"]
        for k in range(ORDER + 1):
            poly[k] = sign * terms["gap_rate"][k]
        if sign != 0:
            shorten_to_first_root(space, _released(poly) if contact["gap_rate"] == 0.0 else 0, GAP_ZERO, c, 0)
        return
    shallow = 0.0 if space["frozen"] != 0 else SHALLOW * body["size"]  # as the mode has been chosen
    depth = -contact["gap"] if contact["gap"] < 0.0 else shallow
    for side in (-1, 1):
        bound = contact["closing"] if side < 0 else -contact["opening"]
        if bound == math.inf:  # of rigid surfaces
            continue
        for k in range(ORDER + 1):
            poly[k] = side * terms["normal"][k]
        poly[0] += bound * depth
        shorten_to_first_root(space, 0, GAP_FREE, c, side)


@kernel
def _is_fresh(contact: np.void) -> bool:
    """Whether a contact has just begun, so that its load is zero by construction; that of rigid surfaces is not."""
    return bool(contact["gap"] == 0.0 and contact["closing"] < math.inf)


@kernel
def watch_slip(contact: np.void, terms: np.void, c: int, space: np.void) -> None:
    """Watch the slip of a contact, or the friction that holds it."""
    poly, sign, contacts = space["poly"], contact["slip_sign"], space["contacts"]
    shared = contacts["slip_shared"] != 0
    if shared and c > 0:
        return
    friction = all_friction(contacts) if shared else contact["friction"]
    if not friction > 0.0 or (contact["slip_still"] != 0 and sign != 0):
        return
    if sign != 0:
        for k in range(ORDER + 1):
            poly[k] = sign * terms["slip"][k]
        shorten_to_first_root(space, _released(poly) if contact["slip"] == 0.0 else 0, SLIP_ZERO, c, 0)
        return
    first = mirrored(space["motion"])
    for side in (-first, first):
        for k in range(ORDER + 1):
            poly[k] = contact["friction"] * terms["normal"][k] + side * terms["force"][k]
        for q in range(1, contacts["count"] if shared else 0):
            other, of = contacts["at"][q], space["series"]["of"][q]
            for k in range(ORDER + 1):
                poly[k] += other["friction"] * of["normal"][k] + side * of["force"][k]
        shorten_to_first_root(space, _begun(poly, 1) if _is_fresh(contact) and not shared else 0, SLIP_FREE, c, side)


@kernel
def watch_spin(contacts: np.void, space: np.void) -> None:
    """Watch the spin, or the rolling resistance that holds it."""
    poly, s, sign = space["poly"], space["series"], contacts["spin_sign"]
    arms, fresh = 0.0, True
    for c in range(contacts["count"]):
        arms += contacts["at"][c]["rolling_arm"]
        fresh = fresh and _is_fresh(contacts["at"][c])
    if not arms > 0.0 or (contacts["spin_still"] != 0 and sign != 0):
        return
    if sign != 0:
        for k in range(ORDER + 1):
            poly[k] = sign * s["omega"][k]
        shorten_to_first_root(space, _released(poly) if s["omega"][0] == 0.0 else 0, SPIN_ZERO, 0, 0)
        return
    first = mirrored(space["motion"])
    for side in (-first, first):
        for k in range(ORDER + 1):
            poly[k] = side * s["moment"][k]
        for c in range(contacts["count"]):
            contact, normal = contacts["at"][c], s["of"][c]["normal"]
            for k in range(ORDER + 1):
                poly[k] += contact["rolling_arm"] * normal[k]
        shorten_to_first_root(space, _begun(poly, 1) if fresh else 0, SPIN_FREE, 0, side)


@kernel
def _watch_end(
    series: np.ndarray, factor: float, offset: float, near: float, code: int, c: int, side: int, space: np.void
) -> None:
    """Watch the end of a feature or of a zone: ``factor`` times a series and an ``offset`` are positive before it."""
    poly, event = space["poly"], space["event"]
    for k in range(ORDER + 1):
        poly[k] = factor * series[k]
    poly[0] += offset
    if poly[0] >= near:
        shorten_to_first_root(space, 0, code, c, side)
        return
    if code == FEATURE and side in (ARC_LOW, ARC_HIGH) and poly[0] < -near:
        return  # the far end of a straight side, in contact by itself
    moves = 0.0
    for k in range(ORDER, 0, -1):
        moves = (moves + abs(poly[k])) * event["time"]
    if abs(poly[0]) < near and moves < RESTING * near:
        return  # it stays at the end
    zeros = _begun(poly, 1)
    if poly[zeros] < 0.0:
        if event["time"] > 0.0:
            event["time"], event["code"], event["who"], event["side"] = 0.0, code, c, side
    elif poly[zeros] > 0.0 and poly[0] > -near:
        shorten_to_first_root(space, zeros, code, c, side)


@kernel
def _watch_foot(body: np.void, pieces: np.ndarray, contact: np.void, c: int, space: np.void) -> None:
    """Watch where an arc touches its piece, and which part of the arc does."""
    s, row, near = space["series"], space["terms"][0], AT_END * body["size"]
    a, piece, reach = contact["arc"], pieces[contact["piece"]], space["reach"]
    tx, ty, cx, cy = piece["tx"], piece["ty"], body["cx"][a], body["cy"][a]
    along_c, along_s = tx * cx + ty * cy, ty * cx - tx * cy
    foot = tx * (s["x"][0] - piece["x"]) + ty * (s["y"][0] - piece["y"])
    foot += along_c * s["cosine"][0] + along_s * s["sine"][0]
    moves = near + reach[X] + reach[Y] + body["h"][a] * (reach[SINE] + reach[COSINE])
    if foot - moves < piece["low"] or foot + moves > piece["high"]:  # else it stays on the piece
        low, begins = end_of_reach(body, pieces, a, contact["piece"], -1)
        high, ends = end_of_reach(body, pieces, a, contact["piece"], 1)
        if begins or ends:
            for k in range(ORDER + 1):
                row[k] = tx * s["x"][k] + ty * s["y"][k] + along_c * s["cosine"][k] + along_s * s["sine"][k]
            row[0] = foot
            if begins:
                _watch_end(row, 1.0, -low, near, FEATURE, c, FOOT_BEGIN, space)
            if ends:
                _watch_end(row, -1.0, high, near, FEATURE, c, FOOT_END, space)
    arcs = int(body["arcs"])
    before = body["smooth"][(a - 1) % arcs] != 0.0
    if arcs > 1 and (before or body["smooth"][a] != 0.0):
        angle = from_middle(body, a, s["phi"][0] - piece["tilt"])
        if abs(angle) + reach[PHI] + AT_END < body["half"][a]:
            return
        for k in range(1, ORDER + 1):
            row[k] = s["phi"][k]
        row[0] = angle
        if before:
            _watch_end(row, 1.0, body["half"][a], AT_END, FEATURE, c, ARC_LOW, space)
        if body["smooth"][a] != 0.0:
            _watch_end(row, -1.0, body["half"][a], AT_END, FEATURE, c, ARC_HIGH, space)


@kernel
def _watch_side(body: np.void, pieces: np.ndarray, contact: np.void, terms: np.void, c: int, space: np.void) -> None:
    """Watch where a side touches a bend, and which part of the bend: its arc, or the point where that ends."""
    s, row, near = space["series"], space["terms"][0], AT_END * body["size"]
    i, j, part = contact["arc"], contact["piece"], contact["bend_part"]
    ox, oy = body["ox"][i], body["oy"][i]
    for k in range(ORDER + 1):
        row[k] = oy * terms["bx"][k] - ox * terms["by"][k]
    begin = oy * body["sx"][i] - ox * body["sy"][i]
    _watch_end(row, 1.0, -begin, near, FEATURE, c, SIDE_BEGIN, space)
    _watch_end(row, -1.0, begin + body["length"][i], near, FEATURE, c, SIDE_END, space)
    if pieces[j]["radius"] == 0.0:
        return
    for end in (NORMAL_BEGIN, NORMAL_END):
        if part == (ON_END if end == NORMAL_BEGIN else ON_BEGIN):
            continue
        piece = pieces[j - 1] if end == NORMAL_BEGIN else pieces[j]
        along_s, along_c = ox * piece["ty"] - oy * piece["tx"], ox * piece["tx"] + oy * piece["ty"]
        for k in range(ORDER + 1):  # the normal along the tangent of the piece
            row[k] = -(along_c * s["cosine"][k] + along_s * s["sine"][k])
        inside = 1.0 if end == NORMAL_BEGIN else -1.0
        if part == ON_ARC:
            _watch_end(row, inside, 0.0, AT_END, FEATURE, c, end, space)
        else:  # back onto the arc
            _watch_end(row, -inside, 0.0, AT_END, FEATURE, c, NORMAL_END if part == ON_BEGIN else NORMAL_BEGIN, space)


@kernel
def _watch_bend(body: np.void, pieces: np.ndarray, contact: np.void, terms: np.void, c: int, space: np.void) -> None:
    """Watch where an arc touches a bend, to which of its pieces the normal comes, and to which end of the arc."""
    row, near = space["terms"][0], AT_END * body["size"]
    a, j = contact["arc"], contact["piece"]
    before, after, sign = pieces[j - 1], pieces[j], pieces[j]["bend"]
    for k in range(ORDER + 1):
        row[k] = before["tx"] * terms["dx"][k] + before["ty"] * terms["dy"][k]
    _watch_end(row, 1.0, 0.0, near, FEATURE, c, BEND_BEGIN, space)
    for k in range(ORDER + 1):
        row[k] = after["tx"] * terms["dx"][k] + after["ty"] * terms["dy"][k]
    _watch_end(row, -1.0, 0.0, near, FEATURE, c, BEND_END, space)
    arcs = int(body["arcs"])
    if arcs == 1:
        return
    cx, cy, angle = body["cx"][a], body["cy"][a], 0.0
    if body["half"][a] > FLAT_ARC:
        angle = from_middle(body, a, angle_of(sign * (cx - terms["bx"][0]), sign * (cy - terms["by"][0])))
    for end in range(2):  # the direction along the outline at each end of the arc
        if body["half"][a] + (angle if end == 0 else -angle) > OUT_OF_REACH:
            continue
        edge = a if end == 1 else (a - 1) % arcs
        # In a dip sides touch with their ends, and so do arcs that are less round than it.
        if sign < 0 and not (
            body["smooth"][edge] != 0.0 and can_touch(body, after, (a + 1 if end == 1 else a - 1) % arcs)
        ):
            continue
        dx, dy = sign * body["oy"][edge], -sign * body["ox"][edge]
        for k in range(ORDER + 1):
            row[k] = dx * terms["bx"][k] + dy * terms["by"][k]
        row[0] -= dx * cx + dy * cy
        _watch_end(row, -1.0 if end == 1 else 1.0, 0.0, near, FEATURE, c, OF_ARC_LOW + end, space)


@kernel
def _watch_zone(body: np.void, pieces: np.ndarray, contact: np.void, terms: np.void, c: int, space: np.void) -> None:
    """Watch where the touching point of a contact passes into another zone; that on a sharp crest stays."""
    ground, s, row = space["ground"], space["series"], space["terms"][0]
    kind, i, zone = contact["kind"], contact["arc"], contact["zone"]
    if not ground["count"] > 1.0 or (kind != ARC_PIECE and pieces[contact["piece"]]["radius"] == 0.0):
        return
    if kind == SIDE_BEND and contact["bend_part"] != ON_ARC:
        return
    for k in range(ORDER + 1):
        if kind == SIDE_BEND:
            row[k] = -pieces[contact["piece"]]["radius"] * (
                body["ox"][i] * s["cosine"][k] - body["oy"][i] * s["sine"][k]
            )
        else:
            row[k] = s["x"][k] + body["cx"][i] * s["cosine"][k] - body["cy"][i] * s["sine"][k]
            if kind == ARC_BEND:
                row[k] -= body["r"][i] * terms["nx"][k]
    if kind == SIDE_BEND:
        row[0] += pieces[contact["piece"]]["qx"]
    elif kind == ARC_PIECE:
        row[0] -= body["r"][i] * contact["nx"]
    near = AT_END * body["size"]
    if zone > 0:
        _watch_end(row, 1.0, -ground["begin"][zone], near, ZONE, c, -1, space)
    if zone + 1 < ground["count"]:
        _watch_end(row, -1.0, ground["begin"][zone + 1], near, ZONE, c, 1, space)


@kernel
def watch_contacts(body: np.void, pieces: np.ndarray, space: np.void) -> None:
    """Let the step end with the first event of the contacts that there are."""
    contacts = space["contacts"]
    measure_reach(space)
    for c in range(contacts["count"]):
        contact, terms = contacts["at"][c], space["series"]["of"][c]
        watch_gap(body, contact, terms, c, space)
        watch_slip(contact, terms, c, space)
        if contact["kind"] == ARC_PIECE:
            _watch_foot(body, pieces, contact, c, space)
        elif contact["kind"] == ARC_BEND:
            _watch_bend(body, pieces, contact, terms, c, space)
        else:
            _watch_side(body, pieces, contact, terms, c, space)
        _watch_zone(body, pieces, contact, terms, c, space)
    if contacts["count"] > 0:
        watch_spin(contacts, space)


@kernel
def watch_finish(space: np.void) -> None:
    """Let the step end where the mass centre comes to the end of the slope, or of the run-out behind it."""
    if space["finish"] < 1e300:
        poly, s = space["poly"], space["series"]
        for k in range(ORDER + 1):
            poly[k] = -s["x"][k]
        poly[0] += space["finish"]
        shorten_to_first_root(space, 0, FINISH, 0, 0)
