"""Random bodies, grounds, laws and launches as people have them: one generator of random numbers for each case."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

import sledenv
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.support import resting_heights
from tests.audit_geometry import BX, BY, SIDE, ground_of, height_at, outline_of, touching_height
from tests.profiles import Case, Profile

Draw = np.random.Generator
LENGTH: Final = 55.0  # [m] of a slope: the finish lies on level ground
END: Final = 50.0  # [m] behind which the ground is level
GRAVITY: Final = 9.81


def log_uniform(rng: Draw, low: float, high: float) -> float:
    """Return a number whose logarithm is uniform."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


# Bodies: each of a size [m], the largest distance of the outline from the mass centre, or nearly so.


def mass_of(rng: Draw, size: float) -> float:
    """Return a mass [kg] from 0.06 to 160, from that of a basket to that of a stone."""
    return log_uniform(rng, max(0.06, 10.0 * size**3), min(160.0, max(0.1, 8000.0 * size**3)))


def sled(rng: Draw, size: float) -> sledenv.Body:
    """A skeleton sled and its rider, who have sizes of their own."""
    low, high = [45.0, 20.0, 1.5, 0.8, 0.08, 10.0, -0.2], [105.0, 50.0, 1.95, 1.2, 0.2, 30.0, 0.2]
    rider, own, tall, length, height, bow, balance = rng.uniform(low, high).tolist()
    return sledenv.sled(rider, own, rider_height=tall, length=length, height=height, bow_radius=bow, balance=balance)


def disc(rng: Draw, size: float) -> sledenv.Body:
    """A uniform disc."""
    return sledenv.disc(mass_of(rng, size), size)


def eccentric_disc(rng: Draw, size: float) -> sledenv.Body:
    """A disc with its mass centre off the middle, by a twentieth to a half of its radius."""
    share, gyration = rng.uniform([0.05, 0.5], [0.5, 0.75]).tolist()
    radius = size / (1.0 + share)
    mass = mass_of(rng, size)
    return sledenv.disc(mass, radius, share * radius, mass * (gyration * radius) ** 2)


def rod(rng: Draw, size: float) -> sledenv.Body:
    """A rod with round ends, from a pole to a fat capsule."""
    return sledenv.rod(mass_of(rng, 0.5 * size), 2.0 * size, 2.0 * size * log_uniform(rng, 0.02, 0.5))


def polygon(rng: Draw, size: float, corners: Any, sharpest: float, roundest: float) -> sledenv.Body:
    """A polygon scaled to a size, its corners rounded by some of that; less where its sides are too short for it."""
    corners = np.array(corners, float)
    corners *= size / np.hypot(*(corners - corners.mean(axis=0)).T).max()
    mass, rounding = mass_of(rng, size), log_uniform(rng, sharpest, roundest) * size
    while True:
        try:
            return sledenv.polygon(mass, corners.tolist(), rounding)
        except ValueError:
            rounding *= 0.5


def wedge(rng: Draw, size: float) -> sledenv.Body:
    """A thin triangle."""
    top, height = rng.uniform([-0.8, 0.1], [0.8, 0.5]).tolist()
    return polygon(rng, size, [(-1.0, 0.0), (1.0, 0.0), (top, height)], 0.003, 0.05)


def crate(rng: Draw, size: float) -> sledenv.Body:
    """A box."""
    height = rng.uniform(0.25, 1.0)
    return polygon(rng, size, [(-1.0, -height), (1.0, -height), (1.0, height), (-1.0, height)], 0.005, 0.2)


def hexagon(rng: Draw, size: float) -> sledenv.Body:
    """A hexagon, regular or flattened."""
    angles, flat = np.arange(6) * math.pi / 3.0, rng.choice([1.0, 0.75])
    return polygon(rng, size, np.column_stack([np.cos(angles), flat * np.sin(angles)]), 0.01, 0.15)


def rock(rng: Draw, size: float) -> sledenv.Body:
    """A polygon with five to ten corners on an ellipse, moved along and across it: what of them is convex."""
    count, flat = int(rng.integers(5, 11)), rng.uniform(0.5, 1.0)
    angles = 2.0 * math.pi * (np.arange(count) + rng.uniform(-0.35, 0.35, count)) / count
    away = rng.uniform(0.8, 1.0, count)
    return polygon(rng, size, convex(np.column_stack([away * np.cos(angles), flat * away * np.sin(angles)])), 0.01, 0.1)


