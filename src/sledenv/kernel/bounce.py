"""Ordinary hops of rigid bodies in packs: a flight, and an impact that lets the body go.

What :func:`bounce` finds to be something else it leaves where it was, for :mod:`sledenv.kernel.rigid`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import LANES, packed
from sledenv.compiler.values import equal, less, not_more, where
from sledenv.kernel import impact
from sledenv.kernel.ballistics import arrival
from sledenv.kernel.flight import for_bodies, touchdowns
from sledenv.kernel.friction import Mobility
from sledenv.kernel.geometry import without_turns
from sledenv.kernel.motion import finish_of
from sledenv.kernel.params import Body
from sledenv.kernel.records import ARC, LOSSES
from sledenv.kernel.state import change


def touch(hop: Any, corners: bool) -> None:
    """Program of a flight up to its touchdown, if that comes first and one point touches, and of how it is hit."""
    finished = finish_of(hop)
    lands = ~not_more(finished, hop.touchdown) & not_more(hop.touchdown, hop.horizon) & less(hop.touchdown, math.inf)
    arrival(hop, hop.touchdown, corners)
    curved, arm = hop.radius, hop.arc_arm
    if corners:
        on_arc = equal(hop.feature, float(ARC))
        lands = lands & (on_arc | ~impact.lies_flat(without_turns(hop.phi_landing), hop.across, hop.size))
        curved, arm = where(on_arc, hop.radius, 0.0), where(on_arc, hop.arc_arm, hop.corner_arm)
    hop.v_t, hop.v_n, hop.arm = hop.v_t_landing, hop.v_n_landing, arm
    pressing = hop.inward + (curved - hop.b) * hop.omega * hop.omega
    hop.restitution = impact.softened(hop.law_restitution, hop.settle_speed, hop.v_n, pressing)
    impact.begin_impact(hop)
    hop.sequence = 0.0
    hop.going = where(lands, hop.going, -1.0)


def leave(hop: Any) -> None:
    """Program of the end of a hop: the next flight starts where an ordinary one has ended."""
    fine = equal(hop.going, 0.0) & less(0.0, hop.v_n)
    hop.hysteresis = impact.hysteresis_of(hop, impact.ENERGETIC)
    change(
        hop,
        fine,
        t=hop.t_landing,
        x=hop.x_landing,
        y=hop.b,
        phi=hop.phi_landing,
        u=hop.v_t - hop.b * hop.omega,
        v=hop.v_n + hop.a * hop.omega,
        horizon=hop.max_time - hop.t_landing,
        rebounds=hop.rebounds + 1.0,
        **{f"lost_{name}": getattr(hop, f"lost_{name}") + getattr(hop, name) for name in LOSSES},
    )
    hop.omega = where(fine, hop.omega, hop.omega_landing)
    hop.fine = where(fine, 1.0, 0.0)


_touch = for_bodies(touch, packed)
_pass, _leave = packed(lambda hop: impact.pass_phase(hop, impact.ENERGETIC)), packed(leave)


@kernel
def _choose(pack: np.void) -> bool:
    """Choose the branch of each impact whose slip or spin is zero; say whether an impact goes on."""
    going = False
    for k in range(LANES):
        if pack["going"][k] > 0.0:
            going = True
            slip, spin = pack["slip"][k], pack["spin"][k]
            if slip == 0.0 or spin == 0.0:
                w = Mobility(pack["per_mass"][k], pack["per_inertia"][k], pack["a"][k], pack["b"][k])
                friction, arm, size = pack["friction"][k], pack["arm"][k], pack["size"][k]
                pack["slip"][k], pack["spin"][k], pack["mu"][k], pack["rho"][k] = impact.choose_signs(
                    w, friction, arm, size, slip, spin
                )
    return going


@kernel
def bounce(body: Body, count: int, pack: np.void, hop: np.void) -> None:
    """Follow the first ``count`` flights of a pack to their next rebound; what is not ordinary stays where it is.

    Parameters
    ----------
    body : Body
        With corners or without, as all those of the pack.
    count : int
        Up to LANES.
    pack : record of PACK
        Told of each lane's body, slope, law, flight and books. Afterwards ``fine`` tells which hops were
        ordinary, and ``touchdown`` how long each flight was.
    hop : record of HOP
        Work space.
    """
    touchdowns(body, count, pack, hop)
    for k in range(count, LANES):
        pack["touchdown"][k] = math.inf
    _touch(body, pack)
    for _ in range(impact.MOST_PHASES - 1):
        if not _choose(pack):
            break
        _pass(pack)
    _leave(pack)
