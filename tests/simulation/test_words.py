"""Words, tables and JSON of a body and its parts."""

from __future__ import annotations

import json
import math

import pytest

from sledenv.pages.as_json import plain_descent, plain_setting
from sledenv.pages.columns import trajectory_columns
from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.outlines import Arc
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.shapes import circular_segment, hull
from sledenv.simulation.words import rebound_cells, rounded, setting, story
from tests.bodies import DISC, HILL, ICE, SLED, run
from tests.plot.outlined import BOULDER, CRATE, LINE, RIDER, descent_of


def first_line(body: Body) -> str:
    """Return the line that is said of a body."""
    descent = run(body, ICE, HILL, (0.0, 0.5, 0.2), max_time=1e-3)
    return setting(body, descent.law, descent.slope, descent.launch).splitlines()[0]


def test_a_body_is_described_by_its_numbers_and_its_parts() -> None:
    assert first_line(DISC) == (
        "body: mass 100 kg, radius 0.5 m, eccentricity 0.25 m, inertia 18.75 kg m^2, no corners"
    )
    assert first_line(circular_segment(100.0, 0.5, 1.2)).endswith("kg m^2, half-angle 68.75 deg")
    assert first_line(LINE) == (
        "body: mass 5 kg, inertia 0.6 kg m^2, size 0.6 m, 2 arcs; parts: nose, tail, bottom, top"
    )
    assert first_line(RIDER) == (
        "body: mass 110 kg, inertia 18 kg m^2, size 0.7579 m, 4 arcs; parts: nose, runner, tail, head, back, front"
    )
    wheel = Body(2.0, 0.1, [Arc(0.0, 0.1, 0.3, 0.0, "tyre")])
    assert first_line(wheel) == "body: mass 2 kg, inertia 0.1 kg m^2, size 0.4 m, 1 arc; parts: tyre"
    stone = hull(2.0, [(0.3 * math.cos(k), 0.3 * math.sin(k), 0.05) for k in range(6)])
    assert first_line(stone).endswith("6 arcs; 12 parts")


def test_a_profile_is_described_by_its_extent_and_its_radii() -> None:
    sharp = Slope(0.2, profile=[(1.0, 0.0), (2.0, 0.5), (4.0, -0.25)])
    for rounding, radii in ((0.0, ""), (1.5, ", radius 1.5 m"), ([0.0, 2.0, 0.5], ", radii 0 to 2 m")):
        words = setting(SLED, ICE, sharp._replace(rounding=rounding), State(0.0, 1.0, 0.0)).splitlines()[2]
        assert words.endswith(f", profile of 3 vertices from 1 to 4 m, heights -0.25 to 0.5 m{radii}")


@pytest.mark.parametrize(("name", "solver"), [("boulder", "rigid"), ("rider", "compliant"), ("line", "compliant")])
def test_tables_name_the_part_that_touched(name: str, solver: str) -> None:
    """Oracle: the codes of the log, which count the parts of the body from 1."""
    descent = descent_of(name, solver)
    names = ("none", *descent.body.parts)
    expected = [names[code] for code in descent.rebounds["feature"]]
    assert [cells[3] for cells in rebound_cells(descent)] == expected
    assert [rebound["feature"] for rebound in plain_descent(descent)["rebounds"]] == expected
    told = trajectory_columns(descent)["feature"]
    assert told == [names[code] for code in descent.trajectory["feature"]]
    assert {"none", *expected} <= set(told) or solver == "rigid"


def test_a_story_tells_on_what_the_body_lay() -> None:
    """Oracle: a rod slides to the end on its side, the shipped segment on its chord."""
    flat = descent_of("line", "compliant")
    assert flat.on_chord is not None
    assert f"side       first lay on one, settled, after {rounded(flat.on_chord[0])} s" in story(flat)
    segments = run(SLED, ICE, HILL, (0.0, 0.0, 3.14159, 1.0, 0.0, 0.0))
    assert segments.on_chord is not None
    assert f"chord      first lay on it, settled, after {rounded(segments.on_chord[0])} s" in story(segments)


def test_a_story_tells_of_a_surface_so_soft_that_a_body_sinks_in() -> None:
    """Oracle: the rebounds; a stiffness of 1 kN/m is one in another unit."""
    for stiffness, told in ((1e3, True), (1e7, False)):
        law = ContactLaw.from_restitution(0.5, stiffness=stiffness, friction=0.2, rolling_arm=0.001)
        descent = run(DISC, law, HILL, (0.0, 1.0, 0.0, 2.0))
        depth = descent.rebounds["peak_penetration"].max()
        words = f"depth      pressed in by {depth:.4g} m, {depth / DISC.size:.2g} times the size of the body"
        assert (words in story(descent)) == told
        assert ("depth" in story(descent)) == told


@pytest.mark.parametrize("body", [SLED, BOULDER, CRATE, RIDER, LINE])
def test_a_body_can_be_read_back_from_json(body: Body) -> None:
    """Oracle: the body."""
    plain = json.loads(json.dumps(plain_setting(body, ICE, HILL, State(0.0, 9.0, 0.0))["body"]))
    if "arcs" in plain:
        plain["arcs"] = [Arc(**arc) for arc in plain["arcs"]]
    assert (Body if "arcs" in plain else segment)(**plain) == body