def convex(points: np.ndarray) -> np.ndarray:
    """Leave out points, in their order around the origin, where the polygon does not turn by a hundredth or more."""
    while True:
        before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
        turns = (before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) / np.hypot(*before.T) / np.hypot(*after.T)
        if turns.min() > 0.01:
            return points
        points = np.delete(points, int(turns.argmin()), axis=0)


def hull(rng: Draw, size: float, count: int) -> sledenv.Body:
    """The hull of circles around the mass centre: none of them within the others."""
    mass, gyration, begin = mass_of(rng, size), rng.uniform(0.35, 0.6), rng.uniform(-0.3, 0.3)
    radii = size * np.exp(rng.uniform(math.log(0.03), math.log(0.4), count))
    angles = begin + 2.0 * math.pi * np.arange(count) / count + rng.uniform(-0.2, 0.2, count)
    away = (size - radii) * np.r_[1.0, rng.uniform(0.6, 1.0, count - 1)]
    if count == 2:  # so that the mass centre is within
        angles[1] = angles[0] + math.pi
    circles = np.column_stack([away * np.cos(angles), away * np.sin(angles), radii])
    return sledenv.hull(mass, circles.tolist(), inertia=mass * (gyration * size) ** 2, centre=(0.0, 0.0))


def hull_of_two(rng: Draw, size: float) -> sledenv.Body:
    """A club."""
    return hull(rng, size, 2)


def hull_of_three(rng: Draw, size: float) -> sledenv.Body:
    """A rounded triangle whose corners are unlike."""
    return hull(rng, size, 3)


BODIES: Final[dict[str, Callable[[Draw, float], sledenv.Body]]] = {
    each.__name__: each
    for each in (sled, disc, eccentric_disc, rod, wedge, crate, hexagon, rock, hull_of_two, hull_of_three)
}

# Grounds: for a body of a size [m], launched at x = 0.


def plane(rng: Draw, size: float) -> Profile:
    """The level plane."""
    return []


def surveyed(rng: Draw, spacing: float, heights: Callable[[np.ndarray], np.ndarray], noise: float) -> Profile:
    """Measure heights from -6 m on at distances of about a spacing, with an error; level at both ends."""
    x = np.arange(-6.0, END, spacing)
    y = heights(x) + rng.normal(0.0, 1.0, len(x)) * noise
    y[1:-1] = np.round(y[1:-1], 6)
    return [(float(a), float(b)) for a, b in zip(x, y, strict=True)]


def hills(rng: Draw, size: float) -> Profile:
    """Smooth hills, surveyed every 0.1 to 1 m, every other time with noise of 2 mm."""
    count = int(rng.integers(1, 4))
    lengths, shares = np.exp(rng.uniform(math.log(6.0), math.log(50.0), count)), rng.uniform(0.02, 0.25, count)
    begins = rng.uniform(0.0, 2.0 * math.pi, count)

    def heights(x: np.ndarray) -> np.ndarray:
        waves = 2.0 * math.pi * x[:, np.newaxis] / lengths
        return np.asarray((shares / count * lengths / (2.0 * math.pi) * np.sin(waves + begins)).sum(axis=1))

    return surveyed(rng, log_uniform(rng, 0.1, 1.0), heights, rng.choice([0.0, 0.002]))


def ramps(rng: Draw, size: float, up: float) -> Profile:
    """Level ground with bumps, or with holes where ``up`` is -1; some of them sharp."""
    found, x = [(-6.0, 0.0)], rng.uniform(0.5, 5.0)
    while x < END - 12.0:
        height, face, top, back = rng.uniform([0.02, 0.5, 0.05, 0.5], [0.6, 4.0, 2.0, 4.0]).tolist()
        height *= up * min(1.0, 4.0 * size)
        found += [(x, 0.0), (x + face, height)]
        if rng.random() < 0.7:
            found.append((x + face + top, height * rng.uniform(0.7, 1.2)))
        found.append((x + face + top + back, 0.0))
        x += face + top + back + rng.uniform(0.2, 6.0)
    return found


def bumps(rng: Draw, size: float) -> Profile:
    """Bumps of three or four vertices."""
    return ramps(rng, size, 1.0)


def holes(rng: Draw, size: float) -> Profile:
    """Holes of three or four vertices."""
    return ramps(rng, size, -1.0)


