"""Many descents, one a lane; a single one is a batch of one lane. Whoever calls this may give blocks to threads."""

from __future__ import annotations

import numpy as np

from sledenv.kernel.descend import close_books, descend, trim
from sledenv.kernel.flight import write_body
from sledenv.kernel.geometry import incline_of
from sledenv.kernel.laws import Law, law_of_row
from sledenv.kernel.params import Limits, Slope, State, body_of, reader, row_of
from sledenv.kernel.records import RUNNING
from sledenv.kernel.state import TAKING_OFF

_slope_of, _launch_of = reader(Slope), reader(State)


def descend_lanes(
    like: Law,
    limits: Limits,
    bodies: np.ndarray,
    laws: np.ndarray,
    slopes: np.ndarray,
    launches: np.ndarray,
    trims: np.ndarray,
    flights: np.ndarray,
    logs: np.ndarray,
    trajectory: np.ndarray,
    spaces: np.ndarray,
    last: int,
) -> None:
    """Follow the descents of some lanes, or a hop of each; a lane does not depend on its neighbours.

    A call that has done ``limits.most_work`` returns before it has come to the last lane: the next one goes on there.

    Parameters
    ----------
    like : ContactLaw or RigidLaw
        Of which kind the rows of ``laws`` are.
    limits : Limits
        Shared by all lanes.
    bodies, laws, slopes : ndarray, one row for all lanes or one a lane
        Fields of Body, of the law and of Slope.
    launches : ndarray, shape (N, 6)
        Fields of State.
    trims : ndarray, shape (N, 2) or (0, 2)
        For one hop, spin that the rider's rotor lends to each body [rad/s] and inertia of the rotor [kg m^2]; no row
        follows all hops.
    flights : ndarray of OUTCOME, shape (N,)
        Where each descent is, see :func:`sledenv.kernel.descend.hop`; moved on, their ledgers brought up to date. Those
        whose status is not RUNNING are left alone.
    logs : ndarray of REBOUND, shape (N, any) or (1, any)
        Of each lane the last row is written again and again once there is no room; one row is room that all share.
    trajectory : ndarray of TRAJECTORY
        Of one lane alone: rows are written while there is room, and counted in its flight.
    spaces : ndarray of SPACE, shape (1,)
        Work space of this call and those that go on with it; ``lane`` is the lane that comes next.
    last : int
        Up to which lane, itself not included.
    """
    space, once = spaces[0], trims.shape[0] > 0
    space["work"], space["most_work"] = 0.0, limits.most_work
    while space["lane"] < last:
        lane = int(space["lane"])
        flight, body = flights[lane], body_of(bodies, lane)
        if flight["status"] == RUNNING:
            if once and space["stage"] == TAKING_OFF:
                trim(body, trims[lane, 1], flight, trims[lane, 0])
            incline, law = incline_of(_slope_of(slopes, lane)), law_of_row(like, laws, lane)
            write_body(body, space["hop"])
            done = descend(body, law, incline, limits, flight, row_of(logs, lane), space, trajectory, once)
            close_books(body, incline, _launch_of(launches, lane), flight)
            if not done:
                return
        space["lane"] += 1.0
