"""Hops of rigid bodies side by side: each lane is the hop alone, bit for bit, whatever the state and its neighbours."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sledenv import (
    Body,
    ContactLaw,
    RideBatch,
    Settings,
    Slope,
    State,
    circular_segment,
    simulate,
    simulate_batch,
)
from sledenv.compiler.trace import LANES
from sledenv.kernel.bounce import bounce
from sledenv.kernel.flight import tell_body, tell_place
from sledenv.kernel.impact import ENERGETIC, impact
from sledenv.kernel.state import HOP, PACK, new
from tests.bodies import rod, same_bits
from tests.compiled import compiled

BODIES = {
    "disc": Body(1.0, 0.1, 0.05, 7.5e-3),
    "balanced disc": Body(1.0, 0.1, 0.0, 5e-3),
    "slender disc": Body(1.0, 0.1, 0.09, 2e-4),  # jams
    "rod": rod(1.0, 0.3, 0.03),
    "segment": circular_segment(2.0, 0.5, math.radians(50.0)),
    "deep segment": circular_segment(2.0, 0.5, math.radians(110.0)),
}


def ugly(rng: np.random.Generator, body: Body, lanes: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Laws, slopes and launches of which many have what is exactly zero, or an edge."""
    edges = (0.0, -0.0, math.pi, -math.pi, body.half_angle, -body.half_angle, 0.5 * math.pi, 20.0, -1e3)
    phi = np.where(rng.random(lanes) < 0.3, rng.choice(edges, lanes), rng.uniform(-math.pi, math.pi, lanes))
    states = np.stack(
        [
            rng.choice((0.0, 39.9), lanes, p=(0.9, 0.1)),
            2.0 * body.radius + body.eccentricity + rng.uniform(0.0, 0.5, lanes),
            phi,
            *rng.uniform((-3.0, -3.0, -30.0), (3.0, 1.0, 30.0), (lanes, 3)).T,
        ],
        axis=-1,
    )
    states[:, 3:][rng.random((lanes, 3)) < 0.15] = 0.0
    states[rng.random(lanes) < 0.01, 4] = math.nextafter(-1e160, 0.0)  # overflows
    given = ((1e6,), (0.0, 0.2, 0.5, 0.999), (0.0, 0.05, 0.3, 1.0), (0.0, 1e-3, 0.02), (0.0, 1e-3))
    laws = np.stack([rng.choice(choices, lanes) for choices in given], axis=-1)
    given = ((0.0, 0.1, 0.3), (40.0, math.inf), (9.81, 1.6))
    return laws, np.stack([rng.choice(choices, lanes) for choices in given], axis=-1), states


@pytest.mark.jit_only  # plain Python warns where a launch overflows, and is slow
@pytest.mark.parametrize("settle_speed", [None, 0.0, 0.5])
@pytest.mark.parametrize("name", BODIES)
def test_a_lane_equals_the_descent_alone(name: str, settle_speed: float | None) -> None:
    """Outcomes and logs, with and without logs; lanes settle, jam, finish and overflow at different times."""
    body = BODIES[name]
    laws, slopes, states = ugly(np.random.default_rng(len(name)), body, 200)
    options: dict[str, Any] = {
        "solver": "rigid",
        "settle_speed": settle_speed,
        "max_time": 4.0,
        "max_rebounds": 25,
    }
    batch = simulate_batch(body, laws, slopes, states, Settings(**options), keep_rebounds=True)
    same_bits(simulate_batch(body, laws, slopes, states, Settings(**options)).outcomes, batch.outcomes)
    for i, (law, slope, state) in enumerate(zip(laws, slopes, states, strict=True)):
        one = simulate(body, ContactLaw(*law), Slope(*slope), State(*state), **options)
        same_bits(batch.outcomes[i], one.outcome)
        same_bits(batch.rebounds[i, : len(one.rebounds)], one.rebounds)


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")  # some of the speeds do, which is their point
@pytest.mark.parametrize("name", ["disc", "deep segment"])
def test_hop_by_hop_a_ride_is_the_descent(name: str) -> None:
    """Hops of a ride side by side, one at a time, with no trim: the outcomes and rebounds of the whole descents."""
    body = BODIES[name]
    laws, slopes, states = ugly(np.random.default_rng(4), body, 100)
    options: dict[str, Any] = {"solver": "rigid", "max_time": 4.0, "max_rebounds": 25}
    batch = simulate_batch(body, laws, slopes, states, Settings(**options), keep_rebounds=True)
    ride = RideBatch(body, laws, slopes, states, Settings(**options), keep_rebounds=True)
    for _ in range(26):  # one more than rebounds, for flights that end without another
        ride.hop(np.zeros(100))
    found = ride.descents()
    same_bits(found.outcomes, batch.outcomes)
    for i, count in enumerate(batch.outcomes["rebounds"]):
        same_bits(found.rebounds[i, :count], batch.rebounds[i, :count])


