"""Descents over profiles that once rode through the air, stopped dead, sank or never came to rest."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sledenv

G = 9.81
RUN = [
    (0.0, 0.0),
    (2.0, 0.0),
    (2.2, 0.0002),
    (6.0, -1.0),
    (7.0, -1.0),
]  # a dip of a millimetre per metre before a crest
WEDGE = sledenv.polygon(0.6, [(-0.4, -0.1), (0.4, -0.1), (0.1, 0.2)], 0.003)


def hollow(pieces: int) -> list[tuple[float, float]]:
    """A round hollow of 1 m radius, cut into chords of equal width."""
    x = np.linspace(-0.7, 0.7, pieces + 1)
    return list(zip(x.tolist(), (1.0 - np.sqrt(1.0 - x * x)).tolist(), strict=True))


def height(profile: list[tuple[float, float]], x: float) -> float:
    return float(np.interp(x, *np.transpose(profile)))


@pytest.mark.parametrize("mirror", [1.0, -1.0])
@pytest.mark.parametrize("stiffness", [1e6, 1e8])
def test_a_foot_that_leaves_a_run_of_dips_goes_on_to_the_crest_at_its_end(mirror: float, stiffness: float) -> None:
    """Oracle: the disc ends on the lower level, pressed in by its weight; it rolled a hand's breadth over the air."""
    law = sledenv.ContactLaw.from_restitution(0.3, stiffness=stiffness, friction=0.01, rolling_arm=0.0)
    profile = sorted((mirror * x, y) for x, y in RUN)
    launch = sledenv.State(0.5 * mirror, 0.3, 0.0, 2.0 * mirror, 0.0, -2.0 / 0.3 * mirror)
    descent = sledenv.simulate(
        sledenv.disc(50.0, 0.3), law, sledenv.Slope(0.0, profile=profile), launch, max_time=6.0, record="trajectory"
    )
    assert abs(descent.state.x) > 15.0
    assert descent.state.y == pytest.approx(-0.7, abs=5.0 * 50.0 * G / law.stiffness)
    for row in descent.trajectory[:: len(descent.trajectory) // 200]:
        x, y = row["x"], row["y"]
        assert y - height(profile, x) > 0.29, row["t"]
        if row["touching"]:
            points = np.array([(contact["x"], contact["y"]) for contact in row["contacts"][: row["touching"]]])
            assert max(abs(point[1] - height(profile, point[0])) for point in points) < 1e-3


@pytest.mark.parametrize("turn", [0.001, 0.01, 0.05, 0.1])
@pytest.mark.parametrize("thickness", [0.02, 0.1, 0.3])
def test_a_rod_that_lies_slides_over_a_crest(turn: float, thickness: float) -> None:
    """Oracle: it goes on along the plane behind the crest. The crest passes from an arc of half a turn to the side."""
    law = sledenv.ContactLaw.from_restitution(0.3, stiffness=1e7, friction=0.02, rolling_arm=0.0)
    slope = sledenv.Slope(0.3, 20.0, profile=[(5.0, 0.0), (12.0, -7.0 * math.tan(turn))])
    rod = sledenv.rod(20.0, 1.0, thickness)
    descent = sledenv.simulate(rod, law, slope, sledenv.State(0.0, 0.5 * thickness, 0.0, 5.0))
    assert descent.status == "finish"
    assert descent.state.y == pytest.approx(0.5 * thickness - 7.0 * math.tan(turn), abs=1e-4)


@pytest.mark.parametrize("u", [19.41, 19.41 + 1e-7, 19.42, 25.0, 3.0])
@pytest.mark.parametrize("turn", [0.0383, 1.2e-9])
def test_a_velocity_is_zero_only_if_it_is(u: float, turn: float) -> None:
    """Oracle: sliding friction alone slows a light body on stiff ground; its normals may differ by a billionth."""
    law = sledenv.ContactLaw(754229746.78, 0.24828, 0.02, 0.01)
    slope = sledenv.Slope(0.069225, 20.0, profile=[(3.0, 0.0), (6.0, -3.0 * math.tan(turn))])
    descent = sledenv.simulate(WEDGE, law, slope, sledenv.State(0.0, 0.10002444623845418, 0.0, u))
    assert descent.status == "finish"
    assert abs(descent.energy.residual) < 1e-9 * descent.energy.turnover
    least = G * (math.sin(slope.angle) - law.friction * math.cos(slope.angle))
    assert descent.state.u > math.sqrt(u * u + 2.0 * least * 20.0) * 0.99


@pytest.mark.filterwarnings("ignore:.*too finely:UserWarning")
@pytest.mark.parametrize("pieces", [24, 30, 36])
@pytest.mark.parametrize("friction", [0.02, 0.3])
def test_a_disc_in_a_round_hollow_comes_to_rest_on_more_contacts_than_it_needs(pieces: int, friction: float) -> None:
    """Oracle: loads push, and together they hold the weight; a few hundred steps are enough."""
    law = sledenv.ContactLaw.from_restitution(0.3, stiffness=1e5, friction=friction, rolling_arm=0.0)
    descent = sledenv.simulate(
        sledenv.disc(20.0, 0.1),
        law,
        sledenv.Slope(0.0, profile=hollow(pieces)),
        sledenv.State(0.0, 0.3, 0.0),
        record="trajectory",
        max_time=20.0,
    )
    assert descent.status == "jammed"
    assert descent.outcome["steps"] < 1000
    last = descent.trajectory[-1]
    contacts = last["contacts"][: last["touching"]]
    assert len(contacts) > 3
    assert (contacts["normal"] >= 0.0).all()
    assert (np.abs(contacts["tangential"]) <= friction * contacts["normal"] * (1.0 + 1e-12)).all()
    force_x = contacts["normal"] * contacts["normal_x"] + contacts["tangential"] * contacts["normal_y"]
    force_y = contacts["normal"] * contacts["normal_y"] - contacts["tangential"] * contacts["normal_x"]
    assert force_x.sum() == pytest.approx(0.0, abs=1e-9 * 20.0 * G)
    assert force_y.sum() == pytest.approx(20.0 * G, rel=1e-9)


@pytest.mark.parametrize("depth", [0.02, 0.029, 0.031, 0.05])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_contact_goes_on_over_a_crest_that_is_deeper_than_its_arc_is_round(depth: float, side: float) -> None:
    """Oracle: a crate that slides 2 to 5 cm deep in plastic ground leaves it where the crest is; its corner has 3 cm.

    Plastic ground gives nothing back: the crate keeps its depth up to there, and its velocity.
    """
    crate = sledenv.polygon(50.0, [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)], 0.03)
    law = sledenv.ContactLaw(1e5, 1.0 - 1e-6, 0.0, 0.0)
    speed = depth * math.sqrt(2e5 / 50.0)
    crest = [(-4.0, -2.0), (0.0, 0.0), (4.0, -2.0)]
    slope = sledenv.Slope(0.0, profile=[(side * x, y) for x, y in crest[:: int(side)]])
    turn = side * math.atan(0.5)
    # Its corner points along the normal of the face before the crest; it moves up that face, and into it.
    phi = turn + side * math.pi / 4.0
    along, normal = np.array([math.cos(turn), math.sin(turn)]), np.array([-math.sin(turn), math.cos(turn)])
    centre = -1.2 * side * along + (0.03 + 0.47 * math.sqrt(2.0)) * normal
    velocity = 6.0 * side * along - speed * normal
    descent = sledenv.simulate(
        crate, law, slope, sledenv.State(*centre, phi, *velocity), max_time=0.5, max_rebounds=1, record="trajectory"
    )
    assert descent.status == "log_full"
    assert descent.rebounds["peak_penetration"][0] > 0.6 * depth
    assert side * descent.state.x > -0.5
    assert abs(descent.energy.residual) < 1e-9 * descent.energy.turnover


