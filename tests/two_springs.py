"""Contact of both corners of a segment with the slope, two springs integrated by scipy: slow, obvious, an oracle.

Mechanics alone, sharing no code with the solver. A rigid body touches with its tail (index 0) and its nose (index 1),
each at (-a_i, -b_i) from the mass centre, with the gap g_i = y - b_i, the gap rate n_i = v - a_i omega and the slip
t_i = u + b_i omega:

    m du/dt = sum F_i + m g sin(beta),    m dv/dt = sum N_i - m g cos(beta),
    J domega/dt = sum (-a_i N_i + b_i F_i) + M.

With the penetration x_i = -g_i and the two stiffnesses k_-, k_+ of docs/physics.md (5.1), set-valued where a velocity
is zero:

    n_i:    N_i = k_+ x_i while n_i < 0,  k_- x_i while n_i > 0,  anything between at n_i = 0
    t_i:    F_i = -f N_i sgn t_i,           |F_i| <= f N_i at t_i = 0
    omega:  M = -d (N_1 + N_2) sgn omega,   |M| <= d (N_1 + N_2) at omega = 0       (d is the corner's rolling arm)

A branch names which corners touch and, for each velocity, its sign, or 0 where it is locked. As n_1 - n_2 and
t_1 - t_2 are multiples of omega, two gap rates or two slips stay zero only with omega; how the two corners then share
a force is open. The motion does not depend on it: for given loads it follows from the least of a convex function, so a
lock holds as long as any share obeys every bound.

Orientation and height are counted from those of the chord flat on the slope, so the gaps suffer no cancellation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853, solve_ivp
from scipy.optimize import brentq

from sledenv.simulation.bodies import Segment
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.shapes import circular_segment

X, HEIGHT, TILT, U, V, SPIN, HYSTERESIS, SLIDING, ROLLING = range(9)  # of the integrated vector
BOTH = (0, 1)  # tail, nose
RTOL = 1e-13
NOISE = 1e-12  # of the speed scale: a velocity this small counts as zero where a branch is chosen
VELOCITY_SLACK, FORCE_SLACK, GAP_SLACK = (
    1e-14,
    1e-11,
    1e-16,
)  # [of the speed scale], [of the load], [m]: how far an event is passed
AT_SURFACE = 1e-15  # [m] a gap this small is that of a corner which is just coming or leaving
GERMS = (1e-5, 1e-4, 1e-3, 1e-2)  # [time units] after which a branch is tried out
TOO_MANY = 2000  # [-] branches of one contact

Pair = tuple[int, int]


class Branch(NamedTuple):
    """Which corners touch, and the sign of each velocity, 0 where it is locked.

    A sign that no force depends on (a corner in the air, no friction, no rolling resistance) is 1.
    """

    touching: tuple[bool, bool]
    gaps: Pair
    slips: Pair
    spin: int


class Forces(NamedTuple):
    """Accelerations and forces of a branch, and how far every lock is from its bound."""

    rates: tuple[float, float, float]  # [m/s^2, m/s^2, rad/s^2] of u, v, omega
    normal: tuple[float, float]  # [N]
    friction: tuple[float, float]  # [N]
    slacks: tuple[float, ...]  # [N] not negative while the locks hold


class Moment(NamedTuple):
    """A time [s] since the start of the contact, and the state then."""

    time: float
    state: State


class Result(NamedTuple):
    """How a contact ended."""

    end: str  # "separated", "rest", "arc" or "max_time"
    time: float  # [s]
    state: State
    lies: Moment | None  # when both gap rates were locked for the first time
    both: bool  # whether both corners touched at the same time
    hysteresis: float  # [J]
    sliding: float  # [J]
    rolling: float  # [J]
    stored: float  # [J] in the springs at the end
    residual: float  # [J] of the energy ledger
    branches: tuple[tuple[float, Branch], ...]  # [s] when each was entered
    doubt: float  # [-] the largest violation of a law that a chosen branch began with


class Chord:
    """Two corners on two springs."""

    def __init__(self, body: Segment, law: ContactLaw, slope: Slope) -> None:
        """Take the segment's geometry (8.2), the law's stiffnesses (5.1) and the components of gravity."""
        self.mass, self.inertia, self.half_angle = body.mass, body.inertia, body.half_angle
        self.depth = body.eccentricity - body.radius * math.cos(body.half_angle)  # H
        self.half = body.radius * math.sin(body.half_angle)  # L
        self.size = math.hypot(self.depth, self.half)
        self.closing, self.opening = law.stiffness * (1.0 + law.asymmetry), law.stiffness * (1.0 - law.asymmetry)
        self.friction, self.arm = law.friction, law.corner_rolling_arm
        self.along, self.into = slope.gravity * math.sin(slope.angle), slope.gravity * math.cos(slope.angle)
        self.unit = 1.0 / math.sqrt(2.0 * self.closing * (1.0 / self.mass + self.half**2 / self.inertia))  # [s]
        self.speed = 1.0  # [m/s] scale; `follow` sets that of its contact

    # --- kinematics

    def arms(self, tilt: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """(a_1, a_2) and (b_1, b_2) [m]."""
        s, c = math.sin(tilt), math.cos(tilt)
        return (
            (-self.depth * s - self.half * c, -self.depth * s + self.half * c),
            (self.depth * c - self.half * s, self.depth * c + self.half * s),
        )

    def penetrations(self, q: np.ndarray) -> tuple[float, float]:
        """x_1, x_2 [m], negative in the air."""
        middle = q[HEIGHT] + 2.0 * self.depth * math.sin(0.5 * q[TILT]) ** 2
        side = self.half * math.sin(q[TILT])
        return -middle - side, -middle + side

    def project(self, branch: Branch, q: np.ndarray) -> np.ndarray:
        """Return ``q`` with every locked velocity exactly zero."""
        q = q.copy()
        a, b = self.arms(q[TILT])
        if branch.spin == 0:
            q[SPIN] = 0.0
        for i in BOTH:
            if branch.touching[i] and branch.gaps[i] == 0:
                q[V] = a[i] * q[SPIN]
            if branch.touching[i] and branch.slips[i] == 0:
                q[U] = -b[i] * q[SPIN]
        return q

    def velocities(self, branch: Branch, q: np.ndarray) -> tuple[list[float], list[float], float]:
        """Gap rates, slips [m/s] and spin [rad/s], from that of a locked corner where there is one."""
        a, b = self.arms(q[TILT])
        spin = 0.0 if branch.spin == 0 else float(q[SPIN])
        rates = [q[V] - a[i] * spin for i in BOTH]
        slips = [q[U] + b[i] * spin for i in BOTH]
        for i in BOTH:
            if branch.touching[i] and branch.gaps[i] == 0:
                rates = [(a[i] - a[j]) * spin for j in BOTH]
            if branch.touching[i] and branch.slips[i] == 0:
                slips = [(b[j] - b[i]) * spin for j in BOTH]
        return rates, slips, spin

    # --- forces

    def forces(self, branch: Branch, q: np.ndarray) -> Forces:
        """Forces and accelerations of a branch."""
        return self._held(branch, q) if branch.spin == 0 else self._spinning(branch, q)

    def _spinning(self, branch: Branch, q: np.ndarray) -> Forces:
        """Of a body free to spin, so that at most one gap rate and one slip are locked: one linear system."""
        (a, b), x, spin = self.arms(q[TILT]), self.penetrations(q), q[SPIN]
        matrix, right = np.zeros((7, 7)), np.zeros(7)  # for du/dt, dv/dt, domega/dt, N_1, N_2, F_1, F_2
        matrix[0, 0] = matrix[1, 1] = self.mass
        matrix[2, 2] = self.inertia
        right[0], right[1] = self.mass * self.along, -self.mass * self.into
        for i in BOTH:
            normal, friction = 3 + i, 5 + i
            matrix[0, friction] = matrix[1, normal] = -1.0
            matrix[2, normal], matrix[2, friction] = a[i] + self.arm * branch.spin, -b[i]
            if branch.touching[i] and branch.gaps[i] == 0:  # dn/dt = dv/dt - a domega/dt + b omega^2 = 0
                matrix[normal, 1], matrix[normal, 2], right[normal] = 1.0, -a[i], -b[i] * spin * spin
            else:
                matrix[normal, normal] = 1.0
                right[normal] = branch.touching[i] * self._stiffness(branch.gaps[i]) * x[i]
            if branch.touching[i] and branch.slips[i] == 0:  # dt/dt = du/dt + b domega/dt + a omega^2 = 0
                matrix[friction, 0], matrix[friction, 2], right[friction] = 1.0, b[i], -a[i] * spin * spin
            else:
                matrix[friction, friction], matrix[friction, normal] = 1.0, self.friction * branch.slips[i]
        z = np.linalg.solve(matrix, right).tolist()
        slacks: list[float] = []
        for i in BOTH:
            if branch.touching[i] and branch.gaps[i] == 0:
                slacks += [z[3 + i] - self.opening * x[i], self.closing * x[i] - z[3 + i]]
            if branch.touching[i] and branch.slips[i] == 0:
                slacks.append(self.friction * z[3 + i] - abs(z[5 + i]))
        return Forces((z[0], z[1], z[2]), (z[3], z[4]), (z[5], z[6]), tuple(slacks))

    def _stiffness(self, rate: int) -> float:
        return self.closing if rate < 0 else self.opening

    def _held(self, branch: Branch, q: np.ndarray) -> Forces:
        """Of a body that does not spin: gap rates are equal, slips too, and M balances the moment of some share."""
        (a, b), x, f, m = self.arms(q[TILT]), self.penetrations(q), self.friction, self.mass
        touching = [i for i in BOTH if branch.touching[i]]
        gap_sign, slip_sign = branch.gaps[touching[0]], branch.slips[touching[0]]
        slacks: list[float] = []
        total = m * self.into
        if gap_sign == 0:
            least, most = (sum(k * x[i] for i in touching) for k in (self.opening, self.closing))
            slacks += [total - least, most - total]
            shares = [_share(i, touching, total, self.opening, self.closing, x) for i in touching]
        else:
            loads = [branch.touching[i] * self._stiffness(gap_sign) * x[i] for i in BOTH]
            total = sum(loads)
            shares = [(loads[0], loads[1])]
        pull = -m * self.along if slip_sign == 0 else -f * slip_sign * total
        if slip_sign == 0:
            slacks.append(f * total - abs(pull))
        # The moment is linear in the shares of N and of F, and is extreme where N is: arms along the slope are longer
        # than the difference of the arms b.
        corners = [(n, pair) for n in shares for pair in _pulls(n, pull, f, slip_sign)]
        moments = [sum(a[i] * n[i] - b[i] * pair[i] for i in BOTH) for n, pair in corners]
        slacks += [(self.arm * total - min(moments)) / self.size, (self.arm * total + max(moments)) / self.size]
        n, pair = corners[0]
        if len(corners) > 1:  # the reported share: M as small as it can be
            lo, hi = moments.index(min(moments)), moments.index(max(moments))
            span = moments[hi] - moments[lo]
            part = min(max(-moments[lo] / span, 0.0), 1.0) if span > 0.0 else 0.5
            n, pair = (tuple((1.0 - part) * corners[lo][k][i] + part * corners[hi][k][i] for i in BOTH) for k in (0, 1))
        return Forces(
            (self.along + pull / m, 0.0 if gap_sign == 0 else total / m - self.into, 0.0), n, pair, tuple(slacks)
        )

    def rates(self, branch: Branch, q: np.ndarray) -> np.ndarray:
        """Time derivative of the integrated vector."""
        q = self.project(branch, q)
        rates, slips, spin = self.velocities(branch, q)
        x, forces = self.penetrations(q), self.forces(branch, q)
        hysteresis = sliding = 0.0
        for i in BOTH:
            if branch.touching[i]:
                hysteresis += (self.closing - self.opening) * x[i] * rates[i] * (branch.gaps[i] > 0)
                sliding += self.friction * forces.normal[i] * branch.slips[i] * slips[i]
        rolling = self.arm * sum(forces.normal) * branch.spin * spin
        return np.array([q[U], q[V], spin, *forces.rates, hysteresis, sliding, rolling])

    def stored(self, q: np.ndarray) -> float:
        """Energy in the springs [J]."""
        return 0.5 * self.closing * sum(max(0.0, x) ** 2 for x in self.penetrations(q))

    def energy(self, q: np.ndarray) -> float:
        """What the ledger keeps constant [J]: kinetic, potential, stored and lost energy."""
        kinetic = 0.5 * self.mass * (q[U] ** 2 + q[V] ** 2) + 0.5 * self.inertia * q[SPIN] ** 2
        potential = self.mass * (self.into * q[HEIGHT] - self.along * q[X])
        return float(kinetic + potential + self.stored(q) + q[HYSTERESIS] + q[SLIDING] + q[ROLLING])

    # --- what a branch rests on

    def signed(self, branch: Branch, q: np.ndarray) -> dict[str, float]:
        """Free velocities in their branch's direction, over the speed scale: not negative while the branch holds."""
        rates, slips, spin = self.velocities(branch, q)
        values = {}
        for i in BOTH:
            if branch.touching[i] and branch.gaps[i]:
                values[f"n{i}"] = branch.gaps[i] * rates[i] / self.speed
            if branch.touching[i] and branch.slips[i] and self.friction:
                values[f"t{i}"] = branch.slips[i] * slips[i] / self.speed
        if branch.spin and self.arm:
            values["w"] = branch.spin * spin * self.size / self.speed
        return values

    def _load(self, forces: Forces, x: tuple[float, float]) -> float:
        return max(0.0, *(max(abs(forces.normal[i]), self.closing * x[i]) for i in BOTH))

    def guards(self, branch: Branch, q: np.ndarray) -> dict[str, float]:
        """What ends the branch where it becomes negative."""
        x, forces = self.penetrations(q), self.forces(branch, q)
        values = {name: value + VELOCITY_SLACK for name, value in self.signed(branch, q).items()}
        for i in BOTH:
            if not branch.touching[i]:
                values[f"down{i}"] = -x[i] + GAP_SLACK
            elif branch.gaps[i]:
                values[f"up{i}"] = x[i] + GAP_SLACK
        load = self._load(forces, x)
        for k, slack in enumerate(forces.slacks):
            values[f"slack{k}"] = slack + FORCE_SLACK * load
        values["arc"] = math.pi - self.half_angle - abs(q[TILT])
        return values

    def violation(self, branch: Branch, q: np.ndarray, zero: set[str]) -> float:
        """How far a branch disobeys the laws of what is locked or in ``zero``; 0 up to rounding."""
        x, forces = self.penetrations(q), self.forces(branch, q)
        load = self._load(forces, x)
        worst = max((-v for name, v in self.signed(branch, q).items() if name in zero), default=0.0)
        worst = worst if worst > VELOCITY_SLACK else 0.0
        if load > 0.0:
            slack = -min(forces.slacks, default=0.0) / load
            worst = max(worst, slack if slack > 1e-9 else 0.0)
        for i in BOTH:
            depth = -x[i] if branch.touching[i] else x[i]
            worst = max(worst, depth / self.size if depth > AT_SURFACE and f"x{i}" in zero else 0.0)
        return worst


