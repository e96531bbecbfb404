"""The mode of the contacts: which velocities are locked at zero, and at which bounds the forces are.

Accelerations decide: docs/physics.md, section 5. A velocity that is not zero has its force at a bound. One that is zero
may stay so, held by a force between the bounds, or leave with the force at one. Where others hold it at zero in any
case, the shares of the forces are not unique, and one of them may be at its bound although its velocity stays zero.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.arithmetic import sign_of
from sledenv.kernel.geometry import ARC_BEND, SIDE_BEND, mirrored, place, velocities
from sledenv.kernel.ground import is_rigid
from sledenv.kernel.rest import hold

FOLLOWS: Final = 2  # a slip that is still because others are; their levers differ by their depths, so it moves a little
UNRESISTED: Final = 2  # a spin that is still without rolling resistance: its sign means nothing
GAP, SPIN, SLIP = range(3)  # kinds of velocities, in the order in which they are locked
DEPENDENT: Final = 1e-9  # part of a row that is left where it depends on others,
NEARLY: Final = 1e-5  # and of a slip that is not locked: points that stick at different depths do not hold the spin
SKEW: Final = 1e-6  # of the product of its diagonal: the determinant of a matrix of which two rows are nearly the same
VANISHING: Final = 1e-9  # of the speed: a velocity that depends on zeros and is smaller is zero
SLOW: Final = 1e-2  # of the speed of a fall or of the springs: what is VANISHING is seen on this speed at least,
ROUNDED: Final = 1e-12  # of that speed: one that is smaller is zero even if normals that differ slightly explain it
TINY: Final = 1e-12  # [m/s] and on this
STANDING: Final = 1e-8  # of the speed of a fall: a body that is slower stands still where all its velocities are locked
STEADY: Final = 1e-10  # of gravity and centrifugal acceleration: a smaller rate is zero
SLIGHT: Final = 1e-12  # of the forces: a mode that is violated by less holds
SHALLOW: Final = 1e-13  # of the size: depth with which a gap is held that is not so deep yet
MOST_TRIED: Final = 7  # zero velocities of which all modes are tried


@kernel
def _row(contacts: np.void, what: int, c: int) -> tuple[float, float, float]:
    """Row of a velocity: what u, v and omega add to it."""
    if what == SPIN:
        return 0.0, 0.0, 1.0
    contact = contacts["at"][c]
    if what == GAP:
        return contact["nx"], contact["ny"], contact["normal_lever"]
    return contact["ny"], -contact["nx"], contact["tangent_lever"]


@kernel
def _sign(contacts: np.void, what: int, c: int) -> int:
    """Sign of a force, 0 between its bounds."""
    if what == SPIN:
        return contacts["spin_sign"]  # type: ignore[no-any-return]
    contact = contacts["at"][c]
    return contact["gap_sign"] if what == GAP else contact["slip_sign"]  # type: ignore[no-any-return]


@kernel
def _left(contacts: np.void, what: int, c: int) -> int:
    """Sign with which a velocity has been released at this instant, or 0."""
    if what == SPIN:
        return contacts["spin_left"]  # type: ignore[no-any-return]
    contact = contacts["at"][c]
    return contact["gap_left"] if what == GAP else contact["slip_left"]  # type: ignore[no-any-return]


@kernel
def _write_sign(contacts: np.void, what: int, c: int, sign: int) -> None:
    if what == SPIN:
        contacts["spin_sign"] = sign
    elif what == GAP:
        contacts["at"][c]["gap_sign"] = sign
    elif contacts["slip_shared"] == 0:
        contacts["at"][c]["slip_sign"] = sign
    else:
        for q in range(contacts["count"]):
            contacts["at"][q]["slip_sign"] = sign


@kernel
def _write_still(contacts: np.void, what: int, c: int, still: int) -> None:
    if what == SPIN:
        contacts["spin_still"] = still
    elif what == GAP:
        contacts["at"][c]["gap_still"] = still
    elif contacts["slip_shared"] == 0:
        contacts["at"][c]["slip_still"] = still
    else:
        for q in range(contacts["count"]):
            contacts["at"][q]["slip_still"] = still


@kernel
def all_friction(contacts: np.void) -> float:
    """Sum of the friction of all contacts: zero if none has any."""
    total = 0.0
    for c in range(contacts["count"]):
        total += contacts["at"][c]["friction"]
    return total


@kernel
def _unit(body: np.void, contacts: np.void, choice: np.void, what: int, c: int) -> tuple[float, float, float, float]:
    """Part of a row that no locked row has, in the norm of the inverse masses, and its share of the row."""
    r0, r1, r2 = _row(contacts, what, c)
    per_mass, per_inertia = math.sqrt(body["per_mass"]), math.sqrt(body["per_inertia"])
    q0, q1, q2 = r0 * per_mass, r1 * per_mass, r2 * per_inertia
    whole = math.sqrt(q0 * q0 + q1 * q1 + q2 * q2)
    for i in range(choice["locks"]):
        unit = choice["lock"][i]["unit"]
        along = q0 * unit[0] + q1 * unit[1] + q2 * unit[2]
        q0, q1, q2 = q0 - along * unit[0], q1 - along * unit[1], q2 - along * unit[2]
    left = math.sqrt(q0 * q0 + q1 * q1 + q2 * q2)
    return q0, q1, q2, left / whole


@kernel
def depends(body: np.void, contacts: np.void, choice: np.void, what: int, c: int) -> bool:
    """Whether a velocity follows from those that are locked."""
    return _unit(body, contacts, choice, what, c)[3] < DEPENDENT


@kernel
def find_locks(body: np.void, contacts: np.void, choice: np.void) -> None:
    """Write the locked velocities that do not depend on each other, and how their forces push the body."""
    choice["locks"] = 0
    for what in range(3):
        for c in range(1 if what == SPIN else contacts["count"]):
            if choice["locks"] == 3 or _sign(contacts, what, c) != 0:
                continue
            q0, q1, q2, part = _unit(body, contacts, choice, what, c)
            if part < (NEARLY if what == SLIP else DEPENDENT):
                continue
            lock, length = choice["lock"][choice["locks"]], math.sqrt(q0 * q0 + q1 * q1 + q2 * q2)
            lock["what"], lock["who"] = what, c
            lock["unit"][0], lock["unit"][1], lock["unit"][2] = q0 / length, q1 / length, q2 / length
            r0, r1, r2 = _row(contacts, what, c)
            lock["row"][0], lock["row"][1], lock["row"][2] = r0, r1, r2
            if what == GAP:  # its load brings friction and rolling resistance with it
                contact = contacts["at"][c]
                pull = -contact["slip_sign"] * contact["friction"]
                r0 += pull * contact["ny"]
                r1 -= pull * contact["nx"]
                r2 += pull * contact["tangent_lever"] - contacts["spin_sign"] * contact["rolling_arm"]
            per_mass, per_inertia = body["per_mass"], body["per_inertia"]
            lock["push"][0], lock["push"][1], lock["push"][2] = r0, r1, r2
            lock["kick"][0], lock["kick"][1], lock["kick"][2] = r0 * per_mass, r1 * per_mass, r2 * per_inertia
            choice["locks"] += 1
    if choice["locks"] > 0:
        _write_mobility(choice)


@kernel
def _write_mobility(choice: np.void) -> None:
    """Write what each locked force changes of each locked velocity, and the inverse of that matrix.

    Locks that are missing leave ones on its diagonal. A matrix that friction makes singular has zeros for an inverse.
    """
    lock, n = choice["lock"], choice["locks"]
    for i in range(3):
        row, mobility = lock[i]["row"], lock[i]["mobility"]
        for j in range(3):
            kick = lock[j]["kick"]
            mobility[j] = 1.0 if i == j else 0.0
            if i < n and j < n:
                mobility[j] = row[0] * kick[0] + row[1] * kick[1] + row[2] * kick[2]
    a, b, d = lock[0]["mobility"], lock[1]["mobility"], lock[2]["mobility"]
    p, q, r = lock[0]["inverse"], lock[1]["inverse"], lock[2]["inverse"]
    p[0], p[1], p[2] = b[1] * d[2] - b[2] * d[1], a[2] * d[1] - a[1] * d[2], a[1] * b[2] - a[2] * b[1]
    q[0], q[1], q[2] = b[2] * d[0] - b[0] * d[2], a[0] * d[2] - a[2] * d[0], a[2] * b[0] - a[0] * b[2]
    r[0], r[1], r[2] = b[0] * d[1] - b[1] * d[0], a[1] * d[0] - a[0] * d[1], a[0] * b[1] - a[1] * b[0]
    choice["determinant"] = a[0] * p[0] + a[1] * q[0] + a[2] * r[0]
    diagonal = a[0] * b[1] * d[2]
    choice["skew"] = 1.0 if abs(choice["determinant"]) < SKEW * abs(diagonal) else 0.0
    per = 1.0 / choice["determinant"] if choice["determinant"] != 0.0 else 0.0
    for i in range(3):
        p[i], q[i], r[i] = p[i] * per, q[i] * per, r[i] * per


@kernel
def _improve_forces(choice: np.void, x: float, y: float, z: float) -> None:
    """Add to the forces what it takes to make the changes (x, y, z) that they should make and do not."""
    lock, n = choice["lock"], choice["locks"]
    for j in range(n):
        force = lock[j]["force"]
        x -= lock[0]["mobility"][j] * force
        y -= lock[1]["mobility"][j] * force if n > 1 else 0.0
        z -= lock[2]["mobility"][j] * force if n > 2 else 0.0
    for i in range(n):
        inverse = lock[i]["inverse"]
        lock[i]["force"] += inverse[0] * x + inverse[1] * y + inverse[2] * z


@kernel
def solve_locks(choice: np.void) -> None:
    """Find the forces that change the locked velocities by minus what ``force`` holds, and write them there."""
    lock, n = choice["lock"], choice["locks"]
    x = -lock[0]["force"]
    y = -lock[1]["force"] if n > 1 else 0.0
    z = -lock[2]["force"] if n > 2 else 0.0
    for i in range(n):
        inverse = lock[i]["inverse"]
        lock[i]["force"] = inverse[0] * x + inverse[1] * y + inverse[2] * z
    if choice["skew"] != 0.0:
        _improve_forces(choice, x, y, z)


@kernel
def _write_drifts(body: np.void, motion: np.void, contact: np.void, share: np.void) -> None:
    """Write how gap rate and slip change without any force, because normal and lever turn."""
    omega, s, c = motion["omega"], motion["sine"], motion["cosine"]
    a, square = contact["arc"], omega * omega
    px, py = contact["qx"] - motion["x"], contact["qy"] - motion["y"]
    if contact["kind"] == SIDE_BEND:
        bx, by = c * px + s * py, c * py - s * px
        ux, uy = c * motion["u"] + s * motion["v"], c * motion["v"] - s * motion["u"]
        ddx, ddy = -2.0 * omega * uy - square * bx, 2.0 * omega * ux - square * by  # of the bend, seen from the body
        ox, oy = body["ox"][a], body["oy"][a]
        share["gap_drift"] = ox * ddx + oy * ddy
        share["slip_drift"] = oy * ddx - ox * ddy - contact["gap_rate"] * omega
        return
    rx, ry = c * body["cx"][a] - s * body["cy"][a], s * body["cx"][a] + c * body["cy"][a]
    nx, ny = contact["nx"], contact["ny"]
    along_n, along_t = -square * (nx * rx + ny * ry), -square * (ny * rx - nx * ry)
    if contact["kind"] == ARC_BEND:
        vx, vy = motion["u"] - omega * ry, motion["v"] + omega * rx
        ex, ey = rx - px, ry - py
        turning = (ny * vx - nx * vy) / (contact["bend"] * math.sqrt(ex * ex + ey * ey))
        along_n += (ny * vx - nx * vy) * turning
        along_t -= (nx * vx + ny * vy) * turning
    share["gap_drift"], share["slip_drift"] = along_n, along_t


@kernel
def _accelerate(body: np.void, slope: Any, contacts: np.void, choice: np.void) -> None:
    """Write forces and accelerations in the mode that the signs of the contacts tell."""
    find_locks(body, contacts, choice)
    mass, spin = body["mass"], contacts["spin_sign"]
    fx, fy, turning, load, rolling = mass * slope.downhill, -mass * slope.inward, 0.0, 0.0, 0.0
    for c in range(contacts["count"]):
        contact, share = contacts["at"][c], choice["share"][c]
        sign = contact["gap_sign"]
        normal = 0.0
        if sign != 0:
            normal = (contact["closing"] if sign < 0 else contact["opening"]) * share["depth"]
        force = -contact["slip_sign"] * contact["friction"] * normal
        share["normal"], share["force"] = normal, force
        fx += normal * contact["nx"] + force * contact["ny"]
        fy += normal * contact["ny"] - force * contact["nx"]
        turning += normal * contact["normal_lever"] + force * contact["tangent_lever"]
        load += contact["rolling_arm"] * normal
    rolling = -spin * load
    turning += rolling
    per_mass, per_inertia = body["per_mass"], body["per_inertia"]
    for i in range(choice["locks"]):
        lock = choice["lock"][i]
        row = lock["row"]
        rate = (row[0] * fx + row[1] * fy) * per_mass + row[2] * turning * per_inertia
        if lock["what"] == GAP:
            rate += choice["share"][lock["who"]]["gap_drift"]
        elif lock["what"] == SLIP:
            rate += choice["share"][lock["who"]]["slip_drift"]
        lock["force"] = rate
    if choice["locks"] > 0:
        solve_locks(choice)
    for i in range(choice["locks"]):
        lock = choice["lock"][i]
        push, force = lock["push"], lock["force"]
        fx, fy, turning = fx + force * push[0], fy + force * push[1], turning + force * push[2]
        if lock["what"] == SPIN:
            rolling += force
            continue
        contact, share = contacts["at"][lock["who"]], choice["share"][lock["who"]]
        if lock["what"] == SLIP:
            share["force"] = force
        else:
            share["normal"], share["force"] = force, -contact["slip_sign"] * contact["friction"] * force
            load += contact["rolling_arm"] * force
            rolling -= spin * contact["rolling_arm"] * force
    choice["du"], choice["dv"], choice["domega"] = fx * per_mass, fy * per_mass, turning * per_inertia
    choice["moment"], choice["load"] = rolling, load
    for c in range(contacts["count"]):
        contact, share = contacts["at"][c], choice["share"][c]
        nx, ny = contact["nx"], contact["ny"]
        du, dv, domega = choice["du"], choice["dv"], choice["domega"]
        share["gap_change"] = nx * du + ny * dv + contact["normal_lever"] * domega + share["gap_drift"]
        share["slip_change"] = ny * du - nx * dv + contact["tangent_lever"] * domega + share["slip_drift"]


@kernel
def _change(body: np.void, choice: np.void, what: int, c: int) -> float:
    """Rate [m/s^2] at which a velocity changes; of the spin that of the rim."""
    if what == SPIN:
        return choice["domega"] * body["size"]  # type: ignore[no-any-return]
    share = choice["share"][c]
    return share["gap_change"] if what == GAP else share["slip_change"]  # type: ignore[no-any-return]


@kernel
def _excess(body: np.void, contacts: np.void, choice: np.void, what: int, c: int) -> float:
    """How far [N] the force of a locked velocity is beyond its bounds, 0 if it is not."""
    if what == SPIN:
        return float(max(abs(choice["moment"]) - choice["load"], 0.0) / body["size"])
    contact, share = contacts["at"][c], choice["share"][c]
    if what == SLIP and contacts["slip_shared"] != 0:
        force, bound = 0.0, 0.0
        for q in range(contacts["count"]):
            force += choice["share"][q]["force"]
            bound += contacts["at"][q]["friction"] * choice["share"][q]["normal"]
        return max(abs(force) - bound, 0.0)
    if what == SLIP:
        return float(max(abs(share["force"]) - contact["friction"] * share["normal"], 0.0))
    above = share["normal"] - contact["closing"] * share["depth"]
    return float(max(above, contact["opening"] * share["depth"] - share["normal"], 0.0))


@kernel
def _violation(body: np.void, slope: Any, still: float, contacts: np.void, choice: np.void) -> float:
    """How far [N] a mode is from holding; what has just been released should stay so, but that weighs little."""
    _accelerate(body, slope, contacts, choice)
    mass = body["mass"]
    scale = mass * slope.gravity
    for c in range(contacts["count"]):
        scale = max(scale, abs(choice["share"][c]["normal"]))
    choice["scale"] = scale
    wrong = 0.0
    determinant = choice["determinant"]
    if choice["locks"] > 0 and (determinant == 0.0 or (choice["rigid"] != 0.0 and not determinant > 0.0)):
        return math.inf
    for i in range(choice["zeros"]):
        zero = choice["zero"][i]
        what, c, sign = zero["what"], zero["who"], zero["sign"]
        left = _left(contacts, what, c)
        if left != 0 and sign != left:
            wrong += 1e-9 * scale
        rate = _change(body, choice, what, c)
        moves = abs(rate) > still
        if sign == 0:
            wrong += _excess(body, contacts, choice, what, c)
            if moves:
                wrong += abs(rate) * mass
        elif rate * sign < 0.0 and (moves or not depends(body, contacts, choice, what, c)):
            wrong += abs(rate) * mass
    return wrong


@kernel
def _write_signs(motion: np.void, contacts: np.void) -> None:
    """Write the signs of all velocities."""
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        contact["gap_sign"], contact["slip_sign"] = sign_of(contact["gap_rate"]), sign_of(contact["slip"])
    contacts["spin_sign"] = sign_of(motion["omega"])


@kernel
def _speed_along(contacts: np.void, motion: np.void, what: int, c: int) -> float:
    """Velocity [m/s, rad/s] of a contact, or the spin, as the motion of the body has it."""
    r0, r1, r2 = _row(contacts, what, c)
    return r0 * motion["u"] + r1 * motion["v"] + r2 * motion["omega"]  # type: ignore[no-any-return]


@kernel
def _change_motion(motion: np.void, contacts: np.void, du: float, dv: float, domega: float) -> None:
    """Change the velocities of the body, and those of its contacts that are not zero: errors would add up."""
    motion["u"], motion["v"], motion["omega"] = motion["u"] + du, motion["v"] + dv, motion["omega"] + domega
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        nx, ny = contact["nx"], contact["ny"]
        if contact["gap_sign"] != 0:
            contact["gap_rate"] += nx * du + ny * dv + contact["normal_lever"] * domega
        if contact["slip_sign"] != 0:
            contact["slip"] += ny * du - nx * dv + contact["tangent_lever"] * domega


@kernel
def _heed_locks(body: np.void, least: float, motion: np.void, contacts: np.void, choice: np.void) -> None:
    """Take off the body what it moves along velocities that are locked, where that is less than ``least`` [m/s].

    Rounding leaves it, and a hand-over to a normal that is nearly the same. It is no part of the motion: the forces of
    the locks would do work on it.
    """
    for i in range(choice["locks"]):
        what, c = choice["lock"][i]["what"], choice["lock"][i]["who"]
        if what == SPIN:
            continue
        r0, r1, r2 = _row(contacts, what, c)
        k0, k1, k2 = r0 * body["per_mass"], r1 * body["per_mass"], r2 * body["per_inertia"]
        if contacts["spin_sign"] == 0:
            k2 = 0.0
        share = -_speed_along(contacts, motion, what, c) / (r0 * k0 + r1 * k1 + r2 * k2)
        change = abs(share) * max(max(abs(k0), abs(k1)), body["size"] * abs(k2))
        if 0.0 < change < least:
            _change_motion(motion, contacts, share * k0, share * k1, share * k2)


@kernel
def _vanishes(
    body: np.void,
    least: float,
    motion: np.void,
    contacts: np.void,
    choice: np.void,
    what: int,
    c: int,
    value: float,
) -> bool:
    """Whether a velocity that is less than ``least`` follows from those that are locked, and is zero as they are.

    Normals that differ by less than ``DEPENDENT`` leave it as much as that part of the motion: that is no rounding.
    """
    q0, q1, q2, part = _unit(body, contacts, choice, what, c)
    if not part < DEPENDENT:
        return False
    u, v, omega = motion["u"], motion["v"], motion["omega"]
    left = (q0 * q0 + q1 * q1 + q2 * q2) * (body["mass"] * (u * u + v * v) + body["inertia"] * omega * omega)
    return abs(value) < ROUNDED / VANISHING * least or value * value > 4.0 * left


@kernel
def _spread_zeros(
    body: np.void, slow: float, standing: float, motion: np.void, contacts: np.void, choice: np.void
) -> None:
    """Write signs of all velocities; what follows from velocities that are zero is made exactly zero before."""
    speed = max(abs(motion["u"]), abs(motion["v"]), body["size"] * abs(motion["omega"]))
    least = VANISHING * max(speed, slow)
    _write_signs(motion, contacts)
    find_locks(body, contacts, choice)
    apart, rigid = choice["locks"] == 3 and speed > standing, choice["rigid"] != 0.0
    for i in range(choice["locks"]):
        lock = choice["lock"][i]
        if (
            not rigid
            and lock["what"] != SPIN
            and abs(_speed_along(contacts, motion, lock["what"], lock["who"])) > least
        ):
            apart = True
    if apart:  # normals have jumped: the velocities of contacts are not those of one body
        for c in range(contacts["count"]):
            contact = contacts["at"][c]
            contact["gap_rate"], contact["slip"] = velocities(motion, contact)
        _write_signs(motion, contacts)
        find_locks(body, contacts, choice)
    if choice["locks"] == 0:
        return
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        small = abs(contact["gap_rate"]) < least and contact["gap_sign"] != 0
        if small and _vanishes(body, least, motion, contacts, choice, GAP, c, contact["gap_rate"]):
            contact["gap_rate"], contact["gap_sign"] = 0.0, 0
        small = abs(contact["slip"]) < least and contact["slip_sign"] != 0
        if small and _vanishes(body, least, motion, contacts, choice, SLIP, c, contact["slip"]):
            contact["slip"], contact["slip_sign"] = 0.0, 0
    small = abs(motion["omega"]) * body["size"] < least and contacts["spin_sign"] != 0
    if small and _vanishes(body, least / body["size"], motion, contacts, choice, SPIN, 0, motion["omega"]):
        _change_motion(motion, contacts, 0.0, 0.0, -motion["omega"])
        contacts["spin_sign"] = 0
    if choice["locks"] < 3 and not (rigid and contacts["spin_sign"] != 0):
        _heed_locks(body, least, motion, contacts, choice)
    elif speed <= standing:  # no motion is left but rounding
        motion["u"] = motion["v"] = motion["omega"] = 0.0
        for c in range(contacts["count"]):
            contacts["at"][c]["gap_rate"] = contacts["at"][c]["slip"] = 0.0
        _write_signs(motion, contacts)


@kernel
def _before(sign: int, still: int, left: int) -> int:
    """Sign that a velocity which is zero has had before: as it was released, as it was held, or else locked."""
    if left != 0:
        return left
    return sign if still != 0 else 0


@kernel
def _remember(contacts: np.void, choice: np.void) -> None:
    """Keep the mode that has been, which is tried first."""
    for c in range(contacts["count"]):
        contact, share = contacts["at"][c], choice["share"][c]
        share["gap_before"] = _before(contact["gap_sign"], contact["gap_still"], contact["gap_left"])
        share["slip_before"] = _before(contact["slip_sign"], contact["slip_still"], contact["slip_left"])
    still = contacts["spin_still"] if contacts["spin_still"] != UNRESISTED else 0
    choice["spin_before"] = _before(contacts["spin_sign"], still, contacts["spin_left"])


@kernel
def _list_zero(contacts: np.void, choice: np.void, what: int, c: int, bounded: bool, before: int) -> None:
    """Add a velocity that is zero to those whose sign is to be chosen, unless no force depends on its sign."""
    if _sign(contacts, what, c) != 0:
        return
    if not bounded:
        _write_sign(contacts, what, c, 1)
        return
    zero = choice["zero"][choice["zeros"]]
    zero["what"], zero["who"], zero["before"] = what, c, before
    choice["zeros"] += 1


@kernel
def _list_zeros(shallow: float, contacts: np.void, choice: np.void) -> None:
    """List the velocities that are zero and whose force has two bounds; no depth is less than ``shallow`` [m]."""
    choice["zeros"] = 0
    arms = 0.0
    for c in range(contacts["count"]):
        contact, share = contacts["at"][c], choice["share"][c]
        share["depth"] = -contact["gap"] if contact["gap"] < 0.0 else shallow
        arms += contact["rolling_arm"]
        _list_zero(contacts, choice, GAP, c, contact["closing"] != contact["opening"], share["gap_before"])
        if contacts["slip_shared"] == 0:
            _list_zero(contacts, choice, SLIP, c, contact["friction"] > 0.0, share["slip_before"])
        elif c == 0:
            _list_zero(contacts, choice, SLIP, 0, all_friction(contacts) > 0.0, share["slip_before"])
    _list_zero(contacts, choice, SPIN, 0, arms > 0.0, choice["spin_before"])


@kernel
def _try_mode(body: np.void, slope: Any, still: float, rests: bool, contacts: np.void, choice: np.void) -> float:
    """How far a mode is from holding whose signs are those of ``choice["zero"]``; inf if it moves but should rest."""
    for i in range(choice["zeros"]):
        zero = choice["zero"][i]
        _write_sign(contacts, zero["what"], zero["who"], zero["sign"])
        if zero["what"] == GAP and zero["sign"] < 0 and contacts["at"][zero["who"]]["closing"] == math.inf:
            return math.inf
    wrong = _violation(body, slope, still, contacts, choice)
    change = max(abs(choice["du"]), abs(choice["dv"]), body["size"] * abs(choice["domega"]))
    return math.inf if rests and not change <= still else wrong


@kernel
def _keep_best(choice: np.void) -> None:
    for i in range(choice["zeros"]):
        choice["zero"][i]["best"] = choice["zero"][i]["sign"]


@kernel
def _try_all(
    body: np.void, slope: Any, still: float, rests: bool, side: int, contacts: np.void, choice: np.void
) -> float:
    """Try all modes until one holds; the best one is kept. ``side`` lets mirror images try in each other's turn."""
    total = 1
    for _ in range(choice["zeros"]):
        total *= 3
    best = math.inf
    for code in range(total):
        rest = code
        for i in range(choice["zeros"]):
            zero = choice["zero"][i]
            digit = rest % 3
            rest //= 3
            sign = digit if digit < 2 else -1
            zero["sign"] = sign if zero["what"] == GAP else sign * side
        wrong = _try_mode(body, slope, still, rests, contacts, choice)
        if wrong < best:
            best = wrong
            _keep_best(choice)
            if wrong <= SLIGHT * choice["scale"]:
                break
    return best


