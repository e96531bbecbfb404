"""Many descents, one a lane: followed in blocks that threads share, and in a block as many side by side as possible."""

from __future__ import annotations

import numpy as np
from numba import prange

from sledenv.kernel.bounce import (
    B_ARM,
    B_CORNER_ARM,
    B_FRICTION,
    B_HYSTERESIS,
    B_LENGTH,
    B_MAX_TIME,
    B_REBOUNDS,
    B_RESTITUTION,
    B_ROLLING,
    B_ROWS,
    B_SETTLE_SPEED,
    B_SLIDING,
    B_T,
    B_U,
    B_X,
    I_FINE,
    I_HYSTERESIS,
    I_IMPULSE,
    I_OMEGA,
    I_ROLLED,
    I_ROLLING,
    I_SLID,
    I_TANGENTIAL,
    I_V_N,
    I_V_T,
    L_A,
    L_B,
    L_FEATURE,
    L_OMEGA,
    L_PHI,
    L_T,
    L_U,
    L_V,
    L_V_T,
    L_X,
    bounce,
    bounce_pack,
)
from sledenv.kernel.chord import NOW_ROWS
from sledenv.kernel.contact import PAUSED, begin_contact, choose_free, end_contact, follow, go_on
from sledenv.kernel.descend import arrive, begin, close_books, depart, hop, land, trim, work_space, write_rebound
from sledenv.kernel.events import NOTHING, RATE_ZERO, SEPARATION
from sledenv.kernel.flight import (
    F_DOWNHILL,
    F_GRAVITY,
    F_HORIZON,
    F_LANE,
    F_OMEGA,
    F_PHI,
    F_TIME,
    F_V,
    F_Y,
    FEW,
    pack_of,
    touchdown_times,
)
from sledenv.kernel.geometry import has_corners, incline_of
from sledenv.kernel.jit import allocating, kernel, parallel_kernel
from sledenv.kernel.laws import Law, by_law, law_of_row, pair_of
from sledenv.kernel.params import Body, ContactLaw, Incline, Limits, RigidLaw, Slope, State
from sledenv.kernel.records import LOG_FULL, REBOUND, RUNNING, TRAJECTORY
from sledenv.kernel.rows import WIDTH, table
from sledenv.kernel.series import ROWS, Z_BRANCH, Z_EVENT, Z_MOST_STEPS, Z_ROWS, Z_STEPS, Z_TOLD
from sledenv.kernel.state import (
    HYSTERESIS,
    IMPULSE_N,
    IMPULSE_R,
    IMPULSE_T,
    OMEGA,
    PHI,
    ROLLING,
    SLIDING,
    STATE_SIZE,
    TIME,
    V_N,
    V_T,
    X,
)
from sledenv.kernel.step import LEFT_ALONE, step_abreast
from sledenv.kernel.trace import ABREAST, LANES

LaneSpace = tuple[
    np.ndarray,
    np.ndarray,
    tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    tuple[np.ndarray, np.ndarray, np.ndarray],
    tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
]


@allocating
def _lane_space(pack: np.ndarray, lanes: int, abreast: int) -> LaneSpace:
    side = table(Z_ROWS, abreast), table(STATE_SIZE, abreast), table(ROWS * WIDTH, abreast)
    own_z = np.zeros((abreast, Z_ROWS + NOW_ROWS))
    own = own_z, np.zeros((abreast, STATE_SIZE)), np.zeros((abreast, STATE_SIZE)), np.zeros(abreast, np.int64)
    places = 1
    while places < lanes:
        places *= 2
    return pack, np.zeros(places, np.int64), work_space(), side, own


@allocating
def _compliant_space(body: Body, like: ContactLaw, lanes: int) -> LaneSpace:
    return _lane_space(pack_of(body), lanes, 0 if has_corners(body) else ABREAST)


@allocating
def _rigid_space(body: Body, like: RigidLaw, lanes: int) -> LaneSpace:
    return _lane_space(bounce_pack(body), lanes, 0)


