"""Motion of a body on springs as power series with many digits, from physics.md, section 12: slow, obvious, an oracle.

The equations of motion are integrated on truncated series until nothing changes: each turn adds one term. Features are
those of :mod:`sledenv.kernel.geometry`; normals and levers are formed from the places of their centres and vertices.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import mpmath
from mpmath import mpf

from sledenv.kernel.geometry import ARC_BEND, SIDE_BEND
from sledenv.kernel.params import Incline

DIGITS = 40


class Jet:
    """A power series, truncated."""

    def __init__(self, terms: Sequence[Any]) -> None:
        self.terms = list(terms)

    def _other(self, other: Any) -> list[Any]:
        return other.terms if isinstance(other, Jet) else [mpf(other)] + [mpf(0)] * (len(self.terms) - 1)

    def __add__(self, other: Any) -> Jet:
        return Jet([a + b for a, b in zip(self.terms, self._other(other), strict=True)])

    def __sub__(self, other: Any) -> Jet:
        return Jet([a - b for a, b in zip(self.terms, self._other(other), strict=True)])

    def __neg__(self) -> Jet:
        return Jet([-a for a in self.terms])

    def __mul__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet([a * mpf(other) for a in self.terms])
        p, q = self.terms, other.terms
        return Jet([mpmath.fdot(zip(p[: k + 1], q[k::-1], strict=True)) for k in range(len(p))])

    __radd__, __rmul__ = __add__, __mul__

    def __truediv__(self, other: Jet) -> Jet:
        quotient: list[Any] = []
        for k, term in enumerate(self.terms):
            known = mpmath.fdot(zip(quotient, other.terms[k:0:-1], strict=True))
            quotient.append((term - known) / other.terms[0])
        return Jet(quotient)

    def root(self) -> Jet:
        root = [mpmath.sqrt(self.terms[0])]
        for k in range(1, len(self.terms)):
            known = mpmath.fdot(zip(root[1:], root[:0:-1], strict=True))
            root.append((self.terms[k] - known) / (2 * root[0]))
        return Jet(root)

    def integral(self, start: Any) -> Jet:
        return Jet([start, *(term / (k + 1) for k, term in enumerate(self.terms[:-1]))])

    def derivative(self) -> Jet:
        return Jet([*((k + 1) * term for k, term in enumerate(self.terms[1:])), mpf(0)])


class Touch(NamedTuple):
    """A contact in its mode."""

    features: tuple[int, int, int]  # kind, arc, piece
    gap: float  # [m]
    stiffness: float  # [N/m]
    friction: float  # [-]
    arm: float  # [m]
    slip_sign: int  # of what friction acts against
    gap_locked: bool
    slip_locked: bool


class Course(NamedTuple):
    """What follows: series of the motion, of the contacts, and of the moment of rolling."""

    motion: list[Jet]  # x, y, phi, u, v, omega
    gaps: list[Jet]
    rates: list[Jet]
    slips: list[Jet]
    normals: list[Jet]
    forces: list[Jet]
    moment: Jet


def rows(body: Any, pieces: Any, touch: Touch, x: Jet, y: Jet, sine: Jet, cosine: Jet) -> tuple[list[Any], list[Any]]:
    """What u, v, omega add to gap rate and slip."""
    kind, arc, j = touch.features

    def turned(along: float, across: float) -> tuple[Jet, Jet]:
        return cosine * along - sine * across, sine * along + cosine * across

    piece = pieces[j]
    sign = float(piece["bend"])
    px, py = -x + piece["qx"], -y + piece["qy"]
    if kind == SIDE_BEND:
        ox, oy = turned(body["ox"][arc], body["oy"][arc])
        sx, sy = turned(body["sx"][arc], body["sy"][arc])
        nx, ny = -ox, -oy
        gap = nx * (sx - px) + ny * (sy - py)
        lx, ly = px + gap * nx, py + gap * ny  # the gap is that of the centre of the bend, seen from the side
    else:
        cx, cy = turned(body["cx"][arc], body["cy"][arc])
        if kind == ARC_BEND:
            dx, dy = cx - px, cy - py
            far = (dx * dx + dy * dy).root()
            nx, ny = sign * (dx / far), sign * (dy / far)
        else:
            nx, ny = x * 0 - piece["ty"], x * 0 + piece["tx"]
        lx, ly = cx - nx * body["r"][arc], cy - ny * body["r"][arc]
    return [nx, ny, ny * lx - nx * ly], [ny, -nx, -(nx * lx) - ny * ly]


def solved(matrix: list[list[Jet]], right: list[Jet]) -> list[Jet]:
    """Solution of linear equations."""
    n = len(right)
    matrix, right = [list(row) for row in matrix], list(right)
    for i in range(n):
        best = max(range(i, n), key=lambda k: abs(matrix[k][i].terms[0]))
        matrix[i], matrix[best], right[i], right[best] = matrix[best], matrix[i], right[best], right[i]
        for k in range(n):
            if k != i:
                share = matrix[k][i] / matrix[i][i]
                matrix[k] = [a - share * b for a, b in zip(matrix[k], matrix[i], strict=True)]
                right[k] = right[k] - share * right[i]
    return [right[i] / matrix[i][i] for i in range(n)]


def dot(one: Sequence[Any], other: Sequence[Any]) -> Any:
    return sum((a * b for a, b in zip(one[1:], other[1:], strict=True)), one[0] * other[0])


def _turn(
    body: Any, pieces: Any, slope: Incline, touches: list[Touch], spin_sign: int, spin_locked: bool, state: list[Jet]
) -> tuple[list[Jet], Course]:
    """Derivatives of the state, and the forces, from the series of the state as far as they are known."""
    x, y, _, u, v, omega, sine, cosine, *gaps = state
    velocity, zero = [u, v, omega], x * 0
    per = [1 / mpf(float(body["mass"]))] * 2 + [1 / mpf(float(body["inertia"]))]
    of = [rows(body, pieces, touch, x, y, sine, cosine) for touch in touches]
    push = [zero, zero, zero]
    normals, forces, load = [zero] * len(touches), [zero] * len(touches), zero
    locks: list[tuple[list[Jet], list[Jet], str, int]] = []  # row, push of a unit of its force, what, who
    for i, touch in enumerate(touches):
        gap_row, slip_row = of[i]
        pull = -touch.slip_sign * touch.friction
        whole = [a + b * (0 if touch.slip_locked else pull) for a, b in zip(gap_row, slip_row, strict=True)]
        if not spin_locked:
            whole[2] = whole[2] - spin_sign * touch.arm
        if touch.gap_locked:
            locks.append((gap_row, whole, "gap", i))
        else:
            normals[i] = gaps[i] * -touch.stiffness
            forces[i] = zero if touch.slip_locked else normals[i] * pull
            load = load + normals[i] * touch.arm
            push = [a + normals[i] * b for a, b in zip(push, whole, strict=True)]
        if touch.slip_locked:
            locks.append((slip_row, slip_row, "slip", i))
    moment = zero if spin_locked else load * -spin_sign
    if spin_locked:
        unit = [zero, zero, zero + 1]
        locks.append((unit, unit, "spin", 0))
    free = [a * b for a, b in zip(push, per, strict=True)]
    free[0], free[1] = free[0] + slope.downhill, free[1] - slope.inward
    if locks:
        matrix = [
            [dot(row, [a * b for a, b in zip(other, per, strict=True)]) for _, other, *_ in locks] for row, *_ in locks
        ]
        drift = [-dot(row, free) - dot([a.derivative() for a in row], velocity) for row, *_ in locks]
        for size, (_, whole, what, i) in zip(solved(matrix, drift), locks, strict=True):
            free = [a + size * b * c for a, b, c in zip(free, whole, per, strict=True)]
            if what == "spin":
                moment = moment + size
            elif what == "slip":
                forces[i] = forces[i] + size
            else:
                normals[i] = size
                if not touches[i].slip_locked:
                    forces[i] = size * (-touches[i].slip_sign * touches[i].friction)
                if not spin_locked:
                    moment = moment - size * (spin_sign * touches[i].arm)
    rates, slips = [dot(pair[0], velocity) for pair in of], [dot(pair[1], velocity) for pair in of]
    ahead = [u, v, omega, *free, cosine * omega, -(sine * omega), *rates]
    return ahead, Course(state[:6], gaps, rates, slips, normals, forces, moment)


def course(
    body: Any,
    pieces: Any,
    slope: Incline,
    pose: Sequence[float],
    velocity: Sequence[float],
    touches: list[Touch],
    spin_sign: int,
    spin_locked: bool,
    terms: int,
) -> Course:
    """Series of the motion, of ``terms`` terms; those of forces have two terms less that are right."""
    with mpmath.workdps(DIGITS):
        phi = mpf(float(pose[2]))
        start = [mpf(float(z)) for z in (*pose, *velocity)] + [mpmath.sin(phi), mpmath.cos(phi)]
        start += [mpf(touch.gap) for touch in touches]
        state = [Jet([first] + [mpf(0)] * (terms - 1)) for first in start]
        for _ in range(terms + 1):
            ahead, found = _turn(body, pieces, slope, touches, spin_sign, spin_locked, state)
            state = [jet.integral(first) for jet, first in zip(ahead, start, strict=True)]
        return found
