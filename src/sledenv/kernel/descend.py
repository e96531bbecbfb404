"""The loop of a descent: flight, touchdown, contact and rebound, hop after hop, until the descent ends."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.rows import WIDTH
from sledenv.compiler.trace import straight
from sledenv.kernel import normal, records
from sledenv.kernel.flight import arrive, begin_search, move, search, write_flight
from sledenv.kernel.ground import GROUND
from sledenv.kernel.laws import Law, touch
from sledenv.kernel.motion import finish_time
from sledenv.kernel.outline import arms, whole_turns
from sledenv.kernel.params import Incline, Limits, State
from sledenv.kernel.progress import passes_line, touches
from sledenv.kernel.records import AT_LINE, FINISH, LOG_FULL, NON_FINITE, RUNNING, SEPARATED, TIMEOUT, TUMBLED
from sledenv.kernel.sampling import write_contact
from sledenv.kernel.state import (
    CONTACT,
    HOP,
    IMPULSES,
    LANDED,
    MOTION,
    PEAKS,
    POINT,
    SEEKING,
    STEP,
    SUMS,
    TAKING_OFF,
    TOUCHDOWN,
    add,
    clear,
    copy,
    record,
)
from sledenv.kernel.trajectory import next_row, rows_to_write

SLIDE_ROLL, STOP_ROLL, SLIDE, STUCK, SPIN_REVERSAL, SLIP_REVERSAL, DOUBLE_REVERSAL = range(1, 8)
NEARLY_STUCK = 0.05  # of the entry speed

# Work space of a descent. The next descent may use the same one.
SPACE = record(
    ("steps", STEP, (2,)),  # of each point
    # Series of two points that touch, see pair.py: the sum of their normal forces, moments, and bounds of the moments.
    ("together", "f8", (WIDTH,)),  # [N]
    ("moments", "f8", (2, WIDTH)),  # [N m]
    ("loads", "f8", (2, WIDTH)),  # [N m]
    ("contact", CONTACT),
    ("points", POINT, (2,)),
    ("ground", GROUND),
    ("touchdown", TOUCHDOWN),
    ("hop", HOP),
    # How much a call has done, and where the next call goes on.
    ("lane", "f8"),  # lane of a batch,
    ("stage", "f8"),  # and what comes next there, see state.py
    ("work", "f8"),  # [-] steps and hops of this call
    ("most_work", "f8"),  # [-] at this number the call stops a search, and begins no other hop
    ("once", "f8"),  # 1 if the call ends with a hop
    # Of a straight side that hits flat, see flat.py.
    ("ends", "f8", (6,)),
    ("lost_flat", "f8", (3,)),
    ("flat", "f8", (9, WIDTH)),
    ("finish", "f8"),  # [m] where the descent ends: the line, or the end of the run-out once that has been passed
    ("strikes", "f8"),  # impacts of rigid bodies since the touchdown
)


def _come_to(at: Any, there: Any) -> None:
    """Program that moves a flight, or a row of it, to where a hop has come, and adds the losses of the hop."""
    copy(at, there, MOTION, of="{}_landing")
    add(at, there, records.FLIGHT_LOSSES)


def _start(launch: Any, flight: Any) -> None:
    """Program that writes the numbers of a flight at its launch."""
    clear(flight, ("t", "u_line", "trim", "rotor", "work", "absorbed", "stored", *records.LOSSES))
    copy(launch, flight, State._fields)


def _arriving(hop: Any, touchdown: Any) -> None:
    """Program that writes how a body touches down where a hop has come to."""
    copy(hop, touchdown, ("x", "phi", "u", "v", "v_t", "v_n", "omega"), of="{}_landing")
    copy(hop, touchdown, ("arc", "a", "b"))
    touchdown.time = hop.t_landing


def meeting(touchdown: Any, contact: Any, point: Any) -> None:
    """Program that begins a contact at a touchdown.

    The gap becomes exactly zero. The energy of the rounding error in the height is far below the error of the ledger.
    """
    copy(touchdown, contact, ("time", "x", "phi", "omega"))
    copy(touchdown, point, ("arc", "v_n", "v_t"))
    point.gap, contact.count = 0.0, 1.0
    clear(contact, ("held", "side_touched", "sequence", "branch", *PEAKS, *SUMS))


def _account(touchdown: Any, contact: Any, rebound: Any) -> None:
    """Program that writes into a rebound what follows from its touchdown and its contact alone."""
    copy(contact, rebound, ("x", "phi", *IMPULSES, *PEAKS))
    copy(touchdown, rebound, ("u", "v", "omega"), to="{}_before")
    copy(contact, rebound, records.CONTACT_LOSSES, to="loss_{}")
    rebound.t, rebound.duration = contact.time, contact.time - touchdown.time
    rebound.t_touchdown, rebound.x_contact = touchdown.time, touchdown.x - touchdown.a
    rebound.omega_after = contact.omega


_set_off, _come, _arrive, _record = straight(_start), straight(_come_to), straight(_arriving), straight(_account)
_meet = straight(meeting)
clear_sums = straight(lambda contact: clear(contact, SUMS))
book_losses = straight(lambda contact, flight: add(contact, flight, records.CONTACT_LOSSES))


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
def stuck_code(body: np.void, entry_speed: float, u: float, omega: float) -> int:
    """2 if the body has neither velocity along the slope nor spin, 1 if both are below 5 % of the entry speed."""
    if u == 0.0 and omega == 0.0:
        return 2
    rim = body["size"] * abs(omega)
    return 1 if max(abs(u), rim) < NEARLY_STUCK * entry_speed else 0


@kernel
def energy(body: np.void, slope: Incline, y: float, x: float, u: float, v: float, omega: float) -> tuple[float, float]:
    """Kinetic and potential energy [J]."""
    kinetic = 0.5 * body["mass"] * (u * u + v * v) + 0.5 * body["inertia"] * omega * omega
    return kinetic, body["mass"] * (y * slope.inward - x * slope.downhill)


@kernel
def begin(launch: State, flight: np.void) -> None:
    """Put a flight at its launch: nothing touched, nothing lost."""
    flight["status"] = RUNNING
    flight["rebounds"] = flight["samples"] = flight["steps"] = 0
    _set_off(launch, flight)
    flight["t_on_chord"] = flight["x_on_chord"] = flight["t_line"] = math.inf


@kernel
def trim(body: np.void, rotor_inertia: float, flight: np.void, spin: float) -> None:
    """Let the rider's rotor lend ``spin`` [rad/s] to the body in flight: docs/physics.md, section 9.

    Parameters
    ----------
    body : record of BODY
    rotor_inertia : float
        Moment of inertia of the rotor [kg m^2], > 0; the same throughout a descent.
    flight : record of OUTCOME
        Where the descent is, see :func:`hop`.
    spin : float
        Spin of the body minus its spin with the rotor at rest [rad/s].
    """
    change = spin - flight["trim"]
    if change != 0.0:  # a spin of -0.0 plus zero would lose its sign
        omega = flight["omega"]
        rotor = 0.5 * (body["inertia"] * spin) ** 2 / rotor_inertia
        done = body["inertia"] * change * (omega + 0.5 * change) + rotor - flight["rotor"]
        flight["omega"] = omega + change
        flight["trim"] = spin
        flight["rotor"] = rotor
        if done > 0.0:
            flight["work"] += done
        else:
            flight["absorbed"] -= done


@kernel
def close_books(body: np.void, slope: Incline, launch: State, flight: np.void) -> None:
    """Bring the energy ledger up to the state of a flight: docs/physics.md, section 9."""
    x, y, u, v, omega = flight["x"], flight["y"], flight["u"], flight["v"], flight["omega"]
    kinetic, potential = energy(body, slope, launch.y, launch.x, launch.u, launch.v, launch.omega)
    drop = max(0.0, launch.y - body["lowest"])
    along = max(0.0, (slope.length if flight["t_line"] < math.inf else x) - launch.x)  # not in the run-out
    flight["initial"] = kinetic + potential
    flight["supplied"] = kinetic + body["mass"] * (drop * slope.inward + along * slope.downhill) + flight["work"]
    flight["kinetic"], flight["potential"] = energy(body, slope, y, x, u, v, omega)
    finite = math.isfinite(x + y + flight["phi"] + u + v + omega + flight["kinetic"] + flight["initial"])
    if flight["status"] != RUNNING and not finite:
        flight["status"] = NON_FINITE


@kernel
def write_rebound(
    body: np.void, touchdown: np.void, contact: np.void, point: np.void, a: float, b: float, rebound: np.void
) -> None:
    """Fill one rebound record from a contact that has ended at a point, with its arms ``a``, ``b`` [m] at its end."""
    u, v, omega = touchdown["u"], touchdown["v"], contact["omega"]
    u_after = point["v_t"] - b * omega
    _record(touchdown, contact, rebound)
    touched = contact["side_touched"]
    rebound["feature"] = int(touched if touched != 0.0 else body["part"][int(touchdown["arc"])])
    rebound["mode"] = contact_mode(touchdown["v_t"], touchdown["omega"], point["v_t"], omega)
    rebound["u_after"] = u_after
    rebound["v_after"] = point["v_n"] + a * omega
    rebound["stuck"] = stuck_code(body, math.sqrt(u * u + v * v), u_after, omega)
    rebound["sequence"] = int(contact["sequence"])


@kernel
def _sample_flight(limits: Limits, flight: np.void, duration: float, at: np.void, trajectory: np.ndarray) -> None:
    """Add rows of a flight from its start on, without its end."""
    rows = max(1.0, np.ceil(duration / limits.sample_interval))
    for i in range(rows_to_write(rows, flight, trajectory)):
        move(at, duration * i / rows)
        row = next_row(trajectory, flight)
        _come(at, row)


@kernel
def _fly(body: np.void, slope: Incline, limits: Limits, flight: np.void, space: np.void, trajectory: np.ndarray) -> int:
    """Move a flight to its touchdown, or to an earlier end; return its status, RUNNING at a touchdown.

    ``space["hop"]`` has the time of the touchdown. Afterwards it also says how the body touches.
    """
    at = space["hop"]
    status = RUNNING
    left = limits.max_time - flight["t"]
    duration = at["touchdown"]
    finish = finish_time(at)
    if finish <= min(duration, left):
        duration = finish
        status = FINISH
    elif not duration <= left:
        duration = left
        status = TIMEOUT
    if not math.isfinite(duration):
        return NON_FINITE
    if trajectory.shape[0] > 0:
        _sample_flight(limits, flight, duration, space["hop"], trajectory)
    arrive(body, at, duration)
    _come(at, flight)
    if status == FINISH:
        flight["x"] = space["finish"]
        if passes_line(limits, flight["t"], flight["u"], flight, space):
            return AT_LINE
    return status


@kernel
def _take_off(body: np.void, flight: np.void, rebound: np.void, space: np.void) -> None:
    """Record a contact, and put the flight where the contact ends."""
    touchdown, contact, points = space["touchdown"], space["contact"], space["points"]
    point = points[0]
    a, b = touchdown["a"], touchdown["b"]
    if contact["phi"] != touchdown["phi"] or point["arc"] != touchdown["arc"]:
        a, b = arms(body, int(point["arc"]), contact["phi"] - whole_turns(contact["phi"]))
    write_rebound(body, touchdown, contact, point, a, b, rebound)
    flight["t"], flight["x"], flight["phi"] = contact["time"], contact["x"], contact["phi"]
    flight["y"] = b + point["gap"]
    flight["u"], flight["v"], flight["omega"] = rebound["u_after"], rebound["v_after"], contact["omega"]
    flight["rebounds"] += 1
    flight["stored"] = 0.0
    for i in range(int(contact["count"])):
        flight["stored"] += normal.stored(contact, points[i])
    book_losses(contact, flight)


@kernel
def find_touchdown(body: np.void, slope: Incline, limits: Limits, flight: np.void, space: np.void) -> None:
    """Look ahead from the start of a flight to its touchdown; arguments are those of :func:`hop`.

    The stage is SEEKING if the work reaches ``space["most_work"]``: the next call then goes on with the search.
    """
    at = space["hop"]
    if space["stage"] == TAKING_OFF:
        write_flight(at, slope, limits, flight)
        at["length"] = space["finish"]
        begin_search(body, at)
    space["work"] += search(space["most_work"] - space["work"], body, at)
    space["stage"] = TAKING_OFF if at["phase"] == LANDED else SEEKING


@kernel
def hop(
    body: np.void,
    law: Law,
    slope: Incline,
    limits: Limits,
    flight: np.void,
    log: np.ndarray,
    space: np.void,
    trajectory: np.ndarray,
) -> None:
    """Follow one hop: the flight to its touchdown, and the contact up to the rebound. The descent may end before.

    Parameters
    ----------
    body : record of BODY
    law, slope, limits
        See :mod:`sledenv.kernel.params`; the type of the law chooses the contact when this is compiled.
    flight : record of OUTCOME
        State of the descent, at its launch or at a rebound, with status RUNNING. It is moved on; :func:`close_books`
        writes its ledger.
    log : ndarray of REBOUND
        A contact fills the row of its number, or the last row if there are fewer, and makes ``flight["rebounds"]``
        larger by one. The descent ends with status LOG_FULL at ``limits.max_rebounds``.
    space : record of SPACE
        Work space, with the body that :func:`sledenv.kernel.flight.write_body` has written; ``space["hop"]`` holds the
        flight and its touchdown, see :func:`find_touchdown`.
    trajectory : ndarray of TRAJECTORY
        Rows are written while there is room; ``flight["samples"]`` says how many were needed.
    """
    contact = space["contact"]
    space["stage"], space["work"] = TAKING_OFF, space["work"] + 1.0
    status = _fly(body, slope, limits, flight, space, trajectory)
    touched = status == RUNNING
    if touched:
        _arrive(space["hop"], space["touchdown"])
        _meet(space["touchdown"], contact, space["points"][0])
        if touches(body, limits.end_part, contact, space["points"]):
            status = TUMBLED
        else:
            status = touch(body, law, slope, limits, flight, space, trajectory)
        _take_off(body, flight, log[min(flight["rebounds"], log.shape[0] - 1)], space)
        if status == SEPARATED:
            status = LOG_FULL if flight["rebounds"] >= limits.max_rebounds else RUNNING
    elif status == AT_LINE:
        status = RUNNING
    flight["status"] = status
    if status != RUNNING and trajectory.shape[0] > 0:
        row = next_row(trajectory, flight)
        if touched and status != LOG_FULL and contact["held"] != 0.0:  # a contact that goes on
            write_contact(body, space, space["steps"][0]["length"], row)


@kernel
def descend(
    body: np.void,
    law: Law,
    slope: Incline,
    limits: Limits,
    flight: np.void,
    log: np.ndarray,
    space: np.void,
    trajectory: np.ndarray,
) -> bool:
    """Follow a descent to its end, or for one hop if ``space["once"]`` is 1; return whether that is done.

    It is not done if ``space["work"]`` reaches ``space["most_work"]`` before. The same call then goes on where this one
    has stopped. Arguments are those of :func:`hop`.
    """
    space["finish"] = slope.length + (limits.run_out if flight["t_line"] < math.inf else 0.0)
    before = flight["rebounds"]
    while flight["status"] == RUNNING:
        if space["work"] >= space["most_work"]:
            return False
        find_touchdown(body, slope, limits, flight, space)
        if space["stage"] == SEEKING:
            return False
        hop(body, law, slope, limits, flight, log, space, trajectory)
        if space["once"] != 0.0 and flight["rebounds"] > before:  # not if it has passed the line alone
            break
    return True
