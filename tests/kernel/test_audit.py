"""Random descents under audit; and the audit itself: its geometry, and whether it finds faults that are planted."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from numba import njit

import sledenv
from tests.audit import SLOW, audit, audited, look
from tests.audit_geometry import (
    BX,
    SIDE,
    deeper,
    ground_of,
    measure_all,
    outline_of,
    touching_height,
)
from tests.profiles import BODIES as PLAIN_BODIES
from tests.profiles import Profile, bumps, dips, hills
from tests.rough_grounds import code_of, rough_case

# Random dips are cut as finely as they come.
pytestmark = [pytest.mark.jit_only, pytest.mark.filterwarnings("ignore:.*too finely:UserWarning")]

FAST, MANY = 31, 32  # seeds


# Random descents.


def faulty(seed: int, numbers: range, **options: Any) -> list[str]:
    """Return what is wrong with descents."""
    found = []
    for number in numbers:
        case = rough_case(seed, number)
        faults = audited(case, **options).faults
        found += [f"{case.name}: {'; '.join(map(str, faults))}"] if faults else []
    return found


@pytest.mark.parametrize("chunk", range(20))
def test_descents_have_no_fault(chunk: int) -> None:
    """Oracle: geometry, Newton's law and the law of the contact, tests/audit.py."""
    assert faulty(FAST, range(50 * chunk, 50 * (chunk + 1))) == []


# Kinds of faults of which some are left: docs/physics.md, section 12.8.
LEFT = (
    *("beside the ground", "outline", "spring in a step", "springs at once", "depth", "driving friction", "forces"),
    *("jump of velocity", "buried too early", "step_budget"),
)


@pytest.mark.slow
def test_of_many_descents_few_have_a_fault_and_none_a_grave_one() -> None:
    """Oracle: geometry, Newton's law and the law of the contact, tests/audit.py; none takes seconds.

    None is in the air or under the ground, has a load that pulls or an open ledger; 30 of them may have another fault.
    """
    found = {}
    for number in range(30_000):
        case = rough_case(MANY, number)
        if faults := audited(case, most_steps=2000, seconds=SLOW).faults:
            found[case.name] = [str(fault) for fault in faults]
    grave = {name: told for name, told in found.items() if not all(one.split(":")[0] in LEFT for one in told)}
    assert grave == {}
    assert len(found) <= 30, found


def test_a_case_can_be_told_as_code() -> None:
    """Oracle: the code, run, makes the same body, law, slope and launch; each number has a case of its own."""
    for number in range(40):
        case = rough_case(5, number)
        told: dict[str, Any] = {}
        exec(code_of(case), told)  # its own text
        assert [told[name] for name in ("body", "law", "slope", "launch")] == list(case[1:])
    assert rough_case(5, 3) == rough_case(5, 3) != rough_case(5, 4)
    assert "sled, hills" in rough_case(5, 3, ground="hills", body="sled").name


# Faults that are planted.


@cache
def ride() -> sledenv.simulation.Descent:
    """Return a crate that slides, turns over and flies over a bump and comes to rest in a dip."""
    corners = [(-0.3, -0.2), (0.3, -0.2), (0.3, 0.2), (-0.3, 0.2)]
    law = sledenv.ContactLaw.from_restitution(
        0.5, stiffness=1e6, friction=0.3, rolling_arm=0.002, corner_rolling_arm=0.002
    )
    profile = [(1.0, 0.0), (2.0, 0.3), (2.5, 0.3), (4.0, -0.1), (5.0, 0.1), (6.5, 0.0)]
    slope, launch = sledenv.Slope(0.2, 20.0, profile=profile), sledenv.State(0.0, 0.6, 0.3, 4.0, -1.0, 2.0)
    crate = sledenv.polygon(12.0, corners, rounding=0.03)
    return sledenv.simulate(crate, law, slope, launch, max_time=3.0, record="trajectory")


def alone(trajectory: np.ndarray) -> np.ndarray:
    """Which rows have one contact that slides under load."""
    return np.asarray((trajectory["touching"] == 1) & (trajectory["slip"] != 0) & (trajectory["normal"] > 50.0))


def begins(trajectory: np.ndarray, count: int) -> int:
    """Return a row in which a step begins after a step, both with so many contacts under load."""
    t, touching, load = trajectory["t"], trajectory["touching"], trajectory["contacts"]["normal"]
    goes_on = (t[1:] == t[:-1]) & (touching[1:] == count) & (touching[:-1] == count)
    loaded = (load[1:, :count] > 20.0).all(axis=1) & (load[:-1, :count] > 20.0).all(axis=1)
    known = ~np.isnan(look(ride()).offsets[:, :count]).any(axis=1)
    return int(np.flatnonzero(goes_on & loaded & known[1:] & known[:-1])[0]) + 1