def one_vertex(rng: Draw, size: float) -> Profile:
    """One vertex that turns by 0.001 to 0.5 rad, up or down; the other one is far."""
    turn, x = log_uniform(rng, 0.001, 0.5) * rng.choice([-1.0, 1.0]), rng.uniform(0.2, 6.0)
    return [(x, 0.0), (END, (END - x) * math.tan(turn))]


def dip(rng: Draw, size: float, places: Callable[[int], np.ndarray]) -> Profile:
    """A round dip, cut in pieces, whose lowest point is where the launch is, or ahead."""
    radius, half, count = log_uniform(rng, 1.5 * size, 30.0), rng.uniform(0.1, 0.7), int(rng.integers(3, 32))
    angles = half * places(count)
    middle = rng.choice([0.0, rng.uniform(0.0, min(25.0, 2.0 * radius * math.sin(half)))])
    return [(middle + radius * math.sin(a), radius * (math.cos(half) - math.cos(a))) for a in angles]


def round_dip(rng: Draw, size: float) -> Profile:
    """A symmetric round dip."""
    return dip(rng, size, lambda count: np.linspace(-1.0, 1.0, count))


def skew_dip(rng: Draw, size: float) -> Profile:
    """A round dip cut anywhere."""
    return dip(rng, size, lambda count: np.r_[-1.0, np.sort(rng.uniform(-0.95, 0.95, count)), 1.0])


def v_dip(rng: Draw, size: float) -> Profile:
    """Two faces that meet, every other time of one slope."""
    depth, middle = size * rng.uniform(0.3, 3.0), rng.choice([0.0, rng.uniform(0.0, 4.0)])
    one, other = np.tan(rng.uniform(0.1, 0.75, 2)).tolist()
    other = one if rng.random() < 0.5 else other
    return [(middle - depth / one, 0.0), (middle, -depth), (middle + depth / other, 0.0)]


def stairs(rng: Draw, size: float) -> Profile:
    """Stairs down, with faces of 20 to 60 degrees."""
    step, tread, face = (rng.uniform([0.1, 0.3, 20.0], [1.2, 3.0, 60.0]) * [size, size, math.pi / 180.0]).tolist()
    x, y = rng.uniform(0.0, 2.0), 0.0
    found: Profile = []
    for _ in range(int(rng.integers(1, 25))):
        found += [(x, y), (x + step / math.tan(face), y - step)]
        x, y = found[-1][0] + tread, y - step
        if x > END - 12.0:
            break
    return found


def gaps(rng: Draw, size: float) -> Profile:
    """Trenches with steep faces, from as wide as half of the body to as wide as four of them."""
    found, x = [], rng.uniform(0.2, 4.0)
    for _ in range(int(rng.integers(1, 8))):
        width, depth, face = size * rng.uniform(1.0, 8.0), size * rng.uniform(0.2, 2.0), math.tan(rng.uniform(0.9, 1.3))
        side = min(depth / face, 0.45 * width)
        found += [(x, 0.0), (x + side, -side * face), (x + width - side, -side * face), (x + width, 0.0)]
        x += width + size * rng.uniform(0.5, 10.0)
        if x > END - 12.0:
            break
    return found


GROUNDS: Final[dict[str, Callable[[Draw, float], Profile]]] = {
    each.__name__: each for each in (plane, hills, bumps, holes, one_vertex, round_dip, skew_dip, v_dip, stairs, gaps)
}

# Launches.
FLAT, RESTING, DROPPED, FAST = LAUNCHES = ("flat", "resting", "dropped", "fast")


def flat_poses(body: sledenv.Body) -> list[float]:
    """Orientations [rad] in which the body lies on a side, or on the middle of its flattest arc, first the widest."""
    arcs, _ = outline_of(body)
    found = [(float(arc[SIDE]), math.atan2(-arc[BX], -arc[BY])) for arc in arcs if arc[SIDE] > 0.0]
    flattest = max(range(len(arcs)), key=lambda k: body.arcs[k].radius)
    if body.arcs[flattest].radius > body.size or not found:
        found.append((2.0 * body.size, math.atan2(-arcs[flattest][3], -arcs[flattest][4])))
    return [angle for _, angle in sorted(found, reverse=True)]