# Arrays that ``hop_lanes`` works in: a pack of flights, lanes that wait, the space of one contact, and that of contacts
# abreast.
lane_space = by_law(_compliant_space, _rigid_space)


@kernel
def _row(table: np.ndarray, lane: int) -> int:
    """Row of a lane in a table with one row a lane or one for all."""
    return lane if table.shape[0] > 1 else 0


@allocating
def _inclines(slopes: np.ndarray) -> np.ndarray:
    """Return the fields of Incline in the rows of many slopes."""
    inclines = np.empty((slopes.shape[0], 4))
    for i in range(slopes.shape[0]):
        q = incline_of(Slope(slopes[i, 0], slopes[i, 1], slopes[i, 2]))
        inclines[i, 0], inclines[i, 1], inclines[i, 2], inclines[i, 3] = q.downhill, q.inward, q.length, q.gravity
    return inclines


@kernel
def _incline(inclines: np.ndarray, lane: int) -> Incline:
    q = inclines[_row(inclines, lane)]
    return Incline(q[0], q[1], q[2], q[3])


@kernel
def _launch(launches: np.ndarray, lane: int) -> State:
    z = launches[lane]
    return State(z[0], z[1], z[2], z[3], z[4], z[5])


@kernel
def block_size(lanes: int) -> int:
    """Lanes that a thread follows at a time: enough to fill packs of flights, few enough to keep all threads busy."""
    return min(max(lanes // 64, LANES), 4 * LANES)


@kernel
def _around(i: int, waiting: np.ndarray) -> int:
    """Place of a lane that waits: there is a power of two of them, and one counts around without a division."""
    return int(i & (waiting.shape[0] - 1))


@kernel
def _seek(
    body: Body,
    inclines: np.ndarray,
    limits: Limits,
    flights: np.ndarray,
    waiting: np.ndarray,
    head: int,
    tail: int,
    pack: np.ndarray,
) -> int:
    """Find the touchdowns of the lanes ``head`` to ``tail - 1`` that wait, up to LANES; return how many."""
    count = min(tail - head, LANES)
    for k in range(count):
        lane = waiting[_around(head + k, waiting)]
        flight = flights[lane]
        pack[F_LANE, k] = lane
        pack[F_GRAVITY, k] = _incline(inclines, lane).inward
        pack[F_Y, k], pack[F_PHI, k] = flight["y"], flight["phi"]
        pack[F_V, k], pack[F_OMEGA, k] = flight["v"], flight["omega"]
        pack[F_HORIZON, k] = limits.max_time - flight["t"]
    touchdown_times(body, count, pack)
    return count


@kernel
def _wait(flights: np.ndarray, first: int, last: int, waiting: np.ndarray) -> int:
    """Let the lanes that have not ended wait for their hop; return how many they are."""
    count = 0
    for lane in range(first, last):
        if flights[lane]["status"] == RUNNING:
            waiting[count] = lane
            count += 1
    return count


@kernel
def _hop_singly(
    body: Body,
    like: ContactLaw,
    laws: np.ndarray,
    inclines: np.ndarray,
    limits: Limits,
    flights: np.ndarray,
    rebounds: np.ndarray,
    log_length: int,
    first: int,
    last: int,
    once: bool,
    space: LaneSpace,
    trajectory: np.ndarray,
) -> None:
    """Follow compliant contacts one by one: see :func:`hop_lanes`."""
    pack, waiting, alone = space[0], space[1], space[2]
    head, tail = 0, _wait(flights, first, last, waiting)
    while head < tail:
        count = _seek(body, inclines, limits, flights, waiting, head, tail, pack)
        head += count
        for k in range(count):
            i = int(pack[F_LANE, k])
            flight, log = flights[i], rebounds[_row(rebounds, i)]
            rebound = log[min(flight["rebounds"], log.shape[0] - 1)]
            law, slope = law_of_row(like, laws[_row(laws, i)]), _incline(inclines, i)
            land(body, law, slope, limits, flight, pack[F_TIME, k], rebound, log_length, alone, trajectory)
            if flight["status"] == RUNNING and not once:
                waiting[_around(tail, waiting)] = i
                tail += 1


@kernel
def _continue_alone(
    body: Body,
    law: ContactLaw,
    slope: Incline,
    limits: Limits,
    flight: np.void,
    rebound: np.void,
    log_length: int,
    pause: int,
    c: np.ndarray,
    z: np.ndarray,
    state: np.ndarray,
    before: np.ndarray,
    trajectory: np.ndarray,
) -> bool:
    """Follow a compliant contact to its end, or to where it can go on abreast; say whether it does."""
    pair = pair_of(law)
    if pause == 0 and choose_free(body, pair, state, z):
        return True
    status, steps, samples = follow(body, pair, slope, limits, state, c, z, pause, trajectory, 0)
    if status == PAUSED:
        return True
    flight["status"] = depart(body, flight, rebound, log_length, status, steps, samples, state, before)
    return False


@kernel
def _hop_abreast(
    body: Body,
    like: ContactLaw,
    laws: np.ndarray,
    inclines: np.ndarray,
    limits: Limits,
    flights: np.ndarray,
    rebounds: np.ndarray,
    log_length: int,
    first: int,
    last: int,
    once: bool,
    space: LaneSpace,
    trajectory: np.ndarray,
) -> None:
    """Follow ABREAST compliant contacts of a body without corners at a time: see :func:`hop_lanes`.

    Each of them has a place, where it takes ordinary steps with its neighbours; every other step it takes alone.
    """
    pack, waiting, (c, _, _, _), (all_z, all_states, all_c), (own_z, own_states, own_before, lanes) = space
    head, tail = 0, _wait(flights, first, last, waiting)
    count, taken = 0, 0
    lanes[:] = -1
    all_z[Z_EVENT] = LEFT_ALONE
    all_z[Z_MOST_STEPS] = -1.0  # nobody there takes a step
    while True:
        busy = False
        for k in range(ABREAST):
            event = all_z[Z_EVENT, k]
            if event in (NOTHING, RATE_ZERO):
                busy = True
                continue
            z, state, before = own_z[k], own_states[k], own_before[k]
            abreast = False
            i = lanes[k]
            told = Z_BRANCH  # rows from here on have changed
            if i >= 0:
                flight, log = flights[i], rebounds[_row(rebounds, i)]
                rebound = log[min(flight["rebounds"], log.shape[0] - 1)]
                law, slope = law_of_row(like, laws[_row(laws, i)]), _incline(inclines, i)
                for row in range(STATE_SIZE):
                    state[row] = all_states[row, k]
                if event == SEPARATION:
                    end_contact(pair_of(law), state, z)
                    steps = int(all_z[Z_STEPS, k])
                    flight["status"] = depart(body, flight, rebound, log_length, RUNNING, steps, 0, state, before)
                else:
                    steps = all_z[Z_STEPS, k]
                    advanced = steps > z[Z_STEPS]
                    for row in range(Z_BRANCH, Z_TOLD):
                        z[row] = all_z[row, k]
                    go_on(event, advanced, z)
                    pause = 1 if event == LEFT_ALONE else 0
                    abreast = _continue_alone(
                        body, law, slope, limits, flight, rebound, log_length, pause, c, z, state, before, trajectory
                    )
                    told = Z_BRANCH if z[Z_STEPS] == steps else 0
                if not abreast and flight["status"] == RUNNING and not once:
                    waiting[_around(tail, waiting)] = i
                    tail += 1
            while not abreast:
                told = 0
                if taken == count:
                    count, taken = _seek(body, inclines, limits, flights, waiting, head, tail, pack), 0
                    head += count
                    if count == 0:
                        break
                i = int(pack[F_LANE, taken])
                flight, log = flights[i], rebounds[_row(rebounds, i)]
                rebound = log[min(flight["rebounds"], log.shape[0] - 1)]
                law, slope = law_of_row(like, laws[_row(laws, i)]), _incline(inclines, i)
                touchdown = pack[F_TIME, taken]
                taken += 1
                flight["status"] = arrive(body, slope, limits, flight, touchdown, state, before, trajectory)
                if flight["status"] == RUNNING:
                    begin_contact(body, pair_of(law), slope, limits, state, z, flight["steps"])
                    abreast = _continue_alone(
                        body, law, slope, limits, flight, rebound, log_length, 0, c, z, state, before, trajectory
                    )
                    if not abreast and flight["status"] == RUNNING and not once:
                        waiting[_around(tail, waiting)] = i
                        tail += 1
            if abreast:
                busy = True
                lanes[k] = i
                for row in range(told, Z_TOLD):
                    all_z[row, k] = z[row]
                if told == 0:
                    for row in range(STATE_SIZE):
                        all_states[row, k] = state[row]
            else:
                lanes[k] = -1
                all_z[Z_MOST_STEPS, k] = -1.0
        if not busy:
            return
        step_abreast(all_z, all_states, all_c)


@kernel
def _hop_compliant(
    body: Body,
    like: ContactLaw,
    laws: np.ndarray,
    inclines: np.ndarray,
    limits: Limits,
    flights: np.ndarray,
    rebounds: np.ndarray,
    log_length: int,
    first: int,
    last: int,
    once: bool,
    space: LaneSpace,
    trajectory: np.ndarray,
) -> None:
    """Follow compliant contacts: see :func:`hop_lanes`.

    Those of a body with corners are followed one by one: only half of their steps are ordinary, which is too few.
    """
    if has_corners(body):
        _hop_singly(
            body, like, laws, inclines, limits, flights, rebounds, log_length, first, last, once, space, trajectory
        )
    else:
        _hop_abreast(
            body, like, laws, inclines, limits, flights, rebounds, log_length, first, last, once, space, trajectory
        )


@kernel
def _board(law: RigidLaw, slope: Incline, limits: Limits, lane: int, flight: np.void, k: int, pack: np.ndarray) -> None:
    """Put a flight at place ``k`` of a pack of rigid bodies."""
    pack[F_LANE, k] = lane
    pack[F_DOWNHILL, k], pack[F_GRAVITY, k] = slope.downhill, slope.inward
    pack[B_LENGTH, k], pack[B_MAX_TIME, k] = slope.length, limits.max_time
    pack[B_FRICTION, k], pack[B_RESTITUTION, k] = law.friction, law.restitution
    pack[B_ARM, k], pack[B_CORNER_ARM, k] = law.rolling_arm, law.corner_rolling_arm
    pack[B_SETTLE_SPEED, k] = law.settle_speed
    pack[B_T, k], pack[B_X, k], pack[F_Y, k], pack[F_PHI, k] = flight["t"], flight["x"], flight["y"], flight["phi"]
    pack[B_U, k], pack[F_V, k], pack[F_OMEGA, k] = flight["u"], flight["v"], flight["omega"]
    pack[F_HORIZON, k] = limits.max_time - flight["t"]
    pack[B_HYSTERESIS, k] = flight["hysteresis"]
    pack[B_SLIDING, k], pack[B_ROLLING, k] = flight["sliding"], flight["rolling"]
    pack[B_REBOUNDS, k] = flight["rebounds"]


@kernel
def _alight(k: int, pack: np.ndarray, flight: np.void) -> None:
    """Bring a flight up to where place ``k`` of a pack is."""
    flight["t"], flight["x"], flight["y"], flight["phi"] = pack[B_T, k], pack[B_X, k], pack[F_Y, k], pack[F_PHI, k]
    flight["u"], flight["v"], flight["omega"] = pack[B_U, k], pack[F_V, k], pack[F_OMEGA, k]
    flight["hysteresis"] = pack[B_HYSTERESIS, k]
    flight["sliding"], flight["rolling"] = pack[B_SLIDING, k], pack[B_ROLLING, k]
    flight["rebounds"] = int(pack[B_REBOUNDS, k])


@kernel
def _record(body: Body, k: int, pack: np.ndarray, rebound: np.void, state: np.ndarray, before: np.ndarray) -> None:
    """Fill the record of the rebound at place ``k`` of a pack."""
    for i in range(STATE_SIZE):
        state[i] = before[i] = 0.0
    before[TIME], before[V_T], before[OMEGA] = pack[L_T, k], pack[L_V_T, k], pack[L_OMEGA, k]
    state[TIME], state[X], state[PHI] = pack[L_T, k], pack[L_X, k], pack[L_PHI, k]
    state[V_T], state[OMEGA], state[V_N] = pack[I_V_T, k], pack[I_OMEGA, k], pack[I_V_N, k]
    state[IMPULSE_N], state[IMPULSE_T] = pack[I_IMPULSE, k], pack[I_TANGENTIAL, k]
    state[IMPULSE_R] = pack[I_ROLLING, k]
    state[HYSTERESIS], state[SLIDING], state[ROLLING] = pack[I_HYSTERESIS, k], pack[I_SLID, k], pack[I_ROLLED, k]
    a, b = pack[L_A, k], pack[L_B, k]
    write_rebound(body, rebound, before, state, int(pack[L_FEATURE, k]), b, a, pack[L_U, k], pack[L_V, k])


@kernel
def _hop_rigid(
    body: Body,
    like: RigidLaw,
    laws: np.ndarray,
    inclines: np.ndarray,
    limits: Limits,
    flights: np.ndarray,
    rebounds: np.ndarray,
    log_length: int,
    first: int,
    last: int,
    once: bool,
    space: LaneSpace,
    trajectory: np.ndarray,
) -> None:
    """Follow packs of rigid bodies: see :func:`hop_lanes`.

    A lane keeps its place from hop to hop; it is left for a hop that is not ordinary.
    """
    pack, waiting, alone = space[0], space[1], space[2]
    _, _, state, before = alone
    kept = rebounds.shape[0] > 1  # or all lanes share a row that nobody reads
    head, tail = 0, _wait(flights, first, last, waiting)
    count = 0
    while True:
        while count < LANES and head < tail:
            i = waiting[head]
            _board(law_of_row(like, laws[_row(laws, i)]), _incline(inclines, i), limits, i, flights[i], count, pack)
            head += 1
            count += 1
        if count < FEW:
            break
        bounce(body, count, pack)
        for k in range(count - 1, -1, -1):
            i = int(pack[F_LANE, k])
            flight, log = flights[i], rebounds[_row(rebounds, i)]
            going = False
            if pack[I_FINE, k] > 0.0:
                done = int(pack[B_REBOUNDS, k])
                if kept:
                    _record(body, k, pack, log[min(done, log.shape[0]) - 1], state, before)
                going = done < log_length and not once
                if not going:
                    _alight(k, pack, flight)
                    flight["status"] = LOG_FULL if done == log_length else RUNNING
            else:
                _alight(k, pack, flight)
                law, slope = law_of_row(like, laws[_row(laws, i)]), _incline(inclines, i)
                rebound = log[min(flight["rebounds"], log.shape[0] - 1)]
                land(body, law, slope, limits, flight, pack[F_TIME, k], rebound, log_length, alone, trajectory)
                going = flight["status"] == RUNNING and not once
                if going:
                    _board(law, slope, limits, i, flight, k, pack)
            if not going and head < tail:
                i = waiting[head]
                _board(law_of_row(like, laws[_row(laws, i)]), _incline(inclines, i), limits, i, flights[i], k, pack)
                head += 1
            elif not going:
                count -= 1
                for row in range(B_ROWS):
                    pack[row, k] = pack[row, count]
    for k in range(count):
        i = int(pack[F_LANE, k])
        flight, log = flights[i], rebounds[_row(rebounds, i)]
        law, slope = law_of_row(like, laws[_row(laws, i)]), _incline(inclines, i)
        _alight(k, pack, flight)
        while flight["status"] == RUNNING:
            rebound = log[min(flight["rebounds"], log.shape[0] - 1)]
            hop(body, law, slope, limits, flight, rebound, log_length, alone, trajectory)
            if once:
                break


# Follow a hop, if ``once``, or all hops in the lanes ``first`` to ``last - 1`` that have not ended, each as ``hop``
# does. Touchdowns are searched for side by side; rigid bodies, and compliant contacts without corners, are followed so.
# Arguments are those of ``descend_batch``; ``rebounds`` may have one row for all lanes, and of its columns the last
# takes what finds no other. ``space`` is from ``lane_space``.
hop_lanes = by_law(_hop_compliant, _hop_rigid)


@parallel_kernel
def descend_batch(
    body: Body,
    like: Law,
    laws: np.ndarray,
    slopes: np.ndarray,
    launches: np.ndarray,
    limits: Limits,
    rebounds: np.ndarray,
    log_length: int,
    outcomes: np.ndarray,
) -> None:
    """Simulate many descents, one a lane; a lane does not depend on its neighbours or on the number of threads.

    Parameters
    ----------
    body, limits
        Shared by all lanes.
    like : ContactLaw or RigidLaw
        Of which kind the rows of ``laws`` are.
    laws, slopes : ndarray, shapes (N or 1, 5) and (N or 1, 3)
        Fields of the law and of Slope; one row serves all lanes.
    launches : ndarray, shape (N, 6)
        Fields of State.
    rebounds : ndarray of REBOUND, shape (N, log_length) or (0, 0)
        The logs; (0, 0) keeps none.
    log_length : int
        Number of rebounds at which a descent ends with status LOG_FULL.
    outcomes : ndarray of OUTCOME, shape (N,)
        Overwritten.
    """
    lanes = launches.shape[0]
    size = block_size(lanes)
    inclines = _inclines(slopes)
    for block in prange((lanes + size - 1) // size):
        first, last = block * size, min((block + 1) * size, lanes)
        logs = rebounds if rebounds.shape[0] > 0 else np.empty((1, 1), REBOUND)
        space, trajectory = lane_space(body, like, size), np.empty(0, TRAJECTORY)
        for i in range(first, last):
            begin(_launch(launches, i), outcomes[i])
        hop_lanes(body, like, laws, inclines, limits, outcomes, logs, log_length, first, last, False, space, trajectory)
        for i in range(first, last):
            close_books(body, _incline(inclines, i), _launch(launches, i), outcomes[i])


@parallel_kernel
def hop_batch(
    body: Body,
    like: Law,
    laws: np.ndarray,
    slopes: np.ndarray,
    launches: np.ndarray,
    limits: Limits,
    rotor_inertia: float,
    trims: np.ndarray,
    flights: np.ndarray,
    rebounds: np.ndarray,
    log_length: int,
) -> None:
    """Trim and follow one hop of many descents, one a lane; lanes that have ended stay as they are.

    Parameters
    ----------
    body, like, laws, slopes, launches, limits, log_length
        As for :func:`descend_batch`.
    rotor_inertia : float
        Of the rider's rotor [kg m^2], shared by all lanes.
    trims : ndarray, shape (N,)
        Spin [rad/s] that the rotor lends to each body during the hop, see :func:`trim`.
    flights : ndarray of OUTCOME, shape (N,)
        Where each descent is, see :func:`hop`; moved on, their ledgers brought up to date. Those whose status is not
        RUNNING are left alone.
    rebounds : ndarray of REBOUND, shape (N,)
        The contact of each lane, as for :func:`hop`.
    """
    lanes = flights.shape[0]
    size = block_size(lanes)
    inclines = _inclines(slopes)
    logs = rebounds.reshape((lanes, 1))
    for block in prange((lanes + size - 1) // size):
        first, last = block * size, min((block + 1) * size, lanes)
        space, trajectory = lane_space(body, like, size), np.empty(0, TRAJECTORY)
        moved = flights["status"][first:last] == RUNNING
        for i in range(first, last):
            if flights[i]["status"] == RUNNING:
                trim(body, rotor_inertia, flights[i], trims[i])
        hop_lanes(body, like, laws, inclines, limits, flights, logs, log_length, first, last, True, space, trajectory)
        for i in range(first, last):
            if moved[i - first]:
                close_books(body, _incline(inclines, i), _launch(launches, i), flights[i])
