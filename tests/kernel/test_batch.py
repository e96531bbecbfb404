"""Batches: each lane is the descent alone, bit for bit, whatever the state and its neighbours."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sledenv import ContactLaw, Segment, Settings, Slope, State, circular_segment, segment, simulate, simulate_batch
from sledenv.simulation import lanes as lanes_module
from tests.bodies import rod, same_bits

DISC = segment(1.0, 0.1, 0.05, 7.5e-3)
SLOPE = Slope(math.radians(10.0), length=40.0)
LAW = ContactLaw(1e6, 0.5, 0.1, 1e-3)


def ugly(rng: np.random.Generator, body: Segment, lanes: int) -> np.ndarray:
    """Launches of which many have a velocity or an angle that is exactly zero, or an edge."""
    phi = rng.uniform(-math.pi, math.pi, lanes)
    edges = np.array([0.0, -0.0, math.pi, -math.pi, body.half_angle, -body.half_angle, 0.5 * math.pi, 20.0])
    phi = np.where(rng.random(lanes) < 0.4, rng.choice(edges, lanes), phi)
    states = np.stack(
        [
            np.where(rng.random(lanes) < 0.1, 39.9, 0.0),
            2.0 * body.radius + body.eccentricity + rng.uniform(0.0, 0.5, lanes),
            phi,
            rng.uniform(-3.0, 3.0, lanes),
            rng.uniform(-3.0, 1.0, lanes),
            rng.uniform(-20.0, 20.0, lanes),
        ],
        axis=-1,
    )
    for column in (3, 5):
        states[rng.random(lanes) < 0.3, column] = 0.0
    states[rng.random(lanes) < 0.05, 5] = 1e-9
    states[rng.random(lanes) < 0.05, 5] = 5e3
    states[rng.random(lanes) < 0.02, 4] = -1e5
    return states


BODIES = {
    "disc": DISC,
    "balanced disc": segment(1.0, 0.1, 0.0, 7.5e-3),
    "rod": rod(1.0, 0.1, 7.5e-3),
    "segment": circular_segment(1.0, 0.5, math.radians(60.0)),
    "deep segment": circular_segment(1.0, 0.1, math.radians(140.0)),
}


@pytest.mark.parametrize("name", BODIES)
def test_a_lane_equals_the_descent_alone(name: str) -> None:
    """Random laws and slopes, exact zeros, edges, limits that cut contacts short: outcomes and logs bit for bit."""
    body = BODIES[name]
    rng = np.random.default_rng(len(name))
    lanes = 24
    states = ugly(rng, body, lanes)
    laws = np.stack(
        [
            10.0 ** rng.uniform(3.0, 7.0, lanes),
            rng.choice((0.0, 0.3, 0.9), lanes),
            rng.choice((0.0, 0.1, 0.8), lanes),
            rng.choice((0.0, 1e-3, 1e-2), lanes),
            rng.choice((0.0, 1e-3), lanes),
        ],
        axis=-1,
    )
    slopes = np.stack(
        [rng.choice((0.0, 0.2, -0.1), lanes), rng.choice((40.0, math.inf), lanes), np.full(lanes, 9.81)], axis=-1
    )
    for options in ({"max_time": 0.8}, {"max_rebounds": 3, "tolerance": 1e-8}):
        options = {"max_rebounds": 40, **options}
        batch = simulate_batch(body, laws, slopes, states, Settings(**options), keep_rebounds=True)
        same_bits(simulate_batch(body, laws, slopes, states, Settings(**options)).outcomes, batch.outcomes)
        for i in range(lanes):
            one = simulate(body, ContactLaw(*laws[i]), Slope(*slopes[i]), State(*states[i]), **options)
            same_bits(batch.outcomes[i], one.outcome)
            same_bits(batch.rebounds[i, : len(one.rebounds)], one.rebounds)


bodies = st.one_of(
    st.sampled_from(list(BODIES.values())),
    st.floats(0.3, math.pi).map(lambda half_angle: circular_segment(1.0, 0.5, half_angle)),
    st.builds(
        # The mass centre between chord and arc.
        lambda share, half_angle: segment(
            2.0, 0.5, 0.5 * (1.0 - share * min(1.0 - math.cos(half_angle), 1.0)), 0.1, half_angle
        ),
        st.floats(0.0, 1.0),
        st.floats(0.3, 3.1),
    ),
    st.builds(lambda mass, h: segment(mass, 0.2, h, 0.01 * mass), st.floats(0.1, 9.0), st.floats(0.0, 0.2)),
)


@pytest.mark.jit_only
@pytest.mark.parametrize("solver", ["compliant", "rigid"])
@given(of_lanes=st.lists(bodies, min_size=1, max_size=20), seed=st.integers(0, 2**32 - 1))
def test_each_lane_may_have_a_body_of_its_own(solver: Any, of_lanes: list[Segment], seed: int) -> None:
    """With corners and without, in any order; with logs and without, on one thread and two; as rows and as records."""
    rng = np.random.default_rng(seed)
    states = np.concatenate([ugly(rng, body, 1) for body in of_lanes])
    laws = [ContactLaw(10.0 ** rng.uniform(4.0, 7.0), *rng.choice((0.0, 0.3), 2), 1e-3) for _ in of_lanes]
    options: dict[str, Any] = {"solver": solver, "max_time": 2.0, "max_rebounds": 12}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lanes_module, "_WORTH_A_THREAD", 1)
        patch.setenv("NUMBA_NUM_THREADS", "1")
        batch = simulate_batch(of_lanes, laws, SLOPE, states, Settings(**options), keep_rebounds=True)
        patch.setenv("NUMBA_NUM_THREADS", "2")
        rows = np.array([[getattr(body, name) for name in Segment.fields[:-1]] for body in of_lanes])
        records = np.concatenate([body.record for body in of_lanes])
        for same in (rows, records):
            same_bits(simulate_batch(same, laws, SLOPE, states, Settings(**options)).outcomes, batch.outcomes)
    for i, (body, law, state) in enumerate(zip(of_lanes, laws, states, strict=True)):
        one = simulate(body, law, SLOPE, State(*state), **options)
        same_bits(batch.outcomes[i], one.outcome)
        same_bits(batch.rebounds[i, : len(one.rebounds)], one.rebounds)
        assert tuple(field[i] for field in batch.jam) == tuple(one.jam)


def test_a_contact_may_be_cut_short_anywhere() -> None:
    """Limits of time through two hops: a step that is refused after the contact has opened, or just before it would."""
    state = State(0.0, 0.2, 0.4, 1.0, -1.0, 3.0)
    first = simulate(DISC, LAW, SLOPE, state, max_rebounds=2).rebounds
    times = np.concatenate([np.linspace(row["t"] - row["duration"], row["t"], 30) for row in first])
    for limit in times.tolist():
        one = simulate(DISC, LAW, SLOPE, state, max_time=limit, max_rebounds=2)
        for lane in simulate_batch(DISC, LAW, SLOPE, [state] * 9, Settings(max_time=limit, max_rebounds=2)).outcomes:
            same_bits(lane, one.outcome)
