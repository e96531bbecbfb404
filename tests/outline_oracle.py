"""Descents of a body told by its outline, with scipy and plain formulas: slow, obvious, an oracle.

Mechanics alone, sharing no code with the solver. A convex outline is a list of arcs in the frame of the body. Arc k has
its centre at (x, y) from the mass centre, so at an orientation phi its lowest point lies at (-a, -b) from there:

    a = y sin(phi) - x cos(phi),    b = radius - y cos(phi) - x sin(phi).

It is the lowest arc while phi lies between its own ``begin`` and that of the next one. Where it hands over, both have
the same b. They have the same a too, or there is a straight side between them, as long as the a differ. Arcs that
follow one another without a side are called a run: one point of the body touches, and passes along the run. Two runs
are two points, with a spring each. Beside a point of one run only the ends of the two runs next to it can touch.

Compliant surfaces. Point i has the gap g_i = y - b_i, the gap rate n_i = v - a_i omega, the slip t_i = u + b_i omega:

    m du/dt = sum F_i + m g sin(beta),    m dv/dt = sum N_i - m g cos(beta),
    J domega/dt = sum (-a_i N_i + b_i F_i) + M.

With the penetration x_i = -g_i, set-valued where a velocity is zero:

    n_i:    N_i = c (1 + Delta) x_i while n_i < 0,  c (1 - Delta) x_i while n_i > 0,  anything between at n_i = 0
    t_i:    F_i = -f N_i sgn t_i,                   |F_i| <= f N_i at t_i = 0
    omega:  M = -sgn omega sum d_i N_i,             |M| <= sum d_i N_i at omega = 0      (d_i is the rolling arm)

Friction f and rolling arms are those of the law, or those of the zone in which the place x - a_i of the point lies.

A branch names the arcs that touch, the zone of each, and, for each velocity, its sign, or 0 where it is locked. As
n_1 - n_2 and t_1 - t_2 are multiples of omega, two gap rates or two slips stay zero only with omega; how the points
then share a force is open. The motion does not depend on it: a lock holds as long as any share obeys every bound. Where
points in different zones slide, friction depends on how they share the normal force: it is then shared so that as
little of the moment as possible is left to rolling resistance. Every combination of signs that the velocities permit is
tried out for a short time, and the one that obeys all laws is followed to its first event.

Rigid surfaces. An impact of one point is that of tests/oracles.py, in exact fractions. Contacts that last, and two
points at once, are not followed: `Unsupported`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853, solve_ivp
from scipy.optimize import brentq, minimize_scalar

from tests.oracles import rational_impact

TURN = 2.0 * math.pi
RTOL = 1e-13
NOISE = 1e-12  # of the speed scale: a velocity this small counts as zero where a branch is chosen
VELOCITY_SLACK, FORCE_SLACK = 1e-14, 1e-11  # of the speed scale, of the load: how far an event is passed
GAP_SLACK, AT_SURFACE = 1e-16, 1e-15  # of the size: how far an event is passed; a point that is just coming or leaving
NO_SIDE = 1e-9  # of the size: arcs that hand over closer than this do so without a side
GERMS = (1e-5, 1e-4, 1e-3, 1e-2)  # [time units] after which a branch is tried out
TOO_MANY = 1000  # [-] branches of one contact
SAMPLES = (0.0, 1e-3, 0.2, 0.4, 0.6, 0.8, 0.999, 1.0)  # of a step, at which guards are looked at
X, Y, PHI, U, V, SPIN, HYSTERESIS, SLIDING, ROLLING, NORMAL, TANGENTIAL, MOMENT = range(12)  # of the integrated vector


class Unsupported(Exception):
    """What this oracle does not follow: three points at once, laws without an answer, a rigid contact that lasts."""


# --- what is given ---------------------------------------------------------------------------------------------------


class Arc(NamedTuple):
    """An arc of an outline; radius 0 is a corner."""

    x: float  # [m] where its centre lies from the mass centre at phi = 0, downhill
    y: float  # [m] and away from the slope
    radius: float  # [m]
    begin: float  # [rad] the orientation from which on it is lowest
    corner: bool  # whether the rolling arm of corners holds for it


class Body(NamedTuple):
    """A convex body. Its arcs are in the order in which they become the lowest one as phi rises."""

    mass: float  # [kg]
    inertia: float  # [kg m^2] about the mass centre
    arcs: tuple[Arc, ...]


class Law(NamedTuple):
    """The fields of sledenv.ContactLaw."""

    stiffness: float  # [N/m]
    asymmetry: float  # [-]
    friction: float  # [-]
    rolling_arm: float  # [m] of an arc
    corner_rolling_arm: float  # [m] of a corner


class Zone(NamedTuple):
    """The fields of sledenv.Zone."""

    begin: float  # [m]
    end: float
    friction: float  # [-]
    rolling_arm: float  # [m] of an arc
    corner_rolling_arm: float  # [m] of a corner


class Slope(NamedTuple):
    """Without an end."""

    angle: float  # [rad]
    gravity: float  # [m/s^2]
    zones: tuple[Zone, ...] = ()  # in order


class State(NamedTuple):
    """Of the mass centre."""

    x: float  # [m]
    y: float
    phi: float  # [rad]
    u: float  # [m/s]
    v: float
    omega: float  # [rad/s]


class Case(NamedTuple):
    """What there is to follow."""

    body: Body
    law: Law
    slope: Slope
    launch: State


# --- what is found ---------------------------------------------------------------------------------------------------


class Losses(NamedTuple):
    """Energy lost in contact [J]."""

    hysteresis: float
    sliding: float
    rolling: float


class Rebound(NamedTuple):
    """One contact or impact."""

    t_touchdown: float  # [s]
    before: State
    arc: int  # that touched first
    t: float  # [s] of the end
    state: State
    impulses: tuple[float, float, float]  # [N s, N s, N m s] normal, tangential, rolling
    losses: Losses
    both: bool  # whether two points touched at the same time
    steps: int  # branches or phases
    locked: bool  # whether any velocity was locked
    lies: tuple[float, float] = (math.inf, math.inf)  # [s], [m] when and where it first lay on a side, settled


class Descent(NamedTuple):
    """What was followed."""

    end: str  # "rebounds", "rest", "max_time" or, of rigid surfaces, "stays"
    time: float  # [s]
    state: State
    rebounds: tuple[Rebound, ...]  # the last one may be a contact in which the descent ended
    stored: float  # [J] in the springs
    losses: Losses
    initial: float  # [J] kinetic and potential energy at launch
    residual: float  # [J] of the energy ledger

    @property
    def turnover(self) -> float:
        """Energy [J] that went through the books."""
        return abs(self.initial) + abs(self.initial - sum(self.losses)) + sum(self.losses)


# --- the outline -----------------------------------------------------------------------------------------------------


def arms(arc: Arc, phi: float) -> tuple[float, float]:
    """(a, b) [m]: the lowest point of the whole circle of an arc lies at (-a, -b) from the mass centre."""
    s, c = math.sin(phi), math.cos(phi)
    return arc.y * s - arc.x * c, arc.radius - arc.y * c - arc.x * s


class Outline:
    """What follows from the arcs of a body."""

    def __init__(self, body: Body) -> None:
        """Measure it; the arcs are not checked."""
        self.arcs, count = body.arcs, len(body.arcs)
        following = [self.arcs[(k + 1) % count] for k in range(count)]
        self.widths = [(b.begin - a.begin) % TURN or TURN for a, b in zip(self.arcs, following, strict=True)]
        self.size = max(math.hypot(*spot) for k in range(count) for spot in self._spots(k))  # [m] furthest from C
        lengths = [abs(arms(a, b.begin)[0] - arms(b, b.begin)[0]) for a, b in zip(self.arcs, following, strict=True)]
        self.sides = [length > NO_SIDE * self.size for length in lengths]  # whether there is one after each arc
        self.lowest = min(spot[1] for k in range(count) for spot in self._spots(k))  # [m] least height of C

    def _spots(self, k: int) -> Iterator[tuple[float, float]]:
        """Arms of the ends of an arc, and of where it is nearest to the mass centre and furthest from it."""
        arc, width = self.arcs[k], self.widths[k]
        nearest = math.atan2(-arc.x, arc.y)
        for phi in (arc.begin, arc.begin + width):
            yield arms(arc, phi)
        for phi in (nearest, nearest + math.pi):
            if (phi - arc.begin) % TURN <= width:
                yield arms(arc, phi)

    def lowest_arc(self, phi: float) -> int:
        """The arc whose interval holds an orientation."""
        begins = [arc.begin for arc in self.arcs]
        least = min(begins)
        local = least + (phi - least) % TURN
        return max((k for k, begin in enumerate(begins) if begin <= local), key=lambda k: begins[k])

    def support_height(self, phi: float) -> float:
        """Height [m] of the mass centre where the lowest point of the body touches the slope."""
        return arms(self.arcs[self.lowest_arc(phi)], phi)[1]

    def point(self, arc: int, phi: float) -> Point:
        """An arc that touches at an orientation, within half a turn of its interval."""
        if len(self.arcs) == 1:
            return Point(arc, -math.inf, math.inf)
        low, high = self.arcs[arc].begin, self.arcs[arc].begin + self.widths[arc]
        turns = TURN * round((phi - 0.5 * (low + high)) / TURN)
        low, high = low + turns, high + turns
        return Point(arc, -math.inf if self.sides[arc - 1] else low, math.inf if self.sides[arc] else high)

    def beyond(self, point: Point, step: int) -> Point:
        """The point that takes over from one at the upper end of its interval, or the lower one: step 1 or -1."""
        arc = (point.arc + step) % len(self.arcs)
        edge = point.high if step > 0 else point.low
        return self.point(arc, edge + 0.5 * step * self.widths[arc])

    def nearest(self, arc: int, phi: float) -> int:
        """Of the arcs that are of the same circle as one, the one whose interval is nearest to an orientation."""
        same = [k for k, other in enumerate(self.arcs) if other[:3] == self.arcs[arc][:3]]
        if len(same) == 1:
            return arc
        middles = [self.arcs[k].begin + 0.5 * self.widths[k] for k in same]
        beyond = [
            abs(math.remainder(phi - at, TURN)) - 0.5 * self.widths[k] for k, at in zip(same, middles, strict=True)
        ]
        return same[beyond.index(min(beyond))]

    def run(self, arc: int) -> tuple[int, int]:
        """First and last arc of the run of an arc, of a body that has a side."""
        first = last = arc
        while not self.sides[first - 1]:
            first = (first - 1) % len(self.arcs)
        while not self.sides[last]:
            last = (last + 1) % len(self.arcs)
        return first, last

    def joins(self, one: int, other: int) -> bool:
        """Whether two arcs are the same or join without a side between them: they have one lowest point."""
        count = len(self.arcs)
        smooth = [not self.sides[k] and (k, (k + 1) % count) in ((one, other), (other, one)) for k in (one, other)]
        return one == other or True in smooth

    def across(self, touching: list[int], phi: float) -> list[int]:
        """Arcs that may come down beside those that touch: the ends of the runs across the straight sides."""
        if True not in self.sides:
            return []
        touching = [self.nearest(arc, phi) for arc in touching]
        runs = [self.run(arc) for arc in touching]
        if self.sides.count(True) == 1:  # both ends belong to the one run that there is
            found = list(runs[0])
            if not all(arc in found for arc in touching):  # the nearer end lies deeper without harm
                found = [min(found, key=lambda end: arms(self.arcs[end], phi)[1])]
            return [arc for arc in found if arc not in touching]
        found = [end for first, last in runs for end in ((last + 1) % len(self.arcs), (first - 1) % len(self.arcs))]
        touched = [self.arcs[arc][:3] for arc in touching]
        coming = {self.nearest(k, phi) for k in found if self.run(k) not in runs and self.arcs[k][:3] not in touched}
        return sorted(coming)

    def circles_stay_inside(self) -> bool:
        """Whether no circle of an arc beside a straight side reaches below the outline, whatever the orientation."""
        ends = [arc for k, arc in enumerate(self.arcs) if self.sides[k] or self.sides[k - 1]]
        turned = np.linspace(-math.pi, math.pi, 361).tolist()
        limit = NO_SIDE * self.size
        return all(arms(arc, phi)[1] <= self.support_height(phi) + limit for phi in turned for arc in ends)


def mirrored(body: Body) -> Body:
    """The mirror image, x turned round."""
    found = []
    for arc, following in zip(body.arcs, (*body.arcs[1:], body.arcs[0]), strict=True):
        begin = math.remainder(-following.begin, TURN) if len(body.arcs) > 1 else -math.pi
        found.append(arc._replace(x=-arc.x, begin=begin if begin < math.pi else -math.pi))
    return body._replace(arcs=tuple(sorted(found, key=lambda arc: arc.begin)))


# --- the ground ------------------------------------------------------------------------------------------------------


def everywhere(law: Law, slope: Slope) -> tuple[Zone, ...]:
    """The slope as zones that leave nothing out."""
    found, reached = [], -math.inf
    for zone in (*slope.zones, Zone(math.inf, math.inf, 0.0, 0.0, 0.0)):
        if reached < zone.begin:
            found.append(Zone(reached, zone.begin, *law[2:]))
        if zone.begin < math.inf:
            found.append(zone)
        reached = zone.end
    return tuple(found)


def zone_at(zones: tuple[Zone, ...], place: float) -> int:
    """The zone of a place [m], of zones that leave nothing out."""
    return max(k for k, zone in enumerate(zones) if zone.begin <= place)


def arm_in(zone: Zone, arc: Arc) -> float:
    """Rolling arm [m] of an arc in a zone."""
    return zone.corner_rolling_arm if arc.corner else zone.rolling_arm


# --- flight ----------------------------------------------------------------------------------------------------------


def moved(slope: Slope, state: State, t: float) -> State:
    """A state after a flight."""
    along, into = slope.gravity * math.sin(slope.angle), slope.gravity * math.cos(slope.angle)
    x, y, phi, u, v, omega = state
    return State(
        x + u * t + 0.5 * along * t * t,
        y + v * t - 0.5 * into * t * t,
        phi + omega * t,
        u + along * t,
        v - into * t,
        omega,
    )


def touchdown(outline: Outline, slope: Slope, start: State, horizon: float) -> float:
    """Time [s] of the first touch, inf if there is none up to the horizon.

    The flight is cut into short pieces. No point of the body accelerates faster than ``most``, so between two times the
    gap is not lower than its chord less most dt^2/8. A piece in which it might be zero is cut in two, until its end is
    below the slope and the root in it plain, or it is too short to matter.
    """
    most = slope.gravity * math.cos(slope.angle) + outline.size * start.omega**2

    def gap(t: float) -> float:
        at = moved(slope, start, t)
        return at.y - outline.support_height(at.phi)

    def rate(t: float) -> float:
        at = moved(slope, start, t)
        return at.v - arms(outline.arcs[outline.lowest_arc(at.phi)], at.phi)[0] * at.omega

    def first_root(begin: float, end: float, above: float, below: float) -> float:
        if min(above, below) - most * (end - begin) ** 2 / 8.0 > 0.0:
            return math.inf
        plain = above > 0.0 > below and rate(begin) + most * (end - begin) < 0.0
        if plain or end - begin < 1e-11 * max(1.0, end):
            if below > 0.0:
                return math.inf
            if above <= 0.0:
                return begin
            return float(brentq(gap, begin, end, xtol=1e-15, rtol=1e-15))
        middle = 0.5 * (begin + end)
        between = gap(middle)
        found = first_root(begin, middle, above, between)
        return found if found < math.inf else first_root(middle, end, between, below)

    here, length = gap(0.0), outline.size
    if here <= 1e-15 * length:
        if here < -1e-12 * length:
            raise ValueError(f"the body lies {-here} m below the slope")
        starting = rate(0.0)
        if starting < 0.0 or (starting == 0.0 and gap(1e-6) < 0.0):
            return 0.0
    piece = 0.02 * math.sqrt(length / max(most, 1e-12))
    begin, above = 0.0, max(here, 0.0)
    while begin < horizon:
        end = min(begin + piece, horizon)
        below = gap(end)
        found = first_root(begin, end, above, below)
        if found < math.inf:
            return found
        begin, above = end, below
    return math.inf


# --- two points on two springs ---------------------------------------------------------------------------------------


class Point(NamedTuple):
    """An arc that touches, and the orientations at which the next arc of its run takes over; inf at a straight side."""

    arc: int
    low: float
    high: float
    zone: int = 0  # in which it touches


class Branch(NamedTuple):
    """Which points touch, and the sign of each velocity, 0 where it is locked.

    A sign that no force depends on (no friction, no rolling resistance) is 1.
    """

    points: tuple[Point, ...]
    gaps: tuple[int, ...]
    slips: tuple[int, ...]
    spin: int


class Forces(NamedTuple):
    """Accelerations and forces of a branch, and how far every lock is from its bound."""

    rates: tuple[float, float, float]  # [m/s^2, m/s^2, rad/s^2] of u, v, omega
    normal: tuple[float, ...]  # [N]
    tangential: tuple[float, ...]  # [N]
    moment: float  # [N m]
    slacks: tuple[float, ...]  # [N] not negative while the locks hold


class Place(NamedTuple):
    """Arms, penetrations and velocities of the points of a branch."""

    a: list[float]
    b: list[float]
    x: list[float]
    rates: list[float]
    slips: list[float]
    spin: float


class Surface:
    """Springs under a body, from one touchdown on. Height and orientation are counted from those at touchdown."""

    def __init__(self, case: Case, start: State, arc: int) -> None:
        """Take a state in which an arc is exactly at the slope."""
        body, law, slope, _ = case
        self.outline, self.arcs, self.start = Outline(body), body.arcs, start
        self.mass, self.inertia, self.size = body.mass, body.inertia, self.outline.size
        self.closing, self.opening = law.stiffness * (1.0 + law.asymmetry), law.stiffness * (1.0 - law.asymmetry)
        self.zones = everywhere(law, slope)
        self.along, self.into = slope.gravity * math.sin(slope.angle), slope.gravity * math.cos(slope.angle)
        self.unit = 1.0 / math.sqrt(2.0 * self.closing * (1.0 / self.mass + self.size**2 / self.inertia))  # [s]
        lowest = arms(body.arcs[arc], start.phi)[1]
        self.first_gaps = [lowest - arms(one, start.phi)[1] for one in body.arcs]
        velocities = [start.u, start.v, self.size * start.omega]
        self.speed = max(*map(abs, velocities), 1e-3 * math.sqrt(self.size * self.into), 1e-9)  # [m/s] scale

    # --- the ground

    def friction(self, point: Point) -> float:
        return self.zones[point.zone].friction

    def roll(self, point: Point) -> float:
        return arm_in(self.zones[point.zone], self.arcs[point.arc])

    def spot(self, arc: int, q: np.ndarray) -> float:
        """Where an arc touches, along the slope [m]."""
        return self.start.x + float(q[X]) - arms(self.arcs[arc], self.start.phi + float(q[PHI]))[0]

    def on_ground(self, point: Point, q: np.ndarray) -> Point:
        """A point that starts to touch, in its zone."""
        return point._replace(zone=zone_at(self.zones, self.spot(point.arc, q)))

    # --- kinematics

    def gap(self, arc: int, q: np.ndarray) -> float:
        """Gap [m] of an arc; db/dphi is a, so the change of b is exact for a small angle."""
        half = 0.5 * float(q[PHI])
        a, _ = arms(self.arcs[arc], self.start.phi + half)
        return self.first_gaps[arc] + float(q[Y]) - 2.0 * math.sin(half) * a

    def place(self, branch: Branch, q: np.ndarray) -> Place:
        """Where the points are and how they move. Velocities follow from that of a locked point where there is one."""
        phi, spin = self.start.phi + float(q[PHI]), 0.0 if branch.spin == 0 else float(q[SPIN])
        u, v, every = float(q[U]), float(q[V]), range(len(branch.points))
        both = [arms(self.arcs[point.arc], phi) for point in branch.points]
        a, b = [pair[0] for pair in both], [pair[1] for pair in both]
        x = [-self.gap(point.arc, q) for point in branch.points]
        rates, slips = [v - a[i] * spin for i in every], [u + b[i] * spin for i in every]
        if 0 in branch.gaps:
            i = branch.gaps.index(0)
            rates = [(a[i] - a[j]) * spin for j in every]
        if 0 in branch.slips:
            i = branch.slips.index(0)
            slips = [(x[j] - x[i]) * spin for j in every]  # b_j - b_i is x_j - x_i
        return Place(a, b, x, rates, slips, spin)

    def project(self, branch: Branch, q: np.ndarray) -> np.ndarray:
        """Return ``q`` with every locked velocity exactly zero."""
        q = q.copy()
        if branch.spin == 0:
            q[SPIN] = 0.0
        both = [arms(self.arcs[point.arc], self.start.phi + float(q[PHI])) for point in branch.points]
        if 0 in branch.gaps:
            q[V] = both[branch.gaps.index(0)][0] * q[SPIN]
        if 0 in branch.slips:
            q[U] = -both[branch.slips.index(0)][1] * q[SPIN]
        return q

    # --- forces

    def stiffness(self, rate: int) -> float:
        return self.closing if rate < 0 else self.opening

    def forces(self, branch: Branch, at: Place) -> Forces:
        """Forces and accelerations of a branch."""
        return self._held(branch, at) if branch.spin == 0 else self._spinning(branch, at)

    def _spinning(self, branch: Branch, at: Place) -> Forces:
        """Of a body free to spin, so that at most one gap rate and one slip are locked: one linear system."""
        count, w2 = len(branch.points), at.spin * at.spin
        size = 3 + 2 * count
        matrix, right = np.zeros((size, size)), np.zeros(size)  # for the rates of u, v and omega, N and F of each point
        matrix[0, 0] = matrix[1, 1] = self.mass
        matrix[2, 2] = self.inertia
        right[:2] = self.mass * self.along, -self.mass * self.into
        for i, point in enumerate(branch.points):
            a, b, lever = at.a[i], at.b[i], self.arcs[point.arc].radius - at.b[i]
            normal, force = 3 + i, 3 + count + i
            matrix[0, force] = matrix[1, normal] = -1.0
            matrix[2, normal], matrix[2, force] = a + self.roll(point) * branch.spin, -b
            if branch.gaps[i] == 0:  # dn/dt = dv/dt - a domega/dt - (r - b) omega^2 = 0
                matrix[normal, 1:3], right[normal] = (1.0, -a), lever * w2
            else:
                matrix[normal, normal], right[normal] = 1.0, self.stiffness(branch.gaps[i]) * at.x[i]
            if branch.slips[i] == 0:  # dt/dt = du/dt + b domega/dt + a omega^2 = 0
                matrix[force, 0], matrix[force, 2], right[force] = 1.0, b, -a * w2
            else:
                matrix[force, force], matrix[force, normal] = 1.0, self.friction(point) * branch.slips[i]
        du, dv, dw, *forces = np.linalg.solve(matrix, right).tolist()
        loads, pulls, slacks = tuple(forces[:count]), tuple(forces[count:]), []
        for i, point in enumerate(branch.points):
            if branch.gaps[i] == 0:
                slacks += [loads[i] - self.opening * at.x[i], self.closing * at.x[i] - loads[i]]
            if branch.slips[i] == 0:
                slacks.append(self.friction(point) * loads[i] - abs(pulls[i]))
        moment = -branch.spin * sum(self.roll(point) * load for point, load in zip(branch.points, loads, strict=True))
        return Forces((du, dv, dw), loads, pulls, moment, tuple(slacks))

    def _held(self, branch: Branch, at: Place) -> Forces:
        """Of a body that does not spin: gap rates are equal, slips too, and M balances the moment of some share."""
        m, every = self.mass, range(len(branch.points))
        f, rolls = [self.friction(point) for point in branch.points], [self.roll(point) for point in branch.points]
        gap_sign, slip_sign = branch.gaps[0], branch.slips[0]
        slacks: list[float] = []
        total = m * self.into
        if gap_sign == 0:
            least, most = ([k * x for x in at.x] for k in (self.opening, self.closing))
            slacks += [total - sum(least), sum(most) - total]
            shares = [_filled(i, total, least, most) for i in every]
        else:
            shares = [[self.stiffness(gap_sign) * x for x in at.x]]
            total = sum(shares[0])
        pull = -m * self.along
        # The moment is linear in the shares of N and of F, and so is what rolling resistance can bear. Both are extreme
        # where the share of N is: arms along the slope are longer than the difference of the arms b.
        ends = [(n, force) for n in shares for force in _pulls(n, pull, f, slip_sign)]
        moments = [sum(at.a[i] * n[i] - at.b[i] * force[i] for i in every) for n, force in ends]
        bearing = [sum(rolls[i] * n[i] for i in every) for n, _ in ends]
        slacks.append(max(bears - moment for bears, moment in zip(bearing, moments, strict=True)) / self.size)
        slacks.append(max(bears + moment for bears, moment in zip(bearing, moments, strict=True)) / self.size)
        lo, hi = moments.index(min(moments)), moments.index(max(moments))
        span = moments[hi] - moments[lo]
        part = min(max(-moments[lo] / span, 0.0), 1.0) if span > 0.0 else 0.5  # the share with the least moment
        n, force = ([(1.0 - part) * ends[lo][k][i] + part * ends[hi][k][i] for i in every] for k in (0, 1))
        moment = (1.0 - part) * moments[lo] + part * moments[hi]
        if slip_sign == 0:
            slacks.append(sum(f[i] * n[i] for i in every) - abs(pull))
        else:
            pull = sum(force)
        rates = (self.along + pull / m, 0.0 if gap_sign == 0 else total / m - self.into, 0.0)
        return Forces(rates, tuple(n), tuple(force), moment, tuple(slacks))

    def derivative(self, branch: Branch, q: np.ndarray) -> np.ndarray:
        """Time derivative of the integrated vector."""
        q = self.project(branch, q)
        at = self.place(branch, q)
        forces = self.forces(branch, at)
        hysteresis = sliding = rolling = 0.0
        for i, point in enumerate(branch.points):
            normal = forces.normal[i]
            if branch.gaps[i] > 0:
                hysteresis += (self.closing - self.opening) * at.x[i] * at.rates[i]
            sliding += self.friction(point) * normal * branch.slips[i] * at.slips[i]
            rolling += self.roll(point) * normal * branch.spin * at.spin
        losses = (hysteresis, sliding, rolling)
        impulses = (sum(forces.normal), sum(forces.tangential), forces.moment)
        return np.array([float(q[U]), float(q[V]), at.spin, *forces.rates, *losses, *impulses])

    def stored(self, points: tuple[Point, ...], q: np.ndarray) -> float:
        """Energy in the springs [J]."""
        return sum(0.5 * self.closing * max(0.0, -self.gap(point.arc, q)) ** 2 for point in points)

    def state(self, q: np.ndarray) -> State:
        x, y, phi, u, v, omega = (float(value) for value in q[:6])
        return State(self.start.x + x, self.start.y + y, self.start.phi + phi, u, v, omega)

    # --- what a branch rests on

    def signed(self, branch: Branch, at: Place) -> dict[str, float]:
        """Free velocities in their branch's direction, over the speed scale: not negative while the branch holds."""
        values = {}
        for i in range(len(branch.points)):
            if branch.gaps[i]:
                values[f"n{i}"] = branch.gaps[i] * at.rates[i] / self.speed
            if branch.slips[i] and self.rubs(branch.points):
                values[f"t{i}"] = branch.slips[i] * at.slips[i] / self.speed
        if branch.spin and self.resists(branch.points):
            values["w"] = branch.spin * at.spin * self.size / self.speed
        return values

    def resists(self, points: tuple[Point, ...]) -> bool:
        """Whether there is rolling resistance."""
        return any(self.roll(point) > 0.0 for point in points)

    def rubs(self, points: tuple[Point, ...]) -> bool:
        """Whether there is friction."""
        return any(self.friction(point) > 0.0 for point in points)

    def _load(self, forces: Forces, at: Place) -> float:
        return max(map(abs, (*forces.normal, *(self.closing * max(x, 0.0) for x in at.x))), default=0.0)

    def guards(self, branch: Branch, q: np.ndarray) -> dict[str, float]:
        """What ends the branch where it becomes negative."""
        at, phi, slack = self.place(branch, q), self.start.phi + float(q[PHI]), GAP_SLACK * self.size
        values = {name: value + VELOCITY_SLACK for name, value in self.signed(branch, at).items()}
        if branch.spin == 0 or 0 in branch.gaps or 0 in branch.slips:
            forces = self.forces(branch, at)
            load = self._load(forces, at)
            values |= {f"slack{k}": value + FORCE_SLACK * load for k, value in enumerate(forces.slacks)}
        for i, point in enumerate(branch.points):
            if branch.gaps[i]:
                values[f"up{i}"] = at.x[i] + slack
            if point.low > -math.inf:
                values[f"low{i}"] = phi - point.low + 1e-15
            if point.high < math.inf:
                values[f"high{i}"] = point.high - phi + 1e-15
            if branch.slips[i] or self.arcs[point.arc].radius > 0.0:  # a corner that sticks stays where it is
                zone, place = self.zones[point.zone], self.spot(point.arc, q)
                rounding = 1e-15 * (self.size + abs(place))
                if zone.begin > -math.inf:
                    values[f"back{i}"] = place - zone.begin + rounding
                if zone.end < math.inf:
                    values[f"ahead{i}"] = zone.end - place + rounding
        for arc in self.outline.across([point.arc for point in branch.points], phi):
            values[f"down{arc}"] = self.gap(arc, q) + slack
        return values

    def violation(self, branch: Branch, q: np.ndarray, zero: set[str]) -> float:
        """How far a branch disobeys the laws of what is locked or in ``zero``; 0 up to rounding."""
        at = self.place(branch, q)
        forces = self.forces(branch, at)
        load = self._load(forces, at)
        worst = max((-v for name, v in self.signed(branch, at).items() if name in zero), default=0.0)
        worst = worst if worst > 0.1 * NOISE else 0.0
        if load > 0.0:
            slack = -min(forces.slacks, default=0.0) / load
            worst = max(worst, slack if slack > 1e-9 else 0.0)
        touching = [point.arc for point in branch.points]
        for name in zero:
            if name.startswith("x"):
                arc = int(name[1:])
                depth = self.gap(arc, q) if arc in touching else -self.gap(arc, q)
                worst = max(worst, depth / self.size if depth > AT_SURFACE * self.size else 0.0)
        return worst


