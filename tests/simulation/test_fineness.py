"""How finely a polyline may be cut for a body and a stiffness, and who is told: docs/physics.md, section 12."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import sledenv
from sledenv import Body, ContactLaw, Ride, Slope, State, simulate, simulate_batch
from sledenv.kernel.params import SCENE
from sledenv.simulation import RideBatch
from sledenv.simulation.fineness import IN_A_ROW, TooFine, too_fine
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.scenes import NO_ZONES, Scenes
from tests.rough_grounds import hull_of_three, rock

G, MASS, STIFFNESS = 9.81, 50.0, 1e6
PRESSED = MASS * G / STIFFNESS  # [m] by the weight
LAW = ContactLaw(STIFFNESS, 0.0, 0.1, 0.0)
Polyline = list[tuple[float, float]]


def hollow(radius: float, turn: float, shift: float = 0.0, half: float = 0.5) -> Polyline:
    """A round dip, cut into pieces that turn by some angle each; x = 0 is a vertex or, shifted by 0.5, between two."""
    angles = turn * (np.arange(-math.ceil(half / turn), math.ceil(half / turn) + 1) + shift)
    return [(float(radius * math.sin(a)), float(radius * (1.0 - math.cos(a)))) for a in angles]


def turn_for(rises: float, radius: float, within: float) -> float:
    """Turn [rad] between pieces over which the parallel at a distance rises by so many depths of the weight."""
    return math.sqrt(rises * PRESSED / (radius - within))


# The rule.


@pytest.mark.parametrize(("radius", "within"), [(3.0, 0.3), (3.0, 2.5), (20.0, 15.0)])
def test_a_finer_cut_is_told_of(radius: float, within: float) -> None:
    """Oracle: theta (s - r theta) is that of the depth; the warning names remedies, and the line of whoever calls."""
    disc, launch = sledenv.disc(MASS, within), State(0.0, within + 0.1, 0.0)
    coarse, fine = (Slope(0.0, profile=hollow(radius, turn_for(rises, radius, within))) for rises in (1.02, 0.98))
    given: dict[str, Any] = {"max_time": 0.01}
    simulate(disc, LAW, coarse, launch, **given)
    simulate(disc, LAW, Slope(0.0, profile=fine.profile, rounding=math.inf), launch, **given)
    simulate(disc, LAW._replace(stiffness=1.1 * STIFFNESS), fine, launch, **given)
    simulate(disc, LAW, fine._replace(gravity=0.9 * G), launch, **given)
    told = r"cut too finely around x = .* presses body.* in by 0\.000491 m, .*rounding=math\.inf.*tolerance_m"
    for call in (
        lambda: simulate(disc, LAW, fine, launch, **given),
        lambda: simulate_batch(disc, LAW, [coarse, fine], [launch] * 2, **given),
        lambda: Ride(disc, LAW, fine, launch),
        lambda: RideBatch(disc, LAW, fine, [launch] * 2),
    ):
        with pytest.warns(UserWarning, match=told) as caught:
            call()
        assert [warning.filename for warning in caught] == [__file__]


def test_a_lane_is_named_and_a_soft_zone_counts() -> None:
    """Oracle: the third of four bodies; the second of two slopes, whose second zone is softer."""
    light, heavy, launch = sledenv.disc(0.1 * MASS, 0.3), sledenv.disc(MASS, 0.3), State(0.0, 0.4, 0.0)
    slope = Slope(0.0, profile=hollow(3.0, turn_for(0.5, 3.0, 0.3)))
    with pytest.warns(UserWarning, match=r"^slope\[2\]\.profile .* presses body\[2\] "):
        simulate_batch([light, light, heavy, light], LAW, [slope] * 4, [launch] * 4, max_time=0.01)
    zones = [sledenv.Zone(0.0, 1.0, 0.1, 0.0), sledenv.Zone(1.0, 2.0, 0.1, 0.0, stiffness=0.1 * STIFFNESS)]
    coarse = Slope(0.0, profile=hollow(3.0, turn_for(2.0, 3.0, 0.3)), zones=zones[:1])
    with pytest.warns(UserWarning, match=r"^slope\[1\]\.profile .* presses body\[1\] "):
        simulate_batch(heavy, LAW, [coarse, coarse._replace(zones=zones)], [launch] * 2, max_time=0.01)


def obvious(body: Body, law: ContactLaw, profile: Sequence[tuple[float, float]]) -> bool:
    """Whether so many pieces in a row, all between dips, are too short for an arc that lies on all: a loop."""
    points = np.array(profile)
    tilts = np.r_[0.0, np.arctan2(*np.diff(points, axis=0).T[::-1]), 0.0]
    turns, lengths = np.diff(tilts), np.hypot(*np.diff(points, axis=0).T)
    ends = [*(arc.begin for arc in body.arcs[1:]), body.arcs[0].begin + 2.0 * math.pi]
    depth = body.mass * G / law.stiffness
    for k in range(1, len(points) - 1 - IN_A_ROW):
        if turns[k : k + IN_A_ROW + 1].min() <= 0.0:
            continue
        for arc, end in zip(body.arcs, ends, strict=True):
            if end - arc.begin < turns[k : k + IN_A_ROW + 1].sum():
                continue
            means = 0.5 * (turns[k : k + IN_A_ROW] + turns[k + 1 : k + IN_A_ROW + 1])
            if (np.abs(means * (lengths[k : k + IN_A_ROW] - arc.radius * means)) < depth).all():
                return True
    return False


def test_many_lanes_are_looked_at_as_each_alone() -> None:
    """Oracle: a loop over arcs and pieces; bodies, laws and grounds of all kinds, in each combination."""
    rng = np.random.default_rng(4)
    bodies = [(rock, hull_of_three)[k % 2](rng, rng.uniform(0.2, 1.0)) for k in range(12)]
    laws = [LAW._replace(stiffness=body.mass * 10.0 ** rng.uniform(3.0, 6.0)) for body in bodies]
    profiles = []
    for _ in bodies:
        x = np.cumsum(rng.uniform(0.05, 0.4, 60))
        profiles.append(np.column_stack([x, 0.3 * np.sin(x / rng.uniform(0.5, 3.0)) + rng.normal(0.0, 0.001, 60)]))
    slopes = [Slope(0.0, profile=each) for each in profiles]

    def looked(those: Sequence[Body], laws: Sequence[ContactLaw], slopes: Sequence[Slope]) -> TooFine | None:
        """Scenes without a check, as checks would warn."""
        ground = Grounds.of([slope.vertices for slope in slopes], range(len(slopes)))
        rows = np.zeros(max(len(those), len(laws), len(slopes)), SCENE)
        rows["body"], rows["gravity"] = np.arange(len(those)), G
        rows["ground"], rows["ground_end"] = ground.places.T
        rows["stiffness"] = [law.stiffness for law in laws]
        return too_fine(Scenes(rows, np.concatenate([body.record for body in those]), ground.pieces, NO_ZONES))

    alone = [[obvious(body, law, profile) for profile in profiles] for body, law in zip(bodies, laws, strict=True)]
    assert 10 < np.sum(alone) < 130
    for i, (body, law) in enumerate(zip(bodies, laws, strict=True)):
        first = next((k for k, fine in enumerate(alone[i]) if fine), None)
        for those in ([body], [body] * len(slopes)):
            found = looked(those, [law], slopes)
            assert (found.lane if found else None) == first
    for k, slope in enumerate(slopes):
        first = next((i for i in range(len(bodies)) if alone[i][k]), None)
        found = looked(bodies, laws, [slope])
        assert (found.lane if found else None) == first