def _share(
    filled: int, touching: list[int], total: float, opening: float, closing: float, x: tuple[float, float]
) -> tuple[float, float]:
    """Loads of the corners, ``total`` in all and each within its bounds, with as much as may be on ``filled``."""
    loads = [0.0, 0.0]
    others = sum(opening * x[i] for i in touching if i != filled)
    loads[filled] = min(closing * x[filled], total - others) if len(touching) > 1 else total
    for i in touching:
        if i != filled:
            loads[i] = total - loads[filled]
    return loads[0], loads[1]


def _pulls(loads: tuple[float, float], pull: float, f: float, slip: int) -> list[tuple[float, float]]:
    """Friction of the corners, ``pull`` in all and each within its bounds: the one share, or the two extreme ones."""
    if slip:
        return [(-f * slip * loads[0], -f * slip * loads[1])]
    low, high = max(-f * loads[0], pull - f * loads[1]), min(f * loads[0], pull + f * loads[1])
    if low > high:  # not enough friction: that is told by the slack
        low = high = 0.5 * (low + high)
    return [(low, pull - low), (high, pull - high)]


# --- choice of a branch ----------------------------------------------------------------------------------------------


def _candidates(chord: Chord, touching: tuple[bool, bool], q: np.ndarray) -> Iterator[tuple[Branch, set[str]]]:
    """Every branch that the signs of the velocities permit, and which velocities (n, t, w) and gaps (x) are zero."""
    rates, slips, spin = chord.velocities(Branch((False, False), (1, 1), (1, 1), 1), q)
    named = {"n0": rates[0], "n1": rates[1], "t0": slips[0], "t1": slips[1], "w": spin * chord.size}
    zero = {name for name, value in named.items() if abs(value) <= NOISE * chord.speed}

    def signs(name: str, matters: bool) -> tuple[int, ...]:
        if not matters:
            return (1,)
        return (0, 1, -1) if name in zero else (1 if named[name] > 0.0 else -1,)

    zero |= {f"x{i}" for i, x in enumerate(chord.penetrations(q)) if abs(x) <= AT_SURFACE}
    grazes = [touching[i] and {f"x{i}", f"n{i}"} <= zero for i in BOTH]
    spins = signs("w", chord.arm > 0.0)
    if chord.arm == 0.0 and "w" in zero:
        spins = (0, 1)
    for down in product(*((True, False) if grazes[i] else (touching[i],) for i in BOTH)):
        gaps = product(*(signs(f"n{i}", down[i]) for i in BOTH))
        slips_ = product(*(signs(f"t{i}", down[i] and chord.friction > 0.0) for i in BOTH))
        for branch in (Branch(down, *rest) for rest in product(gaps, slips_, spins)):
            if _is_possible(chord, branch):
                yield branch, zero