def _filled(first: int, total: float, least: list[float], most: list[float]) -> list[float]:
    """Loads of the points, ``total`` in all and each within its bounds, with as much as may be on the first."""
    if len(least) == 1:
        return [total]
    loads = [0.0, 0.0]
    loads[first] = min(most[first], total - least[1 - first])
    loads[1 - first] = total - loads[first]
    return loads


def _pulls(loads: list[float], pull: float, f: list[float], slip: int) -> list[list[float]]:
    """Friction of the points, ``pull`` in all and each within its bounds: the one share, or the two extreme ones."""
    if slip:
        return [[-f[i] * slip * load for i, load in enumerate(loads)]]
    if len(loads) == 1:
        return [[pull]]
    most, other = f[0] * loads[0], f[1] * loads[1]
    low, high = max(-most, pull - other), min(most, pull + other)
    if low > high:  # not enough friction: that is told by the slack
        low = high = 0.5 * (low + high)
    return [[low, pull - low], [high, pull - high]]


# --- choice of a branch ----------------------------------------------------------------------------------------------


def _candidates(surface: Surface, points: tuple[Point, ...], q: np.ndarray) -> Iterator[tuple[Branch, set[str]]]:
    """Every branch that the signs of the velocities permit, and which velocities (n, t, w) and gaps (x) are zero."""
    free = Branch(points, (1,) * len(points), (1,) * len(points), 1)
    at, limit = surface.place(free, q), NOISE * surface.speed
    resists = surface.resists(points)

    def signs(value: float, matters: bool) -> tuple[int, ...]:
        if not matters:
            return (1,)
        return (0, 1, -1) if abs(value) <= limit else (1 if value > 0.0 else -1,)

    at_surface = [abs(x) <= AT_SURFACE * surface.size for x in at.x]
    grazes = [at_surface[i] and abs(at.rates[i]) <= limit for i in range(len(points))]
    still = abs(at.spin) * surface.size <= limit
    spins = signs(at.spin * surface.size, resists)
    if still and not resists:
        spins = (0, 1)
    for kept in product(*((True, False) if grazing else (True,) for grazing in grazes)):
        chosen = [i for i in range(len(points)) if kept[i]]
        rubs = surface.rubs(tuple(points[i] for i in chosen))
        gaps = product(*(signs(at.rates[i], True) for i in chosen))
        slips = product(*(signs(at.slips[i], rubs) for i in chosen))
        zero = {"w"} if still else set()
        zero |= {f"n{k}" for k, i in enumerate(chosen) if abs(at.rates[i]) <= limit}
        zero |= {f"t{k}" for k, i in enumerate(chosen) if abs(at.slips[i]) <= limit}
        zero |= {f"x{points[i].arc}" for i in range(len(points)) if at_surface[i]}
        for rest in product(gaps, slips, spins):
            branch = Branch(tuple(points[i] for i in chosen), *rest)
            if _is_possible(surface, branch):
                yield branch, zero


