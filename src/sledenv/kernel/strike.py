"""Rigid surfaces that touch: impacts of one point and of several, and what stays in contact after them."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.arithmetic import sine_cosine, wrap
from sledenv.kernel.books import side_that_lies
from sledenv.kernel.candidates import touches_beside
from sledenv.kernel.contacts import add, drop, order_last
from sledenv.kernel.frozen import hit_together
from sledenv.kernel.geometry import ARC_PIECE, arc_number, place, velocities
from sledenv.kernel.impact import ENERGETIC, MOST_PHASES, impact, softened
from sledenv.kernel.outline import arc_at
from sledenv.kernel.params import Incline, Limits
from sledenv.kernel.rebound import end_rebound, gap_to, put_down, separate, touches_end
from sledenv.kernel.records import MOST_CONTACTS, RUNNING, STEP_BUDGET, TUMBLED

MOST_STRIKES: Final = 10000  # impacts without a flight between them
NEARLY: Final = 1e-6  # of the size: stiff springs would touch with another point as close to the slope as this too
LEVEL: Final = 1e-12  # of the size: a point this close to the slope touches
JOLT: Final = 1e-12  # of the speed scale: approach of an impact that friction brings about
CLEAR: Final = 1e-9  # of the loads: no mode that is violated by more holds
AGAIN: Final = -1  # the contacts have changed: their mode is to be chosen anew
MOST_NORMAL: Final = 1e9  # times the weight and the centrifugal forces


@kernel
def pressing(slope: Incline, motion: np.void, contact: np.void) -> float:
    """Acceleration [m/s^2] with which a free body would press a contact onto the slope."""
    turning = motion["cosine"] * contact["gc"] + motion["sine"] * contact["gs"]
    gravity = slope.inward * contact["ny"] - slope.downhill * contact["nx"]
    return float(gravity + motion["omega"] * motion["omega"] * turning)


@kernel
def most_normal(body: np.void, slope: Incline, rebound: np.void) -> float:
    """Load [N] above which rigid surfaces count as having no finite one."""
    size, spin, slip = body["size"], rebound["omega"], rebound["slip"]
    return float(MOST_NORMAL * body["mass"] * (slope.inward + size * spin * spin + slip * slip / size))


@kernel
def _move_along(motion: np.void, contact: np.void) -> None:
    """Give the body the gap rate and the slip of a contact."""
    nx, ny, omega = contact["nx"], contact["ny"], motion["omega"]
    rate, slip = (
        contact["gap_rate"] - contact["normal_lever"] * omega,
        contact["slip"] - contact["tangent_lever"] * omega,
    )
    motion["u"], motion["v"] = nx * rate + ny * slip, ny * rate - nx * slip


@kernel
def _add_near(body: np.void, pieces: np.ndarray, space: np.void) -> bool:
    """Let the point across a straight side touch too, if it is nearly down; return whether all touch."""
    contacts, motion, flat = space["contacts"], space["motion"], True
    j = contacts["at"][0]["piece"]
    lowest = arc_at(body, wrap(motion["phi"] - pieces[j]["tilt"]))
    if body["sinks"][lowest] != 0.0:
        return True
    here = gap_to(body, pieces, motion, contacts["at"][0]["arc"], j)
    for other in (lowest, int(body["falling"][lowest]), int(body["rising"][lowest])):
        if other < 0 or contacts["count"] == MOST_CONTACTS:
            continue
        arc = arc_number(body, other)
        if touches_beside(body, contacts, arc, j):
            continue
        apart = abs(gap_to(body, pieces, motion, arc, j) - here)
        if apart <= NEARLY * body["size"]:
            add(body, pieces, space, ARC_PIECE, arc, j)
            flat = flat and apart <= LEVEL * body["size"]
    return flat


@kernel
def _lay_flat(body: np.void, pieces: np.ndarray, space: np.void) -> None:
    """Turn a body whose straight side is down so that neither end is lower."""
    contacts, motion = space["contacts"], space["motion"]
    arcs = int(body["arcs"])
    for c in range(contacts["count"]):
        one = contacts["at"][c]
        for q in range(contacts["count"]):
            two = contacts["at"][q]
            if (
                body["length"][one["arc"]] > 0.0
                and two["arc"] == (one["arc"] + 1) % arcs
                and two["normal_lever"] < one["normal_lever"]
            ):
                relative, flat = wrap(motion["phi"] - pieces[one["piece"]]["tilt"]), body["high"][one["arc"]]
                if abs(flat) == math.pi:  # and minus that, as in the mirror
                    flat = math.copysign(math.pi, relative)
                motion["phi"] -= wrap(relative - flat)
    motion["sine"], motion["cosine"] = sine_cosine(wrap(motion["phi"]))
    first = contacts["at"][0]
    place(body, pieces, motion, first)
    put_down(body, pieces, motion, first)
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        place(body, pieces, motion, contact)
        rate, slip = velocities(motion, contact)
        contact["gap_rate"] = rate if contact["gap_rate"] != 0.0 else 0.0
        contact["slip"] = slip if contact["slip"] != 0.0 else 0.0


@kernel
def _strike_one(body: np.void, slope: Incline, space: np.void) -> int:
    """Follow the impact of the one point that touches, in closed phases."""
    contact, motion, hit, ground = space["contacts"]["at"][0], space["motion"], space["hit"], space["ground"]
    rebound = space["rebound"]
    hit["size"], hit["per_mass"], hit["per_inertia"] = body["size"], 1.0 / body["mass"], 1.0 / body["inertia"]
    hit["a"], hit["b"], hit["friction"], hit["rolling_arm"] = (
        -contact["normal_lever"],
        contact["tangent_lever"],
        contact["friction"],
        contact["rolling_arm"],
    )
    hit["v_n"], hit["v_t"], hit["omega"] = contact["gap_rate"], contact["slip"], motion["omega"]
    restitution = ground["restitution"][contact["zone"]]
    hit["restitution"] = softened(restitution, ground["settle_speed"], hit["v_n"], pressing(slope, motion, contact))
    hit["sequence"] = rebound["sequence"]
    count = impact(ENERGETIC, hit, None)
    contact["gap_rate"], contact["slip"], motion["omega"] = hit["v_n"], hit["v_t"], hit["omega"]
    _move_along(motion, contact)
    rebound["sequence"] = hit["sequence"]
    rebound["normal_impulse"] += hit["normal_impulse"]
    rebound["tangential_impulse"] += hit["tangential_impulse"]
    rebound["rolling_impulse"] += hit["rolling_impulse"]
    rebound["hysteresis"] += hit["hysteresis"]
    rebound["sliding"] += hit["sliding"]
    rebound["rolling"] += hit["rolling"]
    return RUNNING if count <= MOST_PHASES else STEP_BUDGET


@kernel
def _lie_down(body: np.void, space: np.void) -> None:
    """Bring a body whose ends are slow to rest on them: what they have left is lost, and the slope gives the impulse.

    Impacts in turn would take ever less. Friction stops a slip that its share of the impulse can stop.
    """
    contacts, motion, rebound = space["contacts"], space["motion"], space["rebound"]
    first = contacts["at"][0]
    nx, ny = first["nx"], first["ny"]
    rate, along = nx * motion["u"] + ny * motion["v"], ny * motion["u"] - nx * motion["v"]
    omega = motion["omega"]
    rebound["hysteresis"] += 0.5 * (body["inertia"] * omega * omega + body["mass"] * rate * rate)
    rebound["normal_impulse"] -= body["mass"] * rate
    friction = math.inf
    for c in range(contacts["count"]):
        friction = min(friction, contacts["at"][c]["friction"])
    if abs(along) <= friction * abs(rate):
        rebound["sliding"] += 0.5 * body["mass"] * along * along
        rebound["tangential_impulse"] -= body["mass"] * along
        along = 0.0
    motion["omega"] = 0.0
    motion["u"], motion["v"] = ny * along, -nx * along
    for c in range(contacts["count"]):
        contacts["at"][c]["gap_rate"], contacts["at"][c]["slip"] = 0.0, along


@kernel
def _slip_with(body: np.void, motion: np.void, contact: np.void, first: np.void) -> None:
    """Let a contact slip as the first one does, with its lever."""
    contact["slip"], contact["tangent_lever"] = first["slip"], first["tangent_lever"]
    sine, cosine = motion["sine"], motion["cosine"]
    level = contact["tangent_lever"] - body["r"][contact["arc"]]  # of the centre of its arc
    contact["gs"] = contact["normal_lever"] * cosine - level * sine
    contact["gc"] = -contact["normal_lever"] * sine - level * cosine


@kernel
def _strike_all(body: np.void, pieces: np.ndarray, slope: Incline, space: np.void) -> int:
    """Follow the impact of all points that touch. A slow one is plastic if the body is pressed onto the slope."""
    contacts, motion = space["contacts"], space["motion"]
    fastest, left, right, closes = 0.0, False, False, False
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        fastest = max(fastest, abs(contact["gap_rate"]))
        left, right = left or contact["normal_lever"] < 0.0, right or contact["normal_lever"] > 0.0
        closes = closes or contact["gap_rate"] < 0.0
        _slip_with(body, motion, contact, contacts["at"][0])
    settles = pressing(slope, motion, contacts["at"][0]) > 0.0 and fastest < space["ground"]["settle_speed"]
    if settles and left and right:
        _lie_down(body, space)
    elif closes:
        if not hit_together(body, pieces, settles, space):
            return STEP_BUDGET
        for c in range(contacts["count"]):
            if contacts["at"][c]["gap_rate"] == 0.0:
                _move_along(motion, contacts["at"][c])
                break
    return RUNNING


@kernel
def _strike(body: np.void, pieces: np.ndarray, slope: Incline, jolted: bool, space: np.void) -> int:
    """Let rigid surfaces hit each other at the points that touch; then drop those that do not stay.

    Parameters
    ----------
    body : record of BODY
    pieces : ndarray of PIECE
    slope : Incline
    jolted : bool
        Whether no finite load keeps apart the one point that touches. Without an approach, forces that only grow very
        large would not act at all.
    space : record of SPACE

    Returns
    -------
    int
        RUNNING or STEP_BUDGET.
    """
    contacts, motion, rebound = space["contacts"], space["motion"], space["rebound"]
    space["strikes"] += 1
    space["undecided"] = 1
    if space["strikes"] > MOST_STRIKES:
        return STEP_BUDGET
    first, flat = contacts["at"][0], True
    if jolted:
        size = body["size"]
        scale = max(
            abs(first["gap_rate"]), abs(first["slip"]), size * abs(motion["omega"]), math.sqrt(slope.gravity * size)
        )
        first["gap_rate"] = min(first["gap_rate"], -JOLT * max(scale, JOLT))
    else:
        flat = _add_near(body, pieces, space)
    if contacts["count"] == 1:
        put_down(body, pieces, motion, first)
        return _strike_one(body, slope, space)
    if rebound["side"] == 0.0:
        rebound["side"] = side_that_lies(body, contacts)
    if flat:
        _lay_flat(body, pieces, space)
        order_last(contacts)
    status = _strike_all(body, pieces, slope, space)
    if not flat:  # the other end is off the slope
        contacts["count"] = 1
    return status


@kernel
def _drop_moving(contacts: np.void) -> None:
    """Take the contacts off the list whose gap is not still; one that closes will touch anew."""
    for c in range(contacts["count"] - 1, -1, -1):
        if contacts["at"][c]["gap_rate"] != 0.0:
            drop(contacts, c)


@kernel
def strike(
    body: np.void,
    pieces: np.ndarray,
    slope: Incline,
    limits: Limits,
    jolted: bool,
    flight: np.void,
    log: np.ndarray,
    space: np.void,
) -> int:
    """Let rigid surfaces hit each other, and go on with what stays in contact; return the status."""
    contacts = space["contacts"]
    status = _strike(body, pieces, slope, jolted, space)
    space["event"]["time"] = 0.0
    if status != RUNNING:
        return status
    if touches_end(body, limits, space):
        return TUMBLED
    slip = contacts["at"][0]["slip"]
    _drop_moving(contacts)
    return RUNNING if contacts["count"] > 0 else end_rebound(body, limits, slip, flight, log, space)


@kernel
def release_or_strike(
    body: np.void, pieces: np.ndarray, slope: Incline, limits: Limits, flight: np.void, log: np.ndarray, space: np.void
) -> int:
    """Let rigid contacts go that the chosen mode does not hold; an impact follows where no finite load holds them.

    Returns RUNNING if all are held, AGAIN if a mode is to be chosen anew, or the status with which the descent ends.
    """
    contacts, choice, motion = space["contacts"], space["choice"], space["motion"]
    leaving, count = 0, contacts["count"]
    for c in range(count):
        leaving += 1 if contacts["at"][c]["gap_sign"] > 0 else 0
    fails = choice["wrong"] > CLEAR * choice["scale"]
    if leaving == 0 and not fails:
        return RUNNING
    jolted = False
    if leaving == count or fails:
        jolted = slope.inward > 0.0 if count > 1 else pressing(slope, motion, contacts["at"][0]) > 0.0
        if jolted and count > 1:  # friction tips the body over the point ahead
            ahead = 0
            for c in range(count):
                if contacts["at"][c]["normal_lever"] * contacts["at"][c]["slip"] > 0.0:
                    ahead = c
            contacts["at"][0] = contacts["at"][ahead]
            contacts["count"] = 1
    if jolted:
        status = strike(body, pieces, slope, limits, True, flight, log, space)
    else:
        status = RUNNING
        for c in range(count - 1, -1, -1):
            if status == RUNNING and (fails or contacts["at"][c]["gap_sign"] > 0):
                status = separate(body, pieces, limits, c, flight, log, space)
    return AGAIN if status == RUNNING else status
