"""Batches: each lane is the descent alone, bit for bit, whatever the state and its neighbours."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sledenv import ContactLaw, Settings, Slope, State, circular_segment, segment, simulate, simulate_batch
from sledenv.bodies import Segment
from sledenv.simulation import lanes as lanes_module
from tests.bodies import rod, same_bits, segment_by_share

DISC = segment(1.0, 0.1, 0.05, 7.5e-3)


def ugly(rng: np.random.Generator, body: Segment) -> State:
    """A launch whose velocities and angle are often exactly zero, or an edge."""
    edges = [0.0, -0.0, math.pi, -math.pi, body.half_angle, -body.half_angle, 0.5 * math.pi, 20.0]
    phi = rng.choice(edges) if rng.random() < 0.4 else rng.uniform(-math.pi, math.pi)
    u = rng.choice([0.0, rng.uniform(-3.0, 3.0)], p=[0.3, 0.7])
    v = rng.choice([rng.uniform(-3.0, 1.0), -1e5], p=[0.98, 0.02])
    omega = rng.choice([0.0, 1e-9, 5e3, rng.uniform(-20.0, 20.0)], p=[0.3, 0.05, 0.05, 0.6])
    y = 2.0 * body.radius + body.eccentricity + rng.uniform(0.0, 0.5)
    return State(float(rng.choice([0.0, 39.9], p=[0.9, 0.1])), y, *map(float, (phi, u, v, omega)))


bodies = st.one_of(
    st.sampled_from([DISC, segment(1.0, 0.1, 0.0, 7.5e-3), rod(1.0, 0.1, 7.5e-3)]),
    st.floats(0.3, math.pi).map(lambda half_angle: circular_segment(1.0, 0.5, half_angle)),
    st.builds(
        lambda share, half_angle: segment_by_share(2.0, 0.5, share, 0.1, half_angle),
        st.floats(0.0, 1.0),
        st.floats(0.3, 3.1),
    ),
)


@pytest.mark.jit_only
@pytest.mark.parametrize("solver", ["compliant", "rigid"])
@given(
    of_lanes=st.lists(bodies, min_size=1, max_size=20),
    limits=st.sampled_from([{"max_time": 2.0, "max_rebounds": 12}, {"max_rebounds": 3, "tolerance": 1e-8}]),
    seed=st.integers(0, 2**32 - 1),
)
def test_each_lane_is_the_descent_alone(
    solver: Any, of_lanes: list[Segment], limits: dict[str, Any], seed: int
) -> None:
    """Oracle: the descent alone; with logs and without, on one thread and two; bodies as rows and as records."""
    rng = np.random.default_rng(seed)
    states = [ugly(rng, body) for body in of_lanes]
    laws = [ContactLaw(10.0 ** rng.uniform(3.0, 7.0), *rng.choice((0.0, 0.3, 0.8), 2), 1e-3) for _ in of_lanes]
    slopes = [Slope(rng.choice((0.0, 0.2, -0.1)), rng.choice((40.0, math.inf))) for _ in of_lanes]
    settings = Settings(solver=solver, **limits)
    given_ = np.array(laws), np.array([[slope.angle, slope.length, slope.gravity] for slope in slopes]), states
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lanes_module, "_WORTH_A_THREAD", 1)
        patch.setenv("NUMBA_NUM_THREADS", "1")
        batch = simulate_batch(of_lanes, *given_, settings, keep_rebounds=True)
        patch.setenv("NUMBA_NUM_THREADS", "2")
        rows = np.array([[getattr(body, name) for name in Segment.fields[:-1]] for body in of_lanes])
        for same in (rows, np.concatenate([body.record for body in of_lanes])):
            same_bits(simulate_batch(same, *given_, settings).outcomes, batch.outcomes)
    for i, scene in enumerate(zip(of_lanes, laws, slopes, states, strict=True)):
        one = simulate(*scene, settings)
        same_bits(batch.outcomes[i], one.outcome)
        same_bits(batch.rebounds[i, : len(one.rebounds)], one.rebounds)
        assert tuple(field[i] for field in batch.jam) == tuple(one.jam)


def test_a_contact_may_be_cut_short_anywhere() -> None:
    """Oracle: the descent alone, with limits of time through two hops: after a contact has opened, or just before."""
    state, law, slope = State(0.0, 0.2, 0.4, 1.0, -1.0, 3.0), ContactLaw(1e6, 0.5, 0.1, 1e-3), Slope(0.2, 40.0)
    first = simulate(DISC, law, slope, state, max_rebounds=2).rebounds
    for limit in np.concatenate([np.linspace(row["t"] - row["duration"], row["t"], 30) for row in first]).tolist():
        settings = Settings(max_time=limit, max_rebounds=2)
        one = simulate(DISC, law, slope, state, settings)
        for lane in simulate_batch(DISC, law, slope, [state] * 9, settings).outcomes:
            same_bits(lane, one.outcome)