def _is_possible(chord: Chord, branch: Branch) -> bool:
    """Whether what is locked can stay so by kinematics, and the spin has a reason to be locked."""
    both = all(branch.touching)
    tied = both and (branch.gaps == (0, 0) or branch.slips == (0, 0))
    if branch.spin:
        return not tied
    if not any(branch.touching) or (both and len({*branch.gaps}) + len({*branch.slips}) > 2):
        return False
    return tied or chord.arm > 0.0


def _locks(branch: Branch) -> tuple[int, int, int]:
    return branch.gaps.count(0), branch.slips.count(0), int(branch.spin == 0)


def _small_step(chord: Chord, branch: Branch, q: np.ndarray, dt: float) -> np.ndarray:
    """One step of the classical Runge-Kutta method."""
    q = chord.project(branch, q)
    k1 = chord.rates(branch, q)
    k2 = chord.rates(branch, q + 0.5 * dt * k1)
    k3 = chord.rates(branch, q + 0.5 * dt * k2)
    k4 = chord.rates(branch, q + dt * k3)
    return chord.project(branch, q + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))


def choose(chord: Chord, touching: tuple[bool, bool], q: np.ndarray) -> tuple[Branch, float]:
    """Choose the branch that obeys all laws a little later; of several, the one with most locks.

    Each candidate is followed for a short time, then for longer ones as long as several obey the laws: whatever starts
    from zero (a force at touchdown, a velocity at its release) is judged by where it goes.

    Returns
    -------
    tuple
        The branch, and the violation of the laws by it: 0, or the least there is.
    """
    left = list(_candidates(chord, touching, q))
    nearest = None
    for germ in GERMS:
        if len(left) == 1:
            break
        tried = [(chord.violation(c[0], _small_step(chord, c[0], q, germ * chord.unit), c[1]), c) for c in left]
        least = min(violation for violation, _ in tried)
        nearest = nearest or min(tried, key=lambda item: item[0])
        if least == 0.0:
            left, nearest = [c for violation, c in tried if violation == 0.0], (0.0, left[0])
    if nearest and nearest[0] > 0.0:
        return nearest[1][0], nearest[0]
    return max((branch for branch, _ in left), key=_locks), 0.0