def bounce_once(body: Body, count: int, packs: np.ndarray, hops: np.ndarray) -> None:
    tell_body(body, hops[0])
    for k in range(count):
        tell_place(hops[0], packs[0], k)
    bounce(body, count, packs[0], hops[0])


def hit(hops: np.ndarray) -> int:
    return impact(ENERGETIC, hops[0], None)


def test_a_hop_is_ordinary_if_its_impact_lets_the_body_go() -> None:
    """Oracle: impact() of the touch; one lane finishes before, one is plastic, one lands too late, four are empty."""
    body = BODIES["disc"]
    packs = new(PACK)
    z = packs[0]
    rng = np.random.default_rng(2)
    z["y"], z["v"], z["omega"] = rng.uniform((0.2, -1.0, -9.0), (0.5, 0.0, 9.0), (LANES, 3)).T
    z["inward"], z["horizon"], z["max_time"] = 9.81, 60.0, 60.0
    z["friction"], z["arc_arm"], z["law_restitution"], z["length"] = 0.2, 1e-3, 0.6, math.inf
    z["u"], z["length"][3], z["law_restitution"][5], z["horizon"][7] = 1.0, 0.01, 0.0, 1e-3
    given, count = packs.copy()[0], LANES - 4
    compiled(bounce_once)(body, count, packs, new(HOP))
    others = [3, 5, 7, *range(count, LANES)]
    assert np.array_equal(np.flatnonzero(z["fine"] == 0.0), others)
    assert np.array_equal(z["rebounds"], z["fine"])
    for name in ("y", "v", "omega", "horizon"):
        assert np.array_equal(z[name][others], given[name][others])
    compiled_hit, hops = compiled(hit), new(HOP)
    for k in np.flatnonzero(z["fine"]):
        a, b, omega = z["a"][k], z["b"][k], given["omega"][k]
        assert z["v_n_landing"][k] == given["v"][k] - 9.81 * z["touchdown"][k] - a * omega < 0.0
        touch = hops[0]
        touch["per_mass"], touch["per_inertia"] = 1.0 / body.mass, 1.0 / body.inertia
        touch["size"], touch["a"], touch["b"] = body.radius + body.eccentricity, a, b
        touch["friction"], touch["arm"], touch["restitution"] = 0.2, 1e-3, 0.6
        touch["v_t"], touch["omega"], touch["v_n"] = z["v_t_landing"][k], omega, z["v_n_landing"][k]
        compiled_hit(hops)
        spin, rate = touch["omega"], touch["v_n"]
        assert (z["omega"][k], z["v"][k], z["y"][k]) == (spin, rate + a * spin, b)
        lost = (z["lost_hysteresis"][k], z["lost_sliding"][k], z["lost_rolling"][k])
        assert lost == (touch["hysteresis"], touch["sliding"], touch["rolling"])
