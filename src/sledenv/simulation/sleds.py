"""A skeleton sled with its rider: outline, mass centre and inertia from the parts of both."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from sledenv.simulation.bodies import Body
from sledenv.simulation.outlines import Arc, bulged, hull_of_circles, shifted
from sledenv.simulation.rules import MEASURE, Rule, checked

RUNNER, FRAME, LEGS, RIDER = "runner", "frame", "legs", "rider"  # parts of a sled
_CAP = 0.03  # [m] radius of the round ends of the runners, assumed


class _Limb(NamedTuple):
    """A part of the rider: a stadium of some length and thickness, lying along the sled."""

    part: str  # of the body
    share: float  # of the mass of the rider
    start: float  # of the height of the rider, from the soles: where it begins
    end: float  # and ends
    thickness: float  # [m]


# Shares of mass and lengths of D. A. Winter, Biomechanics and Motor Control of Human Movement, 4th ed., table 4.1 and
# fig. 4.1: head and neck 0.081, trunk 0.497, arms 0.1, thighs 0.2, shanks and feet 0.122. Arms lie beside the trunk,
# the head is lifted no higher than the shoulders. Thicknesses are assumed.
_LIMBS: Final = (
    _Limb(LEGS, 0.122, 0.00, 0.285, 0.11),
    _Limb(LEGS, 0.200, 0.285, 0.53, 0.17),
    _Limb(RIDER, 0.597, 0.53, 0.82, 0.24),
    _Limb(RIDER, 0.081, 0.82, 1.00, 0.24),
)
Circle = tuple[float, float, float]  # x, y and radius [m]
_BALANCE: Rule = (lambda v: abs(v) < 1.0, "in (-1, 1)")


def sled(
    rider_mass: float = 80.0,
    sled_mass: float = 40.0,
    *,
    rider_height: float = 1.75,
    length: float = 0.95,
    height: float = 0.10,
    bow_radius: float = 15.0,
    balance: float = 0.0,
    drag_area: float = 0.0,
) -> Body:
    """Return a skeleton sled with its rider, who lies on it head first: docs/physics.md, section 8.

    The runners are an arc with round ends, and the outline is the hull of sled and rider. Its parts are "runner",
    "frame", "legs" and "rider"; the slope may touch each of them. Legs may touch it as a brake does, the rider should
    not. Mass centre and inertia follow from the parts of both.

    Parameters
    ----------
    rider_mass, sled_mass : float
        [kg], > 0. Rules of the sport allow 120 kg together (men) and 102 kg (women).
    rider_height : float
        From sole to crown [m], > 0.
    length : float
        Of the sled [m], > 0; 0.8 to 1.2 m by the rules of the sport.
    height : float
        Of its deck above the ends of the runners [m], > 0; 0.08 to 0.2 m.
    bow_radius : float
        Radius of the arc to which the runners are bent [m]. Athletes set it; 10 to 30 m, assumed.
    balance : float
        How far the mass centre of the rider lies in front of the middle of the runners, over half the length of the
        sled, in (-1, 1): the balance point that athletes tune.
    drag_area : float
        [m^2], as of :class:`Body`; 0 by default.

    Returns
    -------
    Body
        At phi = 0 it stands on the middle of its runners, with the head downhill.

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range.
    """
    owner = "sled"
    given = {
        "rider_mass": rider_mass,
        "sled_mass": sled_mass,
        "rider_height": rider_height,
        "length": length,
        "height": height,
        "bow_radius": bow_radius,
    }
    given = {name: checked(owner, name, value, MEASURE) for name, value in given.items()}
    balance = checked(owner, "balance", balance, _BALANCE)
    half, deck = 0.5 * given["length"], given["height"]
    for name, value, least in (("length", length, 4.0 * _CAP), ("height", height, _CAP)):
        if not value > least:
            raise ValueError(f"{owner}.{name} = {value!r}: must be in ({least:g}, 1e+50] m")
    limbs = _laid(given["rider_height"], deck, balance * half)
    corners = [(x, y) for x in (_CAP - half, half - _CAP) for y in (_CAP, deck)]
    circles = [(x, y, _CAP, RUNNER if y == _CAP else FRAME) for x, y in corners]
    circles += [(*circle, limb.part) for limb, *ends in limbs for circle in ends]
    table = np.array([circle[:3] for circle in circles])
    parts = [circle[3] for circle in circles]
    arcs = hull_of_circles(table, parts, [part if part in (LEGS, RIDER) else FRAME for part in parts])
    arcs = _on_runners(arcs, given["bow_radius"])
    weights = [(given["sled_mass"], 0.0, 0.5 * deck, (given["length"] ** 2 + deck**2) / 12.0)]
    weights += [(limb.share * given["rider_mass"], *_middle(ends)) for limb, *ends in limbs]
    mass = sum(weight for weight, *_ in weights)
    x, y = (sum(weight[0] * weight[i] for weight in weights) / mass for i in (1, 2))
    inertia = sum(weight * ((a - x) ** 2 + (b - y) ** 2 + own) for weight, a, b, own in weights)
    return Body(mass, inertia, shifted(arcs, -x, -y), drag_area)


def _laid(rider_height: float, deck: float, forward: float) -> list[tuple[_Limb, Circle, Circle]]:
    """Each limb with the circles at its ends; ``forward`` [m] is where the rider's mass centre lies."""
    middle = sum(limb.share * 0.5 * (limb.start + limb.end) for limb in _LIMBS) * rider_height
    laid = []
    for limb in _LIMBS:
        r = 0.5 * limb.thickness
        start, end = limb.start * rider_height - middle + forward, limb.end * rider_height - middle + forward
        laid.append((limb, (start + r, deck + r, r), (end - r, deck + r, r)))
    return laid


def _middle(ends: list[Circle]) -> tuple[float, float, float]:
    """Middle x, y [m] of a limb, and the square of its own radius of gyration [m^2]."""
    (x, y, r), (other, _, _) = ends
    length = other - x + 2.0 * r
    return 0.5 * (x + other), y, (length * length + 4.0 * r * r) / 12.0


def _on_runners(arcs: tuple[Arc, ...], bow_radius: float) -> tuple[Arc, ...]:
    """Bend the straight side between the ends of the runners."""
    following = [*arcs[1:], arcs[0]]
    sides = [k for k, arc in enumerate(arcs) if arc.part == following[k].part == RUNNER]
    if len(sides) != 1:
        raise ValueError("sled: the runners must be on the outline: the rider is too large, or lies too far off")
    (k,) = sides
    try:
        return bulged(arcs, k, bow_radius, RUNNER)
    except ValueError as error:
        wanted = "must be large enough for an arc between the ends of the runners"
        raise ValueError(f"sled.bow_radius = {bow_radius!r}: {wanted}") from error