# --- following a contact ---------------------------------------------------------------------------------------------


def _advance(chord: Chord, branch: Branch, q: np.ndarray, duration: float) -> tuple[float, np.ndarray, str]:
    """Integrate a branch up to what ends it; return when, the vector then, and the name of the guard or "max_time"."""
    springs = any(branch.touching[i] and branch.gaps[i] for i in BOTH)
    slow = 0.1 * min(chord.size / chord.speed, math.sqrt(chord.size / max(chord.into, 1e-3)))
    longest = 0.5 * chord.unit if springs else math.inf if branch.spin == 0 else slow
    length, speed = chord.speed * chord.unit, chord.speed
    energy = 0.5 * chord.mass * speed**2
    lengths, speeds = [length, length, length / chord.size], [speed, speed, speed / chord.size]
    options = {"rtol": RTOL, "atol": 1e-15 * np.array([*lengths, *speeds, energy, energy, energy])}

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        return chord.rates(branch, y)

    first = min(1e-4 * chord.unit, duration)
    solver = DOP853(rates, 0.0, q, duration, first_step=first, max_step=longest, **options)
    while solver.status == "running":
        message = solver.step()
        if solver.status == "failed":
            raise ArithmeticError(message)
        start, state, step = solver.t_old, solver.dense_output(), solver.t - solver.t_old
        samples = 1 if step <= 20.0 * first else 8
        before = start
        for k in range(1, samples + 1):
            now = solver.t if k == samples else start + step * k / samples
            values = chord.guards(branch, solver.y if k == samples else state(now))
            fired = [name for name, value in values.items() if value < 0.0]
            if fired:
                roots = ((_root(chord, branch, state, n, before, now), n) for n in fired)
                when, name = min(roots)
                return *_polished(chord, branch, solver, when, name, options), name
            before = now
    return duration, solver.y, "max_time"


