"""How the contacts come to the end of a step, and what an event there does to their velocities."""

from __future__ import annotations

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel import guards
from sledenv.kernel.books import book_spring, keep_peaks
from sledenv.kernel.contacts import ORDER
from sledenv.kernel.mode import all_friction

AT_SURFACE = 1e-15  # of the size: a gap this small is that of a contact which has just begun


@kernel
def advance_contacts(body: np.void, t: float, space: np.void) -> bool:
    """Carry the contacts along to the end of a step [s]; return whether a velocity has passed zero by rounding.

    Of two events at the same time the later one must not leave its velocity with the wrong sign.
    """
    contacts, event, rebound, passed = space["contacts"], space["event"], space["rebound"], False
    for c in range(contacts["count"]):
        contact, terms = contacts["at"][c], space["series"]["of"][c]
        before = contact["gap"]
        gap = rate = slip = normal = 0.0
        for k in range(ORDER, -1, -1):
            gap, rate = gap * t + terms["gap"][k], rate * t + terms["gap_rate"][k]
            slip, normal = slip * t + terms["slip"][k], normal * t + terms["normal"][k]
        contact["gap"], contact["gap_rate"], contact["slip"] = gap, rate, slip
        separates = event["code"] == guards.SEPARATION and event["who"] == c
        begins = contact["gap_sign"] < 0 and contact["closing"] > 0.0 and contact["gap"] > -AT_SURFACE * body["size"]
        if separates or begins:
            contact["gap"] = 0.0
        book_spring(contact, before, rebound)
        keep_peaks(contact, normal, rebound)
        contact["gap_left"] = contact["slip_left"] = 0
        elastic = contact["closing"] == contact["opening"]
        if contact["gap_sign"] * contact["gap_rate"] < 0.0 and not elastic:
            contact["gap_rate"], passed = 0.0, True
        rubs = contact["friction"] > 0.0 or (contacts["slip_shared"] != 0 and all_friction(contacts) > 0.0)
        if contact["slip_sign"] * contact["slip"] < 0.0 and rubs:
            contact["slip"], passed = 0.0, True
    contacts["spin_left"] = 0
    motion = space["motion"]
    if contacts["spin_sign"] * motion["omega"] < 0.0:
        arms = 0.0
        for c in range(contacts["count"]):
            arms += contacts["at"][c]["rolling_arm"]
        if arms > 0.0:
            motion["omega"], passed = 0.0, True
    return passed


@kernel
def stop_or_release(space: np.void) -> None:
    """Let a velocity of the contacts be zero at the end of a step, or free if it is released there."""
    contacts, event, motion = space["contacts"], space["event"], space["motion"]
    code, side = event["code"], event["side"]
    contact = contacts["at"][event["who"]]
    if code == guards.SPIN_ZERO:
        motion["omega"] = 0.0
    elif code == guards.SPIN_FREE:
        contacts["spin_left"] = side
    elif code == guards.GAP_ZERO:
        contact["gap_rate"] = 0.0
    elif code == guards.GAP_FREE:
        contact["gap_left"] = side
    elif code == guards.SLIP_ZERO:
        contact["slip"] = 0.0
    elif code == guards.SLIP_FREE:
        contact["slip_left"] = side
