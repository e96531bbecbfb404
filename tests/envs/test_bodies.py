"""Several bodies in one scenario: each lane of whatever batch is the descent of its own body, bit for bit."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import sledenv
from sledenv.envs.descent import SledDescent
from sledenv.envs.inputs import FIELDS
from sledenv.envs.launch import SledLaunch
from sledenv.envs.task import Task
from sledenv.envs.vector import SledLaunchVector
from sledenv.kernel.records import RUNNING
from tests.envs.kinds import equal
from tests.own_scenarios import own_scenario

POLYGON = {"kind": "polygon", "mass_kg": 40, "points_m": [[-0.6, 0], [0.6, 0], [0.3, 0.4], [-0.4, 0.3]]}
DISC = {"kind": "disc", "mass_kg": 90, "radius_m": 0.5, "eccentricity_m": 0.1, "inertia_kg_m2": 9.0}
CONTENT = sledenv.load_scenario(own_scenario("ice_drop")).model_dump(mode="json", by_alias=True)
BODIES = [CONTENT["body"], POLYGON, DISC]
SHAPE = sledenv.scenarios.Context._fields.index("shape")


def scenario(body: dict) -> sledenv.scenarios.Scenario:
    """A shipped scenario with another body, on a short slope with two zones and a run-out."""
    slope = CONTENT["slope"] | {"length_m": 4.0, "run_out_m": 2.0}
    zones = [
        {"begin_m": 0.5, "end_m": 1.0, "friction": 0.1},
        {"begin_m": [1.0, 2.0], "end_m": 3.0, "friction": [0.3, 0.6]},
    ]
    return sledenv.scenarios.Scenario.model_validate(CONTENT | {"slope": slope, "zones": zones, "body": body})


SEVERAL = scenario({"kind": "choice", "of": BODIES})


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
@pytest.mark.parametrize("keep_rebounds", [False, True])
def test_batches_and_rides_are_the_descents_of_the_bodies(solver, keep_rebounds):
    """Oracle: simulate() of the body, the law, the slope and the launch of each context."""
    task = Task(SEVERAL, solver=solver, ride=True)
    contexts = task.scenario.contexts(np.random.default_rng(1).random((40, FIELDS)))
    scenes = task.scenes(contexts)
    batch = task.descend(scenes, keep_rebounds=keep_rebounds)
    rides = task.simulator(scenes, keep_rebounds=keep_rebounds)
    while (rides.flights["status"] == RUNNING).any():
        rides.hop(np.zeros(40))
    followed = rides.descents()
    assert len(batch.rebounds) == (40 if keep_rebounds else 0)
    for i in range(40):
        context = sledenv.scenarios.Context(*contexts[i].tolist())
        given = task.scenario.given(context)
        assert given.launch == sledenv.State(*scenes.launches[i])
        assert given.body == SEVERAL.all_bodies()[int(context.shape)]
        alone = sledenv.simulate(*given, SEVERAL.settings(solver))
        for found in (batch, followed):
            assert found.outcomes[i] == alone.outcome
            assert [column[i] for column in found.jam] == list(alone.jam)
            if keep_rebounds:
                assert np.array_equal(found.rebounds[i, : len(alone.rebounds)], alone.rebounds)


def test_a_body_can_be_asked_for():
    env, batch = SledLaunch(SEVERAL), SledLaunchVector(3, SEVERAL)
    for shape in (0, 1, 2):
        assert env.reset(options={"context": {"shape": shape}})[0][SHAPE] == shape - 1.0
    assert batch.reset(options={"context": {"shape": [2, 0, 1]}})[0][:, SHAPE].tolist() == [1.0, -1.0, 0.0]


GIVEN = [SledLaunch, SledDescent, partial(SledLaunchVector, 2)]


@pytest.mark.parametrize("kind", GIVEN)
@pytest.mark.parametrize(
    ("given", "field", "value", "allowed"),
    [
        (SEVERAL, "shape", 3.0, r"a whole number in \[0, 2\]"),
        (own_scenario("ice_drop"), "shape", 1.0, r"a whole number in \[0, 0\]"),
        ("sled_snow", "zone_begin", 9.0, r"in \(-inf, 9.0\) m"),
        ("sled_mat", "zone_begin", 12.0, r"in \(-inf, 12.0\) m"),
        (SEVERAL, "zone_begin", 0.75, r"in \[1.0, 3.0\) m"),
    ],
)
def test_what_the_scenario_does_not_have_is_refused_and_the_episode_goes_on(kind, given, field, value, allowed):
    """Oracle: a twin that was never given it."""
    env, twin = kind(given), kind(given)
    assert equal(env.reset(seed=1), twin.reset(seed=1))
    with pytest.raises(ValueError, match=rf"context\.{field} = {value}: must be {allowed}"):
        env.reset(seed=2, options={"context": {field: value}})
    action = np.zeros(env.action_space.shape, np.float32)
    assert equal(env.step(action), twin.step(action))
    assert equal(env.reset(), twin.reset())


def test_the_scales_of_a_flight_are_those_of_the_fastest_body():
    """Oracle: tasks with each body alone."""
    alone = [Task(scenario(body)) for body in BODIES]
    task = Task(SEVERAL)
    assert task.columns.scales.speed == max(one.columns.scales.speed for one in alone)
    assert task.columns.scales.size == max(one.columns.scales.size for one in alone)