@kernel
def _improve(
    body: np.void, slope: Any, still: float, rests: bool, side: int, contacts: np.void, choice: np.void
) -> float:
    """Change one sign after the other where that makes a mode better, from the best one on, until none does."""
    for i in range(choice["zeros"]):
        choice["zero"][i]["best"] = choice["zero"][i]["before"]
    best, better = math.inf, True
    while better:
        better = False
        for i in range(choice["zeros"]):
            for turn in range(3):
                for k in range(choice["zeros"]):
                    choice["zero"][k]["sign"] = choice["zero"][k]["best"]
                zero = choice["zero"][i]
                zero["sign"] = (turn if turn < 2 else -1) * (side if zero["what"] != GAP else 1)
                wrong = _try_mode(body, slope, still, rests, contacts, choice)
                if wrong < best:
                    best, better = wrong, True
                    _keep_best(choice)
                    if wrong <= SLIGHT * choice["scale"]:
                        return best
    return best


@kernel
def _search(
    body: np.void, slope: Any, still: float, rests: bool, side: int, contacts: np.void, choice: np.void
) -> float:
    """Find the mode that holds, or is nearest to holding: first that before, then all, or all that are near."""
    for i in range(choice["zeros"]):
        choice["zero"][i]["sign"] = choice["zero"][i]["before"]
    _keep_best(choice)
    wrong = _try_mode(body, slope, still, rests, contacts, choice)
    if wrong <= SLIGHT * choice["scale"]:
        return wrong
    if choice["zeros"] <= MOST_TRIED:
        return _try_all(body, slope, still, rests, side, contacts, choice)
    return _improve(body, slope, still, rests, side, contacts, choice)