def _root(chord: Chord, branch: Branch, state: Callable, name: str, low: float, high: float) -> float:
    def value(time: float) -> float:
        return chord.guards(branch, state(time))[name]

    return low if value(low) <= 0.0 else float(brentq(value, low, high, xtol=1e-18 + 1e-15 * (high - low), rtol=1e-15))


def _polished(
    chord: Chord, branch: Branch, solver: DOP853, when: float, name: str, options: dict
) -> tuple[float, np.ndarray]:
    """The time of an event and the vector then, by steps of the method itself and not by its interpolation."""
    begin, state = solver.t_old, solver.dense_output()
    width = 1e-4 * (solver.t - begin)

    def stepped(time: float) -> np.ndarray:
        if time <= begin:
            return state(begin)
        return solve_ivp(
            lambda _, q: chord.rates(branch, q), (begin, time), state(begin), method="DOP853", **options
        ).y.T[-1]

    for _ in range(3):  # Newton's method
        rise = chord.guards(branch, state(when + width))[name] - chord.guards(branch, state(when - width))[name]
        if rise >= 0.0 or when <= begin:
            break
        change = chord.guards(branch, stepped(when))[name] * 2.0 * width / rise
        when -= change
        if abs(change) <= 1e-15 * chord.unit:
            break
    when = max(when, begin)
    return when, stepped(when)


