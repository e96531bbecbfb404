"""The loop that is the dataflow: flight, touchdown, contact, rebound, again and again, until the descent ends."""

from __future__ import annotations

import math

import numpy as np
from numba import prange

from sledenv.kernel.chord import NOW_ROWS
from sledenv.kernel.chord import ROWS as CHORD_ROWS
from sledenv.kernel.contact import PAUSED, begin_contact, choose_free, end_contact, follow, go_on
from sledenv.kernel.events import NOTHING, SEPARATION
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
    finish_time,
    pack_of,
    touchdown_time,
    touchdown_times,
)
from sledenv.kernel.geometry import arms, feature_at, has_corners, lowest_support, pulls, whole_turns
from sledenv.kernel.jit import allocating, kernel, parallel_kernel
from sledenv.kernel.laws import Law, by_law, law_of_row, pair_of, touch
from sledenv.kernel.params import Body, ContactLaw, Limits, Slope, State
from sledenv.kernel.records import CHORD, FINISH, LOG_FULL, NON_FINITE, REBOUND, RUNNING, TIMEOUT, TRAJECTORY
from sledenv.kernel.rows import WIDTH, table
from sledenv.kernel.series import ROWS, Z_BRANCH, Z_EVENT, Z_MOST_STEPS, Z_ROWS, Z_STEPS, Z_TOLD
from sledenv.kernel.state import (
    ARM_A,
    ARM_B,
    FEATURE,
    GAP,
    HYSTERESIS,
    IMPULSE_N,
    IMPULSE_R,
    IMPULSE_T,
    OMEGA,
    ON_CHORD,
    PHI,
    ROLLING,
    SLIDING,
    STATE_SIZE,
    STORED,
    TIME,
    V_N,
    V_T,
    X,
)
from sledenv.kernel.step import LEFT_ALONE, step_abreast
from sledenv.kernel.trace import ABREAST, LANES
from sledenv.kernel.trajectory import add_sample

SLIDE_ROLL, STOP_ROLL, SLIDE, STUCK, SPIN_REVERSAL, SLIP_REVERSAL, DOUBLE_REVERSAL = range(1, 8)
NEARLY_STUCK = 0.05  # of the entry speed


@kernel
def contact_mode(slip_before: float, omega_before: float, slip: float, omega: float) -> int:
    """Mode code of a contact from the slip velocity and the spin at its two ends: docs/physics.md, section 3."""
    slip_reversed = slip_before * slip < 0.0
    spin_reversed = omega_before * omega < 0.0
    if slip == 0.0:
        return STUCK if omega == 0.0 else STOP_ROLL
    if omega == 0.0:
        return SLIDE
    if slip_reversed:
        return DOUBLE_REVERSAL if spin_reversed else SLIP_REVERSAL
    return SPIN_REVERSAL if spin_reversed else SLIDE_ROLL


@kernel
def stuck_code(body: Body, entry_speed: float, u: float, omega: float) -> int:
    """2 if the body has neither velocity along the slope nor spin, 1 if both are below 5 % of the entry speed."""
    if u == 0.0 and omega == 0.0:
        return 2
    rim = max(body.radius, body.eccentricity) * abs(omega)
    return 1 if max(abs(u), rim) < NEARLY_STUCK * entry_speed else 0


@kernel
def fly(
    slope: Slope,
    limits: Limits,
    start: float,
    duration: float,
    x: float,
    y: float,
    phi: float,
    u: float,
    v: float,
    omega: float,
    trajectory: np.ndarray,
    samples: int,
) -> int:
    """Add the rows of one flight to the trajectory, its start included; return the number of rows needed."""
    downhill, inward = pulls(slope)
    rows = max(1, math.ceil(duration / limits.sample_interval))
    for i in range(rows):
        t = duration * i / rows
        samples = add_sample(
            trajectory,
            samples,
            start + t,
            x + t * (u + 0.5 * downhill * t),
            y + t * (v - 0.5 * inward * t),
            phi + omega * t,
            u + downhill * t,
            v - inward * t,
            omega,
            0.0,
            0.0,
            0.0,
            0,
            0,
            0,
        )
    return samples