@kernel
def _is_locked(choice: np.void, what: int, c: int) -> bool:
    """Whether a velocity has a force of its own that holds it."""
    for i in range(choice["locks"]):
        lock = choice["lock"][i]
        if lock["what"] == what and lock["who"] == c:
            return True
    return False


@kernel
def _apply_mode(body: np.void, slope: Any, still: float, omega: float, contacts: np.void, choice: np.void) -> None:
    """Take the best mode, and write which velocities stay zero in it."""
    for c in range(contacts["count"]):
        contacts["at"][c]["gap_still"] = contacts["at"][c]["slip_still"] = 0
    contacts["spin_still"] = 0
    choice["wrong"] = 0.0
    if choice["zeros"] == 0:
        return
    for i in range(choice["zeros"]):
        choice["zero"][i]["sign"] = choice["zero"][i]["best"]
    choice["wrong"] = _try_mode(body, slope, still, False, contacts, choice)
    for i in range(choice["zeros"]):
        zero = choice["zero"][i]
        what, c = zero["what"], zero["who"]
        held = abs(_change(body, choice, what, c)) <= still and depends(body, contacts, choice, what, c)
        still_now = 1 if zero["sign"] == 0 or held else 0
        if what == SLIP and still_now == 1 and not _is_locked(choice, what, c):
            still_now = FOLLOWS
        _write_still(contacts, what, c, still_now)
    held = abs(_change(body, choice, SPIN, 0)) <= still and depends(body, contacts, choice, SPIN, 0)
    if omega == 0.0 and held and contacts["spin_still"] == 0:
        contacts["spin_still"] = UNRESISTED


