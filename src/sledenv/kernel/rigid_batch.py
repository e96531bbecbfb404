"""Many descents, one in each lane; a single one is a batch of one lane. A caller may give blocks to threads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sledenv.kernel.descend import close_books, descend, trim
from sledenv.kernel.flight import write_body
from sledenv.kernel.ground import lay_ground
from sledenv.kernel.laws import Law, law_of_row
from sledenv.kernel.outline import incline_of
from sledenv.kernel.params import Limits, Slope, State, reader, row_of
from sledenv.kernel.records import RUNNING, Written
from sledenv.kernel.state import TAKING_OFF

_slope_of, _launch_of = reader(Slope), reader(State)


class RigidLanes(NamedTuple):
    """What lanes are given; a table has one row for all lanes, or one for each."""

    bodies: np.ndarray  # of BODY
    laws: np.ndarray  # fields of the law
    slopes: np.ndarray  # fields of Slope and of its zones, see :mod:`sledenv.kernel.params`
    launches: np.ndarray  # fields of State
    # Of each lane the spin that the rider's rotor lends to the body [rad/s] and the inertia of the rotor [kg m^2], for
    # one hop; without rows each lane makes all hops.
    trims: np.ndarray


def descend_rigid_lanes(
    like: Law, limits: Limits, lanes: RigidLanes, written: Written, spaces: np.ndarray, last: int
) -> None:
    """Follow the descents of some lanes, or one hop of each. No lane depends on the other lanes.

    A call returns once it has done ``limits.most_work``. The next call then goes on where this one has stopped.

    Parameters
    ----------
    like : ContactLaw or RigidLaw
        Any law of the kind that is in the laws of the lanes.
    limits : Limits
        Shared by all lanes.
    lanes : RigidLanes
    written : Written
        A flight whose status is not RUNNING stays as it is. A trajectory is that of a single lane.
    spaces : ndarray of SPACE, shape (1,)
        Work space of this call and of those that go on with it; its ``lane`` is the lane that comes next.
    last : int
        The lane behind the last one that is followed.
    """
    space, flights, trims = spaces[0], written.flights, lanes.trims
    space["once"] = 1.0 if trims.shape[0] > 0 else 0.0
    space["work"], space["most_work"] = 0.0, limits.most_work
    while space["lane"] < last:
        lane = int(space["lane"])
        flight, body = flights[lane], row_of(lanes.bodies, lane)
        if flight["status"] == RUNNING:
            if trims.shape[0] > 0 and space["stage"] == TAKING_OFF:
                trim(body, trims[lane, 1], flight, trims[lane, 0])
            incline, law = incline_of(_slope_of(lanes.slopes, lane)), law_of_row(like, lanes.laws, lane)
            lay_ground(law, row_of(lanes.slopes, lane), space["ground"])
            write_body(body, space["hop"])
            done = descend(body, law, incline, limits, flight, row_of(written.logs, lane), space, written.trajectory)
            close_books(body, incline, _launch_of(lanes.launches, lane), flight)
            if not done:
                return
        space["lane"] += 1.0
