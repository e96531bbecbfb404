"""One table of wrong inputs: each is refused by argument, value and what is allowed, not in Python's own words."""

from __future__ import annotations

import functools
import math
import os
import re
import reprlib
from collections import namedtuple
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import sledenv
from sledenv import Body, ContactLaw, Settings, Slope, State, Zone, plot
from sledenv.agents import land_flat, land_parallel
from sledenv.agents.clairvoyant import best_rides
from sledenv.benchmark.oracle import best_launches, jam_map, rewards_of
from sledenv.benchmark.problem import Problem
from sledenv.bodies import Arc
from sledenv.closed_forms.equilibrium import static_jam_angles
from sledenv.envs.descent import SledDescent
from sledenv.envs.launch import SledLaunch
from sledenv.envs.sb3 import SledVecEnv, make_vec_env
from sledenv.envs.vector import SledLaunchVector
from sledenv.identification.tracks import identify_tracks
from sledenv.scenarios import Track, load_track
from sledenv.scenarios.scenario import Context, Scenario, load_scenario
from sledenv.simulation import simulator
from sledenv.simulation.outlines import bulged
from sledenv.simulation.shapes import lamina
from sledenv.simulation.smoothing import fit_ground
from tests.own_scenarios import DELETE, POLYGON, changed

NAN, INF, TINY = math.nan, math.inf, -1e-300
NO_NUMBERS = "steep", b"1", None, True, 1j, [1.0], {}, np.array("1"), np.ma.masked, np.True_
NO_NUMBERS += Decimal(1), bytearray(b"1"), memoryview(b"1"), np.timedelta64(1, "s")
NOT_FINITE = NAN, INF, -INF
# Of one number that must be positive, or at least 0, or finite: numbers outside its range, and what is no number.
NO_POSITIVE, NEGATIVE, NO_PLACE = (*NOT_FINITE, 0.0, "x"), (*NOT_FINITE, TINY, "x"), (*NOT_FINITE, "x")
NO_SHARE, NO_MASS = (*NOT_FINITE, TINY, 1.0 + 1e-15), (*NOT_FINITE, 0.0, -1.0, 9e-51, 1.1e50, "x")
NO_INERTIA, NO_LENGTH = (*NOT_FINITE, 0.0, 9e-251, 1.1e150, "x"), (*NOT_FINITE, TINY, 9e-51, 1.1e50, "x")
NO_COUNT, NO_SEED = (0, -3, 1.5, True, "1", 10**400, np.timedelta64(1, "s")), (-1, True, 1.5, NAN, "3")
NO_FLAG = 1, "yes", None

DISC, LAW, INCLINE = sledenv.segment(1.0, 0.1, 0.05, 7.5e-3), ContactLaw(1e6, 0.5, 0.1, 0.001), Slope(0.2, 10.0)
LAUNCH, PATCH = State(0.0, 0.6, 0.5, 1.0, 0.0, -3.0), Zone(1.0, 2.0, 0.1, 0.0)
ROW = [1.0, 0.1, 0.05, 7.5e-3, math.pi]  # of a table of bodies
SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
STAR = [(math.sin(0.8 * math.pi * k), math.cos(0.8 * math.pi * k)) for k in range(5)]
SIDES = [Arc(1.0, 1.0, 0.0, -math.pi), Arc(1.0, -1.0, 0.0, -math.pi / 2), Arc(-1.0, -1.0, 0.0, 0.0)]
SIDES += [Arc(-1.0, 1.0, 0.0, math.pi / 2)]  # of a square
HILL = ((-1.0, 0.0), (0.0, 1.0), (2.0, 0.5))
LAUNCHES = np.array([LAUNCH, LAUNCH])
FELL = sledenv.simulate(DISC, LAW, INCLINE, LAUNCH, record="trajectory")
FRAME = pd.DataFrame(LAUNCHES, columns=State._fields)
MAT, RIDES = Problem("sled_mat"), Problem("sled_rollers", "descent")
ID, ROLLERS, HALF = "sledenv/SledLaunch-v0", load_scenario("sled_rollers"), np.full((2, 11), 0.5)


def zoned(*numbers: float) -> list[Any]:
    """Slopes of two lanes, the second with zones."""
    return [INCLINE, (0.1, 10.0, 9.81, *numbers)]


def arcs(which: int, **changes: Any) -> list[Arc]:
    """Sides of the square, one of them changed."""
    return [arc._replace(**changes) if k == which else arc for k, arc in enumerate(SIDES)]


def stadium(side: float) -> list[Arc]:
    return [Arc(0.5 * side, 0.0, 1.0, -math.pi), Arc(-0.5 * side, 0.0, 1.0, 0.0)]


def ring(count: int) -> list[tuple[float, float]]:
    return [(math.sin(angle), math.cos(angle)) for angle in np.arange(count) * 2.0 * math.pi / count]


def recorded() -> pd.DataFrame:
    rng = np.random.default_rng(0)
    names = [f"{n}_{when}_{unit}" for when in ("before", "after") for n, unit in zip("uv", ("m_s", "m_s"), strict=True)]
    names += ["omega_before_rad_s", "omega_after_rad_s"]
    table = pd.DataFrame(rng.uniform(0.5, 1.0, (20, 6)), columns=names).assign(b_m=0.2)
    table["v_before_m_s"] *= -1.0
    return table.assign(a_m=rng.uniform(-0.1, 0.1, 20))


def tracked(**given: Any) -> Any:
    t = np.arange(9.0)
    return identify_tracks(
        pd.DataFrame({"t_s": t, "x_m": t, "y_m": 1.0, "phi_rad": 0.0}), sledenv.disc(1.0, 0.5), Slope(0.1), **given
    )


def riding(method: str) -> Callable[..., Any]:
    """Return a method of rides that have begun."""
    ride = sledenv.Ride(DISC, LAW, INCLINE, LAUNCH, rotor_inertia=1.0)
    many = sledenv.simulation.RideBatch(DISC, LAW, INCLINE, LAUNCHES, rotor_inertia=1.0)
    return ride.trim if method == "trim" else getattr(many, method)  # type: ignore[no-any-return]


def reset(kind: Any = SledLaunch, scenario: str = "sled_snow", **context: Any) -> Any:
    return kind(scenario).reset(options={"context": context})


def option_of(**options: Any) -> Any:
    envs = make_vec_env(ID, 3)
    envs.set_options(options["options"])
    return envs.reset()


def used(use: str) -> Any:
    if use == "rewards_of":
        return rewards_of(RIDES, RIDES.contexts("test", 3), np.zeros((3, 1)))
    if use == "descend":
        return RIDES.descend(np.zeros((1, 12)), [[0]])
    if use == "best_rides":
        return best_rides(MAT, np.zeros((1, 12)))
    return land_flat.Agent(RIDES) if use == "land_flat" else land_parallel.Agent(MAT)


def in_lanes(**given: Any) -> Any:
    return SledLaunchVector(2, "sled_snow").reset(**given)


def in_context(**changes: Any) -> Any:
    return ROLLERS.given(Context(*ROLLERS.ranges[0])._replace(**changes))


def scenario_with(**changes: Any) -> Any:
    return Scenario.model_validate(changed(**changes))


def on_ground(**slope: Any) -> Any:
    return Scenario.model_validate(changed() | {"slope": {"angle_deg": 8, "length_m": 40} | slope})


def with_body(**body: Any) -> Any:
    return Scenario.model_validate(changed(body=body))


GIVEN: dict[str, Any] = {"body": DISC, "law": LAW, "slope": INCLINE}
ONE, TWO = GIVEN | {"launch": LAUNCH}, GIVEN | {"launches": LAUNCHES}


