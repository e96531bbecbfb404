"""Many descents, one in each lane; a single one is a batch of one lane. A caller may give blocks to threads."""

from __future__ import annotations

import numpy as np

from sledenv.kernel.descend import close_books, descend, trim
from sledenv.kernel.flight import write_body
from sledenv.kernel.ground import lay_ground
from sledenv.kernel.laws import Law, law_of_row
from sledenv.kernel.outline import incline_of
from sledenv.kernel.params import Limits, Slope, State, reader, row_of
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
    """Follow the descents of some lanes, or one hop of each. No lane depends on the other lanes.

    A call returns once it has done ``limits.most_work``. The next call then goes on where this one has stopped.

    Parameters
    ----------
    like : ContactLaw or RigidLaw
        Any law of the kind that is in ``laws``.
    limits : Limits
        Shared by all lanes.
    bodies : ndarray of BODY, one for all lanes or one for each lane
    laws, slopes : ndarray, one row for all lanes or one for each lane
        Fields of the law; of Slope and of its zones, see :mod:`sledenv.kernel.params`.
    launches : ndarray, shape (N, 6)
        Fields of State.
    trims : ndarray, shape (N, 2) or (0, 2)
        Of each lane, the spin that the rider's rotor lends to the body [rad/s] and the inertia of the rotor [kg m^2].
        With rows each lane makes one hop; without rows it makes all hops.
    flights : ndarray of OUTCOME, shape (N,)
        State of each descent, see :func:`sledenv.kernel.descend.hop`; it is moved on, and its ledger is brought up to
        date. A descent whose status is not RUNNING stays as it is.
    logs : ndarray of REBOUND, shape (N, any) or (1, any)
        Log of each lane, or one log that all lanes share. Rebounds for which there is no room overwrite its last row.
    trajectory : ndarray of TRAJECTORY
        For a single lane. Rows are written while there is room, and its flight counts them all.
    spaces : ndarray of SPACE, shape (1,)
        Work space of this call and of those that go on with it; its ``lane`` is the lane that comes next.
    last : int
        The lane behind the last one that is followed.
    """
    space, once = spaces[0], trims.shape[0] > 0
    space["work"], space["most_work"] = 0.0, limits.most_work
    while space["lane"] < last:
        lane = int(space["lane"])
        flight, body = flights[lane], row_of(bodies, lane)
        if flight["status"] == RUNNING:
            if once and space["stage"] == TAKING_OFF:
                trim(body, trims[lane, 1], flight, trims[lane, 0])
            incline, law = incline_of(_slope_of(slopes, lane)), law_of_row(like, laws, lane)
            lay_ground(law, row_of(slopes, lane), space["ground"])
            write_body(body, space["hop"])
            done = descend(body, law, incline, limits, flight, row_of(logs, lane), space, trajectory, once)
            close_books(body, incline, _launch_of(launches, lane), flight)
            if not done:
                return
        space["lane"] += 1.0
