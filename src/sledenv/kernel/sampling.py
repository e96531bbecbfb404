"""Rows of a trajectory during a step of a contact, and what rolling resistance holds of the moment there."""

from __future__ import annotations

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.outline import sine_and_cosine
from sledenv.kernel.params import Limits
from sledenv.kernel.roots import horner
from sledenv.kernel.trajectory import (
    CONTACT_ROWS,
    next_row,
    rows_to_write,
    write_forces,
    write_motion,
    write_slip,
    write_touch,
)


@kernel
def held_part(moment: float, most: float) -> float:
    """Part of a moment that rolling resistance holds; the rest is a couple of the friction of two points.

    A body that does not turn needs a certain moment; ``most`` is what rolling resistance can give at all points.
    """
    return min(max(moment, -most), most)


@kernel
def rolling_part(impulse: float, points: np.ndarray, steps: np.ndarray) -> float:
    """:func:`held_part` of the impulse of a moment in a step of two points."""
    loads = steps[0]["normal_impulse"], steps[1]["normal_impulse"]
    return held_part(impulse, points[0]["arm"] * loads[0] + points[1]["arm"] * loads[1])


@kernel
def _forces(spin: float, point: np.void, step: np.void, t: float) -> tuple[float, float, float]:
    """Normal force, tangential force [N] and moment [N m] of a point during a step."""
    push = horner(step["normal"], t)
    force = -point["slip"] * point["friction"] * push if point["slip"] != 0.0 else horner(step["force"], t)
    moment = -spin * point["arm"] * push if spin != 0.0 else horner(step["moment"], t)
    return push, force, moment


@kernel
def _write_point(
    body: np.void, point: np.void, step: np.void, t: float, row: np.void, normal: float, tangential: float
) -> None:
    """Add a point to the contacts of a row, in which the place of the mass centre is."""
    sine, _ = sine_and_cosine(horner(step["phi"], t) + point["shift"])
    write_touch(row, row["x"] - point["h"] * sine, int(body["part"][int(point["arc"])]), normal, tangential)


@kernel
def write_contact(body: np.void, space: np.void, t: float, row: np.void) -> None:
    """Fill the forces of a row, whose motion is known, at a time of the step."""
    contact, points, steps = space["contact"], space["points"], space["steps"]
    one, two = points[0], points[1]
    slip, spin = int(one["slip"]), int(contact["spin"])
    push, force, moment = _forces(contact["spin"], one, steps[0], t)
    bound = one["friction"] * push
    if contact["count"] == 1.0:
        write_forces(row, push, force, moment, int(body["part"][int(one["arc"])]), slip, spin)
        _write_point(body, one, steps[0], t, row, push, force)
    else:
        push_2, force_2, moment_2 = _forces(contact["spin"], two, steps[1], t)
        bound_2 = two["friction"] * push_2
        if slip == 0 and spin == 0:  # only their sum is determined
            share = bound_2 / (bound + bound_2) if bound + bound_2 > 0.0 else push_2 / (push + push_2)
            force, force_2 = force * (1.0 - share), force * share
        bound += bound_2
        moment = held_part(moment + moment_2, one["arm"] * push + two["arm"] * push_2)
        write_forces(row, push + push_2, force + force_2, moment, int(contact["side_touched"]), slip, spin)
        _write_point(body, one, steps[0], t, row, push, force)
        _write_point(body, two, steps[0], t, row, push_2, force_2)
    write_slip(row, horner(steps[0]["v_t"], t), bound)


@kernel
def sample_step(body: np.void, limits: Limits, flight: np.void, space: np.void, trajectory: np.ndarray) -> None:
    """Add rows over one step, both its ends included: forces may jump between it and the next."""
    contact, point, step = space["contact"], space["points"][0], space["steps"][0]
    h, r, shift = point["h"], point["r"], point["shift"]
    unit, length = step["unit"], step["length"]
    rows = max(float(CONTACT_ROWS), np.ceil(length * unit / limits.sample_interval))
    for i in range(rows_to_write(rows + 1.0, flight, trajectory)):
        t = length * (i / rows)  # never beyond the step
        phi, omega = horner(step["phi"], t), horner(step["omega"], t)
        sine, cosine = sine_and_cosine(phi + shift)
        a, b = h * sine, r - h * cosine
        row = next_row(trajectory, flight)
        write_motion(
            row,
            contact["time"] + t * unit,
            horner(step["x"], t),
            horner(step["gap"], t) + b,
            phi + contact["turns"],
            horner(step["v_t"], t) - b * omega,
            horner(step["v_n"], t) + a * omega,
            omega,
        )
        write_contact(body, space, t, row)