@functools.cache
def calls() -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """Return what is called by its public name, and what it is given beside the wrong argument."""
    return {
        "segment": (sledenv.segment, dict(zip(("mass", "radius", "eccentricity", "inertia"), ROW, strict=False))),
        "Body": (Body, {"mass": 1.0, "inertia": 0.1, "arcs": SIDES}),
        "Arc": (lambda **given: Body(1.0, 1.0, arcs(0, **given)), {}),
        "circular_segment": (sledenv.circular_segment, {"mass": 1.0, "radius": 0.1, "half_angle": 1.9}),
        "disc": (sledenv.disc, {"mass": 1.0, "radius": 0.1, "eccentricity": 0.05, "inertia": 0.1}),
        "rod": (sledenv.rod, {"mass": 1.0, "length": 1.0, "thickness": 0.4}),
        "polygon": (sledenv.polygon, {"mass": 1.0, "points": SQUARE}),
        "polygon with an inertia": (sledenv.polygon, {"mass": 1.0, "points": SQUARE, "inertia": 0.4}),
        "hull": (sledenv.hull, {"mass": 1.0, "circles": [(0.0, 0.0, 1.0), (1.0, 0.0, 1.0)]}),
        "lamina": (lamina, {"mass": 1.0, "arcs": SIDES}),
        "sled": (sledenv.sled, {}),
        "bulged": (bulged, {"arcs": sledenv.rod(1.0, 1.0).arcs, "k": 0, "radius": 1.0}),
        "Body.replace": (sledenv.rod(1.0, 1.0).replace, {}),
        "ContactLaw": (ContactLaw, LAW._asdict()),
        "ContactLaw.from_restitution": (
            ContactLaw.from_restitution,
            {"restitution": 0.5, "stiffness": 1e6, "friction": 0.1, "rolling_arm": 0.0},
        ),
        "Zone": (Zone, PATCH._asdict()),
        "Slope": (Slope, {"angle": 0.1, "length": 10.0}),
        "Slope of a hill": (Slope, {"angle": 0.1, "profile": HILL}),
        "Slope.from_terrain": (Slope.from_terrain, {"x": [0.0, 1.0, 1.1], "z": [1.0, 0.0, -0.1], "angle": 0.0}),
        "Slope.height_at": (INCLINE.height_at, {}),
        "Slope.friction_at": (INCLINE.friction_at, {"x": 1.0, "elsewhere": 0.1}),
        "State": (State, LAUNCH._asdict()),
        "Settings": (Settings, {}),
        "fit_ground": (fit_ground, {"vertices": [(0.0, 0.0), (1.0, 0.0)], "tolerance": 0.1}),
        "simulate": (sledenv.simulate, ONE),
        "simulate_batch": (sledenv.simulate_batch, TWO),
        "simulate_blocks": (sledenv.simulation.simulate_blocks, TWO),
        "Ride": (sledenv.Ride, ONE),
        "RideBatch": (sledenv.simulation.RideBatch, TWO),
        "Ride.trim": (riding("trim"), {}),
        "RideBatch.hop": (riding("hop"), {}),
        "RideBatch.take": (riding("take"), {}),
        "RideBatch.launch": (riding("launch"), GIVEN | {"lanes": [0, 1], "launches": LAUNCHES}),
        "sensitivity": (sledenv.sensitivity, ONE),
        "Sensitivity.of_rebounds": (
            sledenv.sensitivity(**ONE, parameters=["x", "mass"], rebounds=1).of_rebounds,
            {"quantity": "t", "parameter": "x"},
        ),
        "rigid_impact": (sledenv.rigid_impact, {"body": DISC, "law": LAW, "state": LAUNCH}),
        "collide_wheel": (
            sledenv.collide_wheel,
            {"mass": 1.0, "inertia": 0.5, "radius": 1.0, "friction": 0.2, "rolling_arm": 0.01, "restitution": 0.5}
            | {"u": 1.0, "v": -1.0},
        ),
        "static_jam_angles": (static_jam_angles, {"body": sledenv.disc(1.0, 0.5), "law": LAW, "slope": INCLINE}),
        "scenario file": (scenario_with, {}),
        "slope of a scenario": (on_ground, {}),
        "bumps of a scenario": (on_ground, {"bumps": BUMPS}),
        "roof of a scenario": (on_ground, {"profile_m": [[0, 0], [1, 0.1], [2, 0]]}),
        "body of a scenario": (with_body, {"kind": "segment", "mass_kg": 2, "radius_m": 0.5, "half_angle_deg": 60}),
        "custom body of a scenario": (
            with_body,
            {"kind": "custom", "mass_kg": 2, "radius_m": 0.5, "eccentricity_m": 0.1, "inertia_kg_m2": 1},
        ),
        "sled of a scenario": (with_body, {"kind": "sled"}),
        "polygon of a scenario": (with_body, POLYGON),
        "hull of a scenario": (with_body, {"kind": "hull", "mass_kg": 2}),
        "arcs of a scenario": (with_body, {"kind": "arcs", "mass_kg": 2}),
        "track file": (
            lambda **given: Track.model_validate(given),
            {"id": "mine", "title": "Mine", "description": "", "length_m": 20, "profile_m": [[4, 0], [6, 0.5], [8, 0]]},
        ),
        "load_scenario": (load_scenario, {}),
        "load_track": (load_track, {}),
        "Scenario.on": (lambda track, name: load_scenario(name).on(track), {"track": "whoops", "name": "sled_rollers"}),
        "Scenario.settings": (ROLLERS.settings, {}),
        "Scenario.sample": (ROLLERS.sample, {}),
        "Scenario.given": (ROLLERS.given, {"context": Context(*ROLLERS.ranges[0])}),
        "context given": (in_context, {}),
        "Scenario.contexts": (load_scenario("sled_snow").contexts, {"draws": HALF}),
        "Scenario.check": (ROLLERS.check, {}),
        "Scenario.scenes": (ROLLERS.scenes, {"contexts": np.tile(ROLLERS.ranges[0], (2, 1))}),
        "SledLaunch": (SledLaunch, {"scenario": "sled_snow"}),
        "SledLaunch.reset": (SledLaunch("sled_snow").reset, {}),
        "SledDescent": (SledDescent, {}),
        "context of a launch": (reset, {}),
        "context of a ride": (lambda **given: reset(SledDescent, "sled_rollers", **given), {}),
        "SledLaunchVector.reset": (in_lanes, {}),
        "SledVecEnv": (SledVecEnv, {}),
        "SledVecEnv.set_options": (option_of, {}),
        "make_vec_env": (make_vec_env, {"env_id": ID, "n_envs": 2}),
        "SledVecEnv.seed": (make_vec_env(ID, 3).seed, {}),
        "SledVecEnv.get_attr": (make_vec_env(ID, 3).get_attr, {"attr_name": "task"}),
        "SledVecEnv.env_method": (make_vec_env(ID, 3).env_method, {"method_name": "reset"}),
        "Problem.contexts": (MAT.contexts, {"split": "test", "count": 1}),
        "Problem.trials": (MAT.trials, {"split": "test", "contexts": np.zeros((1, 12))}),
        "Problem.scenes": (MAT.scenes, {"contexts": CONTEXTS, "count": 1, "seed": (0,)}),
        "Problem.descend": (MAT.descend, {"actions": np.zeros((1, MAT.actions))}),
        "Problem.judge": (MAT.judge, {"agent": land_flat.Agent(MAT), "trials": np.zeros((1, 12))}),
        "Problem.ride": (RIDES.ride, {"agent": land_parallel.Agent(RIDES), "contexts": np.zeros((1, 12))}),
        "jam_map": (jam_map, {"problem": MAT, "contexts": np.zeros((1, 12))}),
        "best_launches": (best_launches, {"problem": MAT, "contexts": np.zeros((1, 12))}),
        "rewards_of": (rewards_of, {"problem": MAT, "contexts": np.zeros((1, 12)), "launches": [[0]]}),
        "best_rides": (best_rides, {"problem": RIDES, "scenes": np.zeros((1, 12))}),
        "identify": (sledenv.identify, {"table": recorded(), "gyration_radius": 0.3, "starts": 1}),
        "identify_tracks": (tracked, {}),
        "problem of rides": (used, {}),
        "evaluate": (sledenv.evaluate, {"policy": np.zeros_like, "scenario": "sled_rollers"}),
        "study": (sledenv.study, {"given": "push_off", "out": "out"}),
        "plot_descent": (plot.plot_descent, {}),
        "plot_growth": (plot.plot_growth, {}),
        "plot_impact": (plot.plot_impact, {"descent": FELL}),
        "plot_sliding_end": (plot.plot_sliding_end, {}),
        "plot_strobe": (plot.plot_strobe, {"descents": FELL}),
    }


RANGE, PAIR = "must be a number, or a pair [low, high] to sample, in", "must be a pair [low, high] of numbers in"
KINDS = "must be one of disc, segment, sled, polygon, hull, arcs, custom, rock, choice"
POINTS = "must be a list of 3 to 200 pairs [x, y] of numbers in [-1e+50, 1e+50] m"
CIRCLES = "must be a list of 1 to 200 triples [x, y, radius] of numbers in [-1e+50, 1e+50] m"
BUMPS = {"height_m": [0.4, 0.9], "face_m": [2.5, 4], "top_m": [0.2, 1.5], "gap_m": [2, 8]}
ROUND = {"x_m": 0, "y_m": 0, "radius_m": 0.5, "begin_rad": 0}
CONTEXTS = pd.DataFrame(np.ones((2, 12)), columns=Context._fields)
SHORT = {"height_m": 0.01, "face_m": [0.002, 4], "top_m": 0, "gap_m": 0}
POSES = "t_s,x_m,y_m,phi_rad\n"
MASKED = np.ma.masked_less(LAUNCHES, -1.5)

