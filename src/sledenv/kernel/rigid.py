"""The touch of rigid surfaces: impacts, and the sustained contact that they may settle into."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import scalar, straight
from sledenv.kernel import normal
from sledenv.kernel.flat import ENDS, Side, hit_flat
from sledenv.kernel.ground import arm_on, piece_at, restitution_on
from sledenv.kernel.impact import ENERGETIC, MOST_PHASES, impact, softened
from sledenv.kernel.outline import whole_turns, within
from sledenv.kernel.params import Incline, RigidLaw
from sledenv.kernel.progress import NEARLY, arms_now, beside_now, change_point
from sledenv.kernel.records import INCONSISTENT, RUNNING, SEPARATED, STEP_BUDGET
from sledenv.kernel.state import SUMS, add, copy, followed_by

MOST_STRIKES = 10000  # impacts without a flight between them
LEVEL = 1e-12  # of the size: a corner this close to the slope touches
JOLT = 1e-12  # of the speed scale: approach of an impact that friction brings about
MOST_NORMAL = 1e9  # times the weight and the centrifugal forces

# No code of a phase.
_with_side = scalar(lambda sequence, arc, other: (followed_by(sequence, 20.0 + arc + 16.0 * other),))


def _bringing(contact: Any, point: Any, hop: Any) -> None:
    """Program that hands over to an impact what a point does."""
    copy(point, hop, ("v_t", "v_n"))
    copy(contact, hop, ("omega", "sequence"))


def _bringing_back(contact: Any, point: Any, hop: Any) -> None:
    """Program that takes over from an impact what a point does after it, and books the impact."""
    copy(hop, point, ("v_t", "v_n"))
    copy(hop, contact, ("omega", "sequence"))
    add(hop, contact, SUMS)


_hand_over, _take_over = straight(_bringing), straight(_bringing_back)


@kernel
def write_rigid(body: np.void, slope: Incline, contact: np.void, point: np.void) -> None:
    """Write how rigid surfaces meet."""
    size, spin, slip = body["size"], contact["omega"], point["v_t"]
    most = MOST_NORMAL * body["mass"] * (slope.inward + size * spin * spin + slip * slip / size)
    normal.write_rigid(most, contact)


@kernel
def _hit(body: np.void, a: float, b: float, restitution: float, space: np.void) -> int:
    """Follow one impact of the arc that touches, whose arms are given. Return the number of phases."""
    contact, point, hop = space["contact"], space["points"][0], space["hop"]
    hop["a"], hop["b"] = a, b
    piece = int(point["piece"])
    hop["friction"], hop["restitution"] = space["ground"]["friction"][piece], restitution
    hop["arm"] = arm_on(body, int(point["arc"]), space["ground"], piece)
    _hand_over(contact, point, hop)
    count = impact(ENERGETIC, hop, None)
    _take_over(contact, point, hop)
    return count


@kernel
def _account(body: np.void, side: Side, u: float, v: float, omega: float, space: np.void) -> None:
    """Add up impulses and losses of a side that has hit flat, from the motion of the body before."""
    contact, ends, lost = space["contact"], space["ends"], space["lost_flat"]
    now, gap_rate = ends[5], ends[2]
    change_u, change_v = ends[4] - side.b * now - u, gap_rate + side.a_1 * now - v
    before = side.mass * (u * u + v * v) + body["inertia"] * omega * omega
    then_u, then_v = u + change_u, v + change_v
    after = side.mass * (then_u * then_u + then_v * then_v) + body["inertia"] * now * now
    contact["normal_impulse"] += side.mass * change_v
    contact["tangential_impulse"] += side.mass * change_u
    contact["hysteresis"] += lost[0]
    contact["rolling"] += lost[1]
    contact["rolling_impulse"] += lost[2]
    contact["sliding"] += max(0.5 * (before - after) - lost[0] - lost[1], 0.0)


@kernel
def _lie_down(body: np.void, v: float, b: float, space: np.void) -> None:
    """Bring a body whose ends are slow to rest on both: what they have left is lost, and the slope gives the impulse.

    ``v`` [m/s] is how fast the mass centre rises, ``b`` [m] its height. Impacts in turn would take ever less.
    """
    contact, point, ends = space["contact"], space["points"][0], space["ends"]
    omega = contact["omega"]
    contact["hysteresis"] += 0.5 * (body["inertia"] * omega * omega + body["mass"] * v * v)
    contact["normal_impulse"] -= body["mass"] * v
    point["v_t"] -= b * omega
    point["v_n"] = contact["omega"] = ends[2] = ends[3] = ends[5] = 0.0


@kernel
def _strike_flat(body: np.void, law: RigidLaw, pressing: float, other: int, flat: bool, space: np.void) -> int:
    """Follow the impact of a side that has come down with both its ends, of which ``other`` is not the contact's.

    If the side is not quite ``flat``, the other end hits too, but it cannot stay. An impact slower than
    ``law.settle_speed`` is plastic if the body is pressed onto the slope. The result is that of :func:`_strike_once`.
    """
    contact, point, ends = space["contact"], space["points"][0], space["ends"]
    arc, omega = int(point["arc"]), contact["omega"]
    a_1, b = arms_now(body, arc, contact)
    a_2, _ = arms_now(body, other, contact)
    u, v = point["v_t"] - b * omega, point["v_n"] + a_1 * omega
    there = v - a_2 * omega
    ends[0], ends[1], ends[2], ends[3], ends[4], ends[5] = 0.0, 0.0, point["v_n"], there, point["v_t"], omega
    settles = pressing > 0.0 and max(abs(point["v_n"]), abs(there)) < law.settle_speed
    ground = space["ground"]
    piece_1, piece_2 = int(point["piece"]), piece_at(ground, contact["x"] - a_2)
    # Ends in two zones have the larger one, so that the mirror image agrees.
    bouncing = max(restitution_on(ground, piece_1, law.restitution), restitution_on(ground, piece_2, law.restitution))
    restitution = 0.0 if settles else bouncing
    if settles and a_1 * a_2 < 0.0:
        _lie_down(body, v, b, space)
    elif min(point["v_n"], there) < 0.0:
        side = Side(
            body["mass"],
            1.0 / body["inertia"],
            a_1,
            a_2,
            b,
            ground["friction"][piece_1],
            ground["friction"][piece_2],
            arm_on(body, arc, ground, piece_1),
            arm_on(body, other, ground, piece_2),
            body["size"],
            restitution**2,
        )
        first = -1 if contact["phi"] < 0.0 else 1
        if hit_flat(side, first, ends, space["lost_flat"], space["flat"]) != ENDS:
            return STEP_BUDGET
        _account(body, side, u, v, omega, space)
        contact["sequence"] = _with_side(contact["sequence"], arc, other)[0]
        point["v_n"], point["v_t"], contact["omega"] = ends[2], ends[4], ends[5]
    if flat and ends[3] == 0.0:
        if ends[2] == 0.0:
            contact["count"] = 2.0
        else:
            change_point(body, other, contact, point)
            point["piece"], point["v_n"] = piece_2, 0.0
    return RUNNING if point["v_n"] == 0.0 else SEPARATED


@kernel
def _local(body: np.void, contact: np.void, arc: int) -> float:
    """Orientation [rad] of a contact within the interval of an arc."""
    phi = contact["phi"] - whole_turns(contact["phi"])
    return float(phi - within(body, arc, phi))


@kernel
def _strike_once(body: np.void, law: RigidLaw, slope: Incline, a: float, b: float, alone: bool, space: np.void) -> int:
    """Follow the impact of one point whose arms are given, or of two if both are down and not left ``alone``.

    An impact slower than ``law.settle_speed`` is plastic if the body is pressed onto the slope; that ends the infinite
    sequence of ever smaller bounces (docs/physics.md, section 6).

    Returns
    -------
    int
        SEPARATED, RUNNING (one point stays, or both: ``contact["count"]``) or STEP_BUDGET.
    """
    contact, point = space["contact"], space["points"][0]
    arc, omega = int(point["arc"]), contact["omega"]
    pressing = slope.inward + (body["r"][arc] - b) * omega * omega
    if alone:  # without an approach, forces that only grow very large would not act at all
        point["v_n"] = min(point["v_n"], -JOLT * contact["scale"])
    other, apart, rises = beside_now(body, arc, contact["phi"])
    if not alone and abs(apart) <= NEARLY * body["size"] and body["sinks"][arc] == 0.0:
        contact["side_touched"] = (body["rising_side"] if rises else body["falling_side"])[arc]
        flat = abs(apart) <= LEVEL * body["size"]
        if flat:  # neither end lies below the slope
            contact["phi"] += (body["high"][arc] if rises else body["low"][arc]) - _local(body, contact, arc)
        return _strike_flat(body, law, pressing, other, flat, space)
    bouncing = restitution_on(space["ground"], int(point["piece"]), law.restitution)
    restitution = softened(bouncing, law.settle_speed, point["v_n"], pressing)
    if _hit(body, a, b, restitution, space) > MOST_PHASES:
        return STEP_BUDGET
    return SEPARATED if point["v_n"] > 0.0 else RUNNING


@kernel
def strike(body: np.void, law: RigidLaw, slope: Incline, left: int, space: np.void) -> int:
    """Let rigid surfaces hit each other.

    Parameters
    ----------
    body : record of BODY
    law, slope
        See :mod:`sledenv.kernel.params`.
    left : int
        RUNNING at a touchdown; or the status with which :func:`sledenv.kernel.contact.follow` has left the contact.
    space : record of SPACE
        Its ``contact`` holds the state, its ``hop`` the body.

    Returns
    -------
    int
        RUNNING if the surfaces stay in contact, ``contact["count"]`` points of them; SEPARATED or STEP_BUDGET.
    """
    contact, point = space["contact"], space["points"][0]
    a, b = space["touchdown"]["a"], space["touchdown"]["b"]
    if left == RUNNING:
        write_rigid(body, slope, contact, point)
        contact["peak_force"] = math.inf
        space["strikes"] = 0.0
        point["piece"] = piece_at(space["ground"], contact["x"] - a)
    else:  # it keeps its piece of the ground: rounding may have left it short of the boundary that it has just passed
        a, b = arms_now(body, int(point["arc"]), contact)
    space["strikes"] += 1.0
    if space["strikes"] > MOST_STRIKES:
        return STEP_BUDGET
    contact["count"], contact["held"] = 1.0, 0.0
    return _strike_once(body, law, slope, a, b, left == INCONSISTENT, space)