@pytest.mark.parametrize("u", [9.152542372881356, 9.0, 9.2])
def test_a_corner_that_is_pressed_in_without_a_load_does_not_touch_again_and_again(u: float) -> None:
    """Oracle: friction alone slows a sled that slides flat onto a straight piece, three corners of it pressed in.

    It leaves a round dip with two corners that bear it, and stays as deep as it is. The third was found to touch, by
    rounding, and let go at once, until the budget of steps was spent.
    """
    hull = [(-0.33, 0.008), (-0.1, 0.001), (0.15, 0.0), (0.48, 0.024), (0.6, 0.06), (0.7, 0.1), (0.95, 0.23)]
    hull += [(0.97, 0.3), (0.8, 0.35), (0.4, 0.36), (0.0, 0.33), (-0.5, 0.25), (-0.7, 0.2), (-0.88, 0.15)]
    sled = sledenv.polygon(118.0, [*hull, (-0.89, 0.09)], rounding=0.003, centre=(0.05, 0.14), inertia=16.4)
    law = sledenv.ContactLaw.from_restitution(0.15, stiffness=1e6, friction=0.02, rolling_arm=0.001)
    profile = [(0.6, 53.34), (14.0, 51.48), (41.6, 46.2), (73.4, 41.6), (110.2, 33.62), (146.5, 30.92)]
    rounding = [36.7, 264.9, 558.5, 355.8, 209.5, 0.0]
    slope = sledenv.Slope(0.0, 140.0, profile=profile, rounding=rounding)
    launch = sledenv.State(5.0, float(slope.height_at(5.0)) + 0.24507562751024125, 0.0, u)
    descent = sledenv.simulate(sled, law, slope, launch, record="trajectory")
    assert descent.status == "finish"
    assert abs(descent.energy.residual) < 1e-9 * descent.energy.turnover
    slides = descent.trajectory[descent.trajectory["x"] > 130.0]
    fall = math.atan2(33.62 - 30.92, 146.5 - 110.2)
    slows = G * (math.sin(fall) - 0.02 * math.cos(fall))
    speed = np.hypot(slides["u"], slides["v"])
    took = slides["t"][-1] - slides["t"][0]
    assert speed[-1] - speed[0] == pytest.approx(slows * took, rel=0.01, abs=1e-3)


