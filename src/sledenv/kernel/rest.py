"""Whether contacts hold a body that stands still, and with which forces.

Each contact gives any wrench of a convex set: its load lies between those of the opening and of the closing spring,
friction and rolling moment are at most their parts of it. The point of the sum of all sets that is nearest to the
wrench needed is found from corners of the sum (Wolfe 1976, "Finding the nearest point in a polytope").
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from sledenv.compiler.jit import kernel

MOST_TRIED: Final = 100  # corners
FLAT: Final = 1e-14  # of the product of its diagonal: a determinant that is zero
HELD: Final = 1e-12  # of the forces: what is missing of those that hold
NO_NEARER: Final = 1e-26  # of the square of the forces: a corner that is nearer by less is not


@kernel
def _add_corner(body: np.void, slope: Any, contacts: np.void, choice: np.void, x: float, y: float, turn: float) -> None:
    """Add the corner that lies furthest against a direction: at each contact the forces that do least along it."""
    corner = choice["corner"][choice["corners"]]
    fx, fy, turning, rolling = body["mass"] * slope.downhill, -body["mass"] * slope.inward, 0.0, 0.0
    per_mass, per_inertia = math.sqrt(body["per_mass"]), math.sqrt(body["per_inertia"])
    x, y, turn = x * per_mass, y * per_mass, turn * per_inertia
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        nx, ny = contact["nx"], contact["ny"]
        normal_lever, tangent_lever = contact["normal_lever"], contact["tangent_lever"]
        along = ny * x - nx * y + tangent_lever * turn
        pull, arm = -math.copysign(contact["friction"], along), -math.copysign(contact["rolling_arm"], turn)
        does = nx * x + ny * y + normal_lever * turn + pull * along + arm * turn
        normal = (contact["closing"] if does < 0.0 else contact["opening"]) * choice["share"][c]["depth"]
        force = pull * normal
        corner["normal"][c], corner["force"][c] = normal, force
        fx, fy = fx + normal * nx + force * ny, fy + normal * ny - force * nx
        turning += normal * normal_lever + force * tangent_lever
        rolling += arm * normal
    corner["moment"], corner["part"] = rolling, 0.0
    corner["point"][0], corner["point"][1] = fx * per_mass, fy * per_mass
    corner["point"][2] = (turning + rolling) * per_inertia
    choice["corners"] += 1


@kernel
def _inner(p: np.ndarray, q: np.ndarray) -> float:
    return float(p[0] * q[0] + p[1] * q[1] + p[2] * q[2])


@kernel
def _project(choice: np.void) -> bool:
    """Write which parts the corners have of the point next to zero of the plane through all; return whether it is one.

    Three equations at most, for the parts of all corners but the first.
    """
    corner, n = choice["corner"], choice["corners"] - 1
    first = corner[0]["point"]
    for i in range(3):
        row, mobility = choice["lock"][i]["row"], choice["lock"][i]["mobility"]
        for j in range(3):
            row[j] = corner[i + 1]["point"][j] - first[j] if i < n else 0.0
            mobility[j] = 1.0 if i == j else 0.0
    for i in range(n):
        for j in range(n):
            choice["lock"][i]["mobility"][j] = _inner(choice["lock"][i]["row"], choice["lock"][j]["row"])
    a, b, d = choice["lock"][0]["mobility"], choice["lock"][1]["mobility"], choice["lock"][2]["mobility"]
    c0, c1, c2 = b[1] * d[2] - b[2] * d[1], b[2] * d[0] - b[0] * d[2], b[0] * d[1] - b[1] * d[0]
    whole = a[0] * c0 + a[1] * c1 + a[2] * c2
    if not whole > FLAT * a[0] * b[1] * d[2]:
        return False
    x = -_inner(choice["lock"][0]["row"], first)
    y, z = -_inner(choice["lock"][1]["row"], first), -_inner(choice["lock"][2]["row"], first)
    if n > 0:
        corner[1]["then"] = (c0 * x + (a[2] * d[1] - a[1] * d[2]) * y + (a[1] * b[2] - a[2] * b[1]) * z) / whole
    if n > 1:
        corner[2]["then"] = (c1 * x + (a[0] * d[2] - a[2] * d[0]) * y + (a[2] * b[0] - a[0] * b[2]) * z) / whole
    if n > 2:
        corner[3]["then"] = (c2 * x + (a[1] * d[0] - a[0] * d[1]) * y + (a[0] * b[1] - a[1] * b[0]) * z) / whole
    corner[0]["then"] = 1.0
    for i in range(1, n + 1):
        corner[0]["then"] -= corner[i]["then"]
    return True


@kernel
def _go_there(choice: np.void) -> bool:
    """Go towards the point next to zero until a corner has no part left, which goes; return whether it is reached."""
    corner, share, out = choice["corner"], 1.0, -1
    for i in range(choice["corners"]):
        part, then = corner[i]["part"], corner[i]["then"]
        if then < 0.0 and part < share * (part - then):
            share, out = part / (part - then), i
    for i in range(choice["corners"]):
        corner[i]["part"] += share * (corner[i]["then"] - corner[i]["part"])
    if out < 0:
        return True
    choice["corners"] -= 1
    corner[out] = corner[choice["corners"]]
    return False


@kernel
def _write_missing(choice: np.void) -> float:
    """Write the wrench that is missing, a sum of corners; return the square of its norm."""
    missing, corner = choice["missing"], choice["corner"]
    for k in range(3):
        missing[k] = 0.0
        for i in range(choice["corners"]):
            missing[k] += corner[i]["part"] * corner[i]["point"][k]
    return _inner(missing, missing)


@kernel
def _write_shares(contacts: np.void, choice: np.void) -> None:
    corner = choice["corner"]
    choice["moment"] = 0.0
    for i in range(choice["corners"]):
        choice["moment"] += corner[i]["part"] * corner[i]["moment"]
    for c in range(contacts["count"]):
        share = choice["share"][c]
        share["normal"] = share["force"] = 0.0
        for i in range(choice["corners"]):
            share["normal"] += corner[i]["part"] * corner[i]["normal"][c]
            share["force"] += corner[i]["part"] * corner[i]["force"][c]


@kernel
def hold(body: np.void, slope: Any, contacts: np.void, choice: np.void) -> bool:
    """Write forces of contacts that stand still which hold the body, or come nearest to that; return whether they do.

    What is missing then, ``choice["missing"]``, is the wrench with which the body begins to move.
    """
    choice["corners"] = 0
    _add_corner(body, slope, contacts, choice, slope.downhill, -slope.inward, 0.0)
    choice["corner"][0]["part"] = 1.0
    weight = body["mass"] * slope.gravity * slope.gravity
    largest = max(weight, _inner(choice["corner"][0]["point"], choice["corner"][0]["point"]))
    square = _write_missing(choice)
    for _ in range(MOST_TRIED):
        if choice["corners"] == 4 or square <= HELD * HELD * largest:
            break
        missing, last = choice["missing"], choice["corners"]
        _add_corner(body, slope, contacts, choice, missing[0], missing[1], missing[2])
        nearer = square - _inner(missing, choice["corner"][last]["point"])
        if not nearer > NO_NEARER * largest or not _project(choice):
            choice["corners"] = last
            break
        while not _go_there(choice) and _project(choice):
            pass
        square = _write_missing(choice)
    _write_shares(contacts, choice)
    return bool(square <= HELD * HELD * largest)
