"""One step of a contact: where it starts, when its phase is expected to end, the state at its end, what it adds up.

While the series of a step hold, the state at its end is a sum. The same sums prove of most quantities that they do not
change their sign on the way, which saves the search for a root: docs/physics.md, section 10.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from sledenv.compiler import rows, values
from sledenv.compiler.jit import kernel
from sledenv.compiler.rows import EIGHT, NODES, TERMS, WEIGHTS, repeated, sums
from sledenv.compiler.trace import of_point, straight
from sledenv.compiler.values import absolute, equal, fma, larger, less, not_more, root, smaller, where, where_less
from sledenv.kernel import events, normal
from sledenv.kernel.friction import opposing

# A power t^k on [0, 1] lies below its chord t by so much at most.
_ORDERS = np.maximum(rows.COUNT, 2.0)
_SAGS = np.where(rows.COUNT > 1.0, (_ORDERS - 1.0) * _ORDERS ** (-_ORDERS / (_ORDERS - 1.0)), 0.0)
_SAGS_TO_ONE = np.where(rows.COUNT > 1.0, 1.0 - _SAGS, 0.0)


def _nonzero(a: Any) -> Any:
    return less(a, 0.0) | less(0.0, a)


def _orientation(contact: Any, point: Any, step: Any) -> None:
    """Program of how the arc lies."""
    step.theta = contact.phi + point.shift
    step.sine, step.cosine = values.sine_cosine(step.theta)


def _beginning(contact: Any, point: Any, step: Any) -> None:
    """Program of the unit of time of a step, and of where it starts in the contact oscillation.

    The contact is taken for a harmonic oscillator with frozen arms.
    """
    omega = contact.omega
    # Sine and cosine must converge fast as well.
    fast = not_more(1.0, absolute(omega) * point.pace)
    step.unit = where(fast, 1.0 / absolute(omega), point.pace)
    a, b = point.h * step.sine, point.r - point.h * step.cosine
    slipping, spinning = _nonzero(point.slip), _nonzero(contact.spin)
    mu, rho = opposing(contact, point)
    lever = rho - a + where(slipping, mu * b, 0.0)
    share = contact.ratio / where(slipping, 1.0, 1.0 + contact.ratio * b * b)
    yielding = where(spinning, larger(1.0 - a * lever * share, 0.05), 1.0)
    per_pulsation = 1.0 / root(point.stiffness * contact.per_mass * yielding)
    turning = point.h * step.cosine * omega * omega
    gap, speed = point.gap, point.v_n * per_pulsation
    rest = -(contact.inward + turning) * per_pulsation * per_pulsation  # the gap in balance
    # The gap over that in balance, apart cos + speed sin, closes where it is -rest,
    beyond = speed * speed + gap * (gap - 2.0 * rest)
    separating = less(0.0, point.gap_rate) & less(0.0, beyond)
    step.expected = where(separating, events.SEPARATION, events.RATE_ZERO)
    # and turns back where the tangent is speed / apart.
    step.abeam = where(separating, -gap, speed)
    step.ahead = where(separating, speed + root(beyond), gap - rest)
    step.per_pulsation = per_pulsation


def _expectation(contact: Any, point: Any, step: Any) -> None:
    """Program of the event that ends this phase of the contact oscillation, and of when to expect it.

    Angles are right to a thousandth: the event is found exactly, only faster if the guess is good. Nothing is expected
    of a body that turns as fast.
    """
    separating, closing = not_more(step.expected, events.SEPARATION), less(point.gap_rate, 0.0)
    angle = values.rough_angle(step.abeam, step.ahead)
    later = where(closing & less(angle, 0.0), angle + math.pi, angle)
    angle = where(separating, 2.0 * angle, later)
    step.guess = angle * step.per_pulsation / step.unit
    kept = less(absolute(angle), math.inf) & not_more(point.pace, step.unit)
    step.expected = where(kept, step.expected, events.NOTHING)


def _sagging(terms: Sequence[Any], leaving: Any = None) -> Any:
    """How far a polynomial may sag below the chord between its ends, in eight parts: docs/physics.md (10.3).

    If ``leaving`` is 1 instead of 0, the polynomial starts from zero, and the chord is the line from there to its end.
    """
    sags: Any = _SAGS
    if leaving is not None:
        leave = repeated(leaving, EIGHT)
        sags = [fma(leave, rest, sag) for rest, sag in zip(_SAGS_TO_ONE, _SAGS, strict=True)]
    return rows.added(rows.times([larger(part, np.zeros(EIGHT)) for part in terms], sags))


def _completion(contact: Any, point: Any, step: Any) -> None:
    """Program of the state and the work at the end of a step, and of whether anything changes its sign on the way.

    Integrals are taken by Gauss's rule, whose error is below that of the series.
    """
    s = step.length
    time = s * step.unit
    powers = rows.without_constant(rows.powers(s))
    nodes = repeated(s, EIGHT) * NODES
    push, slip, spin = (rows.values(series, TERMS, nodes) for series in (step.normal, step.v_t, step.omega))
    push = push * WEIGHTS
    moving = (step.x, step.gap, step.v_n, step.v_t, step.omega)
    terms = [rows.times(rows.read(series), powers) for series in moving]
    along, gaps, *velocities = terms
    starts = [series[0] for series in moving]
    signs = (point.gap_rate, point.slip, contact.spin)
    zeros = (point.gap_zeros, point.slip_zeros, contact.spin_zeros)
    sagging = [_sagging([-normal.load(contact, *of) for of in zip(gaps, velocities[0], strict=True)])]
    for row, sign, vanishing in zip(velocities, signs, zeros, strict=True):
        signed = repeated(sign, EIGHT)
        sagging.append(_sagging([signed * part for part in row], smaller(vanishing, 1.0)))
    # The gap of the arc beside it.
    sines, cosines = repeated(point.other_sine, EIGHT), repeated(point.other_cosine, EIGHT)
    around = zip(*(rows.times(rows.read(series), powers) for series in (step.sines, step.cosines)), gaps, strict=True)
    other = [fma(sines, p, fma(cosines, q, r)) for p, q, r in around]
    ends = [rows.added(row) for row in terms]
    *changes, turned, impulse, slid = sums([*ends, spin * WEIGHTS, push, push * slip])
    turning = _sagging([absolute(part) for part in velocities[2]])
    rolled, rest, load_sag, *sags, other_sag, other_change, turning_sag = sums(
        [push * spin, rows.sizes(along), *sagging, _sagging(other), rows.added(other), turning]
    )
    x, gap, *rates = (start + change for start, change in zip(starts, changes, strict=True))
    step.x_end, step.gap_end = x, gap
    step.v_n_end, step.v_t_end, step.omega_end = rates
    step.phi_end = fma(time, turned, contact.phi)
    step.normal_impulse = time * impulse
    step.slip_work = time * slid
    step.spin_work = time * rolled
    step.travel = absolute(step.x[1] * s) + rest
    step.safe_load = smaller(-normal.load(contact, *starts[1:3]), -normal.load(contact, gap, rates[0])) - load_sag
    safe = []
    for series, rate, sign, vanishing, sag in zip(moving[2:], rates, signs, zeros, sags, strict=True):
        end = sign * rate
        # If the second coefficient is zero by construction too, it is left out, and the sag of the third is taken back.
        first, second = sign * series[1] * s, sign * series[2] * s * s
        later = end - first + larger(second, 0.0)
        least = where_less(vanishing, 0.5, smaller(sign * series[0], end), where_less(vanishing, 1.5, end, later))
        safe.append(least - sag)
    step.safe_v_n, step.safe_v_t, step.safe_omega = safe
    start = fma(point.other_sine, step.sines[0], fma(point.other_cosine, step.cosines[0], starts[1]))
    start = start + point.other
    step.safe_other = smaller(start, start + other_change) - other_sag
    step.turn = time * (larger(absolute(starts[4]), absolute(rates[2])) + turning_sag)


def _locked_completion(contact: Any, point: Any, step: Any) -> None:
    """Program of the impulses of the forces of locked velocities, and of whether they stay within their bounds."""
    s = step.length
    time = s * step.unit
    powers = rows.without_constant(rows.powers(s))
    nodes = repeated(s, EIGHT) * NODES
    forces = (step.normal, step.force, step.moment)
    normals, *tangential = terms = [rows.times(rows.read(series), powers) for series in forces]
    sizes = [[absolute(part) for part in row] for row in tangential]
    sagging = [_sagging(row) for row in (normals, [-part for part in normals], *sizes)]
    pushes = [rows.values(series, TERMS, nodes) * WEIGHTS for series in forces[1:]]
    *changes, impulse, twist, sag, rise, force_sag, moment_sag = sums(
        [*(rows.added(row) for row in terms), *pushes, *sagging]
    )
    starts = [series[0] for series in forces]
    ends = [start + change for start, change in zip(starts, changes, strict=True)]

    def slack(i: int, sign: float, factor: Any, force_sags: Any) -> Any:
        """How far ``sign`` times a force stays below ``factor`` times the normal force."""
        slacks = [fma(factor, of[0], -sign * of[i]) for of in (starts, ends)]
        return smaller(*slacks) - fma(factor, sag, force_sags)

    step.safe_force = slack(1, 1.0, point.friction, force_sag)
    step.safe_force_back = slack(1, -1.0, point.friction, force_sag)
    step.safe_moment = slack(2, 1.0, point.arm, moment_sag)
    step.safe_moment_back = slack(2, -1.0, point.arm, moment_sag)
    step.force_impulse = time * impulse
    step.moment_impulse = time * twist
    step.safe_least = smaller(starts[0], ends[0]) - step.least - sag
    step.safe_largest = step.largest - larger(starts[0], ends[0]) - rise


def _progress(contact: Any, point: Any, step: Any) -> None:
    """Program that moves a point to the end of its step, and adds up impulses and losses."""
    slipping, spinning = _nonzero(point.slip), _nonzero(contact.spin)
    lost = normal.ease(contact, point, step, equal(step.event, events.SEPARATION))
    contact.hysteresis = contact.hysteresis + lost
    point.v_n, point.v_t = step.v_n_end, step.v_t_end
    normal.keep_peaks(contact, point)
    impulse, (mu, rho) = step.normal_impulse, opposing(contact, point)
    contact.normal_impulse = contact.normal_impulse + impulse
    contact.tangential_impulse = contact.tangential_impulse + where(slipping, mu * impulse, step.force_impulse)
    contact.rolling_impulse = contact.rolling_impulse + where(spinning, rho * impulse, step.moment_impulse)
    # The powers of friction are never negative; the integral of a vanishing one may be, by rounding.
    slid, rolled = larger(-mu * step.slip_work, 0.0), larger(-rho * step.spin_work, 0.0)
    contact.sliding = contact.sliding + where(slipping, slid, 0.0)
    contact.rolling = contact.rolling + where(spinning, rolled, 0.0)


def _motion(contact: Any, step: Any) -> None:
    """Program that moves the body to the end of a step."""
    contact.time = contact.time + step.length * step.unit
    contact.x, contact.phi, contact.omega = step.x_end, step.phi_end, step.omega_end


# Of a contact, a point and a step: write how the arc lies; the unit of time, and where the step starts in the contact
# oscillation; the event that ends the phase of that, and when to expect it; move the point to the end of the step.
orient, advance = of_point(_orientation), of_point(_progress)
begin_step, expect = straight(_beginning), straight(_expectation)
go_on = straight(_motion)
_complete, _complete_locked = straight(_completion), straight(_locked_completion)


@kernel
def complete(contact: np.void, point: np.void, step: np.void) -> None:
    """Write how a step of ``step["length"]`` ends, and whether anything changes its sign on the way."""
    _complete(contact, point, step)
    if point["gap_rate"] == 0.0 or point["slip"] == 0.0 or contact["spin"] == 0.0:
        _complete_locked(contact, point, step)