@kernel
def _begin_to_move(body: np.void, contacts: np.void, choice: np.void) -> None:
    """Let the mode that is tried first be that in which a body starts which its contacts do not hold."""
    per_mass, per_inertia, missing = math.sqrt(body["per_mass"]), math.sqrt(body["per_inertia"]), choice["missing"]
    du, dv, domega = missing[0] * per_mass, missing[1] * per_mass, missing[2] * per_inertia
    least = NEARLY * max(abs(du), abs(dv), body["size"] * abs(domega))
    for i in range(choice["zeros"]):
        zero = choice["zero"][i]
        r0, r1, r2 = _row(contacts, zero["what"], zero["who"])
        rate = r0 * du + r1 * dv + r2 * domega
        scale = body["size"] if zero["what"] == SPIN else 1.0
        zero["before"] = sign_of(rate) if abs(rate) * scale > least else 0


@kernel
def _speed_scale(body: np.void, slope: Any, contacts: np.void) -> float:
    """Speed [m/s] that a fall of one size gives, and the springs as far as they are pressed."""
    speed = math.sqrt(slope.gravity * body["size"])
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        if contact["gap"] < 0.0:
            speed = max(speed, -contact["gap"] * math.sqrt(contact["closing"] * body["per_mass"]))
    return speed