@pytest.mark.parametrize("stiffness", [1e3, 1e4, 3e4])
def test_a_body_pressed_too_deep_into_a_profile_is_buried(stiffness: float) -> None:
    """Oracle: it ends in the first step after a quarter of its radius; it fell through the ground and finished."""
    law = sledenv.ContactLaw.from_restitution(0.3, stiffness=stiffness, friction=0.02, rolling_arm=0.0)
    slope = sledenv.Slope(0.1, 30.0, profile=[(3.0, 0.0), (5.0, 0.5), (6.0, 0.5), (8.0, 0.0)])
    launch = sledenv.State(7.069, 2.0, 0.3, 1.0, -1.0)
    descent = sledenv.simulate(sledenv.disc(20.0, 0.1), law, slope, launch, record="trajectory")
    assert descent.status == "buried"
    rows = descent.trajectory
    depth = 0.1 - (rows["y"] - 0.5 + (rows["x"] - 6.0) * 0.25) * math.cos(math.atan2(0.5, 2.0))
    assert 0.025 < depth[-1] <= 0.05
    begins = np.flatnonzero(np.diff(rows["t"]) == 0.0)  # of steps in contact
    assert depth[begins[:-1]].max(initial=0.0) <= 0.025


@pytest.mark.parametrize("restitution", [1e-15, 1e-12, 1e-9, 1e-8, 2e-8])
def test_a_tiny_restitution_is_none_where_rigid_surfaces_touch_flat(restitution: float) -> None:
    """Oracle: the bits of restitution 0."""
    crate = sledenv.polygon(1.0, [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], 0.02)
    slope, launch = sledenv.Slope(math.radians(5.0), 20.0), sledenv.State(0.0, 1.5, 0.0)
    kept = {"stiffness": 1e6, "friction": 0.3, "rolling_arm": 0.0}
    laws = [sledenv.ContactLaw.from_restitution(e, **kept) for e in (0.0, restitution)]
    plastic, tiny = (sledenv.simulate(crate, law, slope, launch, solver="rigid") for law in laws)
    assert tiny.status == "jammed"
    assert plastic.rebounds.tobytes() == tiny.rebounds.tobytes()