def _is_possible(surface: Surface, branch: Branch) -> bool:
    """Whether what is locked can stay so by kinematics, and the spin has a reason to be locked."""
    both = len(branch.points) == 2
    tied = both and (branch.gaps == (0, 0) or branch.slips == (0, 0))
    if branch.spin:
        return not tied
    if not branch.points or (both and len({*branch.gaps}) + len({*branch.slips}) > 2):
        return False
    return tied or surface.resists(branch.points)


def _locks(branch: Branch) -> tuple[int, int, int]:
    return branch.gaps.count(0), branch.slips.count(0), int(branch.spin == 0)


def _small_step(surface: Surface, branch: Branch, q: np.ndarray, dt: float) -> np.ndarray:
    """One step of the classical Runge-Kutta method."""
    q = surface.project(branch, q)
    k1 = surface.derivative(branch, q)
    k2 = surface.derivative(branch, q + 0.5 * dt * k1)
    k3 = surface.derivative(branch, q + 0.5 * dt * k2)
    k4 = surface.derivative(branch, q + dt * k3)
    return surface.project(branch, q + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))


def choose(surface: Surface, points: tuple[Point, ...], q: np.ndarray) -> Branch:
    """The branch that obeys all laws a little later; of several, the one with most locks.

    Each candidate is followed for a short time, then for longer ones as long as several obey the laws: whatever starts
    from zero (a force at touchdown, a velocity at its release) is judged by where it goes.
    """
    left = list(_candidates(surface, points, q))
    for germ in GERMS:
        if len(left) == 1:
            break
        steps = [_small_step(surface, branch, q, germ * surface.unit) for branch, _ in left]
        tried = [(surface.violation(c[0], step, c[1]), c) for c, step in zip(left, steps, strict=True)]
        obeying = [candidate for violation, candidate in tried if violation == 0.0]
        if not obeying and germ == GERMS[0]:
            raise Unsupported(f"no branch obeys the laws: the least violation is {min(tried, key=lambda t: t[0])[0]}")
        left = obeying or left
    return max((branch for branch, _ in left), key=_locks)