def launch_of(rng: Draw, body: sledenv.Body, slope: sledenv.Slope, how: str) -> sledenv.State:
    """Return a launch at x = 0: flat and sliding, at rest, dropped in any pose with spin, or sliding fast."""
    size, tables = body.size, ground_of(slope.profile, slope.rounding or None)
    reach = 0.3 * size
    rise = height_at(*tables, reach) - height_at(*tables, -reach)
    tilt = math.atan2(rise, 2.0 * reach)
    poses = flat_poses(body)
    phi = tilt + poses[0 if rng.random() < 0.7 else rng.integers(len(poses))]
    if how == DROPPED or (how == RESTING and rng.random() < 0.5):
        phi = rng.uniform(-math.pi, math.pi)
    phi = math.remainder(phi, 2.0 * math.pi)
    if slope.rounding:  # the audit has a closed form for sharp ground alone; a launch is no part of it
        (height,) = resting_heights(body.record, np.zeros(1), np.array([phi]), Grounds.of((slope.vertices,))).tolist()
    else:
        height = touching_height(body, slope.profile, 0.0, phi)
    if how == RESTING:
        return sledenv.State(0.0, height, phi)
    if how == DROPPED:
        rates = rng.uniform([-1.0, -3.0, -15.0], [8.0, 1.0, 15.0]).tolist()
        return sledenv.State(0.0, height + log_uniform(rng, 1e-3, 2.0), phi, *rates)
    speed = rng.uniform(0.5, 8.0) if how == FLAT else rng.uniform(8.0, 25.0)
    return sledenv.State(0.0, height, phi, speed * math.cos(tilt), speed * math.sin(tilt), 0.0)


def law_of(rng: Draw, body: sledenv.Body) -> sledenv.ContactLaw:
    """Return a law: the weight presses the body in by 1e-8 to 1e-3 of its size, by 1e-6 or more where nothing damps."""
    elastic, pressed = rng.random() < 0.1, log_uniform(rng, 1e-8, 1e-3)
    friction = [0.0, log_uniform(rng, 0.005, 0.1), rng.uniform(0.1, 1.5)][rng.choice(3, p=[0.25, 0.35, 0.4])]
    arm = body.size * [0.0, log_uniform(rng, 1e-4, 0.05)][rng.integers(2)]
    return sledenv.ContactLaw.from_restitution(
        1.0 if elastic else rng.uniform(0.05, 1.0),
        stiffness=body.mass * GRAVITY / (max(pressed, 1e-6 if elastic else 0.0) * body.size),
        friction=friction,
        rolling_arm=arm,
        corner_rolling_arm=arm,
    )


def rounding_of(rng: Draw, size: float, profile: Profile) -> float | list[float]:
    """Return no radius, every other time; or one for all vertices, or one for each, of which some are 0."""
    largest = log_uniform(rng, 0.02 * size, 30.0)
    several = [float(rng.choice([0.0, log_uniform(rng, 0.02 * size, largest)])) for _ in profile]
    return [0.0, largest, several][rng.choice(3, p=[0.5, 0.25, 0.25])]


def rough_case(seed: int, number: int, *, ground: str | None = None, body: str | None = None) -> Case:
    """Return a case of its own for each seed and number; body and ground are of any kind unless they are given."""
    rng = np.random.default_rng((seed, number))
    kinds = [str(rng.choice(list(of))) for of in (BODIES, GROUNDS, LAUNCHES)]
    kinds = [body or kinds[0], ground or kinds[1], kinds[2]]
    made = BODIES[kinds[0]](rng, log_uniform(rng, 0.06, 1.2))
    law, angle = law_of(rng, made), float(rng.choice([0.0, rng.uniform(0.0, 0.4)], p=[0.2, 0.8]))
    profile = GROUNDS[kinds[1]](rng, made.size)
    rounding = rounding_of(np.random.default_rng((seed, number, 1)), made.size, profile)
    slope = sledenv.Slope(angle, LENGTH, profile=profile, rounding=rounding)
    launch = launch_of(rng, made, slope, kinds[2])
    return Case(f"{', '.join(kinds)}, seed {seed}, number {number}", made, law, slope, launch)


def code_of(case: Case) -> str:
    """Return the Python that simulates a case."""
    slope = case.slope
    lines = [
        "import sledenv",
        "from sledenv import Body, ContactLaw, Slope, State",
        "from sledenv.bodies import Arc, Segment",
        "",
        f"# {case.name}",
        f"body = {case.body.typed()}",
        f"law = {case.law!r}",
        f"slope = Slope({slope.angle!r}, {slope.length!r}, {slope.gravity!r}, profile={list(slope.profile)!r}, "
        f"rounding={list(slope.rounding) or 0.0!r})",
        f"launch = {case.launch!r}",
    ]
    return "\n".join(lines)