def step(trajectory: np.ndarray, count: int) -> slice:
    """Return the rows of a step with so many contacts under load."""
    first = begins(trajectory, count)
    return slice(first, first + 9)


def in_flight(trajectory: np.ndarray) -> int:
    """Return the second row of a flight that is recorded by three rows or more."""
    flying = trajectory["touching"] == 0
    return int(np.flatnonzero(flying[1:-1] & flying[:-2] & flying[2:])[0]) + 1


def before_touching(trajectory: np.ndarray) -> Any:
    """Return the last rows of all flights."""
    return np.flatnonzero((trajectory["touching"][:-1] == 0) & (trajectory["touching"][1:] > 0))


def upright(trajectory: np.ndarray) -> Any:
    """Return the rows with one contact, on level ground."""
    return alone(trajectory) & (trajectory["contacts"]["normal_x"][:, 0] == 0.0)


def spins(trajectory: np.ndarray) -> Any:
    """Return the rows with one contact of a body that spins."""
    return alone(trajectory) & (np.abs(trajectory["omega"]) > 0.1)


def touches(trajectory: np.ndarray) -> Any:
    return trajectory["touching"] > 0


# What is wrong: in which rows, which field, of contacts if it begins with "at", times what, plus what; what is found.
PLANTED: dict[str, tuple[Callable[[np.ndarray], Any], str, float, float, str]] = {
    "the body is lifted by 3 mm": (touches, "y", 1.0, 0.003, "spring"),
    "the body is sunk by 3 mm": (touches, "y", 1.0, -0.003, "depth"),
    "the body is sunk by more than a quarter of its size": (lambda t: ..., "y", 1.0, -0.15, "not buried"),
    "the body is in the ground before it touches": (before_touching, "y", 1.0, -0.1, "depth in flight"),
    "points touch above the ground": (alone, "at y", 1.0, 1e-6, "beside the ground"),
    "points touch in the air": (alone, "at y", 1.0, 1e-2, "air"),
    "points touch under the ground": (alone, "at y", 1.0, -1e-3, "under the ground"),
    "points touch where the body is not": (alone, "at x", 1.0, 1e-5, "outline"),
    "normals are turned": (upright, "at normal_x", 1.0, 1e-6, "normal"),
    "a load pulls": (lambda t: np.flatnonzero(alone(t))[:5], "at normal", -1.0, 0.0, "pull"),
    "a load is more than its spring gives": (alone, "at normal", 1.001, 0.0, "spring"),
    "friction is larger by 1 %": (alone, "at tangential", 1.01, 0.0, "friction"),
    "friction drives": (alone, "at tangential", -1.0, 0.0, "driving friction"),
    "rolling resistance is larger by 1 %": (alone, "rolling", 1.01, 0.0, "rolling"),
    "rolling resistance drives": (spins, "rolling", -1.0, 0.0, "driving friction"),
    "one of two loads is off once": (
        lambda t: (begins(t, 2) + 4, 0),
        "at normal",
        1.0001,
        0.0,
        "spring in a step",
    ),
    "two springs give way at once": (lambda t: step(t, 2), "at normal", 0.95, 0.0, "springs at once"),
    "friction does not move the body": (lambda t: step(t, 1), "at tangential", 0.9, 0.0, "forces"),
    "a place is off by 10 nm in one row": (lambda t: begins(t, 1) + 4, "x", 1.0, 1e-8, "velocities"),
    "a body is pushed in flight": (lambda t: slice(in_flight(t), None), "u", 1.0, 1e-4, "forces"),
    "a body stops dead": (lambda t: step(t, 1), "u", 0.0, 0.0, "jump of velocity"),
    "a body jumps by a micrometre": (lambda t: slice(begins(t, 1), None), "x", 1.0, 1e-6, "jump of place"),
    "energy is won": (lambda t: t["t"] > 1.0, "u", 1.1, 0.0, "energy"),
    "time runs backwards": (lambda t: 100, "t", 1.0, -1e-3, "time"),
    "loads and their sum differ": (lambda t: 100, "normal", 1.0, 0.1, "sums"),
    "a velocity overflows": (lambda t: 100, "u", 1.0, math.inf, "not finite"),
}


def kinds(descent: sledenv.simulation.Descent, **changes: Any) -> set[str]:
    """Return the kinds of faults that are found in a descent after some changes."""
    return {fault.kind for fault in audit(dataclasses.replace(descent, **changes)).faults}


