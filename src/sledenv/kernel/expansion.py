"""The motion of a body and its contacts as power series in time: one recurrence for any list of contacts, and for none.

Terms of order k of the forces give terms of order k + 1 of the velocities, and those the terms of order k + 2 of the
places: docs/physics.md (5.3). All arcs share the series of sine and cosine of the orientation.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.air import drag_term
from sledenv.kernel.arithmetic import sixteenth_root
from sledenv.kernel.contacts import ORDER, PER
from sledenv.kernel.geometry import ARC_BEND, ARC_PIECE, SIDE_BEND
from sledenv.kernel.mode import GAP, SPIN, find_locks, solve_locks

MOST_TURN: Final = 1.0  # [rad] of a body in a step: the first term left out of sine and cosine is then 3e-15
OF_BEND: Final = 0.2  # part of the distance from the centre of a bend to that of an arc that a step may go
OF_LOAD: Final = 1e3  # times the tolerance: part of a locked load that its last terms may be
OF_AIR: Final = 1e-5  # times the last terms of the speed at least: they count as drag does beside the weight
LONGEST: Final = 1e17  # [s] a step, so that all of its powers are finite
X, Y, SINE, COSINE, PHI = range(5)  # of ``space["reach"]`` and ``space["late"]``


@kernel
def value(series: np.ndarray, t: float) -> float:
    """Value of a power series of order ORDER."""
    total = 0.0
    for k in range(ORDER, -1, -1):
        total = total * t + series[k]
    return total


@kernel
def product(p: np.ndarray, q: np.ndarray, k: int) -> float:
    """Term of order ``k`` of a product of two series."""
    total = 0.0
    for i in range(k + 1):
        total += p[i] * q[k - i]
    return total


@kernel
def place_in_body(px: float, py: float, s: np.void, bx: np.ndarray, by: np.ndarray, k: int) -> None:
    """Write the term of order ``k`` of a place of the ground in the frame of the body."""
    x, y, sine, cosine = s["x"], s["y"], s["sine"], s["cosine"]
    px, py = px - x[0], py - y[0]
    along, across = cosine[k] * px + sine[k] * py, cosine[k] * py - sine[k] * px
    for i in range(1, k + 1):
        along -= x[i] * cosine[k - i] + y[i] * sine[k - i]
        across -= y[i] * cosine[k - i] - x[i] * sine[k - i]
    bx[k], by[k] = along, across


@kernel
def _arc_on_bend(body: np.void, contact: np.void, s: np.void, terms: np.void, k: int) -> None:
    """Write terms of order ``k`` of gap rate and slip, and of order ``k + 1`` of distance and normal."""
    a, m = contact["arc"], k + 1
    dx, dy, distance, nx, ny = terms["dx"], terms["dy"], terms["distance"], terms["nx"], terms["ny"]
    dx[m] = s["x"][m] + s["cosine"][m] * body["cx"][a] - s["sine"][m] * body["cy"][a]
    dy[m] = s["y"][m] + s["sine"][m] * body["cx"][a] + s["cosine"][m] * body["cy"][a]
    square = 0.0
    for i in range(m + 1):
        square += dx[i] * dx[m - i] + dy[i] * dy[m - i]
    for i in range(1, m):
        square -= distance[i] * distance[m - i]
    distance[m] = square / (2.0 * distance[0])
    along, up = contact["bend"] * dx[m], contact["bend"] * dy[m]
    for i in range(1, m + 1):
        along -= distance[i] * nx[m - i]
        up -= distance[i] * ny[m - i]
    nx[m], ny[m] = along / distance[0], up / distance[0]
    slip = body["r"][a] * s["omega"][k]
    for i in range(m):
        slip += (m - i) * (ny[i] * dx[m - i] - nx[i] * dy[m - i])
    terms["gap_rate"][k], terms["slip"][k] = contact["bend"] * (m * distance[m]), slip


@kernel
def _velocities_on_bend(body: np.void, contact: np.void, s: np.void, terms: np.void, k: int) -> None:
    """Write terms of order ``k`` of gap rate and slip where a bend touches, and what they need."""
    a, m, bx, by = contact["arc"], k + 1, terms["bx"], terms["by"]
    place_in_body(contact["qx"], contact["qy"], s, bx, by, m)
    if contact["kind"] == ARC_BEND:
        _arc_on_bend(body, contact, s, terms, k)
        return
    ox, oy = body["ox"][a], body["oy"][a]
    terms["gap_rate"][k] = m * (ox * bx[m] + oy * by[m])
    turning = product(terms["gap"], s["omega"], k) + (contact["radius"] - contact["depth_offset"]) * s["omega"][k]
    terms["slip"][k] = m * (oy * bx[m] - ox * by[m]) - turning


@kernel
def _terms_of_velocities(body: np.void, contact: np.void, s: np.void, terms: np.void, k: int) -> None:
    """Write terms of order ``k`` of gap rate and slip of a contact from those of the motion, and what they need."""
    if contact["kind"] != ARC_PIECE:
        _velocities_on_bend(body, contact, s, terms, k)
        return
    nx, ny, gs, gc = contact["nx"], contact["ny"], contact["gs"], contact["gc"]
    u, v, sw, cw = s["u"][k], s["v"][k], s["sw"][k], s["cw"][k]
    terms["gap_rate"][k] = (nx * u + ny * v) + (gs * cw - gc * sw)
    terms["slip"][k] = (ny * u - nx * v) - (gc * cw + gs * sw) + body["r"][contact["arc"]] * s["omega"][k]


@kernel
def _lock_terms(contact: np.void, terms: np.void, k: int) -> None:
    """Make terms of velocities that stay zero exactly zero, and write the term of the gap after them."""
    if contact["gap_still"] != 0:
        terms["gap_rate"][k] = 0.0
    if contact["slip_still"] == 1:
        terms["slip"][k] = 0.0
    terms["gap"][k + 1] = terms["gap_rate"][k] * PER[k + 1]


@kernel
def _terms_of_places(frozen: int, s: np.void, k: int) -> None:
    """Write terms of order ``k`` of where the body is, from those of its velocities; if ``frozen`` is 1 it is there."""
    per = PER[k] if frozen == 0 else 0.0
    s["x"][k], s["y"][k], s["phi"][k] = s["u"][k - 1] * per, s["v"][k - 1] * per, s["omega"][k - 1] * per
    s["sine"][k], s["cosine"][k] = s["cw"][k - 1] * per, -s["sw"][k - 1] * per


@kernel
def _begin(body: np.void, frozen: int, motion: np.void, contacts: np.void, s: np.void) -> None:
    """Write the first terms of all series."""
    s["x"][0], s["y"][0], s["phi"][0] = motion["x"], motion["y"], motion["phi"]
    s["u"][0], s["v"][0], s["omega"][0] = motion["u"], motion["v"], motion["omega"]
    sine, cosine = motion["sine"], motion["cosine"]
    s["sine"][0], s["cosine"][0] = sine, cosine
    s["sw"][0], s["cw"][0] = sine * motion["omega"], cosine * motion["omega"]
    _terms_of_places(frozen, s, 1)
    for c in range(contacts["count"]):
        contact, terms = contacts["at"][c], s["of"][c]
        a = contact["arc"]
        terms["gap"][0] = contact["gap"]
        _write_push(contact)
        if contact["kind"] != ARC_PIECE:
            place_in_body(contact["qx"], contact["qy"], s, terms["bx"], terms["by"], 0)
        if contact["kind"] == ARC_BEND:
            dx = motion["x"] - contact["qx"] + cosine * body["cx"][a] - sine * body["cy"][a]
            dy = motion["y"] - contact["qy"] + sine * body["cx"][a] + cosine * body["cy"][a]
            terms["dx"][0], terms["dy"][0], terms["distance"][0] = dx, dy, math.sqrt(dx * dx + dy * dy)
            terms["nx"][0], terms["ny"][0] = contact["nx"], contact["ny"]
        _terms_of_velocities(body, contact, s, terms, 0)
        terms["gap_rate"][0], terms["slip"][0] = contact["gap_rate"], contact["slip"]
        _lock_terms(contact, terms, 0)


@kernel
def _write_push(contact: np.void) -> None:
    """Write the stiffness of a contact, and what its load does to the body with the friction that it brings with it."""
    contact["stiffness"] = 0.0
    if contact["gap_sign"] != 0:
        contact["stiffness"] = contact["closing"] if contact["gap_sign"] < 0 else contact["opening"]
    pull, gs, gc = -contact["slip_sign"] * contact["friction"], contact["gs"], contact["gc"]
    contact["pull"] = pull
    contact["push_x"], contact["push_y"] = contact["nx"] + pull * contact["ny"], contact["ny"] - pull * contact["nx"]
    contact["push_s"], contact["push_c"] = gs - pull * gc, gc + pull * gs


@kernel
def _push_on_bend(
    body: np.void, contact: np.void, s: np.void, terms: np.void, k: int
) -> tuple[float, float, float, float, float]:
    """Terms of order ``k`` of the forces of a bend along x and y, of its moment, and of its parts of gs and gc."""
    a, normal, force = contact["arc"], terms["normal"], terms["force"]
    if contact["kind"] == SIDE_BEND:
        ox, oy = body["ox"][a], body["oy"][a]
        sine, cosine, bx, by, gap = s["sine"], s["cosine"], terms["bx"], terms["by"], terms["gap"]
        fx = fy = moment = 0.0
        for i in range(k + 1):
            along, across = -ox * normal[i] - oy * force[i], ox * force[i] - oy * normal[i]
            fx += cosine[k - i] * along - sine[k - i] * across
            fy += sine[k - i] * along + cosine[k - i] * across
            moment += bx[k - i] * across - by[k - i] * along - gap[k - i] * force[i]
        return fx, fy, moment + (contact["depth_offset"] - contact["radius"]) * force[k], 0.0, 0.0
    nx, ny = terms["nx"], terms["ny"]
    fx = fy = 0.0
    for i in range(k + 1):
        fx += normal[i] * nx[k - i] + force[i] * ny[k - i]
        fy += normal[i] * ny[k - i] - force[i] * nx[k - i]
    cx, cy = body["cx"][a], body["cy"][a]
    return fx, fy, body["r"][a] * force[k], cx * fy - cy * fx, cy * fy + cx * fx


@kernel
def _products(s: np.void, k: int) -> tuple[float, float, float]:
    """Terms of order ``k`` of the moment of forces on arcs, and of order ``k + 1`` of sw and cw, but for their last.

    One loop for three sums: none of them waits for another, nor for the forces of order ``k``, and what one has read
    of sine and cosine the other takes.
    """
    sine, cosine, omega, gs, gc = s["sine"], s["cosine"], s["omega"], s["gs"], s["gc"]
    moment = sw = cw = 0.0
    sine_j, cosine_j = sine[k + 1], cosine[k + 1]
    for i in range(k):
        sw, cw = sw + sine_j * omega[i], cw + cosine_j * omega[i]
        sine_j, cosine_j = sine[k - i], cosine[k - i]
        moment += cosine_j * gs[i] - sine_j * gc[i]
    return moment, sw + sine_j * omega[k], cw + cosine_j * omega[k]


@kernel
def _terms_of_forces(body: np.void, slope: Any, contacts: np.void, s: np.void, k: int) -> None:
    """Write terms of order ``k`` of the forces, but for locked ones, and of order ``k + 1`` of the velocities."""
    moment, sw, cw = _products(s, k)
    fx = fy = gs = gc = load = 0.0
    for c in range(contacts["count"]):
        contact, terms = contacts["at"][c], s["of"][c]
        normal = -contact["stiffness"] * terms["gap"][k]
        terms["normal"][k], terms["force"][k] = normal, contact["pull"] * normal
        load += contact["rolling_arm"] * normal
        if contact["kind"] == ARC_PIECE:
            fx, fy = fx + normal * contact["push_x"], fy + normal * contact["push_y"]
            gs, gc = gs + normal * contact["push_s"], gc + normal * contact["push_c"]
            moment += body["r"][contact["arc"]] * contact["pull"] * normal
        else:
            x, y, turning, s_part, c_part = _push_on_bend(body, contact, s, terms, k)
            fx, fy, moment, gs, gc = fx + x, fy + y, moment + turning, gs + s_part, gc + c_part
    rolling = -contacts["spin_sign"] * load
    s["gs"][k], s["gc"][k], s["moment"][k] = gs, gc, rolling
    sine, cosine, per = s["sine"][0], s["cosine"][0], PER[k + 1]
    moment += rolling + (cosine * gs - sine * gc)
    per_mass, omega = body["per_mass"] * per, moment * (body["per_inertia"] * per)
    u, v = fx * per_mass, fy * per_mass
    if k == 0:
        u, v = u + slope.downhill, v - slope.inward
    if slope.drag > 0.0:
        along, up = drag_term(s, k)
        u, v = u - slope.drag * per * along, v - slope.drag * per * up
    s["u"][k + 1], s["v"][k + 1], s["omega"][k + 1] = u, v, omega
    s["sw"][k + 1], s["cw"][k + 1] = sw + sine * omega, cw + cosine * omega


@kernel
def _locked_term(body: np.void, frozen: int, contacts: np.void, lock: np.void, s: np.void, m: int) -> float:
    """Term of order ``m`` of a locked velocity without the locked forces of the order before."""
    if lock["what"] == SPIN:
        return s["omega"][m]  # type: ignore[no-any-return]
    contact, terms = contacts["at"][lock["who"]], s["of"][lock["who"]]
    if contact["kind"] != ARC_PIECE:
        _terms_of_places(frozen, s, m + 1)
    _terms_of_velocities(body, contact, s, terms, m)
    return terms["gap_rate"][m] if lock["what"] == GAP else terms["slip"][m]  # type: ignore[no-any-return]


@kernel
def _add_force(contacts: np.void, lock: np.void, force: float, s: np.void, k: int) -> None:
    """Add a locked force to the terms of order ``k`` of the forces."""
    if lock["what"] == SPIN:
        s["moment"][k] += force
        return
    contact, terms = contacts["at"][lock["who"]], s["of"][lock["who"]]
    if lock["what"] == GAP:
        terms["normal"][k] += force
        terms["force"][k] += contact["pull"] * force
        s["moment"][k] -= contacts["spin_sign"] * contact["rolling_arm"] * force
        if contact["kind"] != SIDE_BEND:
            s["gs"][k] += contact["push_s"] * force
            s["gc"][k] += contact["push_c"] * force
    else:
        terms["force"][k] += force
        if contact["kind"] != SIDE_BEND:
            s["gs"][k] -= contact["gc"] * force
            s["gc"][k] += contact["gs"] * force


@kernel
def _add_locked(body: np.void, frozen: int, contacts: np.void, choice: np.void, s: np.void, k: int) -> None:
    """Add the locked forces of order ``k``, with which locked velocities have no term of order ``k + 1``."""
    m = k + 1
    for i in range(choice["locks"]):
        lock = choice["lock"][i]
        lock["force"] = _locked_term(body, frozen, contacts, lock, s, m)
    solve_locks(choice)
    u, v, omega = s["u"][m], s["v"][m], s["omega"][m]
    before = omega
    for i in range(choice["locks"]):
        lock = choice["lock"][i]
        kick, share = lock["kick"], lock["force"]
        u, v, omega = u + share * kick[0], v + share * kick[1], omega + share * kick[2]
        _add_force(contacts, lock, share * m, s, k)
    if contacts["spin_still"] != 0:
        omega = 0.0
    s["u"][m], s["v"][m], s["omega"][m] = u, v, omega
    s["sw"][m] += s["sine"][0] * (omega - before)
    s["cw"][m] += s["cosine"][0] * (omega - before)


@kernel
def _terms_of_motion(body: np.void, frozen: int, contacts: np.void, s: np.void, k: int) -> None:
    """Write what follows from terms of order ``k`` of the velocities of the body."""
    _terms_of_places(frozen, s, k + 1)
    for c in range(contacts["count"]):
        contact, terms = contacts["at"][c], s["of"][c]
        _terms_of_velocities(body, contact, s, terms, k)
        _lock_terms(contact, terms, k)


@kernel
def _expand_flight(slope: Any, s: np.void) -> None:
    """Write the series of a free body: its spin is constant, and its path without air a parabola."""
    omega = s["omega"][0]
    for k in range(1, ORDER + 1):
        s["u"][k] = s["v"][k] = s["omega"][k] = 0.0
        _terms_of_places(0, s, k)
        s["sw"][k], s["cw"][k] = s["sine"][k] * omega, s["cosine"][k] * omega
        if k == 1:
            s["u"][1], s["v"][1] = slope.downhill, -slope.inward
        if slope.drag > 0.0:
            along, up = drag_term(s, k - 1)
            s["u"][k] -= slope.drag * PER[k] * along
            s["v"][k] -= slope.drag * PER[k] * up
    _terms_of_places(0, s, ORDER + 1)


@kernel
def expand(body: np.void, slope: Any, space: np.void) -> None:
    """Write the series of a step in the mode of the contacts, which have been placed.

    In a ``frozen`` impact the body stays where it is: normals and levers are constant. Where ``slope.drag`` is not
    zero, the speed is not.
    """
    motion, contacts, s, choice = space["motion"], space["contacts"], space["series"], space["choice"]
    frozen = space["frozen"]
    _begin(body, frozen, motion, contacts, s)
    if contacts["count"] == 0:
        _expand_flight(slope, s)
        if slope.drag > 0.0:
            drag_term(s, ORDER)
        return
    find_locks(body, contacts, choice)
    locked = choice["locks"] > 0
    for k in range(ORDER):
        _terms_of_forces(body, slope, contacts, s, k)
        if locked:
            _add_locked(body, frozen, contacts, choice, s, k)
        _terms_of_motion(body, frozen, contacts, s, k + 1)
    if slope.drag > 0.0:
        drag_term(s, ORDER)
    s["moment"][ORDER] = 0.0
    for c in range(contacts["count"]):  # the last terms of locked forces are not known and below rounding
        contact, terms = contacts["at"][c], s["of"][c]
        terms["normal"][ORDER] = -contact["stiffness"] * terms["gap"][ORDER]
        terms["force"][ORDER] = contact["pull"] * terms["normal"][ORDER]


@kernel
def longest_step(body: np.void, slope: Any, tolerance: float, space: np.void) -> float:
    """How long [s] the series of a step hold: the first terms left out are a tenth of ``tolerance`` times the speed.

    Those of sine and cosine move arcs by a tenth of ``tolerance`` times the size: errors of some steps add up. Terms
    fall as powers of the step over the radius of convergence, which the last two terms tell (Jorba and Zou, 2005,
    section 3.2).
    """
    s, contacts, size = space["series"], space["contacts"], body["size"]
    longest, turning = LONGEST, abs(s["omega"][0]) + math.sqrt(0.5 * abs(s["omega"][1]))
    if turning > 0.0 and space["frozen"] == 0:
        longest = MOST_TURN / turning
    if contacts["count"] == 0 and slope.drag == 0.0:
        return longest
    speed = max(abs(s["u"][0]), abs(s["v"][0]), size * abs(s["omega"][0]), math.sqrt(slope.gravity * size), 1e-12)
    far = max(size, body["furthest"]) / size
    power = math.inf  # the step to the power of ORDER
    of_radius = 0.1 * tolerance * sixteenth_root(10.0 / tolerance)  # nearly to the power of ORDER / (ORDER + 1)
    for k in range(ORDER - 1, ORDER + 1):
        last = max(abs(s["u"][k]), abs(s["v"][k]), size * abs(s["omega"][k])) / speed
        last = max(last, max(abs(s["sine"][k]), abs(s["cosine"][k])) * far)
        if slope.drag > 0.0:
            first, drag = s["speed"][0], slope.drag * s["square"][0]
            last = max(last, max(drag / (slope.gravity + drag), OF_AIR) * abs(s["speed"][k]) / first)
        power = min(power, of_radius * _radius(last, k))
    of_radius = OF_LOAD * tolerance
    for c in range(contacts["count"]):
        contact, terms = contacts["at"][c], s["of"][c]
        if contact["gap_sign"] == 0 and space["frozen"] == 0:  # loads may change where velocities do not
            last = abs(terms["normal"][ORDER - 1]) / (abs(terms["normal"][0]) + body["mass"] * slope.gravity)
            power = min(power, of_radius * _radius(last, ORDER - 1))
        if contact["kind"] == ARC_BEND:  # its normal turns
            fast = math.sqrt(terms["dx"][1] * terms["dx"][1] + terms["dy"][1] * terms["dy"][1])
            if fast > 0.0:
                longest = min(longest, OF_BEND * terms["distance"][0] / fast)
    return min(longest, sixteenth_root(power))


@kernel
def _radius(last: float, k: int) -> float:
    """Radius of convergence [s], to the power of ORDER, of a series that begins with 1, from one of its last two terms.

    Nearly: the term before is taken to the power of 17/16 where 16/15 is meant.
    """
    if not last > 0.0:
        return math.inf
    return 1.0 / last if k == ORDER else sixteenth_root(1.0 / last) / last


@kernel
def measure_reach(space: np.void) -> None:
    """Write how far x, y, sine, cosine and phi can move within the step, and how far of that by later terms alone."""
    s, reach, late = space["series"], space["reach"], space["late"]
    x = y = sine = cosine = phi = 0.0
    t = space["event"]["time"]
    power = t * t
    for k in range(2, ORDER + 1):
        x += abs(s["x"][k]) * power
        y += abs(s["y"][k]) * power
        sine += abs(s["sine"][k]) * power
        cosine += abs(s["cosine"][k]) * power
        phi += abs(s["phi"][k]) * power
        power *= t
    late[X], late[Y], late[SINE], late[COSINE], late[PHI] = x, y, sine, cosine, phi
    reach[X], reach[Y], reach[PHI] = x + abs(s["x"][1]) * t, y + abs(s["y"][1]) * t, phi + abs(s["phi"][1]) * t
    reach[SINE], reach[COSINE] = sine + abs(s["sine"][1]) * t, cosine + abs(s["cosine"][1]) * t
