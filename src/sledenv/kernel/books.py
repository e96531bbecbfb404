"""The books of a descent: what each step adds to impulses and losses, the record of a rebound, the energy ledger."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.contacts import ORDER, PER
from sledenv.kernel.geometry import ARC_PIECE, SIDE_BEND, heights_within, touching_place
from sledenv.kernel.params import Incline, State
from sledenv.kernel.records import NON_FINITE, RUNNING

SLIDE_ROLL, STOP_ROLL, SLIDE, STUCK, SPIN_REVERSAL, SLIP_REVERSAL, DOUBLE_REVERSAL = range(1, 8)
NEARLY_STUCK: Final = 0.05  # of the entry speed
# A generator of random numbers (Park and Miller) mixes the codes of a sequence: whole numbers, exact in a double.
_MIX, _PRIME = 48271.0, 2147483647.0


@kernel
def followed_by(sequence: float, event: float) -> float:
    """Code of a sequence that goes on with an event, a whole number from 0 to a few thousand.

    Equal sequences have equal codes; that different ones have too is as likely as one in 2^31.
    """
    mixed = sequence * _MIX + (event + 1.0)
    return mixed - float(np.rint(mixed * (1.0 / _PRIME))) * _PRIME


@kernel
def note_mode(contacts: np.void, rebound: np.void) -> None:
    """Add the mode that has been chosen to the sequence of a rebound."""
    code = contacts["spin_sign"] + 1 + 3 * contacts["spin_still"]
    sequence = followed_by(rebound["sequence"], code)
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        code = contact["gap_sign"] + 1 + 3 * (contact["slip_sign"] + 1) + 9 * contact["kind"]
        sequence = followed_by(sequence, 10 + code)
    rebound["sequence"] = sequence


@kernel
def _integral(p: np.ndarray, q: np.ndarray, t: float) -> float:
    """Integral of the product of two series up to a time [s]: two orders at once, which do not wait for each other."""
    total = 0.0
    for k in range(ORDER, 0, -2):
        high, low = q[0] * p[k], 0.0
        for i in range(k):
            high += p[i] * q[k - i]
            low += p[i] * q[k - 1 - i]
        total = (total * t + high * PER[k + 1]) * t + low * PER[k]
    return float((total * t + p[0] * q[0]) * t)


@kernel
def _book_contact(contacts: np.void, contact: np.void, terms: np.void, s: np.void, t: float, rebound: np.void) -> None:
    """Add impulses and losses of a contact in a step: integrals of series and of products of two."""
    normal, force = terms["normal"], terms["force"]
    push = pull = 0.0
    for k in range(ORDER, -1, -1):
        push, pull = push * t + normal[k] * PER[k + 1], pull * t + force[k] * PER[k + 1]
    rebound["normal_impulse"] += push * t
    rebound["tangential_impulse"] += pull * t
    if contact["slip_still"] != 1 and contact["friction"] > 0.0:  # it slips, or follows others that are still
        rebound["sliding"] = max(rebound["sliding"] - _integral(force, terms["slip"], t), 0.0)
    if contacts["spin_still"] == 0 and contact["rolling_arm"] > 0.0:
        lost = contacts["spin_sign"] * contact["rolling_arm"] * _integral(normal, s["omega"], t)
        rebound["rolling"] = max(rebound["rolling"] + lost, 0.0)


@kernel
def book_step(space: np.void, t: float) -> None:
    """Add what the contacts do in a step of length ``t`` [s] to the books of the rebound, but for their springs."""
    contacts, s, rebound = space["contacts"], space["series"], space["rebound"]
    for c in range(contacts["count"]):
        _book_contact(contacts, contacts["at"][c], s["of"][c], s, t, rebound)
    turning, moment = 0.0, s["moment"]
    for k in range(ORDER, -1, -1):
        turning = turning * t + moment[k] * PER[k + 1]
    rebound["rolling_impulse"] += turning * t


@kernel
def lost_to_air(body: np.void, slope: Incline, s: np.void, t: float) -> float:
    """Energy [J] that drag takes in a step up to a time [s]."""
    if slope.drag == 0.0:
        return 0.0
    return float(body["mass"] * slope.drag * _integral(s["speed"], s["square"], t))


@kernel
def book_spring(contact: np.void, before: float, rebound: np.void) -> None:
    """Book what the spring of a contact loses while its gap [m] goes from ``before`` to where it is."""
    after = contact["gap"]
    if contact["gap_sign"] > 0:
        rebound["hysteresis"] += 0.5 * (contact["closing"] - contact["opening"]) * (before * before - after * after)


@kernel
def book_loose_spring(contact: np.void, rebound: np.void) -> None:
    """Book what is stored in the spring of a contact that has to let go: it is lost."""
    rebound["hysteresis"] += 0.5 * contact["closing"] * contact["gap"] * contact["gap"]
    contact["gap"] = 0.0


@kernel
def keep_peaks(contact: np.void, normal: float, rebound: np.void) -> None:
    """Keep the largest normal force [N] and penetration [m] so far."""
    rebound["peak_force"] = max(rebound["peak_force"], normal)
    rebound["peak_penetration"] = max(rebound["peak_penetration"], -contact["gap"])


@kernel
def stored(contacts: np.void) -> float:
    """Energy [J] in the springs of all contacts."""
    total = 0.0
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        if contact["gap"] != 0.0:  # that of rigid surfaces is zero
            total += 0.5 * contact["closing"] * contact["gap"] * contact["gap"]
    return total


@kernel
def part_of(body: np.void, contact: np.void) -> float:
    """Code of the part of the body that touches."""
    arc = contact["arc"]
    return float(body["side"][arc] if contact["kind"] == SIDE_BEND else body["part"][arc])


@kernel
def ground_of(contact: np.void) -> float:
    """Code of the feature of the ground that is touched: pieces and vertices counted in the order along the slope."""
    return float(2.0 * contact["piece"] - (0.0 if contact["kind"] == ARC_PIECE else 1.0))


@kernel
def side_that_lies(body: np.void, contacts: np.void) -> float:
    """Code of a straight side both ends of which touch the same piece, 0 if there is none."""
    arcs = np.int64(body["arcs"])
    for c in range(contacts["count"]):
        one = contacts["at"][c]
        if one["kind"] != ARC_PIECE or body["side"][one["arc"]] == 0.0:
            continue
        for q in range(contacts["count"]):
            if _lie_on(one, contacts["at"][q], arcs):
                return float(body["side"][one["arc"]])
    return 0.0


@kernel
def _lie_on(one: np.void, two: np.void, arcs: Any) -> bool:
    """Whether two arcs touch the same piece with both ends of the side after the first one, and not of its back."""
    if two["kind"] != ARC_PIECE or two["piece"] != one["piece"] or two["arc"] != (one["arc"] + 1) % arcs:
        return False
    return bool(two["normal_lever"] < one["normal_lever"])


@kernel
def open_rebound(body: np.void, motion: np.void, contact: np.void, rebound: np.void) -> None:
    """Begin the books of a rebound with its first contact."""
    rebound["normal_impulse"] = rebound["tangential_impulse"] = rebound["rolling_impulse"] = 0.0
    rebound["hysteresis"] = rebound["sliding"] = rebound["rolling"] = 0.0
    rebound["peak_force"] = rebound["peak_penetration"] = rebound["side"] = rebound["sequence"] = 0.0
    rebound["t"], rebound["x"], rebound["phi"] = motion["t"], motion["x"], motion["phi"]
    rebound["u"], rebound["v"], rebound["omega"] = motion["u"], motion["v"], motion["omega"]
    rebound["slip"] = contact["slip"]
    rebound["x_contact"] = touching_place(motion, contact)[0]
    rebound["part"], rebound["ground"] = part_of(body, contact), ground_of(contact)


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
def close_rebound(body: np.void, space: np.void, slip: float, flight: np.void, row: np.void) -> None:
    """Write the record of a rebound that has ended where the body is, with a ``slip`` [m/s] of its last contact."""
    rebound, motion = space["rebound"], space["motion"]
    row["t"], row["x"], row["phi"] = motion["t"], motion["x"], motion["phi"]
    row["t_touchdown"], row["x_contact"], row["duration"] = (
        rebound["t"],
        rebound["x_contact"],
        motion["t"] - rebound["t"],
    )
    row["feature"] = int(rebound["side"] if rebound["side"] != 0.0 else rebound["part"])
    row["ground"] = int(rebound["ground"])
    row["mode"] = contact_mode(rebound["slip"], rebound["omega"], slip, motion["omega"])
    row["normal_impulse"], row["tangential_impulse"] = rebound["normal_impulse"], rebound["tangential_impulse"]
    row["rolling_impulse"] = rebound["rolling_impulse"]
    row["peak_force"], row["peak_penetration"] = rebound["peak_force"], rebound["peak_penetration"]
    row["u_before"], row["v_before"], row["omega_before"] = rebound["u"], rebound["v"], rebound["omega"]
    row["u_after"], row["v_after"], row["omega_after"] = motion["u"], motion["v"], motion["omega"]
    row["loss_hysteresis"], row["loss_sliding"] = rebound["hysteresis"], rebound["sliding"]
    row["loss_rolling"] = rebound["rolling"]
    speed = math.sqrt(rebound["u"] * rebound["u"] + rebound["v"] * rebound["v"])
    row["stuck"] = stuck_code(body, speed, motion["u"], motion["omega"])
    row["sequence"] = int(rebound["sequence"])
    flight["hysteresis"] += rebound["hysteresis"]
    flight["sliding"] += rebound["sliding"]
    flight["rolling"] += rebound["rolling"]
    flight["rebounds"] += 1


@kernel
def trim(body: np.void, rotor_inertia: float, flight: np.void, spin: float) -> None:
    """Let the rider's rotor lend ``spin`` [rad/s] to the body in flight: docs/physics.md, section 9.

    Parameters
    ----------
    body : record of BODY
    rotor_inertia : float
        Moment of inertia of the rotor [kg m^2], > 0; the same throughout a descent.
    flight : record of OUTCOME
        Where the descent is.
    spin : float
        Spin of the body minus its spin with the rotor at rest [rad/s].
    """
    change = spin - flight["trim_spin"]
    if change != 0.0:  # a spin of -0.0 plus zero would lose its sign
        omega = flight["omega"]
        rotor = 0.5 * (body["inertia"] * spin) ** 2 / rotor_inertia
        done = body["inertia"] * change * (omega + 0.5 * change) + rotor - flight["rotor"]
        flight["omega"] = omega + change
        flight["trim_spin"] = spin
        flight["rotor"] = rotor
        if done > 0.0:
            flight["work"] += done
        else:
            flight["absorbed"] -= done


@kernel
def energy(body: np.void, slope: Any, y: float, x: float, u: float, v: float, omega: float) -> tuple[float, float]:
    """Kinetic and potential energy [J]."""
    kinetic = 0.5 * body["mass"] * (u * u + v * v) + 0.5 * body["inertia"] * omega * omega
    return kinetic, body["mass"] * (y * slope.inward - x * slope.downhill)


@kernel
def close_books(body: np.void, pieces: np.ndarray, slope: Incline, launch: State, flight: np.void) -> None:
    """Bring the energy ledger up to the state of a flight: docs/physics.md, section 9.

    The drop counts from the lowest place that the mass centre could have within a size of the launch, and once the
    body has passed the end of the slope of that: on a profile that ends lower gravity supplies that much more.
    """
    x, y, u, v, omega = flight["x"], flight["y"], flight["u"], flight["v"], flight["omega"]
    kinetic, potential = energy(body, slope, launch.y, launch.x, launch.u, launch.v, launch.omega)
    passed = flight["t_line"] < math.inf  # not in the run-out
    ground = heights_within(pieces, slope.length if passed else launch.x, body["size"])[0]
    drop = max(0.0, launch.y - body["lowest"] - ground)
    along = max(0.0, (slope.length if passed else x) - launch.x)
    flight["initial"] = kinetic + potential
    flight["supplied"] = kinetic + body["mass"] * (drop * slope.inward + along * slope.downhill) + flight["work"]
    flight["kinetic"], flight["potential"] = energy(body, slope, y, x, u, v, omega)
    finite = math.isfinite(x + y + flight["phi"] + u + v + omega + flight["kinetic"] + flight["initial"])
    if flight["status"] != RUNNING and not finite:
        flight["status"] = NON_FINITE
