"""Many descents, one a lane, followed in packs; whoever calls this may give blocks of lanes to threads."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import LANES, straight
from sledenv.kernel.ballistics import begin_flight
from sledenv.kernel.bounce import bounce
from sledenv.kernel.descend import close_books, find_touchdown, hop, meeting, trim, write_rebound
from sledenv.kernel.flight import FEW, tell_body, tell_flight, tell_place, touchdowns
from sledenv.kernel.geometry import has_corners, incline_of
from sledenv.kernel.laws import Law, by_law, law_of_row
from sledenv.kernel.params import Body, Incline, Limits, RigidLaw, Slope, State, body_of, reader, row_of
from sledenv.kernel.records import LOG_FULL, LOSSES, RUNNING
from sledenv.kernel.state import FLYING, MOTION, SUMS, copy


class Lanes(NamedTuple):
    """What the lanes of a batch have of their own; a table of one row serves all lanes."""

    bodies: np.ndarray  # fields of Body, shape (N or 1, 5)
    laws: np.ndarray  # fields of the law, shape (N or 1, 5)
    inclines: np.ndarray  # fields of Incline, shape (N or 1, fields)
    launches: np.ndarray  # fields of State, shape (N, 6)
    flights: np.ndarray  # of OUTCOME, shape (N,)
    logs: np.ndarray  # of REBOUND, shape (N or 1, any); that of one row is never read


_slope_at, _incline_at, _launch_at = reader(Slope), reader(Incline), reader(State)
_INCLINE = len(Incline._fields)


@kernel
def _told(bodies: np.ndarray, lane: int, hop: np.void) -> Body:
    """Return the body of a lane, and write whose hop it is; one body of all lanes has been told before."""
    body = body_of(bodies, lane)
    if bodies.shape[0] > 1:
        tell_body(body, hop)
    return body


def write_inclines(slopes: np.ndarray, inclines: np.ndarray) -> None:
    """Write the fields of Incline, shape (N, 4), for many slopes."""
    for i in range(slopes.shape[0]):
        incline = incline_of(_slope_at(slopes, i))
        for j in range(_INCLINE):
            inclines[i, j] = incline[j]


@kernel
def _close(lanes: Lanes, lane: int) -> None:
    """Close the books of a lane."""
    slope, launch = _incline_at(lanes.inclines, lane), _launch_at(lanes.launches, lane)
    close_books(body_of(lanes.bodies, lane), slope, launch, lanes.flights[lane])


@kernel
def _find_touchdowns(body: Body, like: Law, count: int, space: np.void) -> None:
    """Find the touchdowns of a pack; every contact is left to be followed by itself."""
    touchdowns(body, count, space["pack"], space["hop"])
    for k in range(count):
        space["pack"]["fine"][k] = 0.0


@kernel
def _bounce_all(body: Body, like: RigidLaw, count: int, space: np.void) -> None:
    bounce(body, count, space["pack"], space["hop"])


# Take a pack as far as its lanes go together.
_go_together = by_law(_find_touchdowns, _bounce_all)


@kernel
def _tell_law(pack: np.void, law: RigidLaw, k: int) -> None:
    pack["friction"][k], pack["law_restitution"][k] = law.friction, law.restitution
    pack["arc_arm"][k], pack["corner_arm"][k] = law.rolling_arm, law.corner_rolling_arm
    pack["settle_speed"][k] = law.settle_speed


# Packs need the law of rigid bodies alone.
_tell_law_of = by_law(lambda pack, law, k: None, _tell_law)


def _boarding(pack: Any, k: Any, slope: Any, limits: Any, flight: Any) -> None:
    """Program of a flight that begins at place ``k`` of a pack, with what has been lost before."""
    begin_flight(pack.at(k), slope, limits, flight)
    copy(flight, pack.at(k), LOSSES, to="lost_{}")


def _alighting(pack: Any, k: Any, flight: Any) -> None:
    """Program of a flight that goes on where place ``k`` of a pack is."""
    copy(pack.at(k), flight, MOTION)
    copy(pack.at(k), flight, LOSSES, of="lost_{}")


def _impact(pack: Any, k: Any, contact: Any) -> None:
    """Program of a contact that was the impact at place ``k`` of a pack."""
    meeting(pack.at(k), contact)
    copy(pack.at(k), contact, ("v_t", "v_n", "omega", "sequence", *SUMS))
    contact.peak_force = math.inf


_put_aboard, _bring_up, _tell_impact = straight(_boarding), straight(_alighting), straight(_impact)


@kernel
def _board(like: Law, lanes: Lanes, limits: Limits, lane: int, k: int, space: np.void) -> None:
    """Put a lane at place ``k`` of a pack."""
    pack, at = space["pack"], space["hop"]
    flight, slope = lanes.flights[lane], _incline_at(lanes.inclines, lane)
    _told(lanes.bodies, lane, at)
    tell_place(at, pack, k)
    _tell_law_of(pack, law_of_row(like, lanes.laws, lane), k)
    pack["lane"][k] = lane
    _put_aboard(pack, k, slope, limits, flight)
    pack["rebounds"][k] = flight["rebounds"]


@kernel
def _alight(k: int, pack: np.void, flight: np.void) -> None:
    """Bring a flight up to where place ``k`` of a pack is."""
    _bring_up(pack, k, flight)
    flight["rebounds"] = int(pack["rebounds"][k])


@kernel
def _log_bounces(count: int, lanes: Lanes, space: np.void) -> None:
    """Record the rebounds of a pack that ordinary impacts have left."""
    pack, contact = space["pack"], space["contact"]
    for k in range(count):
        if pack["fine"][k] > 0.0:
            lane = int(pack["lane"][k])
            _tell_impact(pack, k, contact)
            rebound = lanes.logs[lane][min(int(pack["rebounds"][k]), lanes.logs.shape[1]) - 1]
            write_rebound(body_of(lanes.bodies, lane), rebound, contact, pack["a"][k], pack["b"][k])


@kernel
def _hop_alone(like: Law, lanes: Lanes, limits: Limits, lane: int, space: np.void, trajectory: np.ndarray) -> None:
    """Follow a hop of one lane by itself, from its touchdown if that is found already."""
    flight, slope = lanes.flights[lane], _incline_at(lanes.inclines, lane)
    law, log = law_of_row(like, lanes.laws, lane), row_of(lanes.logs, lane)
    body = _told(lanes.bodies, lane, space["hop"])
    find_touchdown(body, slope, limits, flight, space)
    hop(body, law, slope, limits, flight, log, space, trajectory)


@kernel
def _end_hop(
    like: Law, lanes: Lanes, limits: Limits, k: int, once: bool, space: np.void, trajectory: np.ndarray
) -> bool:
    """End a hop at place ``k`` of a pack, the lane's last one or no ordinary one; say whether the lane stays there."""
    pack, at = space["pack"], space["hop"]
    lane = int(pack["lane"][k])
    flight = lanes.flights[lane]
    _alight(k, pack, flight)
    if pack["fine"][k] > 0.0:
        flight["status"] = LOG_FULL if flight["rebounds"] >= limits.max_rebounds else RUNNING
        return False
    tell_flight(at, _incline_at(lanes.inclines, lane), limits, flight)
    at["touchdown"], space["stage"] = pack["touchdown"][k], FLYING
    _hop_alone(like, lanes, limits, lane, space, trajectory)
    if once or flight["status"] != RUNNING:
        return False
    _board(like, lanes, limits, lane, k, space)
    return True