def follow(body: Segment, law: ContactLaw, slope: Slope, state: State, *, max_time: float = 1.0) -> Result:
    """Follow a contact until both corners have left, everything is locked, the arc touches, or ``max_time``.

    Parameters
    ----------
    body : Segment
        A segment with corners.
    law : ContactLaw
        ``rolling_arm`` is not used.
    slope : Slope
        ``length`` is not used.
    state : State
        With the chord down, within a quarter of a turn, and a corner in the slope, or at it and coming down.
    max_time : float
        Duration [s] after which to stop.

    Raises
    ------
    ValueError
        If no corner touches.
    ArithmeticError
        If events follow each other without end.
    """
    chord = Chord(body, law, slope)
    turned = math.copysign(math.pi, math.remainder(state.phi, 2.0 * math.pi))
    flat = turned if abs(state.phi) <= math.pi else state.phi - math.remainder(state.phi, 2.0 * math.pi) + turned
    q = np.array([0.0, state.y - chord.depth, state.phi - flat, state.u, state.v, state.omega, 0.0, 0.0, 0.0])
    x = chord.penetrations(q)
    if abs(max(x)) <= 1e-12 * chord.size:
        q[HEIGHT] += max(x)  # exactly at the surface
        x = chord.penetrations(q)
    rates, slips, _ = chord.velocities(Branch((False, False), (1, 1), (1, 1), 1), q)
    chord.speed = max(*map(abs, rates), *map(abs, slips), 1e-3 * math.sqrt(chord.size * chord.into), 1e-9)
    limit = NOISE * chord.speed
    touching = tuple(bool(x[i] > AT_SURFACE or (x[i] >= -AT_SURFACE and rates[i] <= limit)) for i in BOTH)
    if not any(touching):
        raise ValueError("no corner touches")

    def as_state(q: np.ndarray) -> State:
        return State(state.x + q[X], chord.depth + q[HEIGHT], flat + q[TILT], q[U], q[V], q[SPIN])

    initial, time, doubt, end = chord.energy(q), 0.0, 0.0, ""
    lies, both, branches = None, False, []
    while not end:
        branch, violation = choose(chord, touching, q)
        q, touching, doubt = chord.project(branch, q), branch.touching, max(doubt, violation)
        branches.append((time, branch))
        both = both or all(touching)
        settled = branch.spin == 0 and all(branch.gaps[i] == 0 for i in BOTH if touching[i])
        if settled and all(touching) and lies is None:
            lies = Moment(time, as_state(q))
        smooth = chord.friction == 0.0 and abs(q[U]) <= limit and chord.along == 0.0
        if not any(touching):
            end = "separated"
        elif settled and (smooth or all(branch.slips[i] == 0 for i in BOTH if touching[i])):
            end = "rest"
        elif time >= max_time:
            end = "max_time"
        elif len(branches) >= TOO_MANY:
            raise ArithmeticError(f"{TOO_MANY} branches in {time} s")
        else:
            passed, q, name = _advance(chord, branch, q, max_time - time)
            time += float(passed)
            end = name if name in ("arc", "max_time") else ""
            touching = _touching_after(chord, branch, q, name)
    return Result(
        end,
        time,
        as_state(q),
        lies,
        both,
        *(float(q[k]) for k in (HYSTERESIS, SLIDING, ROLLING)),
        chord.stored(q),
        chord.energy(q) - initial,
        tuple(branches),
        doubt,
    )


