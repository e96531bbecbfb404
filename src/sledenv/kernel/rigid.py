"""The touch of rigid surfaces: impacts, and the sustained contact that they may settle into."""

from __future__ import annotations

import math

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import scalar, straight
from sledenv.kernel import normal
from sledenv.kernel.geometry import corner_lengths, whole_turns
from sledenv.kernel.impact import ENERGETIC, MOST_PHASES, impact, lies_flat, softened
from sledenv.kernel.params import Body, Incline, RigidLaw
from sledenv.kernel.progress import arms_now, change_corner
from sledenv.kernel.records import ARC, INCONSISTENT, NOSE, RUNNING, SEPARATED, STEP_BUDGET, TAIL
from sledenv.kernel.state import SUMS, add, copy, followed_by

MOST_STRIKES = 10000  # impacts without a flight between them
MOST_CHORD_IMPACTS = 64
LEVEL = 1e-12  # of the size: a corner this close to the slope touches
NEARLY = 1e-6  # of the size: with one this close, springs however stiff would touch with both
JOLT = 1e-12  # of the speed scale: approach of an impact that friction brings about
MOST_NORMAL = 1e9  # times the weight and the centrifugal forces

_bring = straight(lambda source, target: copy(source, target, ("v_t", "v_n", "omega", "sequence")))
_book = straight(lambda hop, contact: add(hop, contact, SUMS))
_with_corner = scalar(lambda sequence, corner: (followed_by(sequence, 20.0 + corner),))  # no code of a phase


@kernel
def write_rigid(body: Body, law: RigidLaw, slope: Incline, contact: np.void) -> None:
    """Write how rigid surfaces meet."""
    size = body.radius + body.eccentricity
    spin, slip = contact["omega"], contact["v_t"]
    normal.write_rigid(contact)
    contact["friction"] = law.friction
    contact["arc_arm"], contact["corner_arm"] = law.rolling_arm, law.corner_rolling_arm
    contact["most_normal"] = MOST_NORMAL * body.mass * (slope.inward + size * spin * spin + slip * slip / size)


@kernel
def _hit(law: RigidLaw, a: float, b: float, restitution: float, contact: np.void, hop: np.void) -> int:
    """Follow one impact of the feature that touches, whose arms are given. Return the number of phases."""
    hop["a"], hop["b"] = a, b
    hop["friction"], hop["restitution"] = law.friction, restitution
    hop["arm"] = law.rolling_arm if contact["feature"] == ARC else law.corner_rolling_arm
    _bring(contact, hop)
    count = impact(ENERGETIC, hop, None)
    _bring(hop, contact)
    _book(hop, contact)
    return count


@kernel
def _lie_down(body: Body, contact: np.void) -> None:
    """Bring a body to lie on its chord: what both corners have left is lost, and the slope gives the impulse."""
    a, b = arms_now(body, int(contact["feature"]), contact)
    omega = contact["omega"]
    v = contact["v_n"] + a * omega
    contact["hysteresis"] += 0.5 * (body.inertia * omega**2 + body.mass * v * v)
    contact["normal_impulse"] -= body.mass * v
    contact["v_t"] -= b * omega
    contact["omega"], contact["v_n"], contact["paired"] = 0.0, 0.0, 1.0


