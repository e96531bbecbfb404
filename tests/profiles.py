"""Random rounded bodies, profiles, laws and launches over them, each from one generator of random numbers."""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

import sledenv
from tests.profile_springs import resting_height

Profile = list[tuple[float, float]]

BODIES: Final[dict[str, sledenv.Body]] = {
    "sled": sledenv.sled(),
    "triangle": sledenv.polygon(50.0, [(-0.5, -0.3), (0.5, -0.3), (0.0, 0.6)], rounding=0.05),
    "block": sledenv.polygon(50.0, [(-0.5, -0.3), (0.5, -0.3), (0.5, 0.3), (-0.5, 0.3)], rounding=0.05),
    "disc": sledenv.disc(20.0, 0.3),
    "hexagon": sledenv.polygon(
        30.0, [(0.4 * math.cos(a), 0.3 * math.sin(a)) for a in np.arange(6) * math.pi / 3.0], rounding=0.03
    ),
}
LEVEL: Final[Profile] = [(0.0, 0.0), (1.0, 0.0)]
START, END = -9.0, 60.0  # [m] of random profiles; both ends are level with the plane
LENGTH = 55.0  # [m] of a slope: the finish lies on level ground


def bumps(rng: np.random.Generator) -> Profile:
    """Level ground with bumps of four vertices."""
    found, x = [(START, 0.0)], rng.uniform(2.0, 5.0)
    while x < 34.0:
        height, face, top, back = rng.uniform([0.1, 1.0, 0.1, 1.0], [0.9, 4.0, 1.5, 4.0]).tolist()
        found += [(x, 0.0), (x + face, height), (x + face + top, height * rng.uniform(0.7, 1.2))]
        found.append((x + face + top + back, 0.0))
        x += face + top + back + rng.uniform(0.2, 6.0)
    return [*found, (END, 0.0)]


def dips(rng: np.random.Generator) -> Profile:
    """Level ground with hollows of one to four vertices."""
    found, x = [(START, 0.0)], rng.uniform(1.0, 3.0)
    while x < 34.0:
        width, depth, vertices = rng.uniform(2.0, 8.0), rng.uniform(0.05, 0.6), int(rng.integers(1, 5))
        found.append((x, 0.0))
        for k in range(1, vertices + 1):
            share = k / (vertices + 1)
            found.append((x + share * width, -4.0 * share * (1.0 - share) * depth))
        found.append((x + width, 0.0))
        x += width + rng.uniform(0.2, 4.0)
    return [*found, (END, 0.0)]


def hills(rng: np.random.Generator) -> Profile:
    """Vertices at random distances with random grades: crests and dips in any order."""
    found, x, y = [(START, 0.0)], rng.uniform(-1.0, 2.0), 0.0
    while x < 34.0:
        found.append((x, y))
        step = rng.uniform(0.3, 3.0)
        x, y = x + step, y + step * rng.uniform(-0.35, 0.35) - 0.1 * y
    last_x, last_y = found[-1]
    return [*found, (max(x, last_x + abs(last_y)), 0.0), (END, 0.0)]  # at most 45 degrees down to the level


def no_profile(rng: np.random.Generator) -> Profile:
    """Return no vertex: the plane."""
    return []


class Case(NamedTuple):
    """A launch and what it meets."""

    name: str
    body: sledenv.Body
    law: sledenv.ContactLaw
    slope: sledenv.Slope
    launch: sledenv.State


def zones(rng: np.random.Generator, begin: float = -5.0) -> list[sledenv.Zone]:
    """Up to four zones, some of which have restitution and stiffness of their own."""
    found: list[sledenv.Zone] = []
    for _ in range(rng.integers(0, 5)):
        begin += rng.uniform(0.0, 4.0)
        end = begin + rng.uniform(0.2, 6.0)
        own: dict[str, Any] = {}
        if rng.random() < 0.5:
            own["restitution"] = rng.uniform(0.1, 1.0)
        if rng.random() < 0.5:
            own["stiffness"] = 10.0 ** rng.uniform(6.0, 8.0)
        found.append(sledenv.Zone(begin, end, rng.choice([0.0, 0.1, 0.6]), rng.choice([0.0, 0.01]), **own))
        begin = end
    return found


def random_case(
    seed: tuple[int, int],
    *,
    elastic: bool = False,
    zoned: bool = False,
    planes: bool = True,
    steepest: float = 0.25,
    stiffness: tuple[float, float] = (1e6, 1e8),
    length: float = LENGTH,
) -> Case:
    """Return a case of its own for each seed; ``elastic`` is without losses."""
    rng = np.random.default_rng(seed)
    kind = list(BODIES)[rng.integers(len(BODIES))]
    grounds = [bumps, dips, hills, *([no_profile] if planes else [])]
    ground = grounds[rng.integers(len(grounds))]
    profile = ground(rng)
    friction, arm = rng.choice([0.0, 0.02, 0.3, 1.0]), rng.choice([0.0, 0.002, 0.02])
    restitution = rng.uniform(0.05, 0.9)
    if elastic:
        friction, arm, restitution = 0.0, 0.0, 1.0
    law = sledenv.ContactLaw.from_restitution(
        restitution,
        stiffness=10.0 ** rng.uniform(*np.log10(stiffness)),
        friction=float(friction),
        rolling_arm=float(arm),
        corner_rolling_arm=float(arm),
    )
    parts = zones(rng) if zoned else []
    slope = sledenv.Slope(rng.uniform(0.0, steepest), length, zones=parts, profile=profile)
    phi, drop = rng.uniform(-3.0, 3.0), rng.uniform(0.0, 1.0)
    height = resting_height(BODIES[kind], profile or LEVEL, 0.0, phi) + drop
    rates = rng.uniform([0.0, -3.0, -6.0], [10.0, 1.0, 6.0])
    launch = sledenv.State(0.0, height, phi, *rates.tolist())
    return Case(f"{kind}, {ground.__name__}, seed {seed}", BODIES[kind], law, slope, launch)


def gravity_of(slope: sledenv.Slope) -> tuple[float, float]:
    """Gravity [m/s^2] along and normal to the slope's plane."""
    return slope.gravity * math.sin(slope.angle), -slope.gravity * math.cos(slope.angle)
