"""The power series of a step in any branch, of one point or two, by plain loops: docs/physics.md (5.5)-(5.9), (8.4).

One point that turns has programs of its own, which take a fraction of the time: series.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sledenv.kernel import normal
from sledenv.kernel.pair import Forces, Held, Point, branch_of, couples, hold, locking, points, unturned
from sledenv.kernel.series import ORDER, expand_free, expand_rolling, expand_settled, expand_sticking
from sledenv.programs.jit import kernel
from sledenv.programs.rows import EIGHT
from sledenv.programs.trace import straight

_SERIES = ("x", "phi", "gap", "v_n", "v_t", "omega", "normal", "force", "moment", "sines", "cosines")


def _emptying(step: Any) -> None:
    """Program that fills the series of a step with zeros: terms behind the last one are read as well."""
    for name in _SERIES:
        setattr(step, name, [np.zeros(EIGHT)] * 3)


_empty = straight(_emptying)


@kernel
def _begin(contact: np.void, step: np.void) -> None:
    """Write the first terms of the series of a point."""
    _empty(step)
    step["x"][0], step["phi"][0], step["gap"][0] = contact["x"], contact["phi"], contact["gap"]
    step["v_n"][0], step["v_t"][0], step["omega"][0] = contact["v_n"], contact["v_t"], contact["omega"]
    step["sines"][0], step["cosines"][0] = step["sine"], step["cosine"]


@kernel
def _expand_unturned(space: np.void, one: Point, two: Point, found: Forces) -> None:
    """Write the series of a step in which the body does not turn, and those of what keeps it from turning."""
    contact, second, step, second_step = space["contact"], space["second"], space["step"], space["second_step"]
    unit, per_mass = step["unit"], contact["per_mass"]
    gap_locked, slip_locked = contact["gap_rate"] == 0.0, contact["slip"] == 0.0
    moments, loads = space["moments"], space["loads"]
    u = contact["v_t"]
    for k in range(ORDER):
        w = unit / (k + 1)
        step["x"][k + 1] = second_step["x"][k + 1] = u * w
        step["gap"][k + 1] = second_step["gap"][k + 1] = step["v_n"][k] * w
        n_1, n_2 = normal.force(contact, step, k), normal.force(second, second_step, k)
        if gap_locked:
            n_1, n_2 = (found.normal_1, found.normal_2) if k == 0 else (0.0, 0.0)
        f_1, f_2 = contact["mu"] * n_1, second["mu"] * n_2
        if slip_locked:
            f_1, f_2 = (found.tangential_1, found.tangential_2) if k == 0 else (0.0, 0.0)
        step["normal"][k], second_step["normal"][k], step["force"][k] = n_1, n_2, f_1 + f_2
        step["moment"][k] = one.a * n_1 - one.b * f_1 + (two.a * n_2 - two.b * f_2)
        moments[0, k], loads[0, k], moments[1, k], loads[1, k] = couples(one, two, n_1, n_2, f_1 + f_2)
        if not slip_locked:
            moments[0, k] = moments[1, k] = step["moment"][k]
            loads[0, k] = loads[1, k] = one.arm * n_1 + two.arm * n_2
        downhill, inward = (contact["downhill"], contact["inward"]) if k == 0 else (0.0, 0.0)
        u = 0.0 if slip_locked else w * ((f_1 + f_2) * per_mass + downhill)
        step["v_t"][k + 1] = second_step["v_t"][k + 1] = u
        step["v_n"][k + 1] = second_step["v_n"][k + 1] = 0.0 if gap_locked else w * ((n_1 + n_2) * per_mass - inward)


@kernel
def _products(point: np.void, at: np.void, tangential: np.ndarray, k: int) -> tuple[float, float, float]:
    """Coefficients of products of a point, as far as they are known before that of the spin, ``omega[k + 1]``.

    Those of sine and of cosine with the spin, of order k + 1; and the moment of the forces, of order k.
    """
    sines, cosines, omega, normal = at["sines"], at["cosines"], at["omega"], at["normal"]
    by_sine, by_cosine, pushed, pulled = 0.0, 0.0, sines[0] * normal[k], cosines[0] * tangential[k]
    for j in range(1, k + 1):
        by_sine += sines[j] * omega[k + 1 - j]
        by_cosine += cosines[j] * omega[k + 1 - j]
        pushed += sines[j] * normal[k - j]
        pulled += cosines[j] * tangential[k - j]
    by_sine += sines[k + 1] * omega[0]
    by_cosine += cosines[k + 1] * omega[0]
    return by_sine, by_cosine, point["r"] * tangential[k] - point["h"] * (pushed + pulled)


@kernel
def _expand_turning(
    contact: np.void, second: np.void, step: np.void, second_step: np.void, held: Held, forces: np.ndarray
) -> None:
    """Write the series of a step in which the body turns; ``forces`` is room for the tangential ones, (2, WIDTH)."""
    unit, per_mass, ratio = step["unit"], contact["per_mass"], contact["ratio"]
    gap_1, gap_2 = contact["gap_rate"] == 0.0, second["gap_rate"] == 0.0
    slip_1, slip_2 = contact["slip"] == 0.0, second["slip"] == 0.0
    omega, normal_1, normal_2, f_1, f_2 = step["omega"], step["normal"], second_step["normal"], forces[0], forces[1]
    u = contact["v_t"] - (contact["r"] - contact["h"] * step["cosine"]) * contact["omega"]
    turn_1, turn_2 = step["sine"] * omega[0], second_step["sine"] * omega[0]  # of order k, products with the spin
    along_1, along_2 = step["cosine"] * omega[0], second_step["cosine"] * omega[0]
    for k in range(ORDER):
        w = unit / (k + 1)
        step["x"][k + 1] = second_step["x"][k + 1] = u * w
        step["phi"][k + 1] = second_step["phi"][k + 1] = omega[k] * w
        step["gap"][k + 1], second_step["gap"][k + 1] = step["v_n"][k] * w, second_step["v_n"][k] * w
        step["sines"][k + 1], second_step["sines"][k + 1] = along_1 * w, along_2 * w
        step["cosines"][k + 1], second_step["cosines"][k + 1] = -turn_1 * w, -turn_2 * w
        normal_1[k] = 0.0 if gap_1 else normal.force(contact, step, k)
        normal_2[k] = 0.0 if gap_2 else normal.force(second, second_step, k)
        f_1[k], f_2[k] = contact["mu"] * normal_1[k], second["mu"] * normal_2[k]
        turn_1, along_1, moment_1 = _products(contact, step, f_1, k)
        turn_2, along_2, moment_2 = _products(second, second_step, f_2, k)
        moment = moment_1 + moment_2 + (contact["rho"] * normal_1[k] + second["rho"] * normal_2[k])
        u, v = (f_1[k] + f_2[k]) * per_mass, (normal_1[k] + normal_2[k]) * per_mass
        if k == 0:
            u, v = u + contact["downhill"], v - contact["inward"]
        spin = moment * per_mass * ratio
        lift = (contact["h"] * turn_1 if gap_1 else second["h"] * turn_2) / w
        sweep = (contact["h"] * along_1 if slip_1 else second["h"] * along_2) / w
        push, force = locking(held, lift, sweep, u, v, spin)
        if gap_1:
            normal_1[k], f_1[k] = push, contact["mu"] * push
        elif gap_2:
            normal_2[k], f_2[k] = push, second["mu"] * push
        if slip_1:
            f_1[k] = force
        elif slip_2:
            f_2[k] = force
        u, v = w * (u + held.n_u * push + held.s_u * force), w * (v + held.n_v * push)
        omega[k + 1] = second_step["omega"][k + 1] = w * (spin + held.n_w * push + held.s_w * force)
        turn_1, turn_2 = turn_1 + step["sine"] * omega[k + 1], turn_2 + second_step["sine"] * omega[k + 1]
        along_1, along_2 = along_1 + step["cosine"] * omega[k + 1], along_2 + second_step["cosine"] * omega[k + 1]
        if not gap_1:
            step["v_n"][k + 1] = v - contact["h"] * turn_1
        if not gap_2:
            second_step["v_n"][k + 1] = v - second["h"] * turn_2
        if not slip_1:
            step["v_t"][k + 1] = u + contact["r"] * omega[k + 1] - contact["h"] * along_1
        if not slip_2:
            second_step["v_t"][k + 1] = u + second["r"] * omega[k + 1] - second["h"] * along_2
    if slip_1:
        step["force"][:] = f_1
    if slip_2:
        second_step["force"][:] = f_2


@kernel
def _stand_alone(second: np.void, second_step: np.void) -> None:
    """Let the second point have no part in what the first does."""
    _empty(second_step)
    second["h"] = second["r"] = second["mu"] = second["rho"] = second["arm"] = second["stiffness"] = 0.0
    second["gap"] = second["v_n"] = second["v_t"] = second["omega"] = 0.0
    second["gap_rate"] = second["slip"] = 1.0
    second_step["sine"] = second_step["cosine"] = 0.0


@kernel
def expand(space: np.void) -> None:
    """Fill the series of a step with the motion of a contact in its branch, of one point or two.

    At least one of gap rate, slip and spin is free. ``unit``, ``sine`` and ``cosine`` of each step are given.
    """
    contact, second, step, second_step = space["contact"], space["second"], space["step"], space["second_step"]
    paired, turning = contact["paired"] != 0.0, contact["spin"] != 0.0
    if turning and not paired:
        gap_locked, slip_locked = contact["gap_rate"] == 0.0, contact["slip"] == 0.0
        if gap_locked and slip_locked:
            expand_rolling(contact, step)
        elif gap_locked:
            expand_settled(contact, step)
        elif slip_locked:
            expand_sticking(contact, step)
        else:
            expand_free(contact, step)
        return
    if not paired:
        _stand_alone(second, second_step)
    one, two = points(contact, second, step, second_step)
    branch = branch_of(contact)
    _begin(contact, step)
    _begin(second, second_step)
    if not turning:
        _expand_unturned(space, one, two, unturned(contact, one, two, branch))
    else:
        held = hold(contact["per_mass"], contact["ratio"], one, two, branch, branch_of(second))
        _expand_turning(contact, second, step, second_step, held, space["moments"])
