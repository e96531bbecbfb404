"""The work that is timed: the reference descent, known to 32 digits, with the error of an answer; random launches."""

from __future__ import annotations

import json
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import sledenv
from perf.harness import ROOT, Floats

_RECORD: dict[str, Any] = json.loads((ROOT / "tests" / "data" / "reference_descent.json").read_text())["reference"]
_GIVEN: dict[str, float] = _RECORD["parameters"]
_REBOUNDS = _RECORD["rebounds"]  # extended precision, from the same double inputs


class Disc(NamedTuple):
    """The body as plain numbers, which compiled functions read."""

    mass: float
    radius: float
    eccentricity: float
    inertia: float


DISC = Disc(*(_GIVEN[name] for name in Disc._fields))
_segment: Any = getattr(sledenv, "segment", sledenv.Body)  # older trees have no other body
BODY: sledenv.Segment = _segment(*DISC)
LAW = sledenv.ContactLaw(_GIVEN["stiffness"], _GIVEN["asymmetry"], _GIVEN["friction"], _GIVEN["rolling_arm"])
SLOPE = sledenv.Slope(_GIVEN["slope"], gravity=_GIVEN["gravity"])
LAUNCH = sledenv.State(**_RECORD["state"])
DOWNHILL, INWARD = SLOPE.gravity * math.sin(SLOPE.angle), SLOPE.gravity * math.cos(SLOPE.angle)
EXACT: Floats = np.array([[float(row[name]) for name in ("u", "v", "omega")] for row in _REBOUNDS])  # after each
TIMES: Floats = np.array([float(row["time"]) for row in _REBOUNDS])
FEW, MANY = 5, 20  # rebounds; the seventh of the many settles and rolls for .59 s


def settings(**fields: Any) -> dict[str, Any]:
    """Return the arguments by which batches and rides are told how to simulate; older trees take them one by one."""
    return {"settings": sledenv.Settings(**fields)} if hasattr(sledenv, "Settings") else fields


def launches(lanes: int, seed: int = 0) -> Floats:
    """Random launches of the reference's disc, shape (lanes, 6)."""
    rng = np.random.default_rng(seed)
    phi = rng.uniform(-math.pi, math.pi, lanes)
    lowest = BODY.radius - BODY.eccentricity * np.cos(phi)
    drop, u, v, spin = (rng.uniform(*ends, lanes) for ends in ((0.05, 0.5), (0.0, 3.0), (-1.0, 0.0), (-8.0, 8.0)))
    return np.column_stack([np.zeros(lanes), lowest + drop, phi, u, v, spin])


def contexts(scenario: str, lanes: int, seed: int = 0, **bounds: tuple[float, float]) -> Floats:
    """Random contexts of a scenario, shape (lanes, 12); some fields within other bounds than its own."""
    rng = np.random.default_rng(seed)
    names = sledenv.Context._fields
    found = sledenv.load_scenario(scenario).contexts(rng.random((lanes, len(names))))
    for name, ends in bounds.items():
        found[:, names.index(name)] = rng.uniform(*ends, lanes)
    return found


def problem(name: str, contexts: Floats) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """Body, laws, slopes and launches of contexts of a scenario, and the fields of its settings."""
    scenario = sledenv.load_scenario(name)
    fields: dict[str, Any] = {
        "max_time": scenario.limits.max_time_s,
        "max_rebounds": scenario.limits.max_rebounds,
        "end_on_chord": scenario.ends.on_chord,
    }
    if scenario.ends.touching is not None:
        fields["end_touching"] = scenario.ends.touching
    if scenario.slope_section.run_out_m > 0.0:
        fields["run_out"] = scenario.slope_section.run_out_m
    if hasattr(scenario.limits, "tolerance"):
        fields["tolerance"] = scenario.limits.tolerance
    bodies, laws, slopes, states = zip(
        *[given_in(scenario, sledenv.Context(*row)) for row in contexts.tolist()], strict=True
    )
    plane = not any(getattr(slope, "profile", ()) for slope in slopes)
    table = [[*slope[:3], *(number for zone in slope.zones for number in zone)] for slope in slopes]  # None becomes NaN
    return (bodies[0], np.array(laws), np.array(table, float) if plane else list(slopes), np.array(states)), fields


def given_in(scenario: Any, context: sledenv.Context) -> tuple[Any, ...]:
    """Body, law, slope and launch of a context; older trees give them one by one."""
    if hasattr(scenario, "given"):
        return tuple(scenario.given(context))
    return scenario.body(), scenario.law(context), scenario.slope(context), scenario.launch(context)


def errors(velocities: ArrayLike) -> Floats:
    """Error of the velocities (u, v, omega) after each of the first n rebounds, arrays of shapes (n,) and (n, 3).

    It is the length of the difference of (u, v, r omega) over that of the exact one, or 1 where there is no number.
    """
    weights = np.array([1.0, 1.0, BODY.radius])
    found = np.asarray(velocities, dtype=float).reshape(-1, 3)
    exact = EXACT[: len(found)]
    error: Floats = np.linalg.norm((found - exact) * weights, axis=1) / np.linalg.norm(exact * weights, axis=1)
    return np.where(np.isfinite(error), error, 1.0)


def worst(velocities: ArrayLike, rebounds: int) -> float:
    """Largest error of the first ``rebounds`` rebounds; 1 if some are missing."""
    found = np.asarray(velocities, dtype=float).reshape(-1, 3)[:rebounds]
    return float(errors(found).max()) if len(found) == rebounds else 1.0