@kernel
def strike_chord(body: Body, law: RigidLaw, pressed: bool, contact: np.void, hop: np.void) -> int:
    """Follow the impacts of a chord that lies on the slope, one corner at a time: docs/physics.md, section 8.

    The corners are hit in turn, the faster first, with the restitution of the law. A body that still approaches after
    MOST_CHORD_IMPACTS of them, or with both corners slower than ``law.settle_speed``, lies on its chord; so does
    one that is pressed onto the slope with both corners at rest.

    Returns
    -------
    int
        SEPARATED (both corners leave), RUNNING (one of them stays, or both: ``contact["paired"]``) or STEP_BUDGET.
    """
    for i in range(2 * MOST_CHORD_IMPACTS):
        corner = int(contact["feature"])
        here = contact["v_n"]
        change_corner(body, NOSE if corner == TAIL else TAIL, contact)
        there = contact["v_n"]
        slow = i >= MOST_CHORD_IMPACTS or (pressed and max(abs(here), abs(there)) < law.settle_speed)
        if (slow and min(here, there) < 0.0) or (pressed and here == 0.0 and there == 0.0):
            _lie_down(body, contact)
            return RUNNING
        if here <= there:
            change_corner(body, corner, contact)
            contact["v_n"] = here
        if contact["v_n"] >= 0.0:
            break
        a, b = arms_now(body, int(contact["feature"]), contact)
        plastic = pressed and -contact["v_n"] < law.settle_speed
        contact["sequence"] = _with_corner(contact["sequence"], contact["feature"])[0]
        if _hit(law, a, b, 0.0 if plastic else law.restitution, contact, hop) > MOST_PHASES:
            return STEP_BUDGET
    return SEPARATED if contact["v_n"] > 0.0 else RUNNING


@kernel
def _strike_once(
    body: Body, law: RigidLaw, slope: Incline, a: float, b: float, alone: bool, contact: np.void, hop: np.void
) -> int:
    """Follow the impact of one point whose arms are given, or of the chord if that is down and not left ``alone``.

    An impact slower than ``law.settle_speed`` is plastic if the body is pressed onto the slope; that ends the infinite
    sequence of ever smaller bounces (docs/physics.md, section 6). The result is that of :func:`strike_chord`.
    """
    feature, omega = int(contact["feature"]), contact["omega"]
    if alone:  # without an approach, forces that only grow very large would not act at all
        contact["v_n"] = min(contact["v_n"], -JOLT * contact["scale"])
    if not alone and feature != ARC:
        local, across = contact["phi"] - whole_turns(contact["phi"]), corner_lengths(body)[1]
        if lies_flat(local, across, NEARLY * hop["size"]):
            contact["on_chord"] = 1.0
        if lies_flat(local, across, LEVEL * hop["size"]):
            contact["phi"] += math.copysign(math.pi, local) - local  # flat, so that neither corner lies below the slope
            return strike_chord(body, law, slope.inward - b * omega * omega > 0.0, contact, hop)
    radius = body.radius if feature == ARC else 0.0
    pressing = slope.inward + (radius - b) * omega * omega
    restitution = softened(law.restitution, law.settle_speed, contact["v_n"], pressing)
    if _hit(law, a, b, restitution, contact, hop) > MOST_PHASES:
        return STEP_BUDGET
    return SEPARATED if contact["v_n"] > 0.0 else RUNNING


@kernel
def strike(body: Body, law: RigidLaw, slope: Incline, left: int, space: np.void) -> int:
    """Let rigid surfaces hit each other.

    Parameters
    ----------
    body, law, slope
        See :mod:`sledenv.kernel.params`.
    left : int
        RUNNING at a touchdown; or the status with which :func:`sledenv.kernel.contact.follow` has left the contact.
    space : record of SPACE
        Its ``contact`` holds the state, its ``hop`` the body.

    Returns
    -------
    int
        RUNNING if the surfaces stay in contact, with two points if ``contact["paired"]``; SEPARATED or STEP_BUDGET.
    """
    contact, hop = space["contact"], space["hop"]
    a, b = contact["a_before"], contact["b_before"]
    if left == RUNNING:
        write_rigid(body, law, slope, contact)
        contact["peak_force"] = math.inf
        space["strikes"] = 0.0
    else:
        a, b = arms_now(body, int(contact["feature"]), contact)
    space["strikes"] += 1.0
    if space["strikes"] > MOST_STRIKES:
        return STEP_BUDGET
    contact["paired"] = contact["held"] = 0.0
    return _strike_once(body, law, slope, a, b, left == INCONSISTENT, contact, hop)
