"""Many descents, one in each lane; a single one is a batch of one lane. A caller may give blocks to threads."""

from __future__ import annotations

import math

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.books import close_books, trim
from sledenv.kernel.descent import descend
from sledenv.kernel.ground import lay_ground, lay_rigid, lay_springs
from sledenv.kernel.params import Limits, Scenes, incline_of, launch_of, law_of, rigid_law_of, row_of
from sledenv.kernel.records import RUNNING, Written

FLY, WAIT, STAY = range(3)  # a lane makes a hop; it goes on until a flight begins that is long enough; it does nothing


@kernel
def put_at_launch(scene: np.void, flight: np.void) -> None:
    """Let a flight, which is all 0, begin as its scene says."""
    flight["t_on_chord"] = flight["x_on_chord"] = flight["t_line"] = math.inf
    flight["x"], flight["y"], flight["phi"] = scene["x"], scene["y"], scene["phi"]
    flight["u"], flight["v"], flight["omega"] = scene["u"], scene["v"], scene["omega"]


def descend_lanes(
    rigid: int,
    limits: Limits,
    scenes: Scenes,
    trims: np.ndarray,
    written: Written,
    spaces: np.ndarray,
    last: int,
) -> None:
    """Follow the descents of some lanes, or one hop of each. No lane depends on the other lanes.

    A call returns once it has done ``limits.most_work``. The next call then goes on where this one has stopped.

    Parameters
    ----------
    rigid : int
        1 if surfaces are rigid, 0 if they are compliant.
    limits : Limits
        Shared by all lanes.
    scenes : Scenes
    trims : ndarray, shape (N, 2) or (0, 2)
        Of each lane the spin that the rider's rotor lends to the body [rad/s], and FLY, WAIT or STAY; without rows each
        lane makes all hops.
    written : Written
        A flight whose status is not RUNNING stays as it is; one that is all 0 begins. A trajectory is that of a single
        lane.
    spaces : ndarray of SPACE, shape (1,)
        Work space of this call and of those that go on with it; its ``lane`` is the lane that comes next.
    last : int
        The lane behind the last one that is followed.
    """
    space, flights, by_hops = spaces[0], written.flights, trims.shape[0] > 0
    space["once"] = 1 if by_hops else 0
    space["work"], space["most_work"] = 0, int(limits.most_work)
    while space["lane"] < last:
        lane = space["lane"]
        flight, what = flights[lane], trims[lane, 1] if by_hops else float(FLY)
        if flight["status"] == RUNNING and what != STAY:
            scene = scenes.rows[lane]
            body, ground = scenes.bodies[int(scene["body"])], space["ground"]
            incline = incline_of(scene, body)
            if space["begun"] == 0:
                if flight["t_line"] == 0.0:
                    put_at_launch(scene, flight)
                space["waits"], space["samples"] = int(what), flight["samples"]
                if by_hops and what == FLY:
                    trim(body, scene["rotor_inertia"], flight, trims[lane, 0])
            zones = scenes.zones[int(scene["zones"]) : int(scene["zones_end"])]
            if rigid != 0:
                stiff = rigid_law_of(scene)
                lay_ground(stiff, zones, ground)
                lay_rigid(stiff, ground)
            else:
                law = law_of(scene)
                lay_ground(law, zones, ground)
                lay_springs(law, ground)
            pieces = scenes.pieces[int(scene["ground"]) : int(scene["ground_end"])]
            log = row_of(written.logs, lane)
            done = descend(body, pieces, incline, limits, flight, log, space, written.trajectory)
            close_books(body, pieces, incline, launch_of(scene), flight)
            if not done:
                return
        space["lane"] += 1