# --- following a contact ---------------------------------------------------------------------------------------------


def _advance(surface: Surface, branch: Branch, q: np.ndarray, duration: float) -> tuple[float, np.ndarray, str]:
    """Integrate a branch up to what ends it; return when, the vector then, and the name of the guard or "max_time"."""
    size, speed, unit = surface.size, surface.speed, surface.unit
    slow = 0.1 * min(size / speed, math.sqrt(size / max(surface.into, 1e-3)))
    longest = 0.5 * unit if any(branch.gaps) else math.inf if branch.spin == 0 else slow
    energy = 0.5 * surface.mass * speed**2
    lengths, speeds = [speed * unit, speed * unit, speed * unit / size], [speed, speed, speed / size]
    impulses = [surface.mass * speed, surface.mass * speed, surface.mass * speed * size]
    options = {"rtol": RTOL, "atol": 1e-15 * np.array([*lengths, *speeds, energy, energy, energy, *impulses])}

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        return surface.derivative(branch, y)

    first = min(1e-4 * unit, duration)
    solver = DOP853(rates, 0.0, q, duration, first_step=first, max_step=longest, **options)
    while solver.status == "running":
        message = solver.step()
        if solver.status == "failed":
            raise ArithmeticError(message)
        begin, end, state = float(solver.t_old), float(solver.t), solver.dense_output()
        parts = SAMPLES if end - begin > 20.0 * first else (0.0, 1.0)
        times = [begin + (end - begin) * part for part in parts[:-1]] + [end]
        fired = _first_fired(surface, branch, state, times)
        if fired:
            when, name = fired
            return *_polished(surface, branch, solver, when, name, options), name
    return duration, solver.y, "max_time"


