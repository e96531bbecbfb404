"""Zones with restitution and stiffness of their own, and boundaries of zones on crests: docs/physics.md, 11 and 14."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import sledenv
from tests.profiles import Profile

G = 9.81
BALL = sledenv.disc(2.0, 0.1)
LAW = sledenv.ContactLaw.from_restitution(0.3, stiffness=1e6, friction=0.0, rolling_arm=0.0)
TABLE: Profile = [(0.0, 0.0), (1.5, -8.0)]


def zone(begin: float, end: float, friction: float = 0.0, **own: float) -> Any:
    return sledenv.Zone(begin, end, friction, 0.0, **own)


def bounced(speed: float, restitution: float, stiffness: float) -> tuple[float, float]:
    """Speed [m/s] after and penetration [m] of a ball that comes down with ``speed``: docs/physics.md (5.11)."""
    squared = restitution**2
    closing = stiffness * 2.0 / (1.0 + squared)  # c (1 + Delta)
    nu = speed * math.sqrt(closing / BALL.mass) / G
    deepest = BALL.mass * G / closing * (1.0 + math.sqrt(1.0 + nu * nu))
    return math.sqrt(squared * speed**2 - 2.0 * G * deepest * (1.0 - squared)), deepest


def first_rebound(x: float, zones: list[Any], **rates: float) -> np.void:
    slope = sledenv.Slope(0.0, zones=zones)
    row: np.void = sledenv.simulate(BALL, LAW, slope, sledenv.State(x, 0.6, 0.0, **rates), max_rebounds=1).rebounds[0]
    return row


@pytest.mark.parametrize(
    "own", [{"restitution": 0.9}, {"stiffness": 2e4}, {"restitution": 0.9, "stiffness": 2e4}, {"restitution": 1.0}, {}]
)
@pytest.mark.parametrize(("x", "within"), [(1.5, True), (0.5, False), (1.0, True), (2.0, False)])
def test_a_ball_bounces_as_its_zone_does(own: dict[str, float], x: float, within: bool) -> None:
    """Oracle: energy of the two springs under gravity in closed form; a zone holds its begin and not its end."""
    row = first_rebound(x, [zone(1.0, 2.0, **own)])
    law = {"restitution": 0.3, "stiffness": 1e6} | (own if within else {})
    after, deepest = bounced(-row["v_before"], **law)
    assert row["v_after"] == pytest.approx(after, rel=1e-11)
    assert row["peak_penetration"] == pytest.approx(deepest, rel=1e-11)
    assert row["x_contact"] == x


@pytest.mark.parametrize("restitution", [0.2, 0.8])
def test_a_rigid_block_that_lands_flat_bounces_as_its_zone_does(restitution: float) -> None:
    """Oracle: both ends touch at once, so the speed is multiplied by the restitution of the zone."""
    block = sledenv.polygon(2.0, [(0.2, -0.1), (-0.2, -0.1), (-0.2, 0.1), (0.2, 0.1)])
    slope = sledenv.Slope(0.0, zones=[zone(-1.0, 1.0, restitution=restitution)])
    (row,) = sledenv.simulate(block, LAW, slope, sledenv.State(0.0, 0.3, 0.0), solver="rigid", max_rebounds=1).rebounds
    assert row["v_after"] == pytest.approx(-restitution * row["v_before"], rel=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_contact_keeps_the_springs_of_where_it_began(sign: float) -> None:
    """Oracle: without friction a ball that runs out of its zone while it is pressed bounces as one that stays in it."""
    speed, fall = 40.0 * sign, math.sqrt(2.0 * 0.5 / G)
    where = speed * fall  # of the touch
    soft = {"restitution": 0.9, "stiffness": 2e4}
    for begin, end in ((-1e-4, 1e-3), (-1e-3, 1e-4)):
        row = first_rebound(0.0, [zone(where + begin, where + end, **soft)], u=speed)
        after, _ = bounced(-row["v_before"], **soft)
        assert row["v_after"] == pytest.approx(after, rel=1e-10)
        assert abs(row["x"] - row["x_contact"]) > 0.1  # far out of the zone
    ahead = where + 1e-3 if sign > 0.0 else where - 1.0
    row = first_rebound(0.0, [zone(ahead, ahead + 0.999, **soft)], u=speed)
    assert row["v_after"] == pytest.approx(bounced(-row["v_before"], 0.3, 1e6)[0], rel=1e-10)


@pytest.mark.parametrize("rough_ahead", [True, False])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_on_a_crest_that_is_a_boundary_the_larger_friction_holds(rough_ahead: bool, sign: float) -> None:
    """Oracle: Coulomb's law on the side of a plate that slides over the edge of a table, and of its mirror image."""
    plate = sledenv.polygon(10.0, [(-0.5, -0.05), (0.5, -0.05), (0.5, 0.05), (-0.5, 0.05)], rounding=0.02)
    rough, smooth = 0.3, 0.05
    ahead, behind = (rough, smooth) if rough_ahead else (smooth, rough)
    law = LAW._replace(stiffness=1e8, friction=behind)
    zones = [zone(0.0, 9.0, ahead)] if sign > 0.0 else [zone(-9.0, 0.0, ahead)]
    profile = TABLE if sign > 0.0 else [(-x, y) for x, y in TABLE[::-1]]
    slope = sledenv.Slope(0.0, zones=zones, profile=profile)
    launch = sledenv.State(-0.3 * sign, 0.05, 0.0, 3.0 * sign)
    rows = sledenv.simulate(
        plate, law, slope, launch, max_time=0.06, record="trajectory", sample_interval=1e-3
    ).trajectory
    crest = 1 if sign > 0.0 else 3  # codes of vertex 0, and of vertex 1
    table = 0 if sign > 0.0 else 4
    seen = 0
    for row in rows:
        for contact in row["contacts"][: row["touching"]]:
            if contact["ground"] in (crest, table) and contact["normal"] > 1.0:
                friction = rough if contact["ground"] == crest else behind
                assert contact["tangential"] == pytest.approx(-sign * friction * contact["normal"], rel=1e-9)
                seen += contact["ground"] == crest
    assert seen > 5
