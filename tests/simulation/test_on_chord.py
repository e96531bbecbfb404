"""Descents that may end where the body lies on its chord: alone, in batches and blocks, hop by hop, of scenarios."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sledenv import load_scenario, simulate
from sledenv.kernel.records import Feature, Status
from sledenv.scenarios.scenario import Scenario, scenario_names
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.support import support_height
from tests.own_scenarios import own_scenario

BODY = circular_segment(100.0, 0.5, math.radians(110.0))
SLOPE = Slope(0.15, 10.0)
SOLVERS = ("compliant", "rigid")


def problem(seed: int) -> tuple[ContactLaw, State]:
    """Launches on the back: some slide on there, some come to rest there at once, some get onto the keel."""
    rng = np.random.default_rng(seed)
    friction = rng.uniform(0.02, 0.1) if seed % 3 else rng.uniform(0.2, 0.5)
    phi, drop, u, omega = math.pi + rng.uniform(-2.0, 2.0), rng.uniform(0.0, 0.3), rng.uniform(-1.0, 3.0), rng.normal()
    if seed % 6 == 0:  # laid down
        friction, phi, drop, u, omega = 0.6, math.pi, 0.0, 0.0, 0.0
    law = ContactLaw.from_restitution(rng.uniform(0.1, 0.5), stiffness=1e7, friction=friction, rolling_arm=0.005)
    return law, State(0.0, support_height(BODY, phi) + drop, phi, u, 0.0, omega)


PROBLEMS = [problem(seed) for seed in range(60)]


def descents(solver: str, end_on_chord: bool) -> list[Descent]:
    return [simulate(BODY, law, SLOPE, launch, solver=solver, end_on_chord=end_on_chord) for law, launch in PROBLEMS]  # type: ignore[arg-type]


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_descent_that_may_ends_where_it_first_lies_on_its_chord_and_else_goes_on(solver: str) -> None:
    """Oracle: the descent that goes on, and says when and where it lay there; up to then both are the same, in bits."""
    seen = {"slid on": 0, "rested": 0, "never": 0}
    for whole, cut in zip(descents(solver, False), descents(solver, True), strict=True):
        assert whole.status != Status.TUMBLED
        if whole.on_chord is None or whole.on_chord[0] == whole.time:
            assert cut.outcome == whole.outcome
            assert np.array_equal(cut.rebounds, whole.rebounds)
            seen["never" if whole.on_chord is None else "rested"] += 1
            assert whole.on_chord is None or whole.status == Status.JAMMED
            continue
        seen["slid on"] += 1
        assert cut.status == Status.TUMBLED
        assert cut.on_chord == whole.on_chord == (cut.time, cut.state.x)
        assert cut.time < whole.time
        assert cut.rebounds[-1]["feature"] == Feature.CHORD
        assert abs(cut.state.v) <= 1e-14  # zero to rounding: speeds are of some m/s
        assert cut.state.omega == 0.0
        assert np.array_equal(cut.rebounds[:-1], whole.rebounds[: len(cut.rebounds) - 1])
        assert cut.jam.retention == 0.0
        assert abs(cut.energy.residual) <= 1e-12 * cut.energy.turnover
    assert min(seen.values()) >= 3, seen


# --- scenarios --------------------------------------------------------------------------------------------------------


def test_the_shipped_sleds_have_a_rider_who_falls_and_nothing_else_does() -> None:
    """Oracle: the bodies with a part of that name."""
    for name in scenario_names():
        scenario = load_scenario(name)
        ridden = all("rider" in body.parts for body in scenario.all_bodies())
        assert scenario.ends.touching in (("rider", ("rider", "legs")) if ridden else (None,)), name
        assert not scenario.ends.on_chord, name


def test_a_rule_and_a_rider_count_in_the_hash_where_there_are_some() -> None:
    """Oracle: the same scenario without the rule, in three ways to say so, and without the rider."""
    content = load_scenario(own_scenario("brake_mat")).model_dump(mode="json")
    off = [content | {"ends": {"on_chord": False}}, content | {"ends": {}}]
    off.append({key: value for key, value in content.items() if key != "ends"})
    alone, own, unridden = (
        {Scenario.model_validate(one).hash for one in some} for some in (off, [content], [content | {"rider": None}])
    )
    assert (len(alone), len(alone | own | unridden)) == (1, 3)