def _first_fired(
    surface: Surface, branch: Branch, state: Callable[[float], np.ndarray], times: list[float]
) -> tuple[float, str] | None:
    """When a guard first becomes negative on a step, and its name. Where a guard has a dip, the least of it counts."""
    guards = [surface.guards(branch, state(time)) for time in times]
    found = []
    for name in {name for values in guards for name in values}:

        def value(time: float, name: str = name) -> float:
            return surface.guards(branch, state(time)).get(name, 1.0)

        # A point that comes into question on the way has a guard from then on.
        row = [values.get(name, math.inf) for values in guards]
        for k in range(1, len(times)):
            low, high = times[k - 1], times[k]
            if not row[k] < 0.0 and k + 1 < len(times) and _may_dip(times[k - 1 : k + 2], row[k - 1 : k + 2]):
                span = (low, times[k + 1])
                least = minimize_scalar(value, bounds=span, method="bounded", options={"xatol": 0.0})
                high = float(least.x) if least.fun < 0.0 else high
            if row[k] < 0.0 or high != times[k]:
                found.append((_root(value, low, high), name))
                break
    return min(found, default=None)


def _may_dip(times: list[float], values: list[float]) -> bool:
    """Whether a guard may be negative between samples that are not: a parabola through three of them comes close."""
    if not values[1] <= min(values[0], values[2]) < math.inf or max(values) == math.inf:
        return False
    before, after = (values[1] - values[0]) / (times[1] - times[0]), (values[2] - values[1]) / (times[2] - times[1])
    curvature = (after - before) / (times[2] - times[0])
    if not curvature > 0.0:
        return False
    slope = before + curvature * (times[1] - times[0])
    return values[1] - slope * slope / (4.0 * curvature) < 0.1 * (max(values) - values[1])