@kernel
def energy(body: Body, slope: Slope, y: float, x: float, u: float, v: float, omega: float) -> tuple[float, float]:
    """Kinetic and potential energy [J]."""
    kinetic = 0.5 * body.mass * (u * u + v * v) + 0.5 * body.inertia * omega * omega
    downhill, inward = pulls(slope)
    return kinetic, body.mass * (y * inward - x * downhill)


@kernel
def begin(launch: State, flight: np.void) -> None:
    """Put a flight at its launch: nothing touched, nothing lost."""
    flight["status"] = RUNNING
    flight["rebounds"] = 0
    flight["samples"] = 0
    flight["steps"] = 0
    flight["t"] = 0.0
    flight["x"] = launch.x
    flight["y"] = launch.y
    flight["phi"] = launch.phi
    flight["u"] = launch.u
    flight["v"] = launch.v
    flight["omega"] = launch.omega
    flight["trim"] = 0.0
    flight["stored"] = 0.0
    flight["hysteresis"] = 0.0
    flight["sliding"] = 0.0
    flight["rolling"] = 0.0
    flight["rotor"] = 0.0
    flight["work"] = 0.0
    flight["absorbed"] = 0.0


@kernel
def trim(body: Body, rotor_inertia: float, flight: np.void, spin: float) -> None:
    """Let the rider's rotor lend ``spin`` [rad/s] to the body in flight: docs/physics.md, section 9.

    Parameters
    ----------
    body : Body
    rotor_inertia : float
        Moment of inertia of the rotor [kg m^2], > 0; the same throughout a descent.
    flight : record of OUTCOME
        Where the descent is, see :func:`hop`.
    spin : float
        What the body spins faster than with the rotor at rest [rad/s].
    """
    change = spin - flight["trim"]
    if change != 0.0:  # or a spin of -0.0 would lose its sign
        omega = flight["omega"]
        rotor = 0.5 * (body.inertia * spin) ** 2 / rotor_inertia
        done = body.inertia * change * (omega + 0.5 * change) + rotor - flight["rotor"]
        flight["omega"] = omega + change
        flight["trim"] = spin
        flight["rotor"] = rotor
        if done > 0.0:
            flight["work"] += done
        else:
            flight["absorbed"] -= done


@kernel
def close_books(body: Body, slope: Slope, launch: State, flight: np.void) -> None:
    """Bring the energy ledger up to the state of a flight: docs/physics.md, section 9."""
    x, y, u, v, omega = flight["x"], flight["y"], flight["u"], flight["v"], flight["omega"]
    kinetic, potential = energy(body, slope, launch.y, launch.x, launch.u, launch.v, launch.omega)
    drop = max(0.0, launch.y - lowest_support(body))
    along = max(0.0, x - launch.x)
    flight["initial"] = kinetic + potential
    downhill, inward = pulls(slope)
    flight["supplied"] = kinetic + body.mass * (drop * inward + along * downhill) + flight["work"]
    flight["kinetic"], flight["potential"] = energy(body, slope, y, x, u, v, omega)
    finite = math.isfinite(x + y + flight["phi"] + u + v + omega + flight["kinetic"] + flight["initial"])
    if flight["status"] != RUNNING and not finite:
        flight["status"] = NON_FINITE


@kernel
def write_rebound(
    body: Body,
    rebound: np.void,
    before: np.ndarray,
    state: np.ndarray,
    feature: int,
    b: float,
    a: float,
    u: float,
    v: float,
) -> None:
    """Fill one rebound record from the contact states at touchdown and at separation."""
    u_after = state[V_T] - b * state[OMEGA]
    rebound["t"] = state[TIME]
    rebound["x"] = state[X]
    rebound["phi"] = state[PHI]
    rebound["duration"] = state[TIME] - before[TIME]
    rebound["feature"] = CHORD if state[ON_CHORD] != 0.0 else feature
    rebound["mode"] = contact_mode(before[V_T], before[OMEGA], state[V_T], state[OMEGA])
    rebound["normal_impulse"] = state[IMPULSE_N]
    rebound["tangential_impulse"] = state[IMPULSE_T]
    rebound["rolling_impulse"] = state[IMPULSE_R]
    rebound["u_before"] = u
    rebound["v_before"] = v
    rebound["omega_before"] = before[OMEGA]
    rebound["u_after"] = u_after
    rebound["v_after"] = state[V_N] + a * state[OMEGA]
    rebound["omega_after"] = state[OMEGA]
    rebound["loss_hysteresis"] = state[HYSTERESIS]
    rebound["loss_sliding"] = state[SLIDING]
    rebound["loss_rolling"] = state[ROLLING]
    rebound["stuck"] = stuck_code(body, math.sqrt(u * u + v * v), u_after, state[OMEGA])