@kernel
def follow_lanes(
    like: Law, lanes: Lanes, limits: Limits, first: int, last: int, once: bool, space: np.void, trajectory: np.ndarray
) -> None:
    """Follow a hop, if ``once``, or all hops in the lanes ``first`` to ``last - 1`` that have not ended.

    Each lane comes out as if it was followed by itself. It keeps its place in a pack from hop to hop, and then leaves
    it to one that waits; bodies with corners have packs of their own. Touchdowns are found for the whole pack; ordinary
    impacts of rigid bodies are followed so, and every other contact by itself. Once ``space["work"]`` is
    ``limits.most_work`` every lane stays where its hop has ended: later calls go on from there.
    """
    pack = space["pack"]
    space["most_work"] = math.inf  # no hop is left unfinished
    kept = lanes.logs.shape[0] > 1  # or one row serves all lanes, and nobody reads it
    tell_body(body_of(lanes.bodies, first), space["hop"])
    for corners in (False, True):
        count, waiting = 0, first
        while space["work"] < limits.most_work:
            while count < LANES and waiting < last:
                alike = has_corners(body_of(lanes.bodies, waiting)) == corners
                if alike and lanes.flights[waiting]["status"] == RUNNING:
                    _board(like, lanes, limits, waiting, count, space)
                    count += 1
                waiting += 1
            if count < FEW:
                break
            _go_together(body_of(lanes.bodies, int(pack["lane"][0])), like, count, space)
            space["work"] += count
            if kept:
                _log_bounces(count, lanes, space)
            for k in range(count - 1, -1, -1):
                if pack["fine"][k] > 0.0 and pack["rebounds"][k] < limits.max_rebounds and not once:
                    continue
                if not _end_hop(like, lanes, limits, k, once, space, trajectory):
                    _close(lanes, int(pack["lane"][k]))
                    count -= 1
                    if k < count:  # the last one moves here
                        lane = int(pack["lane"][count])
                        _alight(count, pack, lanes.flights[lane])
                        _board(like, lanes, limits, lane, k, space)
        for k in range(count):
            lane = int(pack["lane"][k])
            flight = lanes.flights[lane]
            _alight(k, pack, flight)
            while flight["status"] == RUNNING and space["work"] < limits.most_work:
                _hop_alone(like, lanes, limits, lane, space, trajectory)
                if once:
                    break
            _close(lanes, lane)