# Public name: argument, words expected, wrong values.
WRONG: dict[str, list[tuple[Any, ...]]] = {
    "segment": [
        ("mass", "must be a number in [1e-50, 1e+50]", *NO_NUMBERS),
        ("mass", "must be in [1e-50, 1e+50]", *NO_MASS[:-1]),
        ("inertia", "in [1e-250, 1e+150]", *NO_INERTIA),
        ("radius", "0 or in [1e-50, 1e+50]", *NO_LENGTH),
        ("eccentricity", "in [0, inf)", *NEGATIVE),
        ("eccentricity", "[max(radius cos(half_angle), 0), radius] = [0.0, 0.1] m", 0.11),
        ("half_angle", "in (0, pi] rad", *NO_POSITIVE, math.nextafter(math.pi, 4.0)),
    ],
    "Body": [
        ("mass", "in [1e-50, 1e+50]", *NO_MASS),
        ("inertia", "in [1e-250, 1e+150]", *NO_INERTIA),
        ("arcs", "must be a sequence of arcs", None, 1.0, "arcs", b"arcs", {1.0}, object),
        ("arcs", "has 0 arcs: must have 1 to 24", []),
        ("arcs", "has 28 arcs: must have 1 to 24", SIDES * 7),
        ("arcs", "must be an Arc", [[0.0, 0.0, 1.0, 0.0]], [(0.0, 0.0, 1.0)], [None]),
        ("arcs", "begin = -3.14", [*SIDES[1:], SIDES[0]], [SIDES[0], *SIDES]),
        ("arcs", "must rise from arc to arc", arcs(1, begin=1e-10 - math.pi), arcs(3, begin=3.1415926535)),
        ("arcs", "the outline is open or crosses", arcs(2, y=-1.1), arcs(2, begin=0.1)),
        ("arcs", "the side of -2.0 m between the arcs", [Arc(-1, 0, 0, -math.pi), Arc(1, 0, 0, 0)]),
        ("arcs", "0 and 1 are of one circle", [Arc(0, 0, 1, -1), Arc(0, 0, 1, 1, "other")], stadium(1e-300)),
        ("arcs", "m between the arcs 0 and 1 must be 0 or >= 1.0", stadium(1e-11), stadium(9e-10)),
        ("arcs", "the outline passes the mass centre at -0.01", [Arc(0.0, 0.1, 0.09, 0.0)]),
        ("arcs", "passes the mass centre at -0.00", [arc._replace(x=arc.x - 1.001) for arc in SIDES]),
        ("arcs", "the size inf m must be 0 or in [1e-50, 1e+50] m", [Arc(1e308, 1e308, 1e308, 0.0)]),
        ("arcs", "must be in [0, 1e+06 * size] = ", bulged(sledenv.rod(1.0, 1.0).arcs, 0, 6e5)),
    ],
    "Arc": [
        ("x", "must be a number, a finite number", *NO_NUMBERS[:-4]),
        ("y", "must be a finite number", *NOT_FINITE),
        ("radius", "in [0, inf)", *NEGATIVE),
        ("begin", "3.14", math.pi),
        ("part", "must have a letter", ""),
        ("part", "must be a word", 1),
        ("side", "must be a word", None),
        ("corner", "must be True or False", 1),
    ],
    "circular_segment": [
        ("mass", "in [1e-50, 1e+50]", *NO_MASS),
        ("radius", "in [1e-50, 1e+50]", *NO_MASS),
        ("half_angle", "[1e-40, pi] rad", *NO_POSITIVE, 9e-41, math.nextafter(math.pi, 4.0)),
    ],
    "disc": [
        *((name, "in [1e-50, 1e+50]", *NO_MASS) for name in ("mass", "radius")),
        ("eccentricity", "in [0, radius] = [0, 0.1] m", *NEGATIVE, 0.11),
        ("inertia", "in [1e-250, 1e+150]", *NO_INERTIA),
        ("inertia", "must be given where the eccentricity is not 0", None),
    ],
    "rod": [
        ("mass", "in [1e-50, 1e+50]", *NO_MASS),
        ("length", "in [1e-50, 1e+50]", *NO_MASS),
        ("length", "must be in (thickness, inf) = (0.4, inf) m", 0.3),
        ("thickness", "0 or in [1e-50, 1e+50]", *NO_LENGTH),
        ("inertia", "in [1e-250, 1e+150]", *NO_INERTIA),
    ],
    "polygon": [
        ("mass", "in [1e-50, 1e+50]", *NO_MASS),
        ("rounding", "in [0, inf)", *NEGATIVE),
        ("rounding", "must be in [0, 0.", 0.5),
        ("inertia", "in [1e-250, 1e+150]", *NO_INERTIA),
        ("centre", "must be given where polygon.centre is", (0.25, 0.5)),
        ("points", "must have 3 to 24", SQUARE[:2], ring(25)),
        ("points", "has shape", [[0.0, 0.0, 0.0]]),
        ("points", "must be in [-1e+50, 1e+50]", [(0, 0), (1, 0), (1, NAN)], [(0, 0), (1e200, 0), (1, 1)]),
        ("points", "no integer of more than 64 bits", [(0, 0), (10**400, 0), (1, 1)]),
        ("points", "numbers", [("a", "b")], [(0, 0), (Decimal(1), 0), (0, 1)], *NO_NUMBERS[-4:]),
        ("points", "strictly convex", [(0, 0), (1, 0), (2, 0), (1, 1)], [SQUARE[k] for k in (0, 2, 1, 3)]),
        ("points", "polygon.points[2]", [(0, 0), (2, 0), (1, 0.5), (2, 2)]),
        ("points", "once around", STAR),
        ("points", "must differ from the next one", [*SQUARE, SQUARE[3]], [*SQUARE, SQUARE[0]]),
        ("sides", "must be a sequence of names", "abcd"),
        ("sides", "[2] = '': must have a letter", ["a", "b", "", "d"]),
        ("parts", "must be a sequence of names", [1, 2, 3, 4]),
        ("parts", "has 1 names: must have 4", ["a"]),
    ],
    "polygon with an inertia": [("centre", "must lie within the outline", (-0.25, 0.5), (2, 2))],
    "hull": [
        ("circles", "must be numbers", [(0.0, 0.0, 1.0), (0.0,)]),
        ("circles", "radius = -1.0: must be 0 or in [1e-50", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)]),
        ("circles", "has shape (0,): must be (N, 3)", []),
        ("circles", "must be in [-1e+50", [(0, 0, 1e60)]),
        ("circles", "no hull can be told of them", [(0, 0, 0), (5e-324, 0, 0), (0, 5e-324, 0), (5e-324, 5e-324, 0)]),
        ("centre", "must be given where hull.centre is", (0.0, 0.5)),
        ("parts", "has 1 names: must have 2", ["a"]),
    ],
    "lamina": [
        ("mass", "in [1e-50, 1e+50]", *NO_MASS),
        ("arcs", "has 0 arcs: must have 1 to ", []),
        ("arcs", "must be a sequence of arcs", 3),
        ("arcs", "radius = '1': must be a number in [0, inf)", [(0.0, 0.0, "1", 0.0)]),
        ("arcs", "must rise from arc to arc", [(0.0, 0.0, 1.0, 0.0)] * 2),
        ("arcs", "lamina.centre = None: must be given where the outline has no area", sledenv.rod(1.0, 1.0).arcs),
        ("centre", "lamina.inertia = None: must be given where lamina.centre is", (0.0, 0.0)),
    ],
    "bulged": [
        ("radius", "too small to join", 0.4, 0.0),
        ("k", "no straight side follows", 2, -1),
    ],
    "sled": [
        ("rider_mass", "must be a number in [1e-50, 1e+50]", *NO_NUMBERS),
        ("sled_mass", "must be in [1e-50, 1e+50]", *NO_MASS[:-1]),
        ("length", "must be in [1e-50, 1e+50]", 1e200),
        ("length", "must be in (0.12, 1e+50] m", 0.1),
        ("rider_height", "the runners must be on the outline", 1e50),
        ("length", "the runners must be on the outline", 2**64),
        ("balance", "must be in (-1, 1)", 1.0, NAN),
        ("bow_radius", "must be large enough", 0.2),
    ],
    "Body.replace": [("colour", "colour", 1.0)],
    "ContactLaw": [
        ("stiffness", "must be a number in (0, inf)", *NO_NUMBERS),
        ("stiffness", "in (0, inf)", *NO_POSITIVE),
        ("asymmetry", "in [0, 1]", *NO_SHARE),
        *((name, "in [0, inf)", *NEGATIVE) for name in ("friction", "rolling_arm", "corner_rolling_arm")),
    ],
    "ContactLaw.from_restitution": [("restitution", "in [0, 1]", *NO_SHARE)],
    "Zone": [
        ("begin", "must be a", *NO_PLACE),
        ("end", "in (-inf, inf] m", NAN, -INF, "x"),
        ("end", "must be > Zone.begin = 1.0 m", 1.0, 0.5),
        *((name, "in [0, inf)", *NEGATIVE) for name in ("friction", "rolling_arm", "corner_rolling_arm")),
        ("restitution", "in [0, 1]", *NO_SHARE, "x"),
        ("stiffness", "in (0, inf)", *NO_POSITIVE),
    ],
    "Slope": [
        ("angle", "in (-pi/2, pi/2) rad", *NO_PLACE, math.pi / 2, -math.pi / 2),
        ("angle", "must be in", 10**400),
        ("length", "in (0, inf] m", NAN, -INF, 0.0, -1.0, "x"),
        ("gravity", "in [0, inf)", *NEGATIVE),
        ("air_density", "in [0, inf)", *NEGATIVE),
        ("zones", "must be a sequence of Zone", PATCH, "ice", 3.0, None, np.ma.masked),
        ("zones", "must be a Zone", [PATCH, 3.0], [PATCH, PATCH[:3]]),
        ("zones", "Zone.friction = -0.1: must be in [0, inf)", [(1.0, 2.0, -0.1, 0.0, 0.0)]),
        ("zones", "[1].begin = 1.0: must be >= the end of the zone before, 2.0 m", [PATCH, PATCH]),
        ("zones", "[0].end = 20.0: must be <= Slope.length = 10.0 m, or inf", [PATCH._replace(end=20.0)]),
        ("zones", "[0].begin = 10.0: must be < Slope.length", [PATCH._replace(begin=10.0, end=INF)]),
        ("zones", "holds 65: must hold at most 64", [Zone(k, k + 0.5, 0.1, 0.0) for k in range(65)]),
        ("profile", "must be a sequence of pairs", 3.0, "hill", None, {0.0: 1.0}),
        ("profile", "must be a pair (x, y) of numbers", [(0.0, 0.0), 1.0], [(0.0, 0.0), (1.0, 2.0, 3.0)]),
        ("profile", "[1].y", *([(0.0, 0.0), (1.0, y)] for y in ([2.0], "high", True, NAN, Decimal(1)))),
        ("profile", "[1].x = inf: must be a finite number", [(0.0, 0.0), (INF, 1.0)]),
        ("profile", "must hold numbers", np.zeros((2, 2), bool), np.array([["a", "b"], ["c", "d"]])),
        ("profile", "is a masked array", np.ma.masked_array(HILL), [(0.0, 0.0), np.ma.masked_array([1.0, 2.0])]),
        ("profile", "must be (n, 2)", np.zeros(4), np.zeros((4, 3))),
        ("profile", "must hold no vertex, or 2 to 16384", [(0.0, 0.0)], np.zeros((16385, 2))),
        ("profile", ": must be > that of the vertex before", [(0, 0), (0, 1)], [(0, 0), (2, 1), (1, 0)]),
        ("profile", "at most 80 degrees steep to the plane", [(0.0, 0.0), (1.0, 5.7)], [(0.0, 0.0), (1.0, -5.7)]),
    ],
    "Slope of a hill": [
        ("rounding", "in [0, inf] m", NAN, -0.1, "1"),
        ("rounding", "holds 2 numbers: must hold one for each of 3 vertices", [1.0, 2.0]),
        ("rounding", "rounding[1]", [1.0, -2.0, 0.0], [1.0, "a", 0.0], [1.0, [2.0, 3.0], 0.0]),
    ],
    "Slope.from_terrain": [
        ("x", "must be (n,), as x", [[0.0, 1.0, 1.1]]),
        ("z", "must be (n,), as x", [1.0], [[1.0, 0.0, -0.1]]),
        ("z", "[1] = nan: must be a finite", [1.0, NAN, 0.0]),
        ("x", "numbers", ["a", "b", "c"], "ab", None, [0.0, True, 2.0]),
        ("x", "runs from 1 to 3 m: must hold 0, where descents start", [1.0, 2.0, 3.0]),
        ("x", "x[2]: x = 1: is a vertical step from z = 0", [0.0, 1.0, 1.0]),
        ("x", "x[2]: x = 0.5: must be > 1 m, that of x[1]; put the points in the order of x; steep", [0.0, 1.0, 0.5]),
        ("x", "put the points in the order of x: all of them run backwards", [1.1, 1.0, 0.0]),
        ("z", "x[2]: the piece from x[1] to here is -89.", [1.0, 0.0, -9.0]),
        ("angle", "in (-pi/2, pi/2) rad", *NO_PLACE, 2.0),
        ("steepest", "in (0, 1.396", *NO_POSITIVE, 80.0),
        ("tolerance", "in (0, inf)", *NO_POSITIVE),
    ],
    "Slope.height_at": [("x", "must be numbers", "there", None)],
    "Slope.friction_at": [("x", "must be numbers", "there", None), ("elsewhere", "in [0, inf)", None, "x", -1.0)],
    "State": [
        *((name, "a finite number", *NO_PLACE) for name in State._fields),
        ("u", "must be a number, a finite number", *NO_NUMBERS[:8], *NO_NUMBERS[9:]),
    ],
    "Settings": [
        ("solver", "must be one of 'compliant', 'rigid'", "magic", "euler"),
        ("solver", "must be one of 'compliant', 'rigid'; the paper's own method is sledenv.reproduce.euler_", "euler"),
        ("max_rebounds", "must be an integer", *NO_COUNT),
        ("max_time", "in (0, inf)", *NO_POSITIVE),
        ("tolerance", "in [1e-18, 1e-3]", *NOT_FINITE, 1.0, 0.0),
        ("sample_interval", "in [1e-12, inf) s", *NOT_FINITE, 0.0, 1e-300),
        ("settle_speed", "in [0, inf) m/s", *NEGATIVE),
        ("run_out", "in [0, inf) m", *NEGATIVE),
        ("end_on_chord", "must be True or False", *NO_FLAG),
        ("end_touching", "must be the name of a part of the body, or several", 3, [], ["rider", 1]),
    ],
    "fit_ground": [
        ("vertices", "must be (n, 2), n >= 2", [(0.0, 0.0, 0.0)] * 2, [(0.0, 0.0)]),
        ("vertices", "finite", [(0.0, 0.0), (1.0, NAN)]),
        ("vertices", "must be ahead of the one before", [(0, 0), (1, 0), (1, 0.1)], [(0, 0), (1, 6)]),
        ("tolerance", "must be in (0, inf) m", 0.0, NAN, INF),
    ],
    "simulate": [
        ("launch", "must be a State, or as many numbers: x, y, phi, u, v, omega", LAUNCH[:5], None),
        ("launch", "the launch lies below the surface", LAUNCH._replace(y=0.01), LAUNCH._replace(y=0.0)),
        ("launch", "State.x = 11.0: must be < Slope.length = 10.0 m", LAUNCH._replace(x=11.0)),
        ("launch", "State.u = nan: must be a finite number", (*LAUNCH[:3], NAN, *LAUNCH[4:])),
        ("launch", "State.omega = inf: must be a finite number", tuple.__new__(State, (*LAUNCH[:5], INF))),
        ("law", "must be a ContactLaw", (1.0, 2.0)),
        ("law", "ContactLaw.friction = -1.0: must be in [0, inf)", (*LAW[:2], -1.0, *LAW[3:])),
        ("law", "asymmetry = 1.0 (restitution 0): must be in [0, 1) with", (*LAW[:1], 1.0, *LAW[2:])),
        ("slope", "must be a Slope, or as many numbers: angle, length, gravity", 3),
        ("slope", "Slope.angle = -2.0: must be in (-pi/2, pi/2) rad", (-2.0, 10.0, 9.81)),
        ("body", "must be a Body, such as segment(...) or polygon(...) returns", LAW, [DISC], tuple(ROW), DISC.record),
        ("record", "must be one of 'rebounds', 'trajectory'", "all"),
        ("settings", "must be Settings, such as Settings(solver='rigid')", "rigid", {"solver": "rigid"}),
        ("max_rebounds", "Settings.max_rebounds = 0: must be an integer >= 1", 0),
        ("tol", "is no field of Settings; it has solver, max_time, ", 1e-8),
        ("end_touching", "must be a part of the body, one of ", "wing"),
    ],
    "simulate_batch": [
        ("settings", "must be Settings, such as Settings(solver='rigid')", "rigid"),
        ("solver", "must be one of 'compliant', 'rigid'; the paper's own method", "euler"),
        ("colour", "is no field of Settings", 1.0),
        ("keep_rebounds", "must be True or False", *NO_FLAG),
        ("progress", "must be True or False", *NO_FLAG),
        ("launches", "must be (N, 6), columns x, y, phi", [[0.0, 1.0, 0.0]], []),
        ("launches", "[1].y = 0.01: the launch lies below the surface", [LAUNCH, LAUNCH._replace(y=0.01)]),
        ("launches", "[1].x = 11.0: must be < Slope.length = 10.0 m", [LAUNCH, LAUNCH._replace(x=11.0)]),
        ("launches", "holds True or False: must hold numbers, columns x, y", [[0, 1, 0, True, -1, 0]], LAUNCHES > 0.0),
        ("launches", "holds complex128: must hold numbers, columns x, y", LAUNCHES * 1j),
        ("launches", "has the column 'speed': must have the columns x,", FRAME.rename(columns={"u": "speed"})),
        ("launches", "has no column 'phi': must have the columns x, y, phi", FRAME.drop(columns="phi")),
        ("launches", "has the column 'u' more than once", FRAME[[*FRAME, "u"]]),
        ("launches", "v holds ", FRAME.astype({"v": str}), FRAME.assign(v=FRAME["v"] > -1.0)),
        ("launches", "[1].v = nan: must be a finite number", FRAME.assign(v=[0.0, NAN])),
        ("launches", "holds a Series: must be one DataFrame", [row for _, row in FRAME.iterrows()]),
        ("launches", "is a masked array, or holds one", MASKED, [*MASKED], [[0.0, 0.5, 0.1, np.ma.masked, 0.0, 0.0]]),
        ("launches", "[0].u = inf: must be a finite number", np.where(LAUNCHES == 1.0, INF, LAUNCHES)),
        ("launches", "holds a Mixed of y, x: must have x, y, phi", [namedtuple("Mixed", "y x")(0.5, 0.0)]),
        ("law", "1 given for 2 launches; give one or one a launch", [LAW]),
        ("law", "must be a ContactLaw or a sequence of them", "ice", None, np.ma.masked),
        ("law", "must be numbers, columns stiffness, asymmetry", [LAW, LAW[:3]]),
        ("law", "must be (N, 5), columns stiffness, asymmetry", [LAW[:4]] * 2),
        ("law", "law[1].friction = -1.0: must be in [0, inf)", [LAW, (*LAW[:2], -1.0, *LAW[3:])]),
        ("law", "law[1].asymmetry = 1.0 (restitution 0): must be", [LAW, (*LAW[:1], 1.0, *LAW[2:])]),
        ("law", "holds True or False", [(1e6, 0.5, True, 0.0, 0.0)] * 2),
        ("slope", "must be a Slope or a sequence of them", None, "hill", np.array(1.0)),
        ("slope", "slope holds <U", [INCLINE, ("steep", 1.0, 9.81)]),
        ("slope", "holds True or False", [(True, 9.0, 9.81)] * 2),
        ("slope", "no integer of more than 64 bits", [(0.1, 10**400, 9.81)] * 2),
        ("slope", "must be numbers, columns angle", [INCLINE, INCLINE[:2]], [INCLINE, 3], [INCLINE, tuple(INCLINE)]),
        ("slope", "slope[1].length = nan: must be in (0, inf] m", [INCLINE, (0.1, NAN, 9.81)]),
        ("slope", "must be (N, 3), columns angle, length, gravity", np.zeros((2, 4))),
        ("slope", "must be (N, 10), columns angle, length, gravity", np.zeros((2, 11))),
        ("slope", "slope has columns of 65 zones", np.tile([0.1, 10.0, 9.81, *[NAN] * 455], (2, 1))),
        ("slope", "slope[1].zones[0].friction = -0.1: must be in [0, inf)", zoned(1, 2, -0.1, 0, 0, NAN, NAN)),
        ("slope", "slope[1].zones[0].friction = nan: must be in [0, inf)", zoned(1, 2, NAN, 0, 0, 0.5, 1e6)),
        ("slope", "slope[1].zones[0].end = 1.0: must be > its begin", zoned(2, 1, 0.1, 0, 0, 0.5, 1e6)),
        ("slope", "slope[1].zones[0].restitution = 1.5: must be in [0, 1]", zoned(1, 2, 0.1, 0, 0, 1.5, 1e6)),
        ("slope", "zones[0].restitution = 0.0: must be in (0, 1] with", zoned(1, 2, 0.1, 0, 0, 0.0, 1e6)),
        ("slope", "slope[1].zones[0].stiffness = 0.0: must be in (0, inf)", zoned(1, 2, 0.1, 0, 0, NAN, 0.0)),
        ("slope", "slope[1].zones[0].begin = 10.0: must be < Slope.length", zoned(10, INF, 0.1, 0, 0, 0.5, 1e6)),
        ("slope", "slope[1].zones[0].end = 11.0: must be <= Slope.length = 10.0 m", zoned(5, 11, 0.1, 0, 0, 0.5, 1e6)),
        (
            "slope",
            "slope[1].zones[1].begin = 2.0: must be >= ",
            zoned(1, 3, *PATCH.row[2:], 2, 4, *PATCH.row[2:]),
        ),
        ("body", "3 given for 2 launches", [DISC] * 3, np.array([ROW] * 3), np.concatenate([DISC.record] * 3)),
        ("body", "must be a Body or a sequence of them", "disc", None),
        ("body", "body[1] = [1.0, 0.1, 0.05, 0.0075, 3.14", [DISC, ROW]),
        ("body", "must be (N, 5), columns mass, radius", np.array([ROW] * 2)[:, :4]),
        ("body", "body holds <U1: must hold numbers, columns mass, radius", np.array([["a"] * 5] * 2)),
        ("body", "body[1].half_angle = 4.0: must be in (0, pi] rad", np.array([ROW, [*ROW[:4], 4.0]])),
        ("body", "body[0].mass = -1.0: must be in [1e-50, 1e+50]", np.array([[-1.0, *ROW[1:]], ROW])),
        ("body", "body[1].eccentricity = 1.0: must be in [max(radius", np.array([ROW, [*ROW[:2], 1.0, *ROW[3:]]])),
        ("end_touching", "must be a part of the body", "rider"),
    ],
    "simulate_blocks": [
        ("block", "must be an integer", *NO_COUNT),
        ("keep_rebounds", "must be True or False", *NO_FLAG),
        ("launches", "must be (N, 6), columns x, y, phi", [[0.0, 1.0, 0.0]]),
    ],
    "Ride": [
        ("settings", "must be Settings", "rigid"),
        ("record", "must be one of 'rebounds', 'trajectory'", "all"),
        ("rotor_inertia", "in (0, inf)", *NO_POSITIVE),
        ("shortest_flight", "Ride.shortest_flight = ", -0.1, NAN, "x"),
        ("launch", "State.y = 0.0: the launch lies below the surface", LAUNCH._replace(y=0.0)),
        ("law", "ContactLaw.friction = -1.0", (*LAW[:2], -1.0, *LAW[3:])),
    ],
    "RideBatch": [
        ("settings", "must be Settings", "rigid"),
        ("rotor_inertia", "RideBatch.rotor_inertia = -1.0: must be in (0, inf)", -1.0),
        ("keep_rebounds", "must be True or False", *NO_FLAG, np.zeros(2)),
    ],
    "Ride.trim": [("spin", "must be a", *NO_PLACE, 10**400)],
    "RideBatch.hop": [
        ("trims", "has shape (3,): must be (2,)", np.zeros(3)),
        ("trims", "trims[1] = nan: must be a finite number", np.array([0.0, NAN])),
        ("trims", "holds True or False", np.zeros(2, bool)),
        ("trims", "holds complex128", np.zeros(2, complex)),
        ("trims", "must be numbers, each a finite number", [[1.0], [1.0, 2.0]]),
    ],
    "RideBatch.take": [("lanes", "must be among 2 lanes", [2], "a", [0.0], [[0, 1], [0]])],
    "RideBatch.launch": [
        ("lanes", "must be in [0, 2)", [-1, 0]),
        ("lanes", "no two must be alike", [1, 1]),
        ("lanes", "must be whole numbers", [True, False], ["a", "b"], [0.0, 1.0], [[0, 1], [0]]),
        ("lanes", "has shape (1,): must be (2,)", [0]),
        ("launches", "launches[1].y = 0.0: the launch lies below the surface", [LAUNCH, LAUNCH._replace(y=0.0)]),
        ("law", "3 given for 2 launches", [LAW] * 3),
    ],
    "sensitivity": [
        ("settings", "must be Settings", "rigid"),
        ("parameters", "must be a sequence of names, at least one", 5, "x", []),
        ("parameters", "'colour': must be one of 'x', 'y'", ["colour"]),
        ("parameters", "parameters = ['x']: must be one of 'x', 'y'", [["x"]]),
        ("parameters", "each parameter once", ["x", "x"]),
        ("parameters", "the slope has no 'zone_1_begin' that could be varied", ["zone_1_begin"]),
        ("rebounds", "must be an integer", *NO_COUNT),
        ("body", "must be a Body, such as segment(...)", tuple(ROW)),
        ("launch", "State.y = nan", (0.0, NAN, 0.0, 0.0, 0.0, 0.0)),
        ("launch", "lies below the surface", (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
    ],
    "Sensitivity.of_rebounds": [
        ("quantity", "must be one of 't_touchdown'", "colour"),
        ("parameter", "must be one of 'x', 'mass'", "phi"),
    ],
    "rigid_impact": [
        ("restitution", "in [0, 1]", *NO_SHARE),
        ("restitution", "must be a number", "much"),
        ("hypothesis", "must be one of 'energetic', 'poisson', 'newton'", "hertz", np.zeros(2)),
        ("law", "ContactLaw.friction = -0.1", (1.0, 0.5, -0.1, 0.0, 0.0)),
        ("state", "State.phi = inf", (0.0, 0.0, INF, 0.0, -1.0, 0.0)),
        ("body", "must be a Body, such as segment(...) or polygon", tuple(ROW), LAW, [DISC], None),
    ],
    "collide_wheel": [
        ("mass", "numbers, each in (0, inf)", *NO_NUMBERS[:3], True),
        ("friction", "no integer of more than 64 bits", 10**400),
        ("u", "holds True or False: must hold numbers, each a finite number", [1.0, True]),
        ("v", "is a masked array, or holds one", np.ma.masked),
    ],
    "static_jam_angles": [
        ("slope", "Slope.zones has 1 entries: must be empty", INCLINE._replace(zones=[PATCH])),
        ("slope", "Slope.profile has 2 entries: must be empty", INCLINE._replace(profile=[(1, 0), (2, 1)])),
    ],
    "scenario file": [
        ("slope__angle_deg", f"{RANGE} (-90, 90) deg", 95, [5, 90], [1, 2, 3], "10 deg", {"low": 1}),
        ("slope__angle_deg", f"low must not exceed high; {RANGE} (-90, 90) deg", [12, 6]),
        ("slope__length_m", "must be a number in (0, inf) m", 0, INF, [5, 10]),
        ("slope__length_m", "missing; must be a number in (0, inf) m", DELETE),
        ("slope__gravity_m_s2", "must be a number in [0, inf) m/s^2", -9.81, Decimal(1), np.timedelta64(1, "s")),
        ("contact__restitution", f"{RANGE} (0, 1]", 0, [0.5, 1.1]),
        ("contact__friction", f"{RANGE} [0, inf)", -0.1, NAN),
        ("contact__stiffness_n_m", "must be a number in (0, inf) N/m", 0, True),
        ("contact__rolling_arm_m", "must be a number in [0, inf) m", -1),
        ("contact__corner_rolling_arm_m", "must be a number in [0, inf) m", -1),
        ("launch__speed_m_s", f"{RANGE} [0, inf) m/s", -1),
        ("launch__drop_m", f"{RANGE} [0, inf) m", [-0.1, 1]),
        ("launch__fall_m_s", f"{RANGE} [0, inf) m/s", -1),
        ("launch__orientation_deg", f"{RANGE} [-360, 360] deg", 361),
        ("launch__spin_rad_s", f"{RANGE} (-inf, inf) rad/s", INF),
        ("body__mass_kg", "must be a number in [1e-50, 1e+50] kg", 0),
        ("body__radius_m", "must be a number in [1e-50, 1e+50] m", 1e200),
        ("body__eccentricity_m", "must be a number in [0, radius_m) = [0, 0.5) m", 0.5),
        ("body__inertia_kg_m2", "must be a number in (0, m (r^2 - h^2)] = (0, 18.75] kg m^2", 18.76),
        ("body__kind", f"{KINDS} (did you mean 'disc'?)", "disk"),
        ("body__kind", f"missing; {KINDS}", DELETE),
        ("control__spin_rad_s", f"{PAIR} (-inf, inf) rad/s", 8, None),
        ("control__spin_rad_s", f"missing; {PAIR} (-inf, inf) rad/s", DELETE),
        ("control__orientation_deg", f"low must be below high; {PAIR} [-360, 360] deg", [90, 90]),
        ("control__speed_m_s", f"{PAIR} [0, inf) m/s", [-1, 5]),
        ("control__chosen", "must be one of 'both', 'orientation', 'spin', 'orientation+spin', 'all'", "speed"),
        ("control__chosen", "must be text", ["spin"]),
        ("limits__max_time_s", "must be a number in (0, inf) s", 0, 10**400),
        ("limits__max_rebounds", "must be a whole number in [1, 1000000]", 0, 2.5),
        ("id", "must be lower-case letters, digits and underscores", "Ice Drop"),
        ("title", "must be text", 3),
        ("tags", "must be a list", "jam"),
        ("launch", "must be a mapping of keys to values", 3),
        ("launch", "missing; must be a mapping with speed_m_s, drop_m", DELETE),
        ("control", "missing; must be a mapping with orientation_deg, spin_rad_s", DELETE),
        ("body", f"missing; must be a mapping with kind, {KINDS.removeprefix('must be ')}", DELETE),
        ("slope__angle_rad", "unknown key (did you mean 'angle_deg'?); known: angle_deg, length_m,", 1),
        ("body__mass_g", "unknown key (did you mean 'mass_kg'?); known: kind, drag_area_m2, mass_kg, ", 1),
        ("contact__restituton", "unknown key (did you mean 'restitution'?)", 1),
        ("titel", "unknown key (did you mean 'title'?); known: id, title, question,", 1),
        ("slope__zzz", "unknown key; known: angle_deg, length_m, gravity_m_s2", 1),
        ("contact__asymmetry", "either restitution in (0, 1] or asymmetry in [0, 1), but both are given", 0.5),
        ("contact__restitution", "or asymmetry in [0, 1), but both are missing", DELETE),
        ("zones", "restitution = 0: must be a number in (0, 1]", [{"begin_m": 2, "friction": 0.1, "restitution": 0}]),
        ("zones", "stiffness_n_m = -1: must be a number in (0", [{"begin_m": 2, "friction": 0.1, "stiffness_n_m": -1}]),
        ("zones", "pieces = [0, 0]: must be left out: the slope has no profile", [{"pieces": [0, 0], "friction": 0.5}]),
        ("ends", "touching = 'wing': must be a part of the body: arc, nose, tail, chord", {"touching": "wing"}),
        ("ends", "on_chord = 1: must be true or false", {"on_chord": 1}),
        ("ends", "on_chord = 'true': must be true or false", {"on_chord": "true"}),
        ("rider", "trim_rad_s = 0: must be a number in (0", {"trim_rad_s": 0, "rotor_inertia_kg_m2": 1}),
        ("rider", "rotor_inertia_kg_m2: missing; must be a number in (0, inf) kg m^2", {"trim_rad_s": 1}),
    ],
    "slope of a scenario": [
        ("profile_m", "must be a list of 2 to 16384 pairs [x, y] of numbers", [[0, 0]]),
        ("profile_m", "x of vertex 2 is 1: must be > that of the vertex before", [[0, 0], [1, 0.1], [1, 3]]),
        ("profile_m", "the piece from vertex 1 to 2 is 88 degrees steep to the plane", [[0, 0], [1, 0.1], [1.1, 3]]),
        ("tolerance_m", "must be left out without slope.profile_file", 1),
        ("profile_file", "must be the path of a CSV file", 3, ["a.csv"]),
        ("bumps", "face_m = 0.1: must be at least 0.1587 m, for bumps 0.9 m high", BUMPS | {"face_m": 0.1}),
        ("bumps", "back_m = 0.1: must be at least 0.1587 m, for bumps", BUMPS | {"back_m": [0.1, 4]}),
        ("bumps", "heigth_m = 3: unknown key (did you mean 'height_m'?)", BUMPS | {"heigth_m": 3}),
        ("bumps", "must be a mapping of keys to values", 3),
        ("bumps", "start_m = 0.1: must be at least the size of the body, 0.75 m", BUMPS | {"start_m": 0.1}),
        ("bumps", "rounding_m = -1: must be a number in [0, inf) m", BUMPS | {"rounding_m": -1}),
        ("bumps", "must be at most 4096; make them or gap_m longer", SHORT),
        ("rounding_m", "must be left out without profile_m; bumps have a rounding_m of their own", 1),
    ],
    "bumps of a scenario": [
        ("length_m", "must be at least 19 m, the sum of start_m, the longest bump and the size of the body", 18.9),
        ("profile_m", "must be left out where there is a profile, or the profile must", [[0, 0], [1, 0.1], [2, 0]]),
    ],
    "roof of a scenario": [
        ("rounding_m", "must hold one for each of 3 vertices", [1, 2]),
        ("rounding_m", "must be a number, or a list of numbers, in [0", -1, [0, "a", 0]),
    ],
    "body of a scenario": [
        ("half_angle_deg", "must be a number in (0, 180] deg", 0),
        ("inertia_kg_m2", "unknown key; known: kind, drag_area_m2, mass_kg, radius_m, half_angle_deg", 1),
    ],
    "custom body of a scenario": [
        ("radius_m", "must be a number in [0, 1e+50] m", -1),
        ("half_angle_deg", "eccentricity_m = 0.1: must be a number in [max(radius_m cos(half_angle_deg), 0), radi", 60),
    ],
    "sled of a scenario": [
        ("bow_radius_m", "must be a number in [1e-50, 1e+50] m", 0),
        ("balance", "must be a number in (-1, 1)", 1),
    ],
    "polygon of a scenario": [
        ("radius_m", "unknown key; known: kind, drag_area_m2, mass_kg, inertia_kg_m2, centre_m, ", 1),
        ("inertia_kg_m2", "must be a number in [1e-250, 1e+150] kg m^2", 0),
        ("centre_m", "must be a pair [x, y] of numbers in [-1e+50, 1e+50] m", [1]),
        ("centre_m", "inertia_kg_m2 = None: must be given where centre_m is", [0.1, 0.1]),
        ("parts", "must be a list", "abcd"),
        ("parts", "has 1 names: must have 4", ["a"]),
        ("sides", "sides.0 = 1: must be text", [1, "b", "c", "d"]),
        ("sides", "sides[3] = '': must have a letter", ["a", "b", "c", ""]),
        ("rounding_m", "must be a number in [0, 1e+50] m", -0.1),
        ("rounding_m", "must be in [0, 0.15) m, so that a length of each", 0.2),
        ("points_m", POINTS, 0.3, [[0, 0], [1, 0]], 1001 * [[0, 0]], [[0, 0], [1, 0], [0, 1, 0]]),
        ("points_m", POINTS, [[0, 0], [1, "0"], [0, 1]], [[0, 0], [1, 0], [0, INF]]),
        ("points_m", "has 25 rows: must have 3 to 24; rows [", [[*point] for point in ring(25)]),
        ("points_m", "points_m[1] = [1.0, 0.0]: must differ from the next one", [[0, 0], [1, 0], [1, 0]]),
        ("points_m", "must be strictly convex", [[0, 0], [1, 0], [1, 1], [0.9, 0.1]]),
    ],
    "hull of a scenario": [
        ("circles_m", CIRCLES, [[0, 0]], []),
        ("circles_m", "circles_m[0].radius = -0.1: must be 0 or in [1e-50, 1e+50]", [[0, 0, -0.1]]),
        ("circles_m", "the hull has 25 arcs: must have 1 to 24; rows [", [[*point, 0.1] for point in ring(25)]),
    ],
    "arcs of a scenario": [
        ("arcs", "must have at least 1 entry", []),
        ("arcs", "arcs.0.begin = 0: unknown key (did you mean", [ROUND | {"begin": 0}]),
        ("arcs", "arcs[1].begin = 0.0: must rise from arc to arc", [ROUND, ROUND]),
    ],
    "track file": [
        ("length_m", "must be a number in (0, inf) m", -1),
        ("lenght_m", "unknown key (did you mean 'length_m'?); known: id, title, description", 3),
        ("id", "must be lower-case letters, digits and underscores", "no good"),
        ("profile_m", "must be a list of 2 to 16384 pairs", [[4, 0]]),
        ("profile_m", "x of vertex 1 is 4: must be > that of the vertex before, 4 m", [[4, 0], [4, 1]]),
        ("profile_m", "the piece from vertex 0 to 1 is 84.3 degrees steep to the plane", [[4, 0], [4.1, 1]]),
        ("profile_m", "must be in [0, length_m] = [0, 20] m", [[-1, 0], [4, 1]], [[4, 0], [21, 1]]),
    ],
    "load_scenario": [
        ("name_or_path", "scenario = 3: must be the name of one or the path of a file", 3),
        ("name_or_path", "must be the name of one or the path of a file", None, ["sled_snow"]),
        ("name_or_path", "(did you mean 'sled_snow'?); known: ", "sled_snwo"),
    ],
    "load_track": [("name_or_path", "(did you mean 'whoops'?); known: camel, double", "woops")],
    "Scenario.on": [
        ("track", "known: camel, double", "ice"),
        ("name", "must have a rider, and bumps or a profile", "sled_mat"),
    ],
    "Scenario.settings": [
        ("solver", "must be 'compliant' in scenario sled_rollers, which has a profile", "rigid"),
        ("solver", "must be one of 'compliant', 'rigid'", None, "euler", np.zeros(2)),
    ],
    "Scenario.check": [("contexts", "contexts", None, "x", np.zeros((2, 3)), np.full((1, 12), "a"))],
    "Scenario.sample": [("rng", "must be a numpy.random.Generator", None, 3)],
    "Scenario.given": [
        ("context", "must be a Context, or as many numbers: angle, friction", None, 3, "snow", (0.1, 0.2)),
        *((name, "State.", *NOT_FINITE, "x") for name in ("orientation", "spin", "speed")),
    ],
    "context given": [
        ("friction", "in [0, inf)", *NEGATIVE, Decimal(1), bytearray(b"1"), np.timedelta64(1, "s"), None),
        ("track", "must be a whole number in [0, 4294967296)", 0.5, -1.0),
        ("shape", "must be a whole number in [0, 0], that of a body", 9.0),
    ],
    "Scenario.contexts": [
        ("draws", "numbers, each in [0, 1)", None, "x", HALF > 0.0, np.full((2, 11), "a"), HALF * 1j),
        ("draws", "must be in [0, 1)", 3, HALF * NAN, HALF * INF, 2.0 * HALF, HALF - 1.0),
        ("draws", "is a masked array", np.ma.masked_greater(HALF, 0.4)),
        ("draws", "must be (..., 11) or (..., 12)", HALF[:, 1:], np.full((2, 13), 0.5)),
        ("split", "must be one of 'train', 'validation', 'test'", "exam", 5),
    ],
    "Scenario.scenes": [
        ("contexts", "contexts has shape", np.zeros(3), np.zeros((2, 3)), 3),
        ("contexts", "numbers, columns angle", None, "x", np.array([list("abcdefghijkl")])),
        ("errors", "errors", 5, "both", [[0.0, NAN]], np.zeros((3, 2)), np.zeros((1, 3))),
        ("contexts", "has the column 'trak'", CONTEXTS.rename(columns={"track": "trak"})),
        ("contexts", "has no column 'track'", CONTEXTS.drop(columns="track")),
        ("contexts", "contexts is a masked array", np.ma.masked_less(np.ones((2, 12)), 2.0)),
        ("contexts", "[0].shape = 0.1: must be a whole number", [[0.1] * 11 + [NAN]]),
    ],
    "SledLaunch": [
        ("scenario", "(did you mean 'sled_snow'?)", "sled_snwo"),
        ("control", "must be one of 'both', 'orientation', 'spin'", "trim"),
        ("solver", "must be one of 'compliant', 'rigid'", "exact", np.zeros(2)),
        ("split", "must be one of 'train', 'validation', 'test'", "exam", ["test"]),
        ("launch_noise", "must be two numbers", 0.1, np.ma.masked),
        ("launch_noise", "launch_noise.spin = -1.0: must be in [0, inf)", (0.1, -1.0)),
        ("launch_noise", "launch_noise.orientation = nan: must be in [0, inf)", (NAN, 0.0)),
        ("info", "must be a sequence of any of 'context', 'launch'", ("jam", "jem"), np.ma.masked),
        ("render_mode", "must be one of 'human', 'rgb_array'", 5, np.zeros(2)),
        ("columns", "must be a sequence of any of 'context', 'ground'", ("landing",), np.zeros((4, 2)), []),
        ("observe", "must be 'all' or a sequence of any of 'angle', 'friction'", "speed", ["sped"], [1], np.ma.masked),
        ("noise", "unexpected keyword argument 'noise'; it has scenario, control, render_mode, info, ", 0),
    ],
    "SledLaunch.reset": [("options", "must be a mapping", "test"), ("seed", "must be an integer >= 0", *NO_SEED)],
    "SledDescent": [
        ("columns", "must be a sequence of any of 'context', 'state', 'ground'", "landing", ["landings"], [], 3, [1]),
        ("trims", "unexpected keyword argument 'trims'; it has scenario,", 1),
    ],
    "context of a launch": [
        ("friction", "in [0, inf)", -0.1, NAN),
        ("angle", "must be in (-pi/2, pi/2) rad", 2.0),
        *((name, "must be in [-1e+150, 1e+150]", NAN, 1e308, -1e308) for name in ("speed", "spin", "fall")),
        ("drop", "must be in [0, 1e+150] m", -0.5, 1e308),
        ("speed", "must be a number", True, "x"),
    ],
    "context of a ride": [("zone_friction", "must be 0, the scenario has no zones", 0.5)],
    "SledLaunchVector.reset": [
        ("seed", "must be an integer >= 0", *NO_SEED, np.array(1.0)),
        ("seed", "seed[1] = True: must be an integer >= 0", [0, True]),
        ("options", "[1].friction = -1.0: must be in [0, inf)", {"context": [{}, {"friction": -1}]}),
        ("options", "[1].fall = 1e+308: must be in [-1e+150", {"context": {"fall": [0.0, 1e308]}}),
        ("options", "context has shape (11,): must be ", {"context": np.zeros(11)}, {"context": [0.1] * 11}),
    ],
    "SledVecEnv": [("env", "must be a native vector environment, not wrapped", None)],
    "SledVecEnv.set_options": [
        ("options", "must be a mapping, or a list of one per lane", 5, memoryview(b"1")),
        ("options", "must hold numbers, words and arrays", {"context": memoryview(b"1")}),
        ("options", "has 2 entries: must be one per lane, 3", [{}, {}]),
        ("options", "[0].speed = 1e+308: must be in [-1e+150", [{"context": {"speed": 1e308}}, {}, {}]),
    ],
    "make_vec_env": [
        ("info", "must be a sequence of any of 'context', 'launch'", None, [[]]),
        ("env_kwargs", "must be a mapping of names to values", 5),
        ("env_kwargs", "['info'] = ('jam',): must be left out", {"info": ("jam",)}),
        ("env_kwargs", "unexpected keyword argument 'noise'; it has num_envs", {"noise": 0}),
        ("scenario", "is an argument of the environment, give", "sled_mat"),
        ("start_index", "must be an integer >= 0", *NO_SEED, None),
        ("seed", "must be an integer >= 0", *NO_SEED),
    ],
    "SledVecEnv.seed": [("seed", "must be an integer >= 0", *NO_SEED)],
    "SledVecEnv.get_attr": [
        ("indices", "must be the number of a lane, a sequence of them, or None", "a", [True], 1.5, [[0]], NAN),
        ("indices", "must be among 3 lanes", 5, [5], [0, -4]),
    ],
    "SledVecEnv.env_method": [
        ("indices", "must be the number of a lane, a sequence of them, or None", "a", [[0]]),
        ("options", "must be a mapping such as {'split': 'test'}", 5, [{}]),
    ],
    "Problem.contexts": [
        ("count", "contexts = -1: must be an integer >= 0", -1),
        ("count", ": must be an integer", *NO_COUNT[1:]),
        ("seed", "must be an integer >= 0", *NO_SEED),
    ],
    "Problem.trials": [
        ("contexts", "numbers, columns angle", None, "x", np.ones((1, 12)) * 1j),
        ("contexts", "has shape", 3, np.zeros((2, 3))),
        ("contexts", "contexts[0].angle = nan", np.full((1, 12), NAN)),
        ("count", "must be an integer", *NO_COUNT),
    ],
    "Problem.scenes": [
        ("contexts", "numbers, columns angle", None, "x"),
        ("count", "must be an integer", *NO_COUNT),
        ("seed", "must be a sequence of int", None, 3),
    ],
    "Problem.descend": [
        ("contexts", "must be numbers", None, "x"),
        ("contexts", "must be (n, 12) or (n, 14)", np.zeros((1, 3)), np.zeros((1, 1, 12))),
        ("contexts", "has the column 'trak'", CONTEXTS.rename(columns={"track": "trak"})),
    ],
    "Problem.ride": [
        ("agent", "must have a method act or plan", None, np.zeros_like),
        ("contexts", "must be numbers", None, "x"),
    ],
    **{
        name: [
            ("problem", "must be a Problem", None, "sled_mat"),
            (given, "must be numbers", None, "x"),
            (given, "has shape", np.zeros((1, 3))),
        ]
        for given, names in {"contexts": ("jam_map", "best_launches", "rewards_of"), "scenes": ("best_rides",)}.items()
        for name in names
    },
    "Problem.judge": [
        ("agent", "must have a method act or plan", None, np.zeros_like),
        ("trials", "numbers", None, "x"),
        ("trials", "must be (n, t, 14), (n, 12) or (n", np.zeros((2, 3))),
    ],
    "identify": [
        ("table", "must be a DataFrame or the path of a file", None),
        ("table", "u_before_m_s: must be numbers, is of the type", recorded() * 1j),
        ("speed_dependent", "must be True or False", *NO_FLAG),
        ("seed", "must be an integer >= 0", *NO_SEED),
        *((name, "must be a mapping of names to values", 5) for name in ("fixed", "bounds", "start")),
        ("bounds", "bounds, 'friction' = 5: must be a pair", {"friction": 5}),
        ("bounds", "bounds.friction = 'a': must be a number, a finite number", {"friction": ("a", 1)}),
    ],
    "identify_tracks": [
        ("bounds", "bounds.friction = True: must be a number, a finite number", {"friction": (0, True)}),
        ("fixed", "fixed.friction = 'x': must be a number, a finite number", {"friction": "x"}),
        ("fixed", "must be a mapping of names to values", 5),
        ("noise", "must be a pair", 5, np.ma.masked),
        ("seed", "must be an integer >= 0", *NO_SEED),
    ],
    "evaluate": [
        ("policy", "is a file of a model: load it, as PPO.load does", "ppo.zip", Path("runs/sac.zip")),
        *((name, "must be True or False", *NO_FLAG, np.zeros(2)) for name in ("shifted", "tracks")),
        ("environment", "must be one of 'launch', 'descent'", "ride", ["launch"], np.zeros(2)),
    ],
    "study": [
        ("out", "must be the path of a folder", None, 3, ["out"]),
        ("progress", "must be True or False", *NO_FLAG, np.zeros(2)),
        ("workers", "must be an integer >= 1", 0),
        ("launches", "must be an integer", *NO_COUNT),
    ],
    "plot_descent": [("descent", "must be a Descent", None, 3, "x", [FELL])],
    "plot_growth": [("found", "must be a Sensitivity", None, FELL)],
    "plot_impact": [
        ("descent", "must be a Descent", None, 3, FELL.trajectory),
        *((name, f"interval.{name} = ", "x", None, NAN) for name in ("start", "stop")),
    ],
    "plot_sliding_end": [("panels", "must be a mapping of names to values", 5, [FELL], {1: FELL})],
    "plot_strobe": [
        ("descents", "must be a sequence of Descent", None, 3, "x", {"a": FELL}),
        ("descents", "descents[0] = ", ["x"], [FELL.trajectory]),
        ("labels", "must be a sequence of str", 5, "a"),
        ("labels", "labels[0] = 5: must be a str", [5]),
        ("frames", "must be an integer", 1, *NO_COUNT),
        ("between", "must be a pair", 5, "ab", [1.0]),
        ("between", "between.end = ", [0.0, INF], [0.0, "x"]),
    ],
    "problem of rides": [
        ("use", "problem.environment = 'descent': must be 'launch'", "rewards_of", "descend", "land_flat"),
        ("use", "problem.environment = 'launch': must be 'descent'", "land_parallel", "best_rides"),
    ],
}


@pytest.fixture
def nothing_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make every loop fail the test that starts it."""
    calls()

    def run(*arguments: Any) -> None:
        raise AssertionError("simulated")

    monkeypatch.setattr(simulator, "follow_all", run)
    for simulated in (lambda: sledenv.simulate(**ONE), lambda: sledenv.simulate_batch(**TWO)):
        with pytest.raises(AssertionError, match="simulated"):
            simulated()


@pytest.mark.usefixtures("nothing_runs")
@pytest.mark.parametrize(
    ("name", "argument", "words", "value"),
    [
        pytest.param(name, argument, words, value, id=f"{name}-{argument}-{k}")
        for name, rows in WRONG.items()
        for argument, words, *values in rows
        for k, value in enumerate(values)
    ],
)
def test_a_wrong_input_is_refused_by_name_before_anything_runs(
    name: str, argument: str, words: str, value: Any
) -> None:
    """Oracle: the message."""
    call, given = calls()[name]
    with pytest.raises((TypeError, ValueError, IndexError)) as caught:
        call(**given | {argument: value})
    told = str(caught.value)
    assert words in told
    if type(value) in (bool, int, float, str) and words.startswith(("must be", "in ")):
        assert f"{argument.replace('__', '.')} = " in told
        assert f" {reprlib.repr(value)}" in told


# Kind of file: text, words expected.
WRONG_FILES: dict[str, list[tuple[str, str]]] = {
    "profile": [
        ("", "the file is empty: must name the columns, x_m, y_m"),
        ("# nothing\n", "the file is empty"),
        ("x_m;y_m\n0;1\n", "line 1: must name the columns"),
        ("0,1\n1,2\n", "line 1: must name the columns"),
        ("x_cm,y_m\n0,1\n", "line 1: must name the columns"),
        ("x_m,y_m,z_m\n0,1,2\n", "line 1: must name the columns"),
        ("x_m,y_m,x_m\n0,1,2\n", "line 1: must name the columns"),
        (
            "# x_m,y_m\n0,1\n1,2\n",
            "line 1 is a comment: leave out its #, as numpy.savetxt(",
        ),
        ("x_m,y_m\n0,1\n", "holds 1 vertices: must hold at least 2"),
        ("#\nx_m,y_m\n0,1\n\n1,2,3\n", "line 5: has 3 values: must have 2, x_m, y_m"),
        ("x_m,y_m\n0,1\n1,2 m\n", "line 3: y_m = '2 m': must be a finite number of metres, with a decimal point"),
        ('x_m,y_m\n0,1\n1,"2,5"\n', "line 3: y_m = '2,5': must be a finite number of metres, with a decimal point"),
        ("x_m,y_m\n0,1\n1,nan\n", "line 3: y_m = 'nan': must be a finite number of metres"),
        ("x_m,y_m\n0,1\n1,\n2,0\n", "line 3: y_m = '': must be a finite number of metres, with a decimal point; leave"),
        ("x_m,y_m\n0,3_0\n1,2\n", "line 2: y_m = '3_0': must be a finite number of metres"),
        ("x_m,y_m\n0,\uff13\n1,2\n", "line 2: y_m = '\uff13': must be a finite number of metres"),
        ('x_m,y_m\n0,"1\n', "line 2 = '0,\"1': a quotation mark has no other one in its line"),
        ('x_m,y_m\n0,0\n1,"0\n2,0\n3,"0\n4,0\n', "line 3 = '1,\"0': a quotation mark has no other one"),
        ("x_m,y_m\n0,0\n2,0\n1,0\n", "line 4: x_m = 1: must be > 2 m, that of line 3; put the lines in the order of x"),
        ("x_m,y_m\n0,0\n#\n1,0\n1,0\n", "line 5: x_m = 1, y_m = 0: repeats line 4; leave one of them out"),
        (
            "x_m,y_m\n0,0\n1,0\n1,3\n",
            "line 4: x_m = 1: is a vertical step from y_m = 0 in line 3 to 3 m; let",
        ),
        ("x_m,y_m\n0,0\n1,0\n1.1,3\n", "line 4: the piece from line 3 to here is 88.1 degrees steep to the plane"),
        ("x_m,z_m\n5,90\n10,80\n", "x_m runs from 5 to 10 m: must hold 0, where descents start; shift it so that it"),
        (2**17 * "1,1\n", "has 131072 lines: must have at most 65536"),
        (2**24 * " ", "has 16777216 bytes: must have at most 8388608"),
    ],
    "scenario": [
        ("slope: [", "cannot be read: while parsing"),
        ("id: a\nid: b", "cannot be read: repeated key 'id'"),
        ("slope: {length_m: 5, length_m: 6}", "cannot be read: repeated key 'length_m'"),
        (500 * "[" + 500 * "]", "cannot be read: nested too deeply"),
        (2000 * "{a: ", "cannot be read: nested too deeply"),
        ("a: &a {b: 1}\nc: {<<: *a}", "cannot be read: *a refers to another place"),
        ("a: &a [*a]", "cannot be read: *a refers to another place"),
        ("", "must be a mapping of keys to values"),
        ("- a", "must be a mapping of keys to values"),
        ("1: a", "1 = 'a': unknown key; known: id, title"),
        (2**23 * " ", "cannot be read: has 8388608 bytes: must have at most 4194304"),
    ],
    "study": [(2**23 * " ", "cannot be read: has 8388608 bytes: must have at most 4194304")],
    "recording": [
        (f"{POSES}0,3_0,1,0\n1,1,1,0\n2,1,1,0\n", "x_m, line 2: is '3_0', must be a number, with a decimal point"),
        (
            f"{POSES}0,\uff13,1,0\n1,1,1,0\n2,1,1,0\n",
            "x_m, line 2: is '\uff13', must be a number",
        ),
        (f"{POSES}0,inf,1,0\n1,1,1,0\n2,1,1,0\n", "x_m, line 2: is inf, must be in [-1e+09, 1e+09]"),
        (f"{POSES}0,1,1,0,9\n1,1,1,0\n", "line 2: has 5 values: must have 4, as many as its first line"),
        (f"# {POSES}0,3,1,0\n", "its first line is '# t_s': must name the columns; comments are not skipped"),
        (f'{POSES}0,"1,1,0\n', "line 2 = '0,\"1,1,0': a quotation mark has no other one in its line"),
    ],
}
OF_FILES: dict[str, tuple[str, Callable[[Path], Any]]] = {  # how its name ends, and what reads it
    "profile": (".csv", lambda file: scenario_with(slope__profile_file=str(file), slope__angle_deg=45)),
    "scenario": (".yaml", load_scenario),
    "study": (".yaml", sledenv.uncertainty.load_study),
    "recording": (".csv", lambda file: sledenv.identify(file, sledenv.disc(1.0, 0.5), Slope(0.1))),
}


@pytest.mark.parametrize(
    ("kind", "text", "words"),
    [pytest.param(kind, *row, id=f"{kind}-{k}") for kind, rows in WRONG_FILES.items() for k, row in enumerate(rows)],
)
def test_a_wrong_file_is_told_by_its_line(kind: str, text: str, words: str, tmp_path: Path) -> None:
    """Oracle: the message."""
    suffix, read = OF_FILES[kind]
    file = tmp_path / f"wrong{suffix}"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=re.escape(words)):
        read(file)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with names")
@pytest.mark.parametrize("kind", OF_FILES)
def test_what_is_no_file_with_an_end_in_utf_8_is_read_by_nobody(kind: str, tmp_path: Path) -> None:
    """Oracle: the message; a pipe that nobody writes to would be waited for, a device read without end."""
    suffix, read = OF_FILES[kind]
    pipe, device, folder, latin = (tmp_path / f"{name}{suffix}" for name in ("pipe", "device", "folder", "latin"))
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    folder.mkdir()
    for place in (pipe, device, folder):
        with pytest.raises((OSError, ValueError), match="must be a regular file, no folder, device or pipe"):
            read(place)
    latin.write_bytes(b"title: \xe9t\xe9")
    with pytest.raises(ValueError, match="must be text in UTF-8, but byte 8 is not"):
        read(latin)
    with pytest.raises((OSError, ValueError), match="No such file"):
        read(tmp_path / f"absent{suffix}")


def test_what_a_file_holds_that_is_no_profile_is_not_told(tmp_path: Path) -> None:
    """Oracle: a secret; whoever writes a scenario may name any file."""
    (tmp_path / "passwords").write_text('root:"secret:0\n')
    with pytest.raises(ValueError, match="line 1: must name the columns") as caught:
        scenario_with(slope__profile_file=str(tmp_path / "passwords"))
    assert "secret" not in str(caught.value)
