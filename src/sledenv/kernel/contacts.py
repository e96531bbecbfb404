"""The work space of a descent: the motion of the body, the list of its contacts, a step in power series, an event."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.geometry import ARC_PIECE, ON_ARC, SIDE_BEND, part_of_bend, place, touching_place, velocities
from sledenv.kernel.ground import GROUND
from sledenv.kernel.records import CONTACT_LOSSES, MOST_CONTACTS

ORDER: Final = 16  # of the power series
WIDTH: Final = ORDER + 3  # terms that have room; places have one order more than velocities
ZEROS: Final = 2 * MOST_CONTACTS + 1  # velocities that may be zero: gap rate and slip of each contact, and the spin
PER: Final = np.array([0.0, *(1.0 / k for k in range(1, WIDTH + 1))])  # 1 / k
DEEPEST: Final = 64  # rows of the stack of the root search
LEAST_FORCED: Final = 1e-9  # part of a step that is taken in spite of events, where they follow at the same time


def fields(kind: str, names: str, shape: tuple[int, ...] = ()) -> list[tuple[Any, ...]]:
    """Fields of a record that have one type and one shape."""
    return [(name, kind, shape) for name in names.split()]


# Where the body is and how it moves [m, rad, m/s, rad/s], at a time [s]; sine and cosine are those of phi.
MOTION: Final = np.dtype(fields("f8", "t x y phi u v omega sine cosine"))

# A contact. Its gap, gap rate and slip are carried along by series of their own: formed anew from the place of the
# body they would lose digits. In its mode a velocity that is zero and stays so is ``still``. The sign of a velocity
# tells the force: -1 and 1 at its bound (of a closing or an opening gap, of a negative or a positive slip), 0 between.
CONTACT: Final = np.dtype(
    [
        ("kind", "i8"),  # see geometry.py
        ("arc", "i8"),  # of the body; of a side the arc where it begins
        ("piece", "i8"),  # of the ground; of a bend the piece that begins there
        ("bend_part", "i8"),  # of the bend that a side touches
        ("zone", "i8"),  # of the ground, in which it lies
        *fields("i8", "gap_sign slip_sign gap_still slip_still"),
        *fields("i8", "gap_left slip_left"),  # signs with which velocities have been released at this instant, or 0
        ("gap", "f8"),  # [m], 0 where the contact began
        ("gap_rate", "f8"),  # [m/s]
        ("slip", "f8"),  # [m/s]
        *fields("f8", "nx ny"),  # [-] normal
        *fields("f8", "normal_lever tangent_lever"),  # [m] what the spin adds to gap rate and slip
        *fields("f8", "gs gc"),  # [m] the same of the centre of an arc, times cosine and minus sine
        *fields("f8", "push_x push_y push_s push_c"),  # what 1 N of load adds to fx, fy, gs and gc, with its friction
        ("stiffness", "f8"),  # [N/m] in its mode, 0 where the gap is locked
        ("pull", "f8"),  # [-] tangential force over load while it slips
        # [m] how much deeper its features are in each other than its spring is pressed: the depth at which they began;
        # less than zero of two contacts that have become one
        ("depth_offset", "f8"),
        *fields("f8", "qx qy radius"),  # [m] centre and radius of the part of the bend that is touched,
        ("bend", "f8"),  # and 1 of a crest, -1 of a dip
        ("closing", "f8"),  # [N/m] stiffness while the gap closes
        ("opening", "f8"),  # [N/m] and while it opens
        ("friction", "f8"),  # [-]
        ("rolling_arm", "f8"),  # [m] of rolling resistance
    ]
)
CONTACTS: Final = np.dtype(
    [
        *fields("i8", "count"),
        *fields("i8", "spin_sign spin_still spin_left"),  # as those of a contact
        ("slip_shared", "i8"),  # 1 if all slip as the first one does: the sum of their friction is known, no part of it
        ("at", CONTACT, (MOST_CONTACTS + 1,)),  # the last one serves to exchange two
    ]
)

# Power series in time [s] of one step: of a contact, and of what all contacts share. distance, dx, dy: from the
# centre of a bend to that of an arc; nx, ny: of its normal; bx, by: the place of a bend in the frame of the body.
TERMS: Final = np.dtype(fields("f8", "gap gap_rate slip normal force distance dx dy nx ny bx by", (WIDTH,)))
# sw, cw: sine and cosine times the spin; gs, gc: forces on arcs times the places of their centres; speed, square: of
# the mass centre, where it feels the air.
SERIES: Final = np.dtype(
    [
        *fields("f8", "x y phi u v omega sine cosine sw cw gs gc moment speed square", (WIDTH,)),
        ("of", TERMS, (MOST_CONTACTS,)),
    ]
)

# The choice of a mode: see mode.py.
ZERO: Final = np.dtype(fields("i8", "what who sign before best"))  # a velocity that is zero, and its sign
LOCK: Final = np.dtype(
    [*fields("i8", "what who"), *fields("f8", "row push kick unit mobility inverse", (3,)), ("force", "f8")]
)
SHARE: Final = np.dtype(  # of a contact
    [
        *fields("f8", "depth normal force gap_drift slip_drift gap_change slip_change"),
        *fields("i8", "gap_before slip_before"),
    ]
)
# Contacts that stand still: a corner of the sum of what they can give, see rest.py.
CORNER: Final = np.dtype(
    [
        *fields("f8", "point", (3,)),  # [N / sqrt(kg)] wrench with the weight, in the norm of the inverse masses
        *fields("f8", "part then moment"),  # [-] its part of the nearest point, and of the next; [N m] of rolling
        *fields("f8", "normal force", (MOST_CONTACTS,)),  # [N] of each contact
    ]
)
CHOICE: Final = np.dtype(
    [
        *fields("i8", "zeros locks spin_before"),
        ("zero", ZERO, (ZEROS,)),
        ("lock", LOCK, (3,)),
        ("share", SHARE, (MOST_CONTACTS,)),
        *fields("f8", "du dv domega"),  # [m/s^2, rad/s^2]
        *fields("f8", "moment load scale"),  # [N m] of rolling, [N] all loads, [N] scale of forces
        ("wrong", "f8"),  # [N] how far the mode is from holding
        ("determinant", "f8"),  # of the mobility of the locked velocities
        ("skew", "f8"),  # 1 if two locks are nearly the same, so that the inverse of that matrix is inaccurate
        ("rigid", "f8"),  # 1 of rigid surfaces: a gap is locked only if a load can open it
        ("corners", "i8"),
        ("corner", CORNER, (4,)),
        ("missing", "f8", (3,)),  # [N / sqrt(kg)] of what would hold a body that stands still
    ]
)

# What ends a step: when [s after its begin], and what happens there to whom.
EVENT: Final = np.dtype([("time", "f8"), ("longest", "f8"), *fields("i8", "code who side piece")])

# What a rebound adds up and keeps: impulses and losses, peaks, and how it began.
SUMS: Final = ("normal_impulse", "tangential_impulse", "rolling_impulse", *CONTACT_LOSSES)
REBOUNDING: Final = np.dtype(
    [
        *fields("f8", " ".join((*SUMS, "peak_force", "peak_penetration"))),
        *fields("f8", "t x phi u v omega slip x_contact"),  # at its begin; x_contact [m]: of the point that touched
        *fields("f8", "part ground side sequence"),  # codes; side: of the first one that touched with both its ends
    ]
)

# An impact, while it goes on and after it.
IMPACT: Final = np.dtype(
    [
        ("per_mass", "f8"),  # [1/kg]
        ("per_inertia", "f8"),  # [1/(kg m^2)]
        ("size", "f8"),  # [m] of the body
        ("a", "f8"),  # [m] arms of the contact point, which lies at (-a, -b) from the mass centre
        ("b", "f8"),
        ("friction", "f8"),  # [-]
        ("rolling_arm", "f8"),  # [m] of rolling resistance
        ("restitution", "f8"),  # [-] 0 of a plastic impact
        ("v_t", "f8"),  # [m/s] slip
        ("v_n", "f8"),  # [m/s] gap rate
        ("omega", "f8"),  # [rad/s]
        *fields("f8", "slip spin"),  # signs of slip and spin in the next phase, 0 where locked
        ("mu", "f8"),  # [-] tangential force over normal force
        ("rho", "f8"),  # [m] rolling moment over normal force
        ("opening", "f8"),  # 1 while the gap opens, 0 while it closes
        ("span", "f8"),  # [N s] normal impulse of the phase that has just passed
        ("sequence", "f8"),  # code of the phases so far, see :func:`sledenv.kernel.books.followed_by`
        *fields("f8", "normal_impulse tangential_impulse rolling_impulse"),  # [N s, N m s] so far
        ("closed", "f8"),  # [J] work of compression
        ("opened", "f8"),  # [J] work of restitution
        ("stored", "f8"),  # [J] what may be given back
        ("v_n_entry", "f8"),  # [m/s] gap rate at the touch
        ("compressed", "f8"),  # [N s] normal impulse at the end of the first compression, of Poisson's hypothesis
        *fields("f8", " ".join(CONTACT_LOSSES)),  # [J]
    ]
)

SPACE: Final = np.dtype(
    [
        ("motion", MOTION),
        ("contacts", CONTACTS),
        ("series", SERIES),
        ("choice", CHOICE),
        ("event", EVENT),
        ("rebound", REBOUNDING),
        ("ground", GROUND),
        ("hit", IMPACT),
        ("poly", "f8", (WIDTH,)),
        ("terms", "f8", (3, WIDTH)),
        ("stack", "f8", (DEEPEST, WIDTH + 2)),
        ("reach", "f8", (5,)),  # how far x, y, sine, cosine and phi can move within a step,
        ("late", "f8", (5,)),  # and by all terms but the first
        # How much a call has done, and where the next call goes on.
        ("lane", "i8"),  # of a batch
        ("begun", "i8"),  # 1 once the flight of that lane has been taken up
        ("undecided", "i8"),  # 1 if the mode is to be chosen
        ("stalled", "i8"),  # events in a row without any progress in time,
        ("forced", "f8"),  # and the part of a step that is then taken in spite of them
        ("marked", "f8"),  # [s] time at which it was last seen that the descent gets on,
        ("marked_steps", "i8"),  # and the steps in contact up to then
        ("frozen", "i8"),  # 1 in an impact of several points: all stands still but velocities and depths
        ("lifted", "i8"),  # 1 if a rigid contact has ended with a load of zero, and no time has passed since
        ("strikes", "i8"),  # impacts of rigid surfaces in this rebound
        ("work", "i8"),  # [-] steps of this call
        ("most_work", "i8"),  # [-] at this number the call stops
        ("once", "i8"),  # 1 if the call ends where a flight begins that is not too short
        ("waits", "i8"),  # 1 once it does: the flight under way has not been decided about
        ("samples", "i8"),  # rows of the trajectory that there were when it began
        ("drag", "f8"),  # [J] lost to the air since the launch
        ("finish", "f8"),  # [m] where the descent ends: the finish, or the end of the run-out behind it
    ]
)


@kernel
def zone_at(ground: np.void, x: float) -> int:
    """Zone of the ground at a place [m]; at a boundary the one with more friction, so that mirror images agree."""
    zone = int(ground["count"]) - 1
    while zone > 0 and x < ground["begin"][zone]:
        zone -= 1
    if zone > 0 and x == ground["begin"][zone] and ground["friction"][zone - 1] > ground["friction"][zone]:
        zone -= 1
    return zone


@kernel
def write_surface(body: np.void, ground: np.void, contact: np.void) -> None:
    """Write friction and rolling arm of the zone in which a contact lies."""
    zone = contact["zone"]
    corner = contact["kind"] != SIDE_BEND and body["corner"][contact["arc"]] != 0.0
    contact["friction"] = ground["friction"][zone]
    contact["rolling_arm"] = ground["corner_arm"][zone] if corner else ground["arc_arm"][zone]


@kernel
def add(body: np.void, pieces: np.ndarray, space: np.void, kind: int, arc: int, piece: int) -> None:
    """Add a contact with gap zero to the list, which has room for it."""
    contacts, ground, motion = space["contacts"], space["ground"], space["motion"]
    contact = contacts["at"][contacts["count"]]
    contact["kind"], contact["arc"], contact["piece"], contact["gap"] = kind, arc, piece, 0.0
    contact["bend_part"] = ON_ARC
    if kind == SIDE_BEND:
        contact["bend_part"] = part_of_bend(body, pieces, arc, piece, motion["sine"], motion["cosine"])
    place(body, pieces, motion, contact)
    contact["gap_rate"], contact["slip"] = velocities(motion, contact)
    contact["gap_sign"] = contact["slip_sign"] = contact["gap_still"] = contact["slip_still"] = 0
    contact["gap_left"] = contact["slip_left"] = 0
    contact["zone"] = 0
    if ground["count"] > 1.0:
        x = pieces[piece]["x"]
        if kind == ARC_PIECE or pieces[piece]["radius"] > 0.0:
            x = touching_place(motion, contact)[0]
        contact["zone"] = zone_at(ground, x)
    contact["closing"], contact["opening"] = ground["closing"][contact["zone"]], ground["opening"][contact["zone"]]
    write_surface(body, ground, contact)
    contacts["count"] += 1


@kernel
def order_last(contacts: np.void) -> None:
    """Let the longer lever be first of the last two contacts if both begin now: mirror images have mirrored lists."""
    last = contacts["count"] - 1
    if last < 1 or contacts["at"][last - 1]["gap"] != 0.0:
        return
    if abs(contacts["at"][last]["normal_lever"]) > abs(contacts["at"][last - 1]["normal_lever"]):
        contacts["at"][MOST_CONTACTS] = contacts["at"][last]
        contacts["at"][last] = contacts["at"][last - 1]
        contacts["at"][last - 1] = contacts["at"][MOST_CONTACTS]


@kernel
def drop(contacts: np.void, c: int) -> None:
    """Take a contact off the list; the last one takes its place."""
    last = contacts["count"] - 1
    if c != last:
        contacts["at"][c] = contacts["at"][last]
    contacts["count"] = last


@kernel
def touches(contacts: np.void, kind: int, arc: int, piece: int) -> bool:
    """Whether a pair of features is in contact."""
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        if contact["kind"] == kind and contact["arc"] == arc and contact["piece"] == piece:
            return True
    return False
