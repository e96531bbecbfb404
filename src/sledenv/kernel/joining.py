"""Two points touch at once: how the second one joins the first, how they agree, and how they part.

Both are points of one contact, with the orientation, place, time and spin of the body. Each has its own gap, slip and
forces, and each is integrated by itself: what rounding makes different is made equal again after each step.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import straight
from sledenv.compiler.values import absolute, equal, less, not_more, where
from sledenv.kernel import normal, progress
from sledenv.kernel.ground import piece_at
from sledenv.kernel.outline import partner, sine_and_cosine, turn_across
from sledenv.kernel.state import POINT, copy

SAME_RATE = 1e-12  # of the speed scale: gap rates of two points that are equal but for rounding
NO_SLIP = 1e-24  # of it: slips that are zero but for rounding
MOST_TURNING = 1e4  # times that: where the gap rates are equal, a slower rim counts as no spin
AT_SURFACE = 1e-9  # of the size: the second point starts to touch if its gap is below this

_POINT = tuple(name for name in POINT.names or () if name != "filling")
_take = straight(lambda source, target: copy(source, target, _POINT))


def _agreeing(contact: Any, one: Any, two: Any) -> None:
    """Program that makes the velocities of both points those of one body, where some are zero or nearly so.

    Rounding makes of a zero at one point a small number at the other. If one point sticks, the slip of the other is
    what the spin makes of the difference of the gaps.
    """
    small, omega = SAME_RATE * contact.scale, contact.omega
    apart = one.gap - two.gap
    quiet = NO_SLIP * contact.scale
    rests, other_rests = not_more(absolute(one.v_t), quiet), not_more(absolute(two.v_t), quiet)
    settled = equal(one.v_n, 0.0) | equal(two.v_n, 0.0)
    # If both points have the same arm a, their gap rates are equal whatever the spin.
    slow = not_more(absolute(omega) * contact.size, MOST_TURNING * small)
    alike = settled & slow & not_more(absolute(one.v_n - two.v_n), small)
    stuck = rests & other_rests & not_more(absolute(omega) * contact.size, small)
    still = alike | stuck | equal(omega, 0.0)
    # Of a body that does not turn both velocities are the same; if one point sticks the other slips by the turning.
    together = where(rests | other_rests, 0.0, one.v_t)
    far = less(normal.NO_DEPTH * contact.size, absolute(apart))
    holds = rests & (equal(one.slip, 0.0) | other_rests)
    other_holds = other_rests & equal(two.slip, 0.0) & ~holds
    slip, other_slip = where(far & other_holds, -apart * omega, one.v_t), where(far & holds, apart * omega, two.v_t)
    one.v_t, two.v_t = where(still, together, slip), where(still, together, other_slip)
    rate = where(settled, 0.0, one.v_n)
    one.v_n, two.v_n = where(still, rate, one.v_n), where(still, rate, two.v_n)
    contact.omega = where(still, 0.0, omega)
    # A lock that both points share is released at both.
    two.slip_left = where(still & equal(contact.spin, 0.0), one.slip_left, two.slip_left)


_agree = straight(_agreeing)


@kernel
def agree(contact: np.void, points: np.ndarray) -> None:
    """Make the velocities of both points those of one body; see the program."""
    _agree(contact, points[0], points[1])


@kernel
def join(body: np.void, space: np.void) -> bool:
    """Let the arc that is watched touch too; False if it is not at the surface."""
    contact, points, ground = space["contact"], space["points"], space["ground"]
    one, two = points[0], points[1]
    arc, rises, phi = int(one["arc"]), one["rising"] != 0.0, contact["phi"]
    sine, cosine = sine_and_cosine(phi + one["shift"])
    apart = one["other"] + one["other_sine"] * sine + one["other_cosine"] * cosine
    if not abs(one["gap"] + apart) <= AT_SURFACE * contact["size"]:
        return False
    _take(one, two)
    two["arc"], two["at_edge"] = partner(body, arc, rises), 0.0
    turn = one["turn"] + turn_across(body, arc, int(two["arc"]), rises)
    other_sine, _ = sine_and_cosine(phi + body["shift"][int(two["arc"])])
    if ground["count"] > 1.0:
        two["piece"] = piece_at(ground, contact["x"] - body["h"][int(two["arc"])] * other_sine)
    progress.write_arc(body, ground, turn, contact, two)
    flat = abs(apart) <= normal.ROUNDING * contact["size"]
    two["gap"] = one["gap"] if flat else min(one["gap"] + apart, 0.0)
    two["v_n"] += (one["h"] * sine - two["h"] * other_sine) * contact["omega"]
    two["v_t"] += (one["gap"] - two["gap"]) * contact["omega"]
    contact["count"] = 2.0
    progress.watch_third(body, one["rising"], contact, one)
    progress.watch_third(body, 1.0 - one["rising"], contact, two)
    if contact["side_touched"] == 0.0:
        contact["side_touched"] = (body["rising_side"] if rises else body["falling_side"])[arc]
    progress.forget_branch(contact, points)
    agree(contact, points)
    return True


@kernel
def part(body: np.void, first_stays: bool, space: np.void) -> None:
    """Go on with one of two points alone."""
    contact, points = space["contact"], space["points"]
    if not first_stays:
        _take(points[1], points[0])
    contact["count"] = 1.0
    points[0]["other_left"] = 1.0
    progress.write_arc(body, space["ground"], points[0]["turn"], contact, points[0])
