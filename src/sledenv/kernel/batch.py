"""Many descents, one in each lane; a single one is a batch of one lane. A caller may give blocks to threads."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sledenv.kernel.books import close_books, trim
from sledenv.kernel.descent import descend
from sledenv.kernel.ground import lay_ground, lay_rigid, lay_springs
from sledenv.kernel.params import Limits, incline_of, launch_of, law_of, rigid_law_of, row_of, slope_of
from sledenv.kernel.records import RUNNING, Written

FLY, WAIT, STAY = range(3)  # a lane makes a hop; it goes on until a flight begins that is long enough; it does nothing


class Lanes(NamedTuple):
    """What lanes are given; a table has one row for all lanes, or one for each."""

    bodies: np.ndarray  # of BODY
    laws: np.ndarray  # fields of the law
    slopes: np.ndarray  # fields of Slope and of its zones, see :mod:`sledenv.kernel.params`
    launches: np.ndarray  # fields of State
    # Of each lane the spin that the rider's rotor lends to the body [rad/s], the inertia of the rotor [kg m^2], and
    # FLY, WAIT or STAY; without rows each lane makes all hops.
    trims: np.ndarray
    tracks: np.ndarray  # which pieces are the ground of a lane: the first one, and the one behind the last
    pieces: np.ndarray  # of PIECE, of all tracks


def descend_lanes(rigid: int, limits: Limits, lanes: Lanes, written: Written, spaces: np.ndarray, last: int) -> None:
    """Follow the descents of some lanes, or one hop of each. No lane depends on the other lanes.

    A call returns once it has done ``limits.most_work``. The next call then goes on where this one has stopped.

    Parameters
    ----------
    rigid : int
        1 if the laws are those of rigid surfaces, 0 if they are those of compliant ones.
    limits : Limits
        Shared by all lanes.
    lanes : Lanes
    written : Written
        A flight whose status is not RUNNING stays as it is. A trajectory is that of a single lane.
    spaces : ndarray of SPACE, shape (1,)
        Work space of this call and of those that go on with it; its ``lane`` is the lane that comes next.
    last : int
        The lane behind the last one that is followed.
    """
    space, flights, trims = spaces[0], written.flights, lanes.trims
    space["once"] = 1 if trims.shape[0] > 0 else 0
    space["work"], space["most_work"] = 0, int(limits.most_work)
    while space["lane"] < last:
        lane = space["lane"]
        flight, body = flights[lane], row_of(lanes.bodies, lane)
        what = trims[lane, 2] if trims.shape[0] > 0 else float(FLY)
        if flight["status"] == RUNNING and what != STAY:
            if space["begun"] == 0:
                space["waits"], space["samples"] = int(what), flight["samples"]
                if trims.shape[0] > 0 and what == FLY:
                    trim(body, trims[lane, 1], flight, trims[lane, 0])
            incline, ground = incline_of(slope_of(lanes.slopes, lane)), space["ground"]
            if rigid != 0:
                stiff = rigid_law_of(lanes.laws, lane)
                lay_ground(stiff, row_of(lanes.slopes, lane), ground)
                lay_rigid(stiff, ground)
            else:
                law = law_of(lanes.laws, lane)
                lay_ground(law, row_of(lanes.slopes, lane), ground)
                lay_springs(law, ground)
            log, track = row_of(written.logs, lane), row_of(lanes.tracks, lane)
            pieces = lanes.pieces[int(track[0]) : int(track[1])]
            done = descend(body, pieces, incline, limits, flight, log, space, written.trajectory)
            close_books(body, pieces, incline, launch_of(lanes.launches, lane), flight)
            if not done:
                return
        space["lane"] += 1
