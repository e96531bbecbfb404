"""Rows of a trajectory, written while there is room and counted in any case."""

from __future__ import annotations

from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.arithmetic import sign_of, sine_cosine, wrap
from sledenv.kernel.books import ground_of, lost_to_air, part_of, side_that_lies
from sledenv.kernel.expansion import value
from sledenv.kernel.geometry import ARC_BEND, ARC_PIECE, SIDE_BEND
from sledenv.kernel.mode import NEARLY
from sledenv.kernel.params import Incline, Limits
from sledenv.kernel.records import MOST_CONTACTS

CONTACT_ROWS: Final = 8  # intervals of one step of a contact, close enough to draw it
MOST_ROWS: Final = 1e18  # up to which they are counted


@kernel
def _next_row(trajectory: np.ndarray, flight: np.void) -> np.void:
    """Count a row and return it, without forces; where there is no room left, one that nobody will read."""
    row: np.void = trajectory[min(flight["samples"], trajectory.shape[0] - 1)]
    flight["samples"] += 1
    row["normal"] = row["tangential"] = row["rolling"] = row["slip_velocity"] = row["friction_ratio"] = 0.0
    row["feature"] = row["slip"] = row["spin"] = row["touching"] = 0
    for c in range(MOST_CONTACTS):
        contact = row["contacts"][c]
        contact["x"] = contact["y"] = contact["normal_x"] = contact["normal_y"] = 0.0
        contact["normal"] = contact["tangential"] = 0.0
        contact["part"] = contact["ground"] = 0
    return row


@kernel
def _write_motion(s: np.void, begin: float, t: float, row: np.void) -> None:
    row["t"] = begin + t
    row["x"], row["y"], row["phi"] = value(s["x"], t), value(s["y"], t), value(s["phi"], t)
    row["u"], row["v"], row["omega"] = value(s["u"], t), value(s["v"], t), value(s["omega"], t)


@kernel
def _write_place(body: np.void, pieces: np.ndarray, contact: np.void, row: np.void, out: np.void) -> None:
    """Write where a contact is, and its normal, at the place of a row."""
    a, piece = contact["arc"], pieces[contact["piece"]]
    sine, cosine = sine_cosine(wrap(row["phi"]))
    nx, ny = -piece["ty"], piece["tx"]
    x, y = (
        row["x"] + cosine * body["cx"][a] - sine * body["cy"][a],
        row["y"] + sine * body["cx"][a] + cosine * body["cy"][a],
    )
    if contact["kind"] == SIDE_BEND:
        nx, ny = -(cosine * body["ox"][a] - sine * body["oy"][a]), -(sine * body["ox"][a] + cosine * body["oy"][a])
    elif contact["kind"] == ARC_BEND:
        ex, ey = x - contact["qx"], y - contact["qy"]
        distance = contact["bend"] * np.sqrt(ex * ex + ey * ey)
        nx, ny = ex / distance, ey / distance
    out["normal_x"], out["normal_y"] = nx, ny
    if contact["kind"] == ARC_PIECE:
        height = nx * (x - piece["x"]) + ny * (y - piece["y"])
        out["x"], out["y"] = x - height * nx, y - height * ny
    else:
        out["x"] = contact["qx"] + contact["bend"] * contact["radius"] * nx
        out["y"] = contact["qy"] + contact["bend"] * contact["radius"] * ny
    out["part"], out["ground"] = int(part_of(body, contact)), int(ground_of(contact))


@kernel
def _slide_alike(one: np.void, other: np.void, size: float) -> bool:
    """Whether two contacts lie on one tangent: their slip is the same, and only the sum of their friction is known."""
    turned = abs(one["nx"] - other["nx"]) + abs(one["ny"] - other["ny"])
    return bool(turned < NEARLY and abs(one["tangent_lever"] - other["tangent_lever"]) < NEARLY * size)