def _touching_after(chord: Chord, branch: Branch, q: np.ndarray, name: str) -> tuple[bool, bool]:
    """Which corners touch after an event; both may change at the same time."""
    x, (rates, *_) = chord.penetrations(q), chord.velocities(branch, q)

    def touches(i: int) -> bool:
        if branch.touching[i]:
            return name != f"up{i}" and not (branch.gaps[i] > 0 and x[i] <= AT_SURFACE)
        return name == f"down{i}" or bool(x[i] >= -AT_SURFACE and rates[i] < 0.0)

    return touches(0), touches(1)


# --- random contacts -------------------------------------------------------------------------------------------------


class Contact(NamedTuple):
    """What `follow` takes."""

    body: Segment
    law: ContactLaw
    slope: Slope
    state: State


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw so that the logarithm is uniform."""
    return low * (high / low) ** rng.random()


def random_contacts(n: int, seed: int) -> Iterator[Contact]:
    """Yield ``n`` segments with the chord down, one corner at the slope and coming down, many with exact zeros."""
    rng = np.random.default_rng(seed)

    def some(value: float, share: float) -> float:
        """``value``, or exactly zero in a share of the cases."""
        return 0.0 if rng.random() < share else float(value)

    for _ in range(n):
        half_angle = math.radians(rng.uniform(15.0, 165.0))
        body = circular_segment(_log(rng, 3.0, 300.0), _log(rng, 0.1, 2.0), half_angle)
        law = ContactLaw.from_restitution(
            1.0 - some(rng.uniform(0.0, 0.9), 0.05),
            stiffness=_log(rng, 1e6, 1e9),
            friction=some(rng.uniform(0.0, 1.0), 0.25),
            rolling_arm=0.01,
            corner_rolling_arm=some(rng.uniform(0.0, 0.02), 0.5),
        )
        slope = Slope(some(rng.uniform(0.0, 0.4), 0.2))
        steep = 0.05 * rng.random() if rng.random() < 0.5 else _log(rng, 1e-5, 0.05)
        tilt = some(rng.choice([-1.0, 1.0]) * steep, 0.1)
        spin, along = some(rng.uniform(-3.0, 3.0), 0.15), some(rng.uniform(-6.0, 6.0), 0.15)
        speed = _log(rng, 0.05, 4.0)
        chord = Chord(body, law, slope)
        a, b = chord.arms(tilt)
        lower = 1 if tilt > 0.0 or (tilt == 0.0 and rng.random() < 0.5) else 0
        yield Contact(body, law, slope, State(0.0, b[lower], math.pi + tilt, along, a[lower] * spin - speed, spin))
