"""The impact of several points of rigid surfaces: springs at all of them, ever stiffer; docs/physics.md, section 8.3.

Springs get short as they get stiff: the configuration is frozen, and gravity plays no part. The velocities afterwards do
not depend on the stiffness. A nominal one makes the springs so deep that tolerances keep their meaning.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel import guards
from sledenv.kernel.arithmetic import sixteenth_root
from sledenv.kernel.books import book_step, note_mode
from sledenv.kernel.carry import AT_SURFACE, carry_contacts, stop_or_release
from sledenv.kernel.contacts import ORDER, write_surface
from sledenv.kernel.expansion import last_forces, value
from sledenv.kernel.mode import GAP, SPIN, choose, find_locks, solve_locks
from sledenv.kernel.params import Incline

MOST_STEPS: Final = 2000
PACE: Final = 100.0  # sizes over the speed of approach: how fast the springs swing
SOON: Final = (
    1e-9  # of the time of a swing: the springs begin as deep as they are then, so that they have loads to compare
)
LEAST_TERM: Final = 1e-15  # of the speed of approach: the last terms of a step
LEAST_RATE: Final = 1e-13  # of the speed of approach: a slower end stands still


@kernel
def _expand(body: np.void, space: np.void) -> None:
    """Write the series of a step: normals and levers are constant, so that no products are left."""
    motion, contacts, s, choice = space["motion"], space["contacts"], space["series"], space["choice"]
    find_locks(body, contacts, choice)
    s["u"][0], s["v"][0], s["omega"][0] = motion["u"], motion["v"], motion["omega"]
    for c in range(contacts["count"]):
        contact, terms = contacts["at"][c], s["of"][c]
        terms["gap"][0], terms["gap_rate"][0], terms["slip"][0] = contact["gap"], contact["gap_rate"], contact["slip"]
    for k in range(ORDER):
        _terms_of_forces(body, contacts, choice, s, k)
        for c in range(contacts["count"]):
            contact, terms = contacts["at"][c], s["of"][c]
            u, v, omega = s["u"][k + 1], s["v"][k + 1], s["omega"][k + 1]
            nx, ny = contact["nx"], contact["ny"]
            terms["gap_rate"][k + 1] = terms["slip"][k + 1] = 0.0
            if contact["gap_still"] == 0:
                terms["gap_rate"][k + 1] = nx * u + ny * v + contact["ln"] * omega
            if contact["slip_still"] == 0:
                terms["slip"][k + 1] = ny * u - nx * v + contact["lt"] * omega
            terms["gap"][k + 1] = terms["gap_rate"][k] / (k + 1)
    s["moment"][ORDER] = 0.0
    for c in range(contacts["count"]):
        last_forces(contacts["at"][c], s["of"][c])


@kernel
def _terms_of_forces(body: np.void, contacts: np.void, choice: np.void, s: np.void, k: int) -> None:
    """Write terms of order ``k`` of the forces, and of order ``k + 1`` of the velocities of the body."""
    fx = fy = moment = load = 0.0
    for c in range(contacts["count"]):
        contact, terms = contacts["at"][c], s["of"][c]
        normal = 0.0
        if contact["gap_sign"] != 0:
            normal = -(contact["closing"] if contact["gap_sign"] < 0 else contact["opening"]) * terms["gap"][k]
        force = -contact["slip_sign"] * contact["friction"] * normal
        terms["normal"][k], terms["force"][k] = normal, force
        fx += normal * contact["nx"] + force * contact["ny"]
        fy += normal * contact["ny"] - force * contact["nx"]
        moment += normal * contact["ln"] + force * contact["lt"]
        load += contact["arm"] * normal
    rolling = -contacts["spin_sign"] * load
    moment += rolling
    for i in range(choice["locks"]):
        lock = choice["lock"][i]
        row = lock["row"]
        lock["force"] = (row[0] * fx + row[1] * fy) / body["mass"] + row[2] * moment / body["inertia"]
    if choice["locks"] > 0:
        solve_locks(choice)
    for i in range(choice["locks"]):
        lock = choice["lock"][i]
        push, held = lock["push"], lock["force"]
        fx, fy, moment = fx + held * push[0], fy + held * push[1], moment + held * push[2]
        if lock["what"] == SPIN:
            rolling += held
            continue
        contact, terms = contacts["at"][lock["who"]], s["of"][lock["who"]]
        if lock["what"] == GAP:
            terms["normal"][k] += held
            terms["force"][k] -= contact["slip_sign"] * contact["friction"] * held
            rolling -= contacts["spin_sign"] * contact["arm"] * held
        else:
            terms["force"][k] += held
    m = k + 1
    s["u"][m], s["v"][m] = fx / (body["mass"] * m), fy / (body["mass"] * m)
    s["omega"][m] = moment / (body["inertia"] * m) if contacts["spin_still"] == 0 else 0.0
    s["moment"][k] = rolling


@kernel
def _longest(body: np.void, approach: float, space: np.void) -> float:
    """How long [s] the series of a step hold."""
    s, contacts = space["series"], space["contacts"]
    last = body["size"] * abs(s["omega"][ORDER])
    before = body["size"] * abs(s["omega"][ORDER - 1])
    for c in range(contacts["count"]):
        terms = s["of"][c]
        last = max(last, abs(terms["gap_rate"][ORDER]), abs(terms["slip"][ORDER]))
        before = max(before, abs(terms["gap_rate"][ORDER - 1]), abs(terms["slip"][ORDER - 1]))
    scale, longest = LEAST_TERM * approach, math.inf
    if last > 0.0:
        longest = sixteenth_root(scale / last)
    if before > 0.0:
        ratio = scale / before
        longest = min(longest, sixteenth_root(ratio * sixteenth_root(ratio)))  # its root of order 15, nearly
    return longest


@kernel
def _press(body: np.void, spring: float, plastic: bool, space: np.void, c: int) -> None:
    """Let a point press on its spring."""
    contact, ground = space["contacts"]["at"][c], space["ground"]
    restitution = 0.0 if plastic else ground["restitution"][contact["zone"]]
    write_surface(body, ground, contact)
    contact["closing"], contact["opening"] = spring, restitution * restitution * spring


@kernel
def _let_go(contact: np.void) -> None:
    """Let a point be off the surface: it has no forces until it is back."""
    contact["closing"] = contact["opening"] = contact["friction"] = contact["arm"] = 0.0


@kernel
def _pushes(body: np.void, contacts: np.void, rebound: np.void) -> bool:
    """Whether some spring pushes; one that gives nothing back lets go as soon as it opens, and its energy is lost.

    One that opens and is relaxed but for rounding lets go too: friction comes to its bound where the load ends.
    """
    pushes, relaxed = False, -AT_SURFACE * body["size"]
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        opens = contact["closing"] > 0.0 and contact["gap_sign"] > 0
        if opens and (contact["opening"] == 0.0 or (contact["gap_rate"] > 0.0 and contact["gap"] > relaxed)):
            rebound["hysteresis"] += 0.5 * contact["closing"] * contact["gap"] * contact["gap"]
            contact["gap"] = 0.0
            _let_go(contact)
        elif contact["closing"] > 0.0 and contact["gap_sign"] != 0 and contact["gap"] < 0.0:
            pushes = True
    return pushes


@kernel
def _find_event(body: np.void, approach: float, space: np.void) -> None:
    """Find how long a step is, and what ends it; a point that comes back is born again."""
    contacts, event, poly = space["contacts"], space["event"], space["poly"]
    event["code"], event["time"] = guards.NOTHING, _longest(body, approach, space)
    for c in range(contacts["count"]):
        contact, terms = contacts["at"][c], space["series"]["of"][c]
        guards.watch_slip(
            contact, terms, c, space
        )  # of a point that is off too: the first one tells of the slip of all
        if contact["closing"] > 0.0:
            guards.watch_gap(body, contact, terms, c, space)
            continue
        for k in range(ORDER + 1):
            poly[k] = terms["gap"][k]
        zeros = 0
        while zeros < 3 and contact["gap"] == 0.0 and not poly[zeros] > 0.0:
            zeros += 1
        guards.look(space, zeros, guards.BORN, c, 0)
    guards.watch_spin(contacts, space)


@kernel
def _step(body: np.void, approach: float, spring: float, plastic: bool, space: np.void) -> None:
    """Go to the next event."""
    motion, contacts, s, event = space["motion"], space["contacts"], space["series"], space["event"]
    _expand(body, space)
    _find_event(body, approach, space)
    t = event["time"]
    if t > 0.0:
        motion["u"], motion["v"], motion["omega"] = value(s["u"], t), value(s["v"], t), value(s["omega"], t)
        book_step(space, t)
        carry_contacts(body, t, space)
    who = event["who"]
    if event["code"] == guards.SEPARATION:
        contacts["at"][who]["gap"] = 0.0
        _let_go(contacts["at"][who])
    elif event["code"] == guards.BORN:
        contacts["at"][who]["gap"] = 0.0
        _press(body, spring, plastic, space, who)
    elif event["code"] != guards.NOTHING:
        stop_or_release(space)


@kernel
def _kinetic(body: np.void, motion: np.void) -> float:
    square = motion["u"] * motion["u"] + motion["v"] * motion["v"]
    return 0.5 * (body["mass"] * square + body["inertia"] * motion["omega"] * motion["omega"])  # type: ignore[no-any-return]


@kernel
def _end(body: np.void, approach: float, space: np.void) -> None:
    """Give the contacts back to rigid surfaces. What is left in a spring is lost."""
    contacts, motion, rebound = space["contacts"], space["motion"], space["rebound"]
    ground, all_still = space["ground"], True
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        if contact["gap"] < 0.0:
            rebound["hysteresis"] += 0.5 * contact["closing"] * contact["gap"] * contact["gap"]
        contact["gap"] = 0.0
        contact["closing"], contact["opening"] = math.inf, 0.0
        write_surface(body, ground, contact)
        if abs(contact["gap_rate"]) <= LEAST_RATE * approach:
            contact["gap_rate"] = 0.0
        all_still = all_still and contact["gap_rate"] == 0.0
    if all_still:
        motion["omega"] = 0.0


@kernel
def hit_together(body: np.void, pieces: np.ndarray, plastic: bool, space: np.void) -> bool:
    """Follow the impact of all contacts that there are until none pushes; return whether it ends.

    An end that comes near again is another impact.
    """
    contacts, motion, rebound = space["contacts"], space["motion"], space["rebound"]
    approach = 0.0
    for c in range(contacts["count"]):
        approach = max(approach, -contacts["at"][c]["gap_rate"])
    pace = PACE * approach / body["size"]
    spring = body["mass"] * pace * pace
    friction = 0.0
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        friction = max(friction, contact["friction"])
        _press(body, spring, plastic, space, c)
        contact["gap"] = min(contact["gap_rate"], 0.0) * (SOON / pace)
        if contact["gap_rate"] > 0.0:
            _let_go(contact)
    deepest, lost = rebound["peak_penetration"], rebound["hysteresis"] + rebound["rolling"]
    sliding, energy, ends = rebound["sliding"], _kinetic(body, motion), False
    space["frozen"] = 1.0
    for _ in range(MOST_STEPS):
        rests = choose(body, pieces, Incline(0.0, 0.0, 0.0, 0.0), space)
        note_mode(contacts, rebound)
        count = 0
        for c in range(contacts["count"]):
            count += 1 if contacts["at"][c]["closing"] > 0.0 else 0
        pushes = _pushes(body, contacts, rebound)
        for c in range(contacts["count"]):
            count -= 1 if contacts["at"][c]["closing"] > 0.0 else 0
        if count > 0:  # some have been let go
            continue
        if rests or not pushes:
            ends = True
            break
        _step(body, approach, spring, plastic, space)
    space["frozen"] = 0.0
    _end(body, approach, space)
    rebound["peak_penetration"] = deepest
    rebound["sliding"] = sliding
    if friction > 0.0:
        lost = rebound["hysteresis"] + rebound["rolling"] - lost
        rebound["sliding"] += max(energy - _kinetic(body, motion) - lost, 0.0)
    return ends