@allocating
def work_space() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Arrays that :func:`hop` works in; it may get the same ones again and again."""
    tables, told = table(ROWS + CHORD_ROWS, WIDTH), np.zeros(Z_ROWS + NOW_ROWS)  # of a contact, and of the chord
    return tables, told, np.zeros(STATE_SIZE), np.zeros(STATE_SIZE)


LaneSpace = tuple[
    np.ndarray,
    np.ndarray,
    tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    tuple[np.ndarray, np.ndarray, np.ndarray],
    tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
]


@allocating
def _lane_space(body: Body, lanes: int, abreast: int) -> LaneSpace:
    side = table(Z_ROWS, abreast), table(STATE_SIZE, abreast), table(ROWS * WIDTH, abreast)
    own_z = np.zeros((abreast, Z_ROWS + NOW_ROWS))
    own = own_z, np.zeros((abreast, STATE_SIZE)), np.zeros((abreast, STATE_SIZE)), np.zeros(abreast, np.int64)
    places = 1
    while places < lanes:
        places *= 2
    return pack_of(body), np.zeros(places, np.int64), work_space(), side, own


@allocating
def _space_abreast(body: Body, like: Law, lanes: int) -> LaneSpace:
    return _lane_space(body, lanes, 0 if has_corners(body) else ABREAST)


@allocating
def _space_alone(body: Body, like: Law, lanes: int) -> LaneSpace:
    return _lane_space(body, lanes, 0)


# Arrays that ``hop_lanes`` works in: a pack of flights, lanes that wait, the space of one contact, and that of contacts
# abreast.
lane_space = by_law(_space_abreast, _space_alone)


@kernel
def arrive(
    body: Body,
    slope: Slope,
    limits: Limits,
    flight: np.void,
    downhill: float,
    inward: float,
    touchdown: float,
    state: np.ndarray,
    before: np.ndarray,
    trajectory: np.ndarray,
) -> int:
    """Move a flight to its touchdown, or to whatever ends it before; return its status, RUNNING at a touchdown.

    Arguments are those of :func:`land`; the state of the contact is written to ``state`` and to ``before``.
    """
    t, x, y, phi = flight["t"], flight["x"], flight["y"], flight["phi"]
    u, v, omega = flight["u"], flight["v"], flight["omega"]
    status = RUNNING
    left = limits.max_time - t
    duration = touchdown
    finish = finish_time(x, u, downhill, slope.length)
    if finish <= min(duration, left):
        duration = finish
        status = FINISH
    elif not duration <= left:
        duration = left
        status = TIMEOUT
    if math.isfinite(duration):
        if trajectory.shape[0] > 0:
            samples = flight["samples"]
            flight["samples"] = fly(slope, limits, t, duration, x, y, phi, u, v, omega, trajectory, samples)
        t += duration
        x += duration * (u + 0.5 * downhill * duration)
        y += duration * (v - 0.5 * inward * duration)
        u += downhill * duration
        v -= inward * duration
        phi += omega * duration
    else:
        status = NON_FINITE
    if status == FINISH:
        x = slope.length
    flight["t"], flight["x"], flight["y"], flight["phi"] = t, x, y, phi
    flight["u"], flight["v"], flight["omega"] = u, v, omega
    if status == RUNNING:
        # Contact, in its own coordinates; the energy of the rounding error in y is far below that of the ledger.
        local = phi - whole_turns(phi)
        feature = feature_at(body, local)
        a, b = arms(body, feature, local)
        for i in range(STATE_SIZE):
            state[i] = 0.0
        state[TIME] = t
        state[X] = x
        state[PHI] = phi
        state[V_N] = v - a * omega
        state[V_T] = u + b * omega
        state[OMEGA] = omega
        state[FEATURE] = feature
        state[ARM_A], state[ARM_B] = a, b
        for i in range(STATE_SIZE):
            before[i] = state[i]
    return status


@kernel
def depart(
    body: Body,
    flight: np.void,
    rebound: np.void,
    log_length: int,
    status: int,
    steps: int,
    samples: int,
    state: np.ndarray,
    before: np.ndarray,
) -> int:
    """Record a contact and put the flight at its end; return the status of the descent.

    The flight is at the touchdown, ``status``, ``steps`` and ``samples`` are what :func:`touch` returns.
    """
    a, b = before[ARM_A], before[ARM_B]
    if state[PHI] != before[PHI] or state[FEATURE] != before[FEATURE]:
        a, b = arms(body, int(state[FEATURE]), state[PHI] - whole_turns(state[PHI]))
    write_rebound(body, rebound, before, state, int(before[FEATURE]), b, a, flight["u"], flight["v"])
    flight["t"], flight["x"], flight["phi"], flight["omega"] = state[TIME], state[X], state[PHI], state[OMEGA]
    flight["y"] = b + state[GAP]
    flight["u"], flight["v"] = rebound["u_after"], rebound["v_after"]
    flight["rebounds"] += 1
    flight["steps"] = steps
    flight["samples"] = samples
    flight["stored"] = state[STORED]
    flight["hysteresis"] += state[HYSTERESIS]
    flight["sliding"] += state[SLIDING]
    flight["rolling"] += state[ROLLING]
    if status == RUNNING and flight["rebounds"] == log_length:
        status = LOG_FULL
    return status


@kernel
def land(
    body: Body,
    law: Law,
    slope: Slope,
    limits: Limits,
    flight: np.void,
    downhill: float,
    inward: float,
    touchdown: float,
    rebound: np.void,
    log_length: int,
    space: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    trajectory: np.ndarray,
) -> None:
    """Follow one hop whose touchdown is known, up to the rebound or to whatever ends the descent.

    ``downhill`` and ``inward`` are those of :func:`sledenv.kernel.geometry.pulls`, ``touchdown`` is the duration [s] of
    the flight, inf if it is longer than ``limits.max_time`` allows; the other arguments are those of :func:`hop`.
    """
    c, z, state, before = space
    status = arrive(body, slope, limits, flight, downhill, inward, touchdown, state, before, trajectory)
    if status == RUNNING:
        samples = flight["samples"]
        status, steps, samples = touch(body, law, slope, limits, state, c, z, flight["steps"], trajectory, samples)
        status = depart(body, flight, rebound, log_length, status, steps, samples, state, before)
    flight["status"] = status
    if status != RUNNING and trajectory.shape[0] > 0:
        t, x, y, phi = flight["t"], flight["x"], flight["y"], flight["phi"]
        u, v, omega = flight["u"], flight["v"], flight["omega"]
        samples = flight["samples"]
        flight["samples"] = add_sample(trajectory, samples, t, x, y, phi, u, v, omega, 0.0, 0.0, 0.0, 0, 0, 0)


@kernel
def hop(
    body: Body,
    law: Law,
    slope: Slope,
    limits: Limits,
    flight: np.void,
    rebound: np.void,
    log_length: int,
    space: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    trajectory: np.ndarray,
) -> None:
    """Follow one hop: the flight, the touchdown and the contact up to the rebound, or whatever ends the descent.

    Parameters
    ----------
    body, law, slope, limits
        See :mod:`sledenv.kernel.params`; the type of the law chooses the contact, at compile time.
    flight : record of OUTCOME
        Where the descent is, with status RUNNING: at its launch or at a rebound. Moved on; its ledger is left to
        :func:`close_books`.
    rebound : record of REBOUND
        Overwritten if there was a contact, that is if ``flight["rebounds"]`` has grown.
    log_length : int
        Number of rebounds at which the descent ends with status LOG_FULL.
    space : tuple of ndarray
        See :func:`work_space`.
    trajectory : ndarray of TRAJECTORY
        Rows are written while there is room; ``flight["samples"]`` tells how many were needed.
    """
    downhill, inward = pulls(slope)
    y, phi, v, omega = flight["y"], flight["phi"], flight["v"], flight["omega"]
    touchdown = touchdown_time(body, inward, y, phi, v, omega, limits.max_time - flight["t"])
    land(body, law, slope, limits, flight, downhill, inward, touchdown, rebound, log_length, space, trajectory)


@kernel
def descend(
    body: Body,
    law: Law,
    slope: Slope,
    launch: State,
    limits: Limits,
    rebounds: np.ndarray,
    space: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    trajectory: np.ndarray,
    outcome: np.void,
) -> None:
    """Simulate one descent: hop after hop.

    Parameters
    ----------
    body, law, slope, launch, limits
        See :mod:`sledenv.kernel.params`; the type of the law chooses the contact, at compile time.
    rebounds : ndarray of REBOUND, shape (max_rebounds,)
        The log; a descent that fills it ends with status LOG_FULL.
    space : tuple of ndarray
        See :func:`work_space`.
    trajectory : ndarray of TRAJECTORY
        Rows are written while there is room; ``outcome["samples"]`` tells how many were needed.
    outcome : record of OUTCOME
        Overwritten.
    """
    begin(launch, outcome)
    while outcome["status"] == RUNNING:
        rebound = rebounds[outcome["rebounds"]]
        hop(body, law, slope, limits, outcome, rebound, rebounds.shape[0], space, trajectory)
    close_books(body, slope, launch, outcome)


@kernel
def _row(table: np.ndarray, lane: int) -> int:
    """Row of a lane in a table with one row a lane or one for all."""
    return lane if table.shape[0] > 1 else 0


@kernel
def _slope(slopes: np.ndarray, lane: int) -> Slope:
    q = slopes[_row(slopes, lane)]
    return Slope(q[0], q[1], q[2])


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
    slopes: np.ndarray,
    limits: Limits,
    flights: np.ndarray,
    waiting: np.ndarray,
    begin: int,
    end: int,
    pack: np.ndarray,
) -> int:
    """Find the touchdowns of the lanes ``begin`` to ``end - 1`` that wait, up to LANES; return how many."""
    count = min(end - begin, LANES)
    for k in range(count):
        lane = waiting[_around(begin + k, waiting)]
        flight = flights[lane]
        pack[F_LANE, k] = lane
        pack[F_DOWNHILL, k], pack[F_GRAVITY, k] = pulls(_slope(slopes, lane))
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
    like: Law,
    laws: np.ndarray,
    slopes: np.ndarray,
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
    """Follow contacts one by one: see :func:`hop_lanes`."""
    pack, waiting, alone = space[0], space[1], space[2]
    begin, end = 0, _wait(flights, first, last, waiting)
    while begin < end:
        count = _seek(body, slopes, limits, flights, waiting, begin, end, pack)
        begin += count
        for k in range(count):
            i = int(pack[F_LANE, k])
            flight, log = flights[i], rebounds[_row(rebounds, i)]
            rebound = log[min(flight["rebounds"], log.shape[0] - 1)]
            law, slope = law_of_row(like, laws[_row(laws, i)]), _slope(slopes, i)
            downhill, inward, touchdown = pack[F_DOWNHILL, k], pack[F_GRAVITY, k], pack[F_TIME, k]
            land(body, law, slope, limits, flight, downhill, inward, touchdown, rebound, log_length, alone, trajectory)
            if flight["status"] == RUNNING and not once:
                waiting[_around(end, waiting)] = i
                end += 1


@kernel
def _continue_alone(
    body: Body,
    law: ContactLaw,
    slope: Slope,
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
    slopes: np.ndarray,
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
    begin, end = 0, _wait(flights, first, last, waiting)
    count, taken = 0, 0
    lanes[:] = -1
    all_z[Z_EVENT] = LEFT_ALONE
    all_z[Z_MOST_STEPS] = -1.0  # nobody there takes a step
    while True:
        busy = False
        for k in range(ABREAST):
            event = all_z[Z_EVENT, k]
            if event == NOTHING:
                busy = True
                continue
            z, state, before = own_z[k], own_states[k], own_before[k]
            abreast = False
            i = lanes[k]
            told = Z_BRANCH  # rows from here on have changed
            if i >= 0:
                flight, log = flights[i], rebounds[_row(rebounds, i)]
                rebound = log[min(flight["rebounds"], log.shape[0] - 1)]
                law, slope = law_of_row(like, laws[_row(laws, i)]), _slope(slopes, i)
                for row in range(STATE_SIZE):
                    state[row] = all_states[row, k]
                if event == SEPARATION:
                    end_contact(pair_of(law), state, z)
                    steps = int(all_z[Z_STEPS, k])
                    flight["status"] = depart(body, flight, rebound, log_length, RUNNING, steps, 0, state, before)
                else:
                    steps = all_z[Z_STEPS, k]
                    go_on(event, steps, z)
                    pause = 1 if event == LEFT_ALONE else 0
                    abreast = _continue_alone(
                        body, law, slope, limits, flight, rebound, log_length, pause, c, z, state, before, trajectory
                    )
                    told = Z_BRANCH if z[Z_STEPS] == steps else 0
                if not abreast and flight["status"] == RUNNING and not once:
                    waiting[_around(end, waiting)] = i
                    end += 1
            while not abreast:
                told = 0
                if taken == count:
                    count, taken = _seek(body, slopes, limits, flights, waiting, begin, end, pack), 0
                    begin += count
                    if count == 0:
                        break
                i = int(pack[F_LANE, taken])
                flight, log = flights[i], rebounds[_row(rebounds, i)]
                rebound = log[min(flight["rebounds"], log.shape[0] - 1)]
                law, slope = law_of_row(like, laws[_row(laws, i)]), _slope(slopes, i)
                downhill, inward, touchdown = pack[F_DOWNHILL, taken], pack[F_GRAVITY, taken], pack[F_TIME, taken]
                taken += 1
                flight["status"] = arrive(
                    body, slope, limits, flight, downhill, inward, touchdown, state, before, trajectory
                )
                if flight["status"] == RUNNING:
                    begin_contact(body, pair_of(law), slope, limits, state, z, flight["steps"])
                    abreast = _continue_alone(
                        body, law, slope, limits, flight, rebound, log_length, 0, c, z, state, before, trajectory
                    )
                    if not abreast and flight["status"] == RUNNING and not once:
                        waiting[_around(end, waiting)] = i
                        end += 1
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
    slopes: np.ndarray,
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
            body, like, laws, slopes, limits, flights, rebounds, log_length, first, last, once, space, trajectory
        )
    else:
        _hop_abreast(
            body, like, laws, slopes, limits, flights, rebounds, log_length, first, last, once, space, trajectory
        )


# Follow a hop, if ``once``, or all hops in the lanes ``first`` to ``last - 1`` that have not ended, each as ``hop``
# does. The touchdowns are searched for side by side, and compliant contacts of bodies without corners followed so.
# Arguments are those of ``descend_batch``; ``rebounds`` may have one row for all lanes, and of its columns the last
# takes what finds no other. ``space`` is from ``lane_space``.
hop_lanes = by_law(_hop_compliant, _hop_singly)


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
    for block in prange((lanes + size - 1) // size):
        first, last = block * size, min((block + 1) * size, lanes)
        logs = rebounds if rebounds.shape[0] > 0 else np.empty((1, 1), REBOUND)
        space, trajectory = lane_space(body, like, size), np.empty(0, TRAJECTORY)
        for i in range(first, last):
            begin(_launch(launches, i), outcomes[i])
        hop_lanes(body, like, laws, slopes, limits, outcomes, logs, log_length, first, last, False, space, trajectory)
        for i in range(first, last):
            close_books(body, _slope(slopes, i), _launch(launches, i), outcomes[i])


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
    logs = rebounds.reshape((lanes, 1))
    for block in prange((lanes + size - 1) // size):
        first, last = block * size, min((block + 1) * size, lanes)
        space, trajectory = lane_space(body, like, size), np.empty(0, TRAJECTORY)
        moved = flights["status"][first:last] == RUNNING
        for i in range(first, last):
            if flights[i]["status"] == RUNNING:
                trim(body, rotor_inertia, flights[i], trims[i])
        hop_lanes(body, like, laws, slopes, limits, flights, logs, log_length, first, last, True, space, trajectory)
        for i in range(first, last):
            if moved[i - first]:
                close_books(body, _slope(slopes, i), _launch(launches, i), flights[i])