def _root(value: Callable[[float], float], low: float, high: float) -> float:
    return low if value(low) <= 0.0 else float(brentq(value, low, high, xtol=1e-18 + 1e-15 * (high - low), rtol=1e-15))


def _polished(
    surface: Surface, branch: Branch, solver: DOP853, when: float, name: str, options: dict[str, Any]
) -> tuple[float, np.ndarray]:
    """The time of an event and the vector then, by steps of the method itself and not by its interpolation."""
    begin, state = float(solver.t_old), solver.dense_output()
    width = 1e-4 * float(solver.t - begin)

    def rates(_: float, q: np.ndarray) -> np.ndarray:
        return surface.derivative(branch, q)

    def stepped(time: float) -> np.ndarray:
        if time <= begin:
            return np.asarray(state(begin))
        return np.asarray(solve_ivp(rates, (begin, time), state(begin), "DOP853", **options).y.T[-1])

    def value(q: np.ndarray) -> float:
        return surface.guards(branch, q).get(name, 1.0)

    for _ in range(3):  # Newton's method
        rise = value(state(when + width)) - value(state(when - width))
        if rise >= 0.0 or when <= begin:
            break
        change = value(stepped(when)) * 2.0 * width / rise
        when -= change
        if abs(change) <= 1e-15 * surface.unit:
            break
    when = max(when, begin)
    return when, stepped(when)


class _Contact(NamedTuple):
    """How a contact ended."""

    end: str  # "separated", "rest" or "max_time"
    time: float  # [s]
    q: np.ndarray
    points: tuple[Point, ...]
    both: bool
    branches: tuple[Branch, ...]
    lies: tuple[float, float]


def _follow_contact(surface: Surface, points: tuple[Point, ...], q: np.ndarray, max_time: float) -> _Contact:
    """Follow a contact until all points have left, everything is locked, or ``max_time``."""
    time, both, branches, limit = 0.0, False, [], NOISE * surface.speed
    lies = (math.inf, math.inf)
    while True:
        branch = choose(surface, points, q)
        q, points = surface.project(branch, q), branch.points
        branches.append(branch)
        both = both or len(points) == 2
        smooth = not surface.rubs(points) and abs(q[U]) <= limit and surface.along == 0.0
        settled = branch.spin == 0 and not any(branch.gaps)
        held = settled and (smooth or not any(branch.slips))
        if settled and len(points) == 2 and lies[0] == math.inf:
            lies = (time, surface.state(q).x)
        end = "separated" if not points else "rest" if held else "max_time" if time >= max_time else ""
        if end:
            return _Contact(end, time, q, points, both, tuple(branches), lies)
        if len(branches) >= TOO_MANY:
            raise Unsupported(f"{TOO_MANY} branches in {time} s")
        passed, q, name = _advance(surface, branch, q, max_time - time)
        time += float(passed)
        points = _points_after(surface, branch, q, name)


def _points_after(surface: Surface, branch: Branch, q: np.ndarray, name: str) -> tuple[Point, ...]:
    """Which points touch after an event; both may change at the same time."""
    at, phi = surface.place(branch, q), surface.start.phi + float(q[PHI])
    limit, found = AT_SURFACE * surface.size, []
    for i, point in enumerate(branch.points):
        if name == f"up{i}" or (branch.gaps[i] > 0 and at.x[i] <= limit):
            continue
        if name in (f"low{i}", f"high{i}"):
            found.append(surface.outline.beyond(point, 1 if name == f"high{i}" else -1)._replace(zone=point.zone))
        elif name in (f"back{i}", f"ahead{i}"):
            found.append(point._replace(zone=point.zone + (1 if name == f"ahead{i}" else -1)))
        elif surface.outline.nearest(point.arc, phi) != point.arc:
            nearest = surface.outline.point(surface.outline.nearest(point.arc, phi), phi)
            found.append(nearest._replace(zone=point.zone))
        else:
            found.append(point)
    for arc in surface.outline.across([point.arc for point in branch.points], phi):
        a, _ = arms(surface.arcs[arc], phi)
        closing = float(q[V]) - a * at.spin < 0.0
        if name == f"down{arc}" or (surface.gap(arc, q) <= limit and closing):
            if any(surface.outline.joins(arc, point.arc) for point in branch.points):
                raise Unsupported("an end of the side comes down beside its own arc: the body is pressed in too deep")
            found.append(surface.on_ground(surface.outline.point(arc, phi), q))
    if len(found) > 2 or len({point.arc for point in found}) < len(found):
        raise Unsupported("three points at the same time: the body is pressed in too deep")
    return tuple(found)


def follow_compliant(case: Case, *, max_rebounds: int = 1, max_time: float = 10.0) -> Descent:
    """Follow a descent on springs up to a number of rebounds, to rest or to a time.

    Raises
    ------
    Unsupported
        If three points touch at the same time, if an end of a side comes down while the arc that joins it touches,
        as the body is pressed in so deep, or if no branch obeys the laws.
    """
    body, _, slope, state = case
    outline, time = Outline(body), 0.0
    rebounds: list[Rebound] = []
    while True:
        flight = touchdown(outline, slope, state, max_time - time)
        if not time + flight < max_time:
            return _ended(case, "max_time", max_time, moved(slope, state, max_time - time), rebounds, 0.0)
        before = moved(slope, state, flight)
        arc = outline.lowest_arc(before.phi)
        time += flight
        surface = Surface(case, before, arc)
        q = np.array([0.0, 0.0, 0.0, before.u, before.v, before.omega, *[0.0] * 6])
        points = [surface.on_ground(outline.point(arc, before.phi), q)]
        for other in outline.across([arc], before.phi):
            a, _ = arms(body.arcs[other], before.phi)
            closing = before.v - a * before.omega <= NOISE * surface.speed
            if surface.gap(other, q) <= AT_SURFACE * surface.size and closing:
                points.append(surface.on_ground(outline.point(other, before.phi), q))
        if len(points) > 1 and before.v - arms(body.arcs[arc], before.phi)[0] * before.omega > NOISE * surface.speed:
            points = points[1:]  # the side is level, and the body turns from this end to the other
            arc = points[0].arc
        if len(points) > 2:
            raise Unsupported("three points at the same time")
        contact = _follow_contact(surface, tuple(points), q, max_time - time)
        state, began, time = surface.state(contact.q), time, time + contact.time
        stored = surface.stored(contact.points, contact.q)
        impulses = float(contact.q[NORMAL]), float(contact.q[TANGENTIAL]), float(contact.q[MOMENT])
        losses = Losses(*(float(contact.q[k]) for k in (HYSTERESIS, SLIDING, ROLLING)))
        locked = any(sum(_locks(branch)) for branch in contact.branches)
        steps = len(contact.branches)
        lies = (began + contact.lies[0], contact.lies[1])
        rebounds.append(Rebound(began, before, arc, time, state, impulses, losses, contact.both, steps, locked, lies))
        if contact.end != "separated":
            return _ended(case, contact.end, time, state, rebounds, stored)
        if len(rebounds) >= max_rebounds:
            return _ended(case, "rebounds", time, state, rebounds, stored)


