"""Random convex bodies, with corners and without, that come down on a plane, some of them flat and over zones."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

import sledenv
from sledenv.simulation.support import support_height
from tests.profiles import Case
from tests.rough_grounds import hull_of_three, hull_of_two, log_uniform, rock, rod

GRAVITY = 9.81
TURN = 2.0 * math.pi


def segment(rng: np.random.Generator, size: float) -> sledenv.Body:
    """A uniform segment, from a shallow bowl to a disc that lacks a slice."""
    return sledenv.circular_segment(log_uniform(rng, 0.5, 100.0), size, rng.uniform(0.3, 2.9))


def stone(rng: np.random.Generator, size: float) -> sledenv.Body:
    """A polygon with sharp corners on an ellipse."""
    count, mass = int(rng.integers(3, 9)), log_uniform(rng, 0.5, 100.0)
    angles = TURN * (np.arange(count) + rng.uniform(-0.3, 0.3, count)) / count
    return sledenv.polygon(mass, size * np.column_stack([np.cos(angles), rng.uniform(0.3, 1.0) * np.sin(angles)]))


KINDS = (segment, stone, rock, rod, hull_of_two, hull_of_three)


def plane_case(seed: int, *, zoned: bool = False, finish: float = math.inf) -> Case:
    """Return a case of its own for each seed: kinds of bodies take turns, and some numbers are exactly zero.

    A third comes down with one of its sides nearly flat, or exactly so. Zones have friction of their own.
    """
    rng = np.random.default_rng([2024, seed])

    def some(value: Any, share: float) -> float:
        """``value``, or exactly zero in a share of the cases."""
        return 0.0 if rng.random() < share else float(value)

    kind = KINDS[seed % len(KINDS)]
    body = kind(rng, log_uniform(rng, 0.2, 1.0))
    arm, sides = some(rng.uniform(0.0, 0.05) * body.size, 0.3), body.record["side"][0]
    law = sledenv.ContactLaw.from_restitution(
        rng.uniform(0.05, 1.0) if rng.random() < 0.9 else 1.0,
        stiffness=body.mass * log_uniform(rng, 1e4, 1e6),
        friction=some(rng.uniform(0.0, 0.8), 0.15),
        rolling_arm=arm,
        corner_rolling_arm=arm,
    )
    phi, drop, spin = rng.uniform(-math.pi, math.pi), log_uniform(rng, 0.01, 1.0), 3.0 / body.size
    if rng.random() < 1.0 / 3.0 and np.any(sides > 0.0):
        flat = float(body.record["high"][0, rng.choice(np.flatnonzero(sides > 0.0))])
        phi, drop, spin = flat + some(0.1 * rng.normal(), 0.3), min(drop, 0.3), 0.1 * spin
    phi = math.remainder(phi, TURN)
    u, v, omega = some(rng.uniform(-5.0, 5.0), 0.1), some(rng.uniform(-3.0, 2.0), 0.1), some(rng.normal() * spin, 0.2)
    launch = sledenv.State(0.0, support_height(body, phi) + drop, phi, u, v, omega)
    slope = sledenv.Slope(some(rng.uniform(-0.5, 0.5), 0.1), finish, GRAVITY)
    if zoned:
        touches = sledenv.simulate(body, law, slope, launch, max_time=3.0, max_rebounds=3).rebounds
        edges = rng.normal(touches["x_contact"].mean() if len(touches) else 0.0, body.size, 5)
        zones = [
            sledenv.Zone(begin, end, some(rng.uniform(0.0, 0.8), 0.2), own := some(0.03 * body.size, 0.5), own)
            for begin, end in pairwise(np.sort(edges).tolist())
            if rng.random() < 0.8
        ]
        slope = slope._replace(zones=zones)
    return Case(f"{kind.__name__}, seed {seed}", body, law, slope, launch)


def mirrored(case: Case) -> Case:
    """Return the same seen from the other side of the picture."""
    body, slope, (x, y, phi, u, v, omega) = case.body, case.slope, case.launch
    if not isinstance(body, sledenv.bodies.Segment):
        arcs = []
        for k, arc in enumerate(body.arcs):
            begin = -body.arcs[(k + 1) % len(body.arcs)].begin
            begin = -math.pi if begin == math.pi else begin
            arcs.append(arc._replace(x=-arc.x, begin=begin, side=body.arcs[k - 1].side))
        body = sledenv.Body(body.mass, body.inertia, sorted(arcs, key=lambda arc: arc.begin))
    image = sledenv.Slope(
        -slope.angle,
        gravity=slope.gravity,
        zones=[zone._replace(begin=-zone.end, end=-zone.begin) for zone in slope.zones[::-1]],
        profile=[(-x, y) for x, y in slope.profile[::-1]],
    )
    return Case(case.name, body, case.law, image, sledenv.State(-x, y, -phi, -u, v, -omega))