def test_a_good_descent_has_no_fault() -> None:
    """Oracle: a crate that slides, turns over, flies, and rests with three contacts."""
    found = audit(ride())
    assert found.faults == []
    assert found.counts["rows"] == len(ride().trajectory) > 1000
    assert set(ride().trajectory["touching"].tolist()) == {0, 1, 2, 3}


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_fault_is_found(name: str) -> None:
    """Oracle: a good descent, with what is planted in its trajectory."""
    rows_of, what, factor, amount, kind = PLANTED[name]
    trajectory = ride().trajectory.copy()
    table, field = trajectory["contacts"] if what.startswith("at ") else trajectory, what.removeprefix("at ")
    which = rows_of(trajectory)
    table[field][which] = table[field][which] * factor + amount
    if what in ("at normal", "at tangential"):
        trajectory[field] = table[field].sum(axis=1)
    assert kind in kinds(ride(), trajectory=trajectory)


def test_the_end_of_a_descent_is_audited() -> None:
    """Oracle: a good descent with another end."""
    descent, energy = ride(), ride().energy
    sunk = descent.trajectory.copy()
    sunk["y"][-1] -= 0.01
    assert kinds(descent, status=sledenv.Status.STEP_BUDGET) == {"step_budget"}
    assert kinds(descent, status=sledenv.Status.BURIED) == {"buried too early"}
    assert "finish under the ground" in kinds(descent, status=sledenv.Status.FINISH, trajectory=sunk)
    assert kinds(descent, energy=energy._replace(sliding=energy.sliding + 1e-5)) == {"ledger"}
    assert "loss below zero" in kinds(descent, energy=energy._replace(rolling=-1e-6))
    assert "energy of the state" in kinds(descent, energy=energy._replace(kinetic=energy.kinetic + 1e-3))
    assert kinds(descent, state=sledenv.State.found([math.nan] * 6)) == {"not finite"}


# Geometry.


def measured(body: sledenv.Body, profile: Profile, pose: tuple[float, ...], radii: list[float] | None = None) -> Any:
    """Return how deep the outline, crests and the mass centre are."""
    out = np.zeros((1, 3))
    measure_all(*outline_of(body), *ground_of(profile, radii), body.size, np.array([pose]), out)
    return out[0]


def outline_points(body: sledenv.Body, count: int) -> np.ndarray:
    """Return points of an outline, so many of each arc and each side."""
    arcs, found = outline_of(body).arcs, []
    for k, arc in enumerate(body.arcs):
        after = body.arcs[(k + 1) % len(body.arcs)]
        angles = np.linspace(arc.begin, after.begin + (2.0 * math.pi if k == len(body.arcs) - 1 else 0.0), count)
        found.append(np.column_stack([arc.x - arc.radius * np.sin(angles), arc.y - arc.radius * np.cos(angles)]))
        if arcs[k, SIDE] > 0.0:
            end = np.array([after.x, after.y]) + after.radius * arcs[k, BX : BX + 2]
            found.append(found[-1][-1] + np.linspace(0.0, 1.0, count)[:, np.newaxis] * (end - found[-1][-1]))
    return np.vstack(found)


@njit(cache=True)
def deepest_of(pieces: Any, bends: Any, points: Any, x: float, y: float, phi: float) -> float:
    deepest, S, C = 0.0, math.sin(phi), math.cos(phi)
    for px, py in points:
        deepest = deeper(pieces, bends, x + C * px - S * py, y + S * px + C * py, deepest)
    return deepest


@pytest.mark.parametrize("count", [12, pytest.param(300, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", PLAIN_BODIES)
def test_depths_are_those_of_a_dense_outline(kind: str, count: int) -> None:
    """Oracle: thousands of points of the outline, on sharp and on rounded ground, from a touch to a deep press."""
    body, points, rng = PLAIN_BODIES[kind], outline_points(PLAIN_BODIES[kind], 4001), np.random.default_rng(7)
    apart = np.hypot(*np.diff(points, axis=0).T).max()
    for number in range(count):
        profile = (hills, bumps, dips)[number % 3](rng)
        radii = rng.choice([0.0, 0.05, 0.3, 2.0, 20.0], len(profile)).tolist() if number % 2 else None
        ground, x, phi = ground_of(profile, radii), rng.uniform(0.0, 20.0), rng.uniform(-3.0, 3.0)
        high = touching_height(body, profile, x, phi)
        for sunk in (1e-6, 1e-3, 0.02):
            depth, crest, _ = measured(body, profile, (x, high - sunk, phi), radii)
            dense = deepest_of(*ground, points, x, high - sunk, phi)
            assert dense - 1e-12 <= max(depth, crest), (number, sunk)
            assert depth <= dense + 0.5 * apart, (number, sunk)
            assert crest <= sunk + 1e-12
