"""The impact of several points of rigid surfaces: springs at all of them, ever stiffer; docs/physics.md, 8.3.

The stiffer the springs, the shorter they act: the body stands still, and gravity plays no part. The velocities after
it do not depend on the stiffness. A nominal one makes the springs so deep that tolerances keep their meaning.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel import guards
from sledenv.kernel.advance import AT_SURFACE, advance_contacts, stop_or_release
from sledenv.kernel.books import book_step, note_mode
from sledenv.kernel.contacts import ORDER, write_surface
from sledenv.kernel.expansion import expand, longest_step, value
from sledenv.kernel.mode import choose
from sledenv.kernel.params import Incline

MOST_STEPS: Final = 2000
PACE: Final = 100.0  # sizes over the speed of approach: how fast the springs swing
SOON: Final = 1e-9  # of the time of a swing: springs begin as deep as they are then, so that their loads compare
LEAST_TERM: Final = 1e-15  # of the speed of approach: the last terms of a step
PLASTIC: Final = 1e-7  # restitution below which what several points give back is lost in rounding: they give nothing
_NO_GRAVITY: Final = Incline(0.0, 0.0, 0.0, 0.0, 0.0)
LEAST_RATE: Final = 1e-13  # of the speed of approach: a slower end stands still


@kernel
def _press(body: np.void, spring: float, plastic: bool, space: np.void, c: int) -> None:
    """Let a point press on its spring."""
    contact, ground = space["contacts"]["at"][c], space["ground"]
    restitution = ground["restitution"][contact["zone"]]
    if plastic or restitution < PLASTIC:
        restitution = 0.0
    write_surface(body, ground, contact)
    contact["closing"], contact["opening"] = spring, restitution * restitution * spring


@kernel
def _let_go(contact: np.void) -> None:
    """Let a point be off the surface: it has no forces until it is back."""
    contact["closing"] = contact["opening"] = contact["friction"] = contact["rolling_arm"] = 0.0


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
    """Find how long a step is, and what ends it; a point that comes back touches again."""
    contacts, event, poly, motion = space["contacts"], space["event"], space["poly"], space["motion"]
    speed = max(abs(motion["u"]), abs(motion["v"]), body["size"] * abs(motion["omega"]), 1e-12)
    event["code"] = guards.NOTHING
    event["time"] = longest_step(body, _NO_GRAVITY, LEAST_TERM * approach / speed, space)
    for c in range(contacts["count"]):
        contact, terms = contacts["at"][c], space["series"]["of"][c]
        guards.watch_slip(contact, terms, c, space)  # of one that is off too: the first one tells of the slip of all
        if contact["closing"] > 0.0:
            guards.watch_gap(body, contact, terms, c, space)
            continue
        for k in range(ORDER + 1):
            poly[k] = terms["gap"][k]
        zeros = 0
        while zeros < 3 and contact["gap"] == 0.0 and not poly[zeros] > 0.0:
            zeros += 1
        guards.shorten_to_first_root(space, zeros, guards.TOUCH, c, 0)
    guards.watch_spin(contacts, space)


@kernel
def _step(body: np.void, pieces: np.ndarray, approach: float, spring: float, plastic: bool, space: np.void) -> None:
    """Go to the next event."""
    motion, contacts, s, event = space["motion"], space["contacts"], space["series"], space["event"]
    expand(body, _NO_GRAVITY, space)
    _find_event(body, approach, space)
    t = event["time"]
    if t > 0.0:
        motion["u"], motion["v"], motion["omega"] = value(s["u"], t), value(s["v"], t), value(s["omega"], t)
        book_step(space, t)
        advance_contacts(body, t, space)
    who = event["who"]
    if event["code"] == guards.SEPARATION:
        contacts["at"][who]["gap"] = 0.0
        _let_go(contacts["at"][who])
    elif event["code"] == guards.TOUCH:
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
    space["frozen"] = 1
    for _ in range(MOST_STEPS):
        rests = choose(body, pieces, _NO_GRAVITY, space)
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
        _step(body, pieces, approach, spring, plastic, space)
    space["frozen"] = 0
    _end(body, approach, space)
    rebound["peak_penetration"] = deepest
    rebound["sliding"] = sliding
    if friction > 0.0:
        lost = rebound["hysteresis"] + rebound["rolling"] - lost
        rebound["sliding"] += max(energy - _kinetic(body, motion) - lost, 0.0)
    return ends
