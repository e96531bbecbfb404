"""Extended-precision reference for the compliant descent, from Newton's laws alone, sharing no code with sledenv.

The body is a disc of radius r (or a rod end, r = 0) whose arc centre O lies at the distance h from the mass centre C:
O = C + h (-sin phi, cos phi). It touches at the lowest point K of the arc, K - C = (-a, -b) with a = h sin phi and
b = r - h cos phi, and the velocity of K is (v_t, v_n) = (u + b omega, v - a omega). In contact

    m du/dt = F + m g sin(beta),    m dv/dt = N - m g cos(beta),    J domega/dt = -a N + b F + M,

with the penetration p = r - y - h cos(phi) and three set-valued laws, each single-valued off its surface:

    v_n:    N = c (1 + Delta) p while v_n < 0,  c (1 - Delta) p while v_n > 0,  anything between at v_n = 0
    v_t:    F = -sgn(v_t) f N,      |F| <= f N at v_t = 0
    omega:  M = -sgn(omega) d N,    |M| <= d N at omega = 0       (d is the rolling arm)

A mode names, for each of v_t, omega, v_n, its sign, or 0 where it is locked. Within one mode the motion is analytic,
so it is advanced by Taylor series whose coefficients come from recurrences: a row of a linear system for (N, F, M)
says either what the law gives or that the locked velocity stays constant, and that system is solved order by order.
Every condition that a mode rests on (sign of a free velocity, slack of a locked multiplier, p > 0) is then a
polynomial, positive within the mode; its first root is isolated with Bernstein coefficients, which cannot step over
a root.

`python tests/oracles.py` computes the rebounds of all cases in tests/data/reference_descent.json anew.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterable
from fractions import Fraction
from itertools import pairwise, product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mpmath import mp, mpf
from mpmath.libmp import to_rational

DATA_FILE = Path(__file__).parent / "data" / "reference_descent.json"
SLIP, SPIN, NORMAL, SEPARATION = 0, 1, 2, 3  # the surfaces v_t = 0, omega = 0, v_n = 0, and p = 0
Mode = tuple[int, int, int]  # the signs of (v_t, omega, v_n), 0 where that velocity is locked


class OracleBody(NamedTuple):
    """A disc or rod end, its contact law and its slope. Numbers may be mpf, decimal strings or (exact) floats."""

    mass: mpf  # [kg]
    radius: mpf  # [m] r of the arc, 0 for a rod
    eccentricity: mpf  # [m] h, from the mass centre to the arc centre
    inertia: mpf  # [kg m^2] about the mass centre
    stiffness: mpf  # [N/m] c
    asymmetry: mpf  # [-] Delta, 0 <= Delta < 1
    friction: mpf  # [-] f
    rolling_arm: mpf  # [m] d
    slope: mpf  # [rad] beta
    gravity: mpf  # [m/s^2] g


class OracleState(NamedTuple):
    """Position and velocity of the mass centre, in the frame of the slope."""

    x: mpf  # [m] downhill
    y: mpf  # [m] along the outward normal
    phi: mpf  # [rad] counter-clockwise
    u: mpf  # [m/s] dx/dt
    v: mpf  # [m/s] dy/dt
    omega: mpf  # [rad/s] dphi/dt


class OracleRebound(NamedTuple):
    """The state at one separation."""

    time: mpf  # [s] of separation, since the start of the descent
    x: mpf  # [m]
    y: mpf  # [m]
    phi: mpf  # [rad]
    u: mpf  # [m/s]
    v: mpf  # [m/s]
    omega: mpf  # [rad/s]
    duration: mpf  # [s] from touchdown to separation
    segments: int  # [-] number of modes the contact went through


class ContactSeries(NamedTuple):
    """Taylor coefficients in time of everything that moves during one contact mode."""

    x: list
    y: list
    phi: list
    u: list
    v: list
    omega: list
    penetration: list
    slip: list  # v_t
    approach: list  # v_n
    normal: list  # N
    friction: list  # F
    moment: list  # M


class Guard(NamedTuple):
    """A condition of the present mode: a polynomial in time that is positive while the mode lasts."""

    surface: int
    coefficients: list
    unit: mpf  # natural magnitude, against which a coefficient counts as zero
    is_slack: bool  # slack of a locked multiplier (True) or a velocity or penetration (False)


class NoUniqueModeError(ArithmeticError):
    """The laws admit no contact mode, or more than one."""


# --- small tools -----------------------------------------------------------------------------------------------------


def convolve(left: list, right: list, order: int, first: int = 0) -> mpf:
    """Coefficient `order` of left * right, leaving out the terms with left[k], k < first."""
    last = min(order, len(left) - 1)
    return mp.fdot((left[k], right[order - k]) for k in range(first, last + 1))


def evaluate(coefficients: list, t: mpf) -> mpf:
    """Sum of coefficients[k] t^k."""
    return mp.polyval(coefficients[::-1], t)


def natural_units(body: OracleBody, state: OracleState) -> tuple[mpf, mpf]:
    """Natural velocity [m/s] and time [s] of a contact, the scales of every test for zero."""
    period = mp.sqrt(body.mass / (body.stiffness * (1 + body.asymmetry)))
    size = body.radius + body.eccentricity
    return abs(state.u) + abs(state.v) + size * abs(state.omega) + body.gravity * period, period


def zero_tolerance() -> mpf:
    """Relative size below which a Taylor coefficient is rounding: far below any physical one, far above mp.eps."""
    return mp.mpf(10) ** (-(6 * mp.dps) // 10)


def first_root(coefficients: list, end: mpf) -> mpf | None:
    """First root in [0, end] of a polynomial that is positive just after 0; None if there is none.

    Bernstein coefficients without a sign change prove that there is no root, one sign change proves that there is
    exactly one; anything else is halved.
    """
    scaled = [c * end**k for k, c in enumerate(coefficients)]
    if scaled[0] <= 0:
        return mpf(0)
    if scaled[0] + mp.fsum(c for c in scaled if c < 0) > 0:
        return None
    degree = len(scaled) - 1
    weighted = [c / math.comb(degree, k) for k, c in enumerate(scaled)]
    bernstein = [mp.fdot((math.comb(j, k), weighted[k]) for k in range(j + 1)) for j in range(degree + 1)]
    pieces = [(mpf(0), mpf(1), bernstein)]
    while pieces:
        low, high, control = pieces.pop()
        if control[0] <= 0:
            return low * end
        signs = [c > 0 for c in control if c != 0]
        changes = sum(s != t for s, t in pairwise(signs))
        if changes == 0:
            continue
        if changes == 1:
            return polish_root(scaled, low, high) * end
        if high - low < mp.mpf(2) ** -100:
            raise ArithmeticError("a grazing event that this precision cannot resolve")
        left, right = halve(control)
        middle = (low + high) / 2
        pieces += [(middle, high, right), (low, middle, left)]
    return None


def halve(control: list) -> tuple[list, list]:
    """De Casteljau: Bernstein coefficients on the left and on the right half."""
    left, right, row = [], [], control
    while row:
        left.append(row[0])
        right.append(row[-1])
        row = [(p + q) / 2 for p, q in pairwise(row)]
    return left, right[::-1]


def polish_root(coefficients: list, low: mpf, high: mpf) -> mpf:
    """The root between low, where the polynomial is positive, and high, where it is not: Newton kept in its bracket."""
    backwards = coefficients[::-1]
    t = (low + high) / 2
    for _ in range(4 * mp.prec):
        value, rate = mp.polyval(backwards, t, derivative=1)
        if value > 0:
            low = t
        else:
            high = t
        newton = t - value / rate if rate != 0 else low
        nearer = newton if low < newton < high else (low + high) / 2
        if abs(nearer - t) <= 4 * mp.eps * abs(t) or high - low <= 4 * mp.eps * high:
            return nearer
        t = nearer
    return t


# --- free flight -----------------------------------------------------------------------------------------------------


def fly(body: OracleBody, state: OracleState, t: mpf) -> OracleState:
    """The ballistic state a time t [s] later."""
    along, towards = body.gravity * mp.sin(body.slope), body.gravity * mp.cos(body.slope)
    return OracleState(
        state.x + state.u * t + along * t * t / 2,
        state.y + state.v * t - towards * t * t / 2,
        state.phi + state.omega * t,
        state.u + along * t,
        state.v - towards * t,
        state.omega,
    )


def gap_and_rate(body: OracleBody, state: OracleState) -> tuple[mpf, mpf]:
    """Height of the lowest arc point above the slope [m] and its rate v_n [m/s]."""
    gap = state.y + body.eccentricity * mp.cos(state.phi) - body.radius
    return gap, state.v - body.eccentricity * mp.sin(state.phi) * state.omega


def touchdown_time(body: OracleBody, state: OracleState, leaving: bool) -> mpf:
    """First t > 0 [s] with gap = 0; `leaving` says that the gap is zero now.

    As d2gap/dt2 >= -B with B = g cos(beta) + h omega^2, the gap stays positive until gap + rate t - B t^2/2 = 0, and
    a march by these certified steps converges on the first root from below, quadratically.
    """
    bound = body.gravity * mp.cos(body.slope) + body.eccentricity * state.omega**2
    t = mpf(0)
    while True:
        gap, rate = gap_and_rate(body, fly(body, state, t))
        if leaving and t == 0:
            gap = mpf(0)
        gap = max(gap, mpf(0))
        root = mp.sqrt(rate * rate + 2 * bound * gap)
        step = (rate + root) / bound if rate > 0 else 2 * gap / (root - rate)
        t += step
        if step <= 4 * mp.eps * t:
            return t


# --- contact ---------------------------------------------------------------------------------------------------------


def set_valued_surfaces(body: OracleBody) -> list[int]:
    """The surfaces on which a force jumps; without friction, rolling resistance or asymmetry there is no jump."""
    return [k for k, jump in enumerate((body.friction, body.rolling_arm, body.asymmetry)) if jump > 0]


def contact_velocities(body: OracleBody, state: OracleState) -> tuple[mpf, mpf, mpf]:
    """(v_t [m/s], omega [rad/s], v_n [m/s])."""
    a = body.eccentricity * mp.sin(state.phi)
    b = body.radius - body.eccentricity * mp.cos(state.phi)
    return state.u + b * state.omega, state.omega, state.v - a * state.omega


def with_zero_velocities(body: OracleBody, state: OracleState, surfaces: Iterable[int]) -> OracleState:
    """The state with the named contact velocities set to exact zero."""
    surfaces = set(surfaces)
    if SPIN in surfaces:
        state = state._replace(omega=mpf(0))
    if SLIP in surfaces:
        state = state._replace(u=-(body.radius - body.eccentricity * mp.cos(state.phi)) * state.omega)
    if NORMAL in surfaces:
        state = state._replace(v=body.eccentricity * mp.sin(state.phi) * state.omega)
    return state


def contact_series(body: OracleBody, state: OracleState, mode: Mode, order: int) -> ContactSeries:
    """Taylor coefficients 0..order of the motion in one contact mode.

    The forces z = (N, F, M) solve A z = q. A row belongs to a velocity: a free one contributes its law, a locked one
    the statement that its acceleration is zero,

        v_t:    F + s f N = 0           or   -a b N/J + (1/m + b^2/J) F + b M/J = -g sin(beta) - a omega^2
        omega:  M + s d N = 0           or   -a N + b F + M = 0
        v_n:    N = c (1 -+ Delta) p    or   (1/m + a^2/J) N - a b F/J - a M/J = g cos(beta) + h cos(phi) omega^2
    """
    m, r, h, inertia = body.mass, body.radius, body.eccentricity, body.inertia
    along, towards = body.gravity * mp.sin(body.slope), body.gravity * mp.cos(body.slope)
    slip_sign, spin_sign, normal_sign = mode
    stiffness = body.stiffness * (1 - normal_sign * body.asymmetry)

    x, y, phi, u, v, omega = ([value] for value in state)
    sine, cosine = [], []
    a, b, spin_squared, centripetal_t, centripetal_n = [], [], [], [], []
    aa, ab, bb = [], [], []
    penetration, slip, approach = [], [], []
    forces = ([], [], [])
    normal, friction, moment = forces
    matrix = [[None] * 3 for _ in range(3)]
    one, zero = [mpf(1)], [mpf(0)]
    slip_row = [[], [], []]
    normal_row = [[], [], []]
    matrix[SLIP] = slip_row if slip_sign == 0 else [[slip_sign * body.friction], one, zero]
    matrix[SPIN] = [[], b, one] if spin_sign == 0 else [[spin_sign * body.rolling_arm], zero, one]
    matrix[NORMAL] = normal_row if normal_sign == 0 else [one, zero, zero]
    inverse = None

    for n in range(order + 1):
        sine.append(convolve(cosine, omega, n - 1) / n if n else mp.sin(state.phi))
        cosine.append(-convolve(sine, omega, n - 1) / n if n else mp.cos(state.phi))
        a.append(h * sine[n])
        b.append((0 if n else r) - h * cosine[n])
        spin_squared.append(convolve(omega, omega, n))
        penetration.append((0 if n else r) - y[n] - h * cosine[n])
        slip.append(u[n] + convolve(b, omega, n))
        approach.append(v[n] - convolve(a, omega, n))

        right = [mpf(0), mpf(0), stiffness * penetration[n]]
        if slip_sign == 0 or normal_sign == 0:
            ab.append(convolve(a, b, n))
        if slip_sign == 0:
            bb.append(convolve(b, b, n))
            centripetal_t.append(convolve(a, spin_squared, n))
            right[SLIP] = -centripetal_t[n] - (0 if n else along)
            for column, entry in enumerate((-ab[n] / inertia, (0 if n else 1 / m) + bb[n] / inertia, b[n] / inertia)):
                slip_row[column].append(entry)
        if spin_sign == 0:
            matrix[SPIN][0].append(-a[n])
        if normal_sign == 0:
            aa.append(convolve(a, a, n))
            centripetal_n.append(h * convolve(cosine, spin_squared, n))
            right[NORMAL] = centripetal_n[n] + (0 if n else towards)
            for column, entry in enumerate(((0 if n else 1 / m) + aa[n] / inertia, -ab[n] / inertia, -a[n] / inertia)):
                normal_row[column].append(entry)
        if n == 0:
            inverse = mp.inverse(mp.matrix([[entry[0] for entry in row] for row in matrix]))
        for row in range(3):
            right[row] -= sum(convolve(matrix[row][column], forces[column], n, first=1) for column in range(3))
        for k in range(3):
            forces[k].append(mp.fdot((inverse[k, row], right[row]) for row in range(3)))

        if n < order:
            torque = -convolve(a, normal, n) + convolve(b, friction, n) + moment[n]
            x.append(u[n] / (n + 1))
            y.append(v[n] / (n + 1))
            phi.append(omega[n] / (n + 1))
            u.append((friction[n] / m + (0 if n else along)) / (n + 1))
            v.append((normal[n] / m - (0 if n else towards)) / (n + 1))
            omega.append(torque / inertia / (n + 1))
    return ContactSeries(x, y, phi, u, v, omega, penetration, slip, approach, normal, friction, moment)


def mode_guards(body: OracleBody, series: ContactSeries, mode: Mode, units: tuple[mpf, mpf]) -> list[Guard]:
    """Every condition that the mode rests on."""
    speed, period = units
    force, size = body.mass * speed / period, body.radius + body.eccentricity
    friction, arm = body.friction, body.rolling_arm
    least, most = body.stiffness * (1 - body.asymmetry), body.stiffness * (1 + body.asymmetry)

    def combine(p: mpf, left: list, q: mpf, right: list) -> list:
        return [p * s + q * t for s, t in zip(left, right, strict=True)]

    velocities = (series.slip, series.omega, series.approach)
    speeds = (speed, speed / size, speed)
    slacks = (
        [combine(friction, series.normal, side, series.friction) for side in (-1, 1)],
        [combine(arm, series.normal, side, series.moment) for side in (-1, 1)],
        [combine(most, series.penetration, -1, series.normal), combine(-least, series.penetration, 1, series.normal)],
    )
    slack_units = (force, force * (size + arm), force)
    guards = [Guard(SEPARATION, series.penetration, speed * period, False)]
    for k in set_valued_surfaces(body):
        if mode[k]:
            guards.append(Guard(k, [mode[k] * c for c in velocities[k]], speeds[k], False))
        else:
            guards += [Guard(k, slack, slack_units[k], True) for slack in slacks[k]]
    return guards


def leading_term(guard: Guard, period: mpf) -> int | None:
    """Index of the first Taylor coefficient that is not zero up to rounding; None if all vanish."""
    floor = zero_tolerance() * guard.unit
    return next((k for k, c in enumerate(guard.coefficients) if abs(c) * period**k > floor), None)


def choose_mode(body: OracleBody, state: OracleState, signs: Mode, zeros: set[int]) -> Mode:
    """The one mode that the laws admit just after a state in which the velocities `zeros` vanish.

    Each of them may stay locked or leave with either sign, all combinations are tried, and one is admitted if every
    condition it rests on begins with a positive Taylor coefficient.
    """
    if not zeros:
        return signs
    units = natural_units(body, state)
    admitted = []
    for mode in product(*((0, 1, -1) if k in zeros else (signs[k],) for k in range(3))):
        guards = mode_guards(body, contact_series(body, state, mode, order=8), mode, units)
        leads = [(guard, leading_term(guard, units[1])) for guard in guards if guard.surface in zeros]
        if all(guard.is_slack if lead is None else guard.coefficients[lead] > 0 for guard, lead in leads):
            admitted.append(mode)
    if len(admitted) != 1:
        raise NoUniqueModeError(f"zeros {sorted(zeros)}, signs {signs}: {admitted}")
    return admitted[0]


def series_reach(body: OracleBody, series: ContactSeries, units: tuple[mpf, mpf]) -> mpf:
    """Time [s] for which the truncated series is exact to the working precision; inf for an exact polynomial."""
    speed, period = units
    size = body.radius + body.eccentricity
    order = len(series.u) - 1
    reach = mp.inf
    rows = ((series.u, 1), (series.v, 1), (series.omega, size), (series.normal, period / body.mass))
    for coefficients, factor in rows:
        for k in (order - 1, order):
            if coefficients[k] != 0:
                reach = min(reach, mp.root(mp.eps * speed / (factor * abs(coefficients[k])), k))
    return reach


def go_through_contact(
    body: OracleBody, state: OracleState, start: mpf, horizon: mpf, order: int, step_fraction: mpf
) -> tuple[OracleState, mpf, int] | None:
    """State at separation, its time [s] and the number of modes; None if the contact outlasts the horizon."""
    units = natural_units(body, state)
    velocities = contact_velocities(body, state)
    speeds = (units[0], units[0] / (body.radius + body.eccentricity), units[0])
    surfaces = set_valued_surfaces(body)
    zeros = {k for k in surfaces if abs(velocities[k]) <= zero_tolerance() * speeds[k]}
    mode = tuple(1 if w > 0 or k not in surfaces else -1 for k, w in enumerate(velocities))
    now, segments, fresh = start, 0, True
    while True:
        if fresh:  # a new mode begins
            state = with_zero_velocities(body, state, zeros)
            mode = choose_mode(body, state, mode, zeros)
            segments += 1
        locked = {k for k in surfaces if mode[k] == 0}
        state = with_zero_velocities(body, state, locked)
        units = natural_units(body, state)
        series = contact_series(body, state, mode, order)
        step = min(step_fraction * series_reach(body, series, units), horizon - now)
        roots = []
        for guard in mode_guards(body, series, mode, units):
            coefficients = guard.coefficients
            if fresh:  # the coefficients known to be zero must not be found again as a root
                lead = leading_term(guard, units[1])
                if lead is None:
                    continue
                coefficients = coefficients[lead:]
            root = first_root(coefficients, step)
            if root is not None:
                roots.append((root, guard.surface))
        elapsed = min((root for root, _ in roots), default=step)
        state = OracleState(*(evaluate(c, elapsed) for c in series[:6]))
        now += elapsed
        met = {surface for root, surface in roots if root <= elapsed + zero_tolerance() * units[1]}
        if SEPARATION in met:
            return state, now, segments
        fresh = bool(met)
        zeros = locked | met
        if not met and now >= horizon:
            return None


# --- the descent -----------------------------------------------------------------------------------------------------


def compliant_descent(
    body: OracleBody,
    state: OracleState,
    rebounds: int = 20,
    dps: int = 50,
    order: int = 44,
    step_fraction: str = "0.9",
    horizon: str = "20",
) -> list[OracleRebound]:
    """The first rebounds of a compliant descent that starts in free flight.

    Numbers are mpf, decimal strings (exact) or floats (their exact binary value). The step is a fraction of what the
    series of some order allows. There are fewer rebounds if the body is still in contact at the horizon [s].
    """
    with mp.workdps(dps):
        body = OracleBody(*(+mpf(value) for value in body))
        state = OracleState(*(+mpf(value) for value in state))
        now, done = mpf(0), []
        while len(done) < rebounds:
            flight = touchdown_time(body, state, leaving=bool(done))
            state = fly(body, state, flight)
            state = state._replace(y=body.radius - body.eccentricity * mp.cos(state.phi))
            now += flight
            contact = go_through_contact(body, state, now, mpf(horizon), order, mpf(step_fraction))
            if contact is None:
                break
            touchdown = now
            state, now, segments = contact
            done.append(OracleRebound(now, *state, now - touchdown, segments))
        return done


def largest_shift(first: list[OracleRebound], second: list[OracleRebound]) -> list[mpf]:
    """Per rebound, the largest difference of two descents, relative to 1 or to the value if that is larger."""
    return [
        max(abs(p - q) / max(1, abs(p)) for p, q in zip(one[:8], other[:8], strict=True))
        for one, other in zip(first, second, strict=True)
    ]


def verified_descent(
    body: OracleBody, state: OracleState, rebounds: int, dps: int = 50, agreement: str = "1e-25"
) -> list[OracleRebound]:
    """A descent computed twice, with other digits, order and steps, which agree."""
    coarse = compliant_descent(body, state, rebounds, dps, order=44, step_fraction="0.9")
    fine = compliant_descent(body, state, rebounds, dps + 12, order=60, step_fraction="0.7")
    disagreement = max(largest_shift(coarse, fine))
    if disagreement > mpf(agreement) or any(p.segments != q.segments for p, q in zip(coarse, fine, strict=True)):
        raise ArithmeticError(f"two descents disagree by {mp.nstr(disagreement, 3)}")
    return fine


# --- slow and obvious versions of single kernels ----------------------------------------------------------------------
# `body` is anything with mass, radius, eccentricity, inertia and half_angle, in floats.


def support(body, phi: np.ndarray) -> np.ndarray:
    """Height [m] of the mass centre when the lowest of arc and corners touches, from where those points are."""
    wrapped = np.arctan2(np.sin(phi), np.cos(phi))
    arc = body.radius - body.eccentricity * np.cos(phi)
    if body.radius == 0.0 or body.half_angle >= math.pi:
        return arc
    across, above = body.radius * math.sin(body.half_angle), body.eccentricity - body.radius * math.cos(body.half_angle)
    corners = np.maximum(-across * np.sin(phi) - above * np.cos(phi), across * np.sin(phi) - above * np.cos(phi))
    return np.where(np.abs(wrapped) <= body.half_angle, arc, corners)


# --- the impact in the stiff limit -----------------------------------------------------------------------------------
#
# With the configuration frozen and the normal impulse p in the part of time,
#
#     m du = mu dp,    m dv = dp,    J domega = (-a + b mu + rho) dp,    v_t = u + b omega,    v_n = v - a omega,
#
# (mu, rho) is the point of the box |mu| <= f, |rho| <= d, a nonzero velocity pinning its component to the opposing
# bound, at which mu^2/(2m) + (b mu + rho - a)^2/(2J) is least: Gauss's principle, what friction can do to slow down
# (v_t, omega). Everything but the last instant is rational, so doubles are taken as the fractions they are, signs and
# simultaneous events are exact, and only the square root at the end is rounded, to the precision of mpmath.


class ImpactPhase(NamedTuple):
    """One stretch of an impact between two events."""

    start: float  # [N s] normal impulse at its start
    impulse: float  # [N s] of the phase
    slip: int  # sign of v_t, 0 sticking
    spin: int  # sign of omega, 0 stopped
    opening: bool


class ImpactResult(NamedTuple):
    """Velocities after an impact, impulses and losses, rounded to double precision at the very end."""

    slip: float  # [m/s] v_t
    omega: float  # [rad/s]
    approach: float  # [m/s] v_n
    normal: float  # [N s]
    friction: float  # [N s]
    moment: float  # [N m s]
    loss_normal: float  # [J]
    loss_sliding: float  # [J]
    loss_rolling: float  # [J]
    phases: list[ImpactPhase]


def sign(value: Fraction) -> int:
    """-1, 0 or 1."""
    return (value > 0) - (value < 0)


def least_in_box(mobility: list, drive: list, box: list) -> tuple[Fraction, Fraction]:
    """The point z of a box at which z'Az/2 + k'z is least, by listing all stationary points of inside, sides, corners.

    `mobility` is (A11, A12, A22), `drive` is k, `box` a pair of (low, high).
    """
    a11, a12, a22 = mobility
    k1, k2 = drive
    (low1, high1), (low2, high2) = box
    determinant = a11 * a22 - a12 * a12
    points = [((a12 * k2 - a22 * k1) / determinant, (a12 * k1 - a11 * k2) / determinant)]
    points += [(z1, -(k2 + a12 * z1) / a22) for z1 in (low1, high1)]
    points += [(-(k1 + a12 * z2) / a11, z2) for z2 in (low2, high2)]
    points += list(product((low1, high1), (low2, high2)))
    inside = [z for z in points if low1 <= z[0] <= high1 and low2 <= z[1] <= high2]
    return min(
        inside, key=lambda z: a11 * z[0] ** 2 + 2 * a12 * z[0] * z[1] + a22 * z[1] ** 2 + 2 * (k1 * z[0] + k2 * z[1])
    )


def rational_impact(
    mass: float,
    inertia: float,
    a: float,
    b: float,
    friction: float,
    arm: float,
    restitution: float,
    slip: float,
    omega: float,
    approach: float,
    hypothesis: str = "energetic",
    dps: int = 30,
    number: Callable = float,
) -> ImpactResult:
    """One impact of rigid surfaces, exact up to one square root, which has ``dps`` digits.

    The contact point lies at (-a, -b) from the mass centre and comes with v_t, omega and v_n <= 0. An "energetic"
    contact gives back e^2 times the work it took, a "poisson" one ends at (1 + e) times the impulse of the (first)
    compression, a "newton" one when v_n is -e times that at touch. ``number`` makes the numbers of the result.
    """
    m, inertia_, a, b, f, d, e = map(Fraction, (mass, inertia, a, b, friction, arm, restitution))
    mobility = [1 / m + b * b / inertia_, b / inertia_, 1 / inertia_]
    drive = [-a * b / inertia_, -a / inertia_]
    v_t, w, v_n = map(Fraction, (slip, omega, approach))
    entry = v_n
    p = total_friction = total_moment = taken = given = slid = rolled = Fraction(0)
    compression = None  # impulse at the end of the first one
    phases: list[ImpactPhase] = []
    while True:
        bounds = [(-s * limit, -s * limit) if s else (-limit, limit) for s, limit in ((sign(v_t), f), (sign(w), d))]
        mu, rho = least_in_box(mobility, drive, bounds)
        rate_t = mobility[0] * mu + mobility[1] * rho + drive[0]
        rate_w = mobility[1] * mu + mobility[2] * rho + drive[1]
        rate_n = 1 / m - a * rate_w
        opening = v_n > 0 or (v_n == 0 and rate_n > 0)
        if v_n == 0 and rate_n == 0:
            break
        if opening:
            compression = p if compression is None else compression
            if hypothesis == "energetic" and e * e * taken == given:
                break
        events = [-v / rate for v, rate in ((v_t, rate_t), (w, rate_w), (v_n, rate_n)) if v * rate < 0]
        span = min(events, default=None)
        last = False
        if opening and hypothesis == "energetic":
            left = e * e * taken - given
            last = span is None or v_n * span + rate_n * span * span / 2 >= left
            if last:  # the only irrational number of the impact
                with mp.workdps(dps):
                    root = mp.sqrt(to_mpf(v_n * v_n + 2 * rate_n * left))
                    span = 2 * to_mpf(left) / (to_mpf(v_n) + root)
        elif opening:
            if hypothesis == "poisson":
                end = max((1 + e) * compression - p, Fraction(0))
            else:
                end = max(-e * entry - v_n, Fraction(0)) / rate_n if rate_n > 0 or v_n >= -e * entry else None
            last = end is not None and (span is None or end <= span)
            span = end if last else span
        if span is None:
            raise ArithmeticError("an impact without an end")
        if last and not isinstance(span, Fraction):
            with mp.workdps(dps):
                numbers = map(to_mpf, (v_t, w, v_n, rate_t, rate_w, rate_n, mu, rho, p))
                v_t, w, v_n, rate_t, rate_w, rate_n, mu, rho, p = numbers
                total_friction, total_moment, taken, given, slid, rolled = map(
                    to_mpf, (total_friction, total_moment, taken, given, slid, rolled)
                )
        with mp.workdps(dps):
            end_t, end_w, end_n = v_t + rate_t * span, w + rate_w * span, v_n + rate_n * span
            if span > 0:
                signs = (sign(v_t + end_t), sign(w + end_w))
                phases.append(ImpactPhase(float(p), float(span), *signs, opening))
            work = (v_n + end_n) * span / 2
            taken, given = (taken, given + work) if opening else (taken - work, given)
            slid -= mu * (v_t + end_t) * span / 2
            rolled -= rho * (w + end_w) * span / 2
            total_friction += mu * span
            total_moment += rho * span
            p += span
            v_t, w, v_n = end_t, end_w, end_n
        if last:
            break
    numbers = (v_t, w, v_n, p, total_friction, total_moment, taken - given, slid, rolled)
    return ImpactResult(*map(number, numbers), phases)


def to_mpf(value: Fraction) -> mpf:
    """A fraction, rounded to the working precision."""
    return mpf(value.numerator) / value.denominator


def to_fraction(value: mpf) -> Fraction:
    """The fraction that a number of many digits is, exactly."""
    return Fraction(*(int(part) for part in to_rational(mpf(value)._mpf_)))


def rigid_descent(
    body: OracleBody, state: OracleState, restitution: mpf, rebounds: int, dps: int = 50
) -> list[OracleRebound]:
    """The first rebounds of the disc of rigid surfaces, each of which leaves at once: flights, and exact impacts.

    `body.stiffness` and `body.asymmetry` play no part.
    """

    def digits(value: Fraction | mpf) -> mpf:
        return to_mpf(value) if isinstance(value, Fraction) else +value

    with mp.workdps(dps):
        body, state = OracleBody(*map(mpf, body)), OracleState(*map(mpf, state))
        now, done = mpf(0), []
        while len(done) < rebounds:
            flight = touchdown_time(body, state, leaving=bool(done))
            now, state = now + flight, fly(body, state, flight)
            a = body.eccentricity * mp.sin(state.phi)
            b = body.radius - body.eccentricity * mp.cos(state.phi)
            given = (body.mass, body.inertia, a, b, body.friction, body.rolling_arm, restitution)
            met = (state.u + b * state.omega, state.omega, state.v - a * state.omega)
            hit = rational_impact(*map(to_fraction, (*given, *met)), dps=dps, number=digits)
            u, v = hit.slip - b * hit.omega, hit.approach + a * hit.omega
            state = OracleState(state.x, b, state.phi, u, v, hit.omega)
            done.append(OracleRebound(now, *state, mpf(0), len(hit.phases)))
        return done


def wang_mason(
    mass: float,
    inertia: float,
    a: float,
    b: float,
    friction: float,
    restitution: float,
    slip: float,
    omega: float,
    approach: float,
) -> tuple[str, float, float, float]:
    """Closed form of Wang and Mason (1992) for Poisson's hypothesis, without rolling resistance.

    Returns
    -------
    tuple
        Their name of the contact mode ("sliding", or "sticking" or "reversed sliding" followed by the phase, C or R, in
        which the initial slip stops), and v_t [m/s], omega [rad/s], v_n [m/s] afterwards.
    """
    m, inertia_, a, b, f, e = map(Fraction, (mass, inertia, a, b, friction, restitution))
    v_t, w, v_n = map(Fraction, (slip, omega, approach))
    s = sign(v_t)
    b1, b2, b3 = 1 / m + b * b / inertia_, 1 / m + a * a / inertia_, a * b / inertia_
    slowing, closing = f * b1 + s * b3, b2 + s * f * b3
    infinity = Fraction(10) ** 300
    p_q = Fraction(0) if s == 0 else abs(v_t) / slowing if slowing > 0 else infinity
    p_d = -v_n / closing if closing > 0 else infinity
    if s != 0 and p_q >= (1 + e) * p_d:
        mode, p, q = "sliding", (1 + e) * p_d, -s * f * (1 + e) * p_d
    else:
        sticks = f * b1 >= abs(b3)
        mu = b3 / b1 if sticks else f * sign(b3)
        in_compression = p_q < p_d
        p_c = p_q - (v_n + closing * p_q) / (b2 - b3 * mu) if in_compression else p_d
        p = (1 + e) * p_c
        q = -s * f * p_q + mu * (p - p_q)
        mode = f"{'sticking' if sticks else 'reversed sliding'}, {'C' if in_compression else 'R'}"
    return mode, float(v_t + b1 * q - b3 * p), float(w + (b * q - a * p) / inertia_), float(v_n - b3 * q + b2 * p)


# --- the data file ---------------------------------------------------------------------------------------------------


def sensitivity(body: OracleBody, state: OracleState, rebounds: int, dps: int = 50) -> mpf:
    """Shift of the last rebound per relative change of the parameters and the initial state, signs alternating."""
    amount = mpf(10) ** (-dps // 2)

    def changed(values: Iterable) -> list[mpf]:
        return [mpf(value) * (1 + (-1) ** k * amount) for k, value in enumerate(values)]

    with mp.workdps(dps):
        moved = compliant_descent(OracleBody(*changed(body)), OracleState(*changed(state)), rebounds, dps)
        return max(largest_shift(compliant_descent(body, state, rebounds, dps), moved)) / amount


def with_change(body: OracleBody, state: OracleState, parameter: str, change: mpf) -> tuple[OracleBody, OracleState]:
    """The same descent with another launch, body, law or slope; `restitution` stands for the asymmetry."""
    if parameter in state._fields:
        return body, state._replace(**{parameter: getattr(state, parameter) + change})
    if parameter == "restitution":
        e = mp.sqrt((1 - mpf(body.asymmetry)) / (1 + mpf(body.asymmetry))) + change
        return body._replace(asymmetry=(1 - e * e) / (1 + e * e)), state
    return body._replace(**{parameter: getattr(body, parameter) + change}), state


def derivatives(
    descend: Callable[[OracleBody, OracleState], list[OracleRebound]],
    body: OracleBody,
    state: OracleState,
    parameters: Iterable[str],
    dps: int = 50,
) -> dict[str, list[mpf]]:
    """Derivatives of (time, x, y, phi, u, v, omega) at the last rebound, by differences of fourth order.

    A parameter with a "-" behind its name is only made smaller: the descent is another one beyond.
    """
    found = {}
    with mp.workdps(dps):
        step = mpf(10) ** (-dps // 3)
        body, state = OracleBody(*map(mpf, body)), OracleState(*map(mpf, state))
        for name in parameters:
            sides = [-4, -3, -2, -1] if name.endswith("-") else [-2, -1, 1, 2]
            ends = [descend(*with_change(body, state, name.removesuffix("-"), k * step))[-1][:7] for k in sides]
            if name.endswith("-"):  # of fourth order: f'(0) of the cubic through -4, -3, -2, -1 and the descent itself
                here = descend(body, state)[-1][:7]
                weights = [mpf(1) / 4, -mpf(4) / 3, 3, -4]
                last = [mpf(25) / 12 * value for value in here]
            else:
                weights, last = [mpf(1) / 12, -mpf(2) / 3, mpf(2) / 3, -mpf(1) / 12], [mpf(0)] * 7
            sums = [mp.fdot(weights, column) for column in zip(*ends, strict=True)]
            found[name] = [(total + own) / step for total, own in zip(sums, last, strict=True)]
    return found


def derivative_record(rebounds: int = 5) -> dict:
    """Derivatives of the reference descent at a rebound, from the double inputs."""
    given = reference_doubles()
    names = ["y", "phi", "u", "v", "omega-", "restitution", *OracleBody._fields]
    names.remove("asymmetry")
    found = derivatives(lambda *inputs: compliant_descent(*inputs, rebounds=rebounds), *given, names)
    with mp.workdps(50):
        return {
            "rebound": rebounds,
            "of": list(OracleRebound._fields[:7]),
            "by": {name: [mp.nstr(value, 20) for value in values] for name, values in found.items()},
        }


def reference_doubles() -> tuple[OracleBody, OracleState]:
    """The reference descent with its inputs rounded to doubles."""
    body = OracleBody(1.0, 0.1, 0.05, 7.5e-3, 1e6, 0.5, 0.1, 0.001, math.radians(10.0), 9.81)
    return body, OracleState(0.0, 0.6 - 0.05 * math.cos(math.pi / 4), math.pi / 4, 0.0, 0.0, 0.0)


def as_text(rebound: OracleRebound, digits: int = 32) -> dict:
    """A rebound as JSON: decimal strings, and the number of modes."""
    with mp.workdps(60):
        return {
            key: value if isinstance(value, int) else mp.nstr(value, digits, strip_zeros=False)
            for key, value in rebound._asdict().items()
        }


def main() -> None:
    """Compute and verify every descent of the data file, and write it."""
    record = json.loads(DATA_FILE.read_text())
    for case in (record["reference"], *record["random_cases"]):
        began, given = time.perf_counter(), (OracleBody(**case["parameters"]), OracleState(**case["state"]))
        case["rebounds"] = [as_text(rebound) for rebound in verified_descent(*given, len(case["rebounds"]))]
        case["sensitivity"] = mp.nstr(sensitivity(*given, len(case["rebounds"])), 3)
        print(f"{case['name']}: sensitivity {case['sensitivity']}, {time.perf_counter() - began:.0f} s")
    record["derivatives"] = derivative_record()
    DATA_FILE.write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