@kernel
def choose(body: np.void, pieces: np.ndarray, slope: Any, space: np.void) -> bool:
    """Choose the mode of the contacts; return whether the body is at rest for good.

    Parameters
    ----------
    body : record of BODY
    pieces : ndarray of PIECE
    slope : Incline
    space : record of SPACE
        Its ``motion`` and ``contacts`` are what is chosen for; in a ``frozen`` impact normals and levers stand
        still. Velocities that must be zero are made exactly zero.
    """
    motion, contacts, choice = space["motion"], space["contacts"], space["choice"]
    _remember(contacts, choice)
    frozen = space["frozen"] != 0
    choice["rigid"], contacts["slip_shared"] = 0.0, 0
    if is_rigid(space["ground"]):  # all that touch lie on one straight side
        choice["rigid"], contacts["slip_shared"] = 1.0, 1
        for c in range(1, contacts["count"]):
            contacts["at"][c]["slip"] = contacts["at"][0]["slip"]
            contacts["at"][c]["slip_left"] = contacts["at"][0]["slip_left"]
    if not frozen:
        for c in range(contacts["count"]):
            place(body, pieces, motion, contacts["at"][c])
    slow = SLOW * _speed_scale(body, slope, contacts) + TINY
    standing = STANDING * math.sqrt(slope.gravity * body["size"]) + SLOW * TINY
    _spread_zeros(body, slow, standing, motion, contacts, choice)
    _list_zeros(0.0 if frozen else SHALLOW * body["size"], contacts, choice)
    still = STEADY * (slope.gravity + motion["omega"] * motion["omega"] * body["size"])
    if frozen:
        still = 0.0
        for c in range(contacts["count"]):
            still = max(still, STEADY * contacts["at"][c]["closing"] * choice["share"][c]["depth"] / body["mass"])
    if choice["zeros"] > 0:
        for c in range(contacts["count"]):
            choice["share"][c]["gap_drift"] = choice["share"][c]["slip_drift"] = 0.0
            if not frozen:
                _write_drifts(body, motion, contacts["at"][c], choice["share"][c])
        side = mirrored(motion)
        if motion["u"] == 0.0 and motion["v"] == 0.0 and motion["omega"] == 0.0:
            if choice["zeros"] > MOST_TRIED and choice["rigid"] == 0.0:
                if hold(body, slope, contacts, choice):
                    return True
                _begin_to_move(body, contacts, choice)
            elif _search(body, slope, still, True, side, contacts, choice) <= SLIGHT * choice["scale"]:
                _apply_mode(body, slope, still, motion["omega"], contacts, choice)
                return True
        _search(body, slope, still, False, side, contacts, choice)
    _apply_mode(body, slope, still, motion["omega"], contacts, choice)
    return False