def energy(case: Case, state: State) -> float:
    """Kinetic and potential energy [J], the latter zero at x = 0, y = 0."""
    body, _, slope, _ = case
    along, into = slope.gravity * math.sin(slope.angle), slope.gravity * math.cos(slope.angle)
    kinetic = 0.5 * body.mass * (state.u**2 + state.v**2) + 0.5 * body.inertia * state.omega**2
    return kinetic + body.mass * (into * state.y - along * state.x)


def _ended(case: Case, end: str, time: float, state: State, rebounds: list[Rebound], stored: float) -> Descent:
    """Close the books."""
    losses = Losses(*map(sum, zip(*(rebound.losses for rebound in rebounds), strict=True))) if rebounds else None
    losses = losses or Losses(0.0, 0.0, 0.0)
    initial = energy(case, case.launch)
    residual = energy(case, state) + stored + sum(losses) - initial
    return Descent(end, time, state, tuple(rebounds), stored, losses, initial, residual)


# --- rigid surfaces --------------------------------------------------------------------------------------------------


def follow_rigid(case: Case, *, max_rebounds: int = 1, max_time: float = 10.0, settle_speed: float = 0.0) -> Descent:
    """Follow a descent on a rigid slope, by flights and impacts of one point alone.

    Raises
    ------
    Unsupported
        If a second point is within a millionth of the size of the slope, if an impact is slower than ``settle_speed``
        or leaves the body on the slope.
    """
    body, law, slope, state = case
    e = math.sqrt((1.0 - law.asymmetry) / (1.0 + law.asymmetry))
    outline, zones, time = Outline(body), everywhere(law, slope), 0.0
    rebounds: list[Rebound] = []
    while True:
        flight = touchdown(outline, slope, state, max_time - time)
        if not time + flight < max_time:
            return _ended(case, "max_time", max_time, moved(slope, state, max_time - time), rebounds, 0.0)
        time, before = time + flight, moved(slope, state, flight)
        k = outline.lowest_arc(before.phi)
        arc = body.arcs[k]
        a, b = arms(arc, before.phi)
        if any(b - arms(body.arcs[j], before.phi)[1] < 1e-6 * outline.size for j in outline.across([k], before.phi)):
            raise Unsupported("two points at once")
        if before.v - a * before.omega > -settle_speed:
            raise Unsupported("a slow impact")
        zone = zones[zone_at(zones, before.x - a)]
        met = before.u + b * before.omega, before.omega, before.v - a * before.omega
        impact = rational_impact(body.mass, body.inertia, a, b, zone.friction, arm_in(zone, arc), e, *met)
        if impact.approach <= 0.0:
            raise Unsupported("a rigid contact that lasts")
        u, v = impact.slip - b * impact.omega, impact.approach + a * impact.omega
        state = State(*before[:3], u, v, impact.omega)
        locked = any(phase.slip == 0 or phase.spin == 0 for phase in impact.phases)
        impulses = (impact.normal, impact.friction, impact.moment)
        losses = Losses(impact.loss_normal, impact.loss_sliding, impact.loss_rolling)
        ended = (impulses, losses, False, len(impact.phases), locked)
        rebounds.append(Rebound(time, before, k, time, state, *ended))
        if len(rebounds) >= max_rebounds:
            return _ended(case, "rebounds", time, state, rebounds, 0.0)


# --- outlines --------------------------------------------------------------------------------------------------------


def hull(circles: list[tuple[float, float, float]]) -> tuple[Arc, ...]:
    """Outline of the convex hull of circles (x, y, radius), told from the mass centre; circles inside have no arc.

    At an orientation the circle with the largest b is lowest, and b is that of another one at most twice in a turn.
    """
    crossings = []
    for i, (x, y, r) in enumerate(circles):
        for x_2, y_2, r_2 in circles[:i]:
            # r - y cos(phi) - x sin(phi) is the same for both where distance cos(phi - direction) = r - r_2.
            distance, direction = math.hypot(y - y_2, x - x_2), math.atan2(x - x_2, y - y_2)
            if distance > abs(r - r_2):
                half = math.acos((r - r_2) / distance)
                crossings += [direction - half, direction + half]
    crossings = sorted(math.remainder(angle, TURN) for angle in crossings)
    if not crossings:
        biggest = max(circles, key=lambda circle: circle[2])
        return (Arc(*biggest, -math.pi, biggest[2] == 0.0),)
    found: list[tuple[int, float]] = []
    for begin, end in pairwise([*crossings, crossings[0] + TURN]):
        phi = 0.5 * (begin + end)
        deepest = [r - y * math.cos(phi) - x * math.sin(phi) for x, y, r in circles]
        k = deepest.index(max(deepest))
        if not found or found[-1][0] != k:
            found.append((k, begin))
    if len(found) > 1 and found[0][0] == found[-1][0]:
        found = found[1:]
    return tuple(Arc(*circles[k], begin, circles[k][2] == 0.0) for k, begin in found)


def segment(radius: float, eccentricity: float, half_angle: float) -> tuple[Arc, ...]:
    """An arc whose centre lies above the mass centre, closed by its chord: nose, arc, tail."""
    across, above = radius * math.sin(half_angle), eccentricity - radius * math.cos(half_angle)
    if half_angle >= math.pi:
        return (Arc(0.0, eccentricity, radius, -math.pi, False),)
    nose = Arc(across, above, 0.0, -math.pi, True)
    return (
        nose,
        Arc(0.0, eccentricity, radius, -half_angle, False),
        nose._replace(x=-across, begin=half_angle),
    )


def oval(pieces: list[tuple[float, float, float]], x: float, y: float) -> tuple[Arc, ...]:
    """Outline with a centre of symmetry at (x, y), of arcs and sides: half of it as (width, radius, side after it).

    Widths are angles that add up to pi. The outline is drawn along its own tangent, clockwise.
    """
    full = [*pieces, *pieces]
    begin, at, arcs = -math.pi, (0.0, 0.0), []
    for width, radius, side in full:
        normal = (-math.sin(begin), -math.cos(begin))  # outward, of the point that is lowest at that orientation
        centre = at[0] - radius * normal[0], at[1] - radius * normal[1]
        arcs.append(Arc(*centre, radius, begin, radius == 0.0))
        begin += width
        at = (
            centre[0] - radius * math.sin(begin) - side * math.cos(begin),
            centre[1] - radius * math.cos(begin) + side * math.sin(begin),
        )
    half = len(pieces)
    middle = 0.5 * (arcs[0].x + arcs[half].x), 0.5 * (arcs[0].y + arcs[half].y)
    return tuple(arc._replace(x=arc.x - middle[0] + x, y=arc.y - middle[1] + y) for arc in arcs)