def descend_lanes(
    like: Law,
    limits: Limits,
    bodies: np.ndarray,
    laws: np.ndarray,
    inclines: np.ndarray,
    launches: np.ndarray,
    trims: np.ndarray,
    flights: np.ndarray,
    rebounds: np.ndarray,
    trajectory: np.ndarray,
    spaces: np.ndarray,
    first: int,
    last: int,
) -> None:
    """Follow the descents of some lanes, or a hop of each; a lane does not depend on its neighbours.

    With ``limits.most_work`` done the lanes are left RUNNING, for calls that go on with them; what follows a hop alone
    does not stop.

    Parameters
    ----------
    like : ContactLaw or RigidLaw
        Of which kind the rows of ``laws`` are.
    limits : Limits
        Shared by all lanes.
    bodies, laws, inclines : ndarray, one row for all lanes or one a lane
        Fields of Body, of the law and of Incline.
    launches : ndarray, shape (N, 6)
        Fields of State.
    trims : ndarray, shape (N, 2) or (0, 2)
        For one hop, spin that the rider's rotor lends to each body [rad/s] and inertia of the rotor [kg m^2]; no row
        follows all hops. (In a tuple with other arguments the table would cost a fifth of the speed.)
    flights : ndarray of OUTCOME, shape (N,)
        Where each descent is, see :func:`sledenv.kernel.descend.hop`; moved on, their ledgers brought up to date. Those
        whose status is not RUNNING are left alone.
    rebounds : ndarray of REBOUND, shape (N, ``limits.max_rebounds``), (N, 1) or (1, 1)
        The logs; of a hop, the last contact; one row is room that nobody reads.
    trajectory : ndarray of TRAJECTORY, shape (0,)
    spaces : ndarray of SPACE, shape (1,)
        Work space, of this call alone.
    first, last : int
        The lanes are ``first`` to ``last - 1``.
    """
    once = trims.shape[0] > 0
    lanes = Lanes(bodies, laws, inclines, launches, flights, rebounds)
    spaces[0]["work"] = 0.0
    if once:
        for i in range(first, last):
            if flights[i]["status"] == RUNNING:
                trim(body_of(bodies, i), trims[i, 1], flights[i], trims[i, 0])
    follow_lanes(like, lanes, limits, first, last, once, spaces[0], trajectory)
