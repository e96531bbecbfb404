"""The power series of a step in any branch, of one point or two: docs/physics.md (5.5)-(5.9), (8.4).

Two points are computed together, as vectors of two. One point of a body that turns has faster programs in series.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sledenv.compiler import rows
from sledenv.compiler.jit import kernel
from sledenv.compiler.rows import element, repeated, shuffled, side_by_side
from sledenv.compiler.trace import Program, straight
from sledenv.compiler.values import equal, fma, where
from sledenv.kernel import normal
from sledenv.kernel.friction import opposing
from sledenv.kernel.pair import both_points, branch_of, couples, hold, locking, pick, unturned
from sledenv.kernel.series import ORDER, expand_free, expand_rolling, expand_settled, expand_sticking, product

_DERIVED = np.array([1.0, 1.0, -1.0, -1.0])  # signs of cosines and sines in the derivatives of sines and cosines


def _write_common(space: Any, x: list[Any], phi: list[Any], omega: list[Any], moment: list[Any]) -> None:
    """Write the series that both points have in common; the rolling moment of both is booked at the first."""
    for step in space.steps:
        step.x, step.phi, step.omega = rows.of(x), rows.of(phi), rows.of(omega)
    space.steps[0].moment, space.steps[1].moment = rows.of(moment), rows.of([])


def _write_both(space: Any, **series: list[Any]) -> None:
    """Write series of both points, given as vectors of two."""
    for name, pairs in series.items():
        for step, row in zip(space.steps, rows.apart(pairs), strict=True):
            setattr(step, name, row)


def _both(space: Any, name: str, count: int = 2) -> Any:
    """Vector of a number of both points; 0 for one that there is not."""
    numbers = [getattr(point, name) for point in space.points[:count]]
    return side_by_side(*numbers, *[0.0] * (2 - count))


def _summed(pair: Any) -> Any:
    return element(pair, 0) + element(pair, 1)


def _still(count: int) -> Program:
    """Return the program of a step in which a body with ``count`` points does not turn, and of what holds it so."""

    def program(space: Any) -> None:
        contact, points, unit = space.contact, space.points[:count], space.steps[0].unit
        one, two = both_points(space, count)
        found = unturned(contact, one, two, branch_of(contact, points[0]), count)
        gap_locked, slip_locked = equal(points[0].gap_rate, 0.0), equal(points[0].slip, 0.0)
        x, u, gap, v_n = [contact.x], [points[0].v_t], [_both(space, "gap", count)], [points[0].v_n]
        pushes, forces, moments, keeping = [], [], [], []
        absent = [0.0] * (2 - count)
        factors = [*(opposing(contact, point)[0] for point in points), *absent]
        for k in range(ORDER):
            first = k == 0
            rate = repeated(v_n[k], 2)
            x.append(u[k] * (unit / (k + 1)))
            gap.append(rate * repeated(unit / (k + 1), 2))
            free = [normal.force(contact, point, element(gap[k], i), v_n[k]) for i, point in enumerate(points)]
            held = (found.normal_1, found.normal_2) if first else (0.0, 0.0)
            n_1, n_2 = (where(gap_locked, p, q) for p, q in zip(held, [*free, *absent], strict=True))
            held = (found.tangential_1, found.tangential_2) if first else (0.0, 0.0)
            f_1, f_2 = (where(slip_locked, p, mu * n) for p, mu, n in zip(held, factors, (n_1, n_2), strict=True))
            pushes.append(side_by_side(n_1, n_2))
            forces.append(side_by_side(f_1 + f_2, 0.0))
            moments.append(one.a * n_1 - one.b * f_1 + (two.a * n_2 - two.b * f_2))
            load = one.arm * n_1 + two.arm * n_2
            alike = (moments[k], load, moments[k], load)
            shared = couples(one, two, n_1, n_2, f_1 + f_2)
            keeping.append([where(slip_locked, p, q) for p, q in zip(shared, alike, strict=True)])
            rate_t, rate_n = (f_1 + f_2) * contact.per_mass, (n_1 + n_2) * contact.per_mass
            if first:
                rate_t, rate_n = rate_t + contact.downhill, rate_n - contact.inward
            u.append(where(slip_locked, 0.0, rate_t * (unit / (k + 1))))
            v_n.append(where(gap_locked, 0.0, rate_n * (unit / (k + 1))))
        _write_common(space, x, [contact.phi], [0.0], moments)
        sines, cosines = (side_by_side(*(getattr(step, n) for step in space.steps)) for n in ("sine", "cosine"))
        v_t = [side_by_side(n, n) for n in u]
        v_n = [side_by_side(n, n) for n in v_n]
        _write_both(space, gap=gap, v_n=v_n, v_t=v_t, normal=pushes, force=forces, sines=[sines], cosines=[cosines])
        moment, load, other_moment, other_load = (rows.of(numbers) for numbers in zip(*keeping, strict=True))
        space.moments, space.loads = [*moment, *other_moment], [*load, *other_load]

    return program


def _four(low: Any, high: Any) -> Any:
    """Vector of two pairs."""
    return shuffled(low, high, range(4))


def _low(four: Any) -> Any:
    return shuffled(four, None, (0, 1))


def _high(four: Any) -> Any:
    return shuffled(four, None, (2, 3))


def _turning(space: Any) -> None:
    """Program of a step in which the body turns."""
    contact, points, unit = space.contact, space.points, space.steps[0].unit
    per_mass = contact.per_mass
    one, two = both_points(space)
    branch, other = (branch_of(contact, point) for point in points)
    held = hold(contact, one, two, branch, other)
    gaps, slips = (equal(_both(space, name), np.zeros(2)) for name in ("gap_rate", "slip"))
    at_gap, at_gap_2 = (equal(point.gap_rate, 0.0) for point in points)
    at_slip, at_slip_2 = (equal(point.slip, 0.0) for point in points)
    h, r = (_both(space, name) for name in ("h", "r"))
    mu, rho = (side_by_side(*pair) for pair in zip(*(opposing(contact, point) for point in points), strict=True))
    # Distance h of the point whose gap rate is locked, and 0 for the other point; the same of the slip.
    lifted, swept = (
        h * side_by_side(pick(one_locked, two_locked, 1.0, 0.0), pick(one_locked, two_locked, 0.0, 1.0))
        for one_locked, two_locked in ((at_gap, at_gap_2), (at_slip, at_slip_2))
    )
    # Vectors of four: trig holds the sines and the cosines of both points, turned those times the spin, and acting the
    # normal and the tangential forces of both.
    sine, cosine = (side_by_side(*(getattr(step, n) for step in space.steps)) for n in ("sine", "cosine"))
    trig = [_four(sine, cosine)]
    x, phi, omega = [contact.x], [contact.phi], [contact.omega]
    gap, v_n, v_t = ([_both(space, name)] for name in ("gap", "v_n", "v_t"))
    u: Any = points[0].v_t - one.b * contact.omega
    spins = [repeated(contact.omega, 4)]
    turned = trig[0] * spins[0]
    acting: list[Any] = []
    for k in range(ORDER):
        w, per_w = unit / (k + 1), (k + 1) / unit
        twice = repeated(w, 2)
        x.append(u * w)
        phi.append(omega[k] * w)
        gap.append(v_n[k] * twice)
        trig.append(shuffled(turned, None, (2, 3, 0, 1)) * (repeated(w, 4) * _DERIVED))
        pressed = [
            normal.force(contact, point, element(gap[k], i), element(v_n[k], i)) for i, point in enumerate(points)
        ]
        push = where(gaps, np.zeros(2), side_by_side(*pressed))
        # Products without the terms that need the locked forces or the next coefficient of the spin.
        known = product(trig[1:], spins, k, 0)
        acting.append(_four(push, mu * push))
        levers = product(trig, acting, k, 0)
        arms = r * (mu * push) - h * (_low(levers) + _high(levers))
        rate_u, rate_v = _summed(mu * push) * per_mass, _summed(push) * per_mass
        if k == 0:
            rate_u, rate_v = rate_u + contact.downhill, rate_v - contact.inward
        spin = _summed(arms + rho * push) * per_mass * contact.ratio
        pushing, force = locking(
            held,
            _summed(lifted * _low(known)) * per_w,
            _summed(swept * _high(known)) * per_w,
            rate_u,
            rate_v,
            spin,
        )
        push = where(gaps, repeated(pushing, 2), push)
        acting[k] = _four(push, where(slips, repeated(force, 2), mu * push))
        u = w * (rate_u + held.n_u * pushing + held.s_u * force)
        v = repeated(w * (rate_v + held.n_v * pushing), 2)
        omega.append(w * (spin + held.n_w * pushing + held.s_w * force))
        spins.append(repeated(omega[k + 1], 4))
        turned = fma(trig[0], spins[k + 1], known)
        v_n.append(where(gaps, np.zeros(2), v - h * _low(turned)))
        slip = repeated(u, 2) + r * repeated(omega[k + 1], 2) - h * _high(turned)
        v_t.append(where(slips, np.zeros(2), slip))
    _write_common(space, x, phi, omega, [])
    normals, forces, sines, cosines = ([half(p) for p in of] for of in (acting, trig) for half in (_low, _high))
    _write_both(space, gap=gap, v_n=v_n, v_t=v_t, normal=normals, force=forces, sines=sines, cosines=cosines)


_expand_still_point, _expand_still_pair = straight(_still(count=1)), straight(_still(count=2))
_expand_turning = straight(_turning)


@kernel
def expand(space: np.void) -> None:
    """Fill the series of a step with the motion of a contact in its branch, of one point or two.

    Any of gap rate, slip and spin may be locked. ``unit``, ``sine`` and ``cosine`` of each step are given.
    """
    contact, point, step = space["contact"], space["points"][0], space["steps"][0]
    gap_locked, slip_locked, turning = point["gap_rate"] == 0.0, point["slip"] == 0.0, contact["spin"] != 0.0
    if not turning and contact["count"] == 1.0:
        _expand_still_point(space)
    elif not turning:
        _expand_still_pair(space)
    elif contact["count"] > 1.0:
        _expand_turning(space)
    elif gap_locked and slip_locked:
        expand_rolling(contact, point, step)
    elif gap_locked:
        expand_settled(contact, point, step)
    elif slip_locked:
        expand_sticking(contact, point, step)
    else:
        expand_free(contact, point, step)