def with_corners(arcs: tuple[Arc, ...], width: float = 1e-8) -> tuple[Arc, ...]:
    """The same outline with a corner at each end of an arc beside a straight side, the lowest point for a small angle.

    So what is across a side is the end of that arc. Without a corner it is the whole circle, which of a flat arc soon
    reaches below the end.
    """
    outline, found = Outline(Body(1.0, 1.0, arcs)), []
    for k, arc in enumerate(arcs):
        begin, end = arc.begin + width, arc.begin + outline.widths[k] - width
        corners = [
            Arc(arc.x - arc.radius * math.sin(phi), arc.y - arc.radius * math.cos(phi), 0.0, start, False)
            for phi, start in ((begin, arc.begin), (end, math.remainder(end, TURN)))
        ]
        round_arc = arc.radius > 0.0
        if round_arc and outline.sides[k - 1]:
            found.append(corners[0])
            arc = arc._replace(begin=begin)
        found.append(arc)
        if round_arc and outline.sides[k]:
            found.append(corners[1])
    return tuple(sorted(found, key=lambda arc: arc.begin))


def _inside(rng: np.random.Generator, corners: np.ndarray) -> np.ndarray:
    """A point inside a polygon, more likely in its middle."""
    return np.asarray(rng.dirichlet(np.full(len(corners), 2.0)) @ corners)


def _random_polygon(rng: np.random.Generator) -> tuple[Arc, ...]:
    corners = rng.normal(size=(int(rng.integers(3, 9)), 2)) * [1.0, rng.uniform(0.3, 1.0)]
    corners = corners - _inside(rng, corners)
    return hull([(x, y, 0.0) for x, y in corners.tolist()])


def _random_hull(rng: np.random.Generator) -> tuple[Arc, ...]:
    count = int(rng.integers(2, 7))
    centres = rng.normal(size=(count, 2)) * [1.0, rng.uniform(0.2, 1.0)]
    radii = np.exp(rng.uniform(math.log(0.02), math.log(0.8), count)) * (rng.random(count) < 0.8)
    centres = centres - _inside(rng, centres)
    return hull([(*centre, r) for centre, r in zip(centres.tolist(), radii.tolist(), strict=True)])


def _random_segment(rng: np.random.Generator) -> tuple[Arc, ...]:
    half_angle = rng.uniform(0.2, 2.9)
    least = max(math.cos(half_angle), 0.0)
    return segment(1.0, least + rng.uniform(0.05, 0.9) * (1.0 - least), half_angle)


def _random_oval(rng: np.random.Generator) -> tuple[Arc, ...]:
    """Joined arcs, corners among them, with or without sides; arcs beside a side are no flatter than it allows."""
    while True:
        count = int(rng.integers(2, 5))
        widths = math.pi * rng.dirichlet(np.full(count, 3.0))
        radii = np.exp(rng.uniform(math.log(0.1), math.log(10.0), count)) * (rng.random(count) < 0.75)
        sides = rng.uniform(0.2, 1.0, count) * (rng.random(count) < 0.4)
        pieces = list(zip(widths.tolist(), radii.tolist(), sides.tolist(), strict=True))
        if ((radii == 0.0) & (np.roll(radii, -1) == 0.0) & (sides == 0.0)).any():  # two corners at one place
            continue
        x, y = _inside(rng, _beginnings(oval(pieces, 0.0, 0.0))).tolist()
        arcs = oval(pieces, -x, -y)
        if Outline(Body(1.0, 1.0, arcs)).circles_stay_inside():
            return arcs


def _beginnings(arcs: tuple[Arc, ...]) -> np.ndarray:
    """Points of the outline where arcs begin, in the frame of the body."""
    outward = [(-math.sin(arc.begin), -math.cos(arc.begin)) for arc in arcs]
    return np.array(
        [(arc.x + arc.radius * n[0], arc.y + arc.radius * n[1]) for arc, n in zip(arcs, outward, strict=True)]
    )


KINDS: dict[str, Callable[[np.random.Generator], tuple[Arc, ...]]] = {
    "polygon": _random_polygon,
    "hull": _random_hull,
    "segment": _random_segment,
    "oval": _random_oval,
}


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw so that the logarithm is uniform."""
    return float(low * (high / low) ** rng.random())


def random_body(rng: np.random.Generator, kind: str) -> Body:
    """A body that reaches 0.2 to 1 m from its mass centre, which lies inside."""
    while True:
        arcs = KINDS[kind](rng)
        outline = Outline(Body(1.0, 1.0, arcs))
        if outline.lowest > 0.02 * outline.size and min(outline.widths) > 1e-3:
            break
    reach, mass = _log(rng, 0.2, 1.0), _log(rng, 0.5, 100.0)
    factor = reach / outline.size
    arcs = tuple(Arc(arc.x * factor, arc.y * factor, arc.radius * factor, *arc[3:]) for arc in arcs)
    return Body(mass, mass * reach**2 * rng.uniform(0.15, 0.6), arcs)


def random_zones(rng: np.random.Generator, edges: list[float], size: float) -> tuple[Zone, ...]:
    """Zones between edges [m], some of which touch and some of which do not; the last one may have no end."""
    edges = sorted(set(edges))
    found = []
    for begin, end in pairwise([*edges, math.inf]):
        if rng.random() < 0.8:
            friction = rng.uniform(0.0, 0.8) if rng.random() < 0.9 else 0.0
            rolls = (float(rng.uniform(0.0, 0.05) * size * (rng.random() < 0.7)) for _ in range(2))
            found.append(Zone(begin, end, float(friction), *rolls))
    return tuple(found)


def random_case(seed: int) -> Case:
    """A body, a law, a slope and a launch of moderate size, some numbers exactly zero. Kinds of bodies take turns.

    A third comes down with one of its sides nearly flat.
    """
    rng = np.random.default_rng([2024, seed])

    def some(value: float, share: float) -> float:
        """``value``, or exactly zero in a share of the cases."""
        return 0.0 if rng.random() < share else float(value)

    body = random_body(rng, list(KINDS)[seed % len(KINDS)])
    outline = Outline(body)
    size = outline.size
    law = Law(
        stiffness=body.mass * _log(rng, 1e3, 1e6),
        asymmetry=some(rng.uniform(0.0, 0.9), 0.1),
        friction=some(rng.uniform(0.0, 0.6), 0.15),
        rolling_arm=some(rng.uniform(0.0, 0.05) * size, 0.3),
        corner_rolling_arm=some(rng.uniform(0.0, 0.05) * size, 0.5),
    )
    slope = Slope(some(rng.uniform(-0.5, 0.5), 0.1), 9.81)
    phi, drop = float(rng.uniform(-math.pi, math.pi)), _log(rng, 0.01, 2.0)
    u, v = some(rng.uniform(-5.0, 5.0), 0.1), some(rng.uniform(-3.0, 2.0), 0.1)
    omega = some(rng.uniform(-3.0, 3.0) / size, 0.1)
    flat = [body.arcs[(k + 1) % len(body.arcs)].begin for k, side in enumerate(outline.sides) if side]
    if flat and rng.random() < 1.0 / 3.0:
        phi, omega = float(rng.choice(flat)) + 0.1 * rng.normal(), 0.1 * omega
        drop, law = min(drop, 0.3), law._replace(stiffness=min(law.stiffness, 1e5 * body.mass))
    phi = math.remainder(phi, TURN)
    launch = State(0.0, outline.support_height(phi) + drop, phi, u, v, omega)
    return Case(body, law, slope, launch)