@kernel
def _share(body: np.void, space: np.void, t: float, at_rest: bool, row: np.void) -> None:
    """Write the friction of contacts that stick on one tangent: they share its sum as their bounds are."""
    contacts, s, choice = space["contacts"], space["series"], space["choice"]
    for c in range(contacts["count"]):
        contact, out = contacts["at"][c], row["contacts"][c]
        if contact["slip_still"] == 0:
            continue
        bound, force = 0.0, 0.0
        for q in range(contacts["count"]):
            other = contacts["at"][q]
            if other["slip_still"] != 0 and _slide_alike(contact, other, body["size"]):
                bound += other["friction"] * row["contacts"][q]["normal"]
                force += choice["share"][q]["force"] if at_rest else value(s["of"][q]["force"], t)
        if bound > 0.0:
            out["tangential"] = force * (contact["friction"] * out["normal"] / bound)


@kernel
def _write_forces(body: np.void, pieces: np.ndarray, space: np.void, t: float, at_rest: bool, row: np.void) -> None:
    """Write the forces of a row at a time of the step; or those with which the body rests."""
    contacts, s, choice = space["contacts"], space["series"], space["choice"]
    count = contacts["count"]
    bound = 0.0
    for c in range(count):
        contact, terms, out = contacts["at"][c], s["of"][c], row["contacts"][c]
        _write_place(body, pieces, contact, row, out)
        normal, force = value(terms["normal"], t), value(terms["force"], t)
        if at_rest:
            normal, force = choice["share"][c]["normal"], choice["share"][c]["force"]
        out["normal"], out["tangential"] = normal, force
        row["normal"] += normal
        row["tangential"] += force
        bound += contact["friction"] * normal
    _share(body, space, t, at_rest, row)
    row["touching"] = count
    row["rolling"] = choice["moment"] if at_rest else value(s["moment"], t)
    row["friction_ratio"] = row["tangential"] / bound if bound > 0.0 else 0.0
    first = contacts["at"][0]
    row["slip_velocity"] = 0.0 if at_rest else value(s["of"][0]["slip"], t)
    slip = first["slip_sign"] if first["friction"] > 0.0 else sign_of(row["slip_velocity"])
    row["slip"] = 0 if first["slip_still"] != 0 or at_rest else slip
    spin = contacts["spin_sign"] if first["rolling_arm"] > 0.0 else sign_of(row["omega"])
    row["spin"] = 0 if contacts["spin_still"] != 0 or at_rest else spin
    side = side_that_lies(body, contacts)
    row["feature"] = int(side if side != 0.0 else part_of(body, first))


@kernel
def record_step(
    body: np.void,
    pieces: np.ndarray,
    slope: Incline,
    limits: Limits,
    length: float,
    space: np.void,
    flight: np.void,
    rows: np.ndarray,
) -> None:
    """Add rows of a step of some length [s]: of a contact with both its ends, as forces may jump there."""
    contacts, s, begin = space["contacts"], space["series"], space["motion"]["t"]
    touching = contacts["count"] > 0
    parts = max(CONTACT_ROWS if touching else 1.0, np.ceil(length / limits.sample_interval))
    count = parts + 1.0 if touching else parts
    if flight["samples"] + count > rows.shape[0]:
        flight["samples"] = int(min(flight["samples"] + count, MOST_ROWS))
        return
    for i in range(int(count)):
        t = length * (i / parts)
        row = _next_row(rows, flight)
        _write_motion(s, begin, t, row)
        row["drag"] = space["drag"] + lost_to_air(body, slope, s, t)
        if touching:
            _write_forces(body, pieces, space, t, False, row)


@kernel
def record_end(
    body: np.void, pieces: np.ndarray, at_rest: bool, space: np.void, flight: np.void, rows: np.ndarray
) -> None:
    """Add the row of the end of a descent; a body that rests has the forces of its rest."""
    row, motion = _next_row(rows, flight), space["motion"]
    row["t"], row["x"], row["y"], row["phi"] = motion["t"], motion["x"], motion["y"], motion["phi"]
    row["u"], row["v"], row["omega"], row["drag"] = motion["u"], motion["v"], motion["omega"], space["drag"]
    contacts, event = space["contacts"], space["event"]
    if contacts["count"] > 0 and (at_rest or event["time"] > 0.0):
        _write_forces(body, pieces, space, event["time"], at_rest, row)
