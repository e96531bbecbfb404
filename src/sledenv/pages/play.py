"""A page that simulates: the kernel, a context and a choice of bodies in one file, for any browser, offline."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, Final, NamedTuple

import numpy as np

from sledenv.pages.as_json import plain_slope
from sledenv.pages.html import filled
from sledenv.pages.kernel import descent_input, jsonable, packed_kernel
from sledenv.pages.scenes import drawn_body
from sledenv.scenarios.scenario import Context, Scenario, load_scenario, scenario_names
from sledenv.scenarios.sections import BOTH, control_words
from sledenv.simulation.bends import MOST_VERTICES, STEEPEST
from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.checks import has_sharp_corner
from sledenv.simulation.jam import SHOWN
from sledenv.simulation.records import CONTACT_LOSSES, FLIGHT_LOSSES, Mode
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Settings, Solver
from sledenv.simulation.shapes import disc, polygon
from sledenv.simulation.sleds import sled
from sledenv.simulation.support import clearance, support_height
from sledenv.simulation.words import REBOUND_HEADER, metric_name, mode_name

MOST_SEEDS: Final = 24  # contexts of a page
_DEGREE: Final = math.pi / 180.0
_HOLD: Final = 0.6  # [s] that an impact stays on the screen at least
_HARD: Final = (
    0.5  # [m/s] that it adds to the velocity off the slope; the hold of gentler ones is shorter in proportion
)
# Besides those of the scenario, fit for sharp vertices: what each is called, how Python makes it, and what it makes.
_READY: Final[tuple[tuple[str, str, Callable[[], Body]], ...]] = (
    ("sled with rider", "sledenv.sled()", sled),
    ("disc", "sledenv.disc(60.0, 0.4)", lambda: disc(60.0, 0.4)),
    ("eccentric disc", "sledenv.segment(60.0, 0.4, 0.15, 6.0)", lambda: segment(60.0, 0.4, 0.15, 6.0)),
    (
        "hexagon",
        "sledenv.polygon(60.0, [(0.5, 0.0), (0.2, 0.4), (-0.3, 0.35), (-0.5, 0.0), (-0.3, -0.3), (0.25, -0.35)], 0.02)",
        lambda: polygon(60.0, [(0.5, 0.0), (0.2, 0.4), (-0.3, 0.35), (-0.5, 0.0), (-0.3, -0.3), (0.25, -0.35)], 0.02),
    ),
)


class _Parameter(NamedTuple):
    """A parameter that a slider sets."""

    name: str  # in the address of the page
    group: str  # of the sliders
    label: str
    unit: str  # in which a reader sees it
    low: float  # in this unit
    high: float
    step: float  # of the slider; 0 of one whose steps are factors
    factor: float = 1.0  # that makes it an SI unit


_PARAMETERS: Final = (
    _Parameter("orientation", "launch", "orientation", "°", -180.0, 180.0, 0.5, _DEGREE),
    _Parameter("spin", "launch", "spin", "rad/s", -20.0, 20.0, 0.05),
    _Parameter("speed", "launch", "speed along the slope", "m/s", 0.0, 20.0, 0.05),
    _Parameter("fall", "launch", "speed towards it", "m/s", -5.0, 15.0, 0.05),
    _Parameter("drop", "launch", "height above it", "m", 0.0, 3.0, 0.01),
    _Parameter("angle", "slope", "angle", "°", -10.0, 50.0, 0.1, _DEGREE),
    _Parameter("length", "slope", "length", "m", 1.0, 60.0, 0.5),
    _Parameter("rounding", "ground", "rounding of all vertices", "m", 0.0, math.inf, 0.05),
    _Parameter("friction", "surface", "friction", "", 0.0, 1.5, 0.005),
    _Parameter("restitution", "surface", "restitution", "", 0.01, 1.0, 0.01),
    _Parameter("stiffness", "surface", "stiffness", "kN/m", 10.0, 1e6, 0.0, 1e3),
    _Parameter("rolling_arm", "surface", "rolling arm", "mm", 0.0, 50.0, 0.1, 1e-3),
    _Parameter("corner_rolling_arm", "surface", "the same of corners", "mm", 0.0, 50.0, 0.1, 1e-3),
    _Parameter("mass", "body", "mass", "kg", 0.1, 1000.0, 0.0),
    _Parameter("gyration", "body", "radius of gyration", "m", 0.01, 2.0, 0.0),
    _Parameter("error_orientation", "hand", "of the orientation", "°", 0.0, 10.0, 0.05, _DEGREE),
    _Parameter("error_spin", "hand", "of the spin", "rad/s", 0.0, 2.0, 0.01),
)


class NamedBody(NamedTuple):
    """A body that can be chosen."""

    name: str
    python: str  # what makes it
    body: Body


class Mark(NamedTuple):
    """A launch that maps mark."""

    name: str
    sign: str  # a letter
    colour: str  # "#rrggbb"
    launch: dict[str, float]  # what is chosen of orientation [rad], spin [rad/s] and speed [m/s]
    expected: float  # reward under the launch noise


class Played(NamedTuple):
    """A context that a page can be set to."""

    name: str
    context: Context
    marks: tuple[Mark, ...] = ()


def play_page(
    scenario: Scenario,
    contexts: Sequence[Played],
    solver: Solver = "compliant",
    axes: tuple[str, str] = BOTH,
    free: Collection[str] = BOTH,
) -> str:
    """Return a page that simulates, which needs no other file and no network: docs/browser.md.

    It opens with the descent that :func:`sledenv.simulate` gives for the first context, and has its numbers to the last
    bit.

    Parameters
    ----------
    scenario : Scenario
        Bounds of the launch, launch noise, limits and ends are its own, and its bodies are the first to choose.
    contexts : sequence of Played
        Draws of it, at least one.
    solver : {"compliant", "rigid"}
        How surfaces touch.
    axes : pair of str
        What the maps are over, in the order x, y: two of those that the scenario has bounds for.
    free : collection of str
        Of the axes those over which the page looks for the best launch.

    Raises
    ------
    TypeError, ValueError
        If a context is no context of the scenario, or there is none.
    """
    if not contexts:
        raise ValueError("contexts is empty: must hold at least one context")
    told = [_context(scenario, one) for one in contexts]
    first = contexts[0].context
    own = _own_bodies(scenario)
    _, law, slope, _ = scenario.given(first)
    return simulating_page(
        told,
        own,
        law,
        slope,
        scenario.settings(solver),
        title=scenario.title,
        question=scenario.question,
        own=len(own),
        axes=axes,
        free=[axis for axis in axes if axis in free],
        bounds=scenario.control_bounds,
        maps=True,
    )


def simulating_page(
    contexts: list[dict[str, Any]],
    bodies: list[NamedBody],
    law: ContactLaw,
    slope: Slope,
    settings: Settings,
    **told: Any,
) -> str:
    """Return a page that simulates.

    Parameters
    ----------
    contexts : list of dict
        Of :func:`told_setting`.
    bodies : list of NamedBody
        The first ones to choose.
    law, slope, settings
        Of the first context.
    **told
        What else the page is told: its title and question, what differs from a page of one descent.
    """
    ready = [*bodies, *(NamedBody(name, python, make()) for name, python, make in _READY)]
    choices = [_body(law, slope, settings, one) for one in ready]
    parameters = [one._asdict() for one in _widened([one["values"] for one in contexts], choices)]
    ground = {"most": MOST_VERTICES, "steepest": math.tan(STEEPEST)}
    exact = {"contexts": contexts, "bodies": choices, "parameters": parameters, "ground": ground}
    content = {
        "solver": settings.solver,
        "exact": exact_text(exact),
        "drawn": [drawn_body(one.body) for one in ready],
        "modes": {str(mode.value): mode_name(mode) for mode in Mode},
        "losses": CONTACT_LOSSES,
        "flight_losses": FLIGHT_LOSSES,
        "metrics": {name: metric_name(name) for name in SHOWN},
        "header": [name for name in REBOUND_HEADER if name not in ("grip", "loss")],
        "hold": _HOLD,
        "hard": _HARD,
        "kernel": packed_kernel(),
        **{"ghost": None, "recorded": None, "notes": [], "maps": False},
        **{"own": 0, "axes": BOTH, "free": BOTH, "bounds": {}},
    }
    return filled("play.html", data=content | told)


def exact_text(content: dict[str, Any]) -> str:
    """Return JSON as text: numbers of a page are rounded, but these decide bits."""
    return json.dumps(jsonable(content), separators=(",", ":"))


def told_setting(
    name: str,
    body: int,
    values: dict[str, float],
    law: ContactLaw,
    slope: Slope,
    launch: State,
    marks: Sequence[Mark] = (),
) -> dict[str, Any]:
    """Return what the page must know of what it can be set to, all digits of its numbers.

    ``values`` is what the sliders show. As long as none of them is moved, law, slope and launch are these.
    """
    return {
        "name": name,
        "body": body,
        "values": values,
        "law": law._asdict(),
        "slope": plain_slope(slope),
        "launch": launch._asdict(),
        "marks": [mark._asdict() for mark in marks],
    }


def map_page(scenario: Scenario, seeds: Sequence[int], marks: Mapping[int, Sequence[Mark]]) -> str:
    """Return the page that simulates contexts of a scenario, whose maps are over what it lets an agent choose.

    That is the first two things, or orientation and spin if it is one alone; the page looks for the best launch over
    what is chosen.

    Parameters
    ----------
    scenario : Scenario
    seeds : sequence of int
        Which contexts are drawn, as in ``sledenv simulate``: from 1 to ``MOST_SEEDS``, all different.
    marks : mapping of int to sequence of Mark
        What is marked in the contexts of some of them.

    Raises
    ------
    ValueError
        If the seeds are wrong.
    """
    if not 1 <= len(seeds) <= MOST_SEEDS or len(set(seeds)) < len(seeds):
        raise ValueError(f"seeds = {list(seeds)}: must be 1 to {MOST_SEEDS} integers, all different")
    contexts = [
        Played(f"seed {seed}", scenario.sample(np.random.default_rng(seed)), tuple(marks.get(seed, ())))
        for seed in seeds
    ]
    free = control_words(scenario.control_bounds)[scenario.control.chosen]
    first, *others = free
    return play_page(scenario, contexts, axes=(first, others[0]) if others else BOTH, free=free)


def _context(scenario: Scenario, played: Played) -> dict[str, Any]:
    name, context, marks = played
    _, law, slope, launch = scenario.given(context)
    control = scenario.control
    values = {
        "orientation": launch.phi,
        "spin": context.spin,
        "speed": context.speed,
        "fall": context.fall,
        "drop": context.drop,
        **_ground_values(law, slope),
        "error_orientation": math.radians(control.noise_orientation_deg),
        "error_spin": control.noise_spin_rad_s,
    }
    return told_setting(name, int(context.shape), values, law, slope, launch, marks)


def given_values(body: Body, law: ContactLaw, slope: Slope, launch: State) -> dict[str, float]:
    """Return what the sliders show of a descent, in SI units."""
    return {
        "orientation": launch.phi,
        "spin": launch.omega,
        "speed": launch.u,
        "fall": 0.0 - launch.v,
        "drop": clearance(body, slope, launch),
        **_ground_values(law, slope),
        "error_orientation": 0.0,
        "error_spin": 0.0,
    }


def _ground_values(law: ContactLaw, slope: Slope) -> dict[str, float]:
    """Return what the sliders show but for launch and body, in SI units.

    A ground whose vertices have several radii has no rounding of all.
    """
    radii = set(slope.rounding or (0.0,))
    return {
        "angle": slope.angle,
        "length": slope.length,
        "rounding": radii.pop() if len(radii) == 1 else math.nan,
        "friction": law.friction,
        "restitution": law.restitution,
        "stiffness": law.stiffness,
        "rolling_arm": law.rolling_arm,
        "corner_rolling_arm": law.corner_rolling_arm,
    }


def _own_bodies(scenario: Scenario) -> list[NamedBody]:
    bodies = scenario.all_bodies()
    shipped = scenario.id in scenario_names() and load_scenario(scenario.id) == scenario
    found = []
    for k, body in enumerate(bodies):
        name = f"body {k + 1} of {scenario.id}" if len(bodies) > 1 else f"body of {scenario.id}"
        python = f'sledenv.load_scenario("{scenario.id}").all_bodies()[{k}]' if shipped else body.typed()
        found.append(NamedBody(name, python, body))
    return found


def _body(law: ContactLaw, slope: Slope, settings: Settings, named: NamedBody) -> dict[str, Any]:
    """Return a body as the page must know it, with all digits of its numbers, and how its descents end."""
    name, python, body = named
    ending = [name for name in settings.end_parts if name in body.parts]
    settings = replace(settings, end_touching=ending or None)
    anyhow = State(0.0, support_height(body, 0.0), 0.0)
    plane = Slope(slope.angle, slope.length, slope.gravity, air_density=slope.air_density)
    given = descent_input(body, law, plane, anyhow, settings)
    rigid = descent_input(body, law, plane, anyhow, replace(settings, solver="rigid"))
    told = {key: getattr(settings, key) for key in ("max_time", "max_rebounds", "run_out")}
    told |= {
        one.name: getattr(settings, one.name)
        for one in fields(settings)
        if one.name != "solver" and one.name not in told and getattr(settings, one.name) != one.default
    }
    return {
        "name": name,
        "python": python,
        "settings": ", ".join(f"{key}={value!r}" for key, value in told.items()),
        "given": given["body"],
        "limits": given["limits"],
        "settle_speed": rigid["law"]["settle_speed"],
        "gyration": math.sqrt(body.inertia / body.mass),
        "parts": body.parts,
        "sharp": bool(has_sharp_corner(body.record)[0]),
        "size": body.size or 0.1,  # a point mass has none, but is to be seen
    }


def _widened(contexts: list[dict[str, float]], bodies: list[dict[str, Any]]) -> list[_Parameter]:
    """Return the parameters with ranges that hold what the page begins with."""
    held = {name: [values[name] for values in contexts] for name in contexts[0]}
    held |= {"mass": [one["given"]["mass"] for one in bodies], "gyration": [one["gyration"] for one in bodies]}
    found = []
    for one in _PARAMETERS:
        shown = [value / one.factor for value in held[one.name] if math.isfinite(value)]
        found.append(one._replace(low=min([one.low, *shown]), high=max([one.high, *shown])))
    return found
