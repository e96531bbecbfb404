"""Time and error on the reference descent: event-driven solvers, explicit Euler, general physics engines.

Every method simulates the same seconds; its error is against the 32-digit solution of perf.reference. A method that
solves another contact law than the reference keeps the distance of the two models, however small its step.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import sledenv
from perf import engines
from perf.harness import Floats, publish, spread, take_turns, timed
from perf.reference import BODY, FEW, LAUNCH, LAW, MANY, SLOPE, worst
from sledenv.reproduce.euler import euler_descent

ROUNDS = 15
LANES = 1024  # copies of the reference descent in a batch


class Peer(NamedTuple):
    """A method: how it is run, what it answers, and what is timed."""

    name: str
    rebounds: int
    run: Callable[[], Any]
    answer: Callable[[], Floats]  # velocities after each rebound
    copies: int = 1  # of the descent that one run simulates


def _velocities(rebounds: np.ndarray) -> Floats:
    return np.stack([rebounds[name] for name in ("u_after", "v_after", "omega_after")], axis=-1)


def called(name: str, rebounds: int, simulate: Callable[..., Any] = sledenv.simulate, **options: Any) -> Peer:
    """Return one call of a simulator."""
    run = partial(simulate, BODY, LAW, SLOPE, LAUNCH, max_rebounds=rebounds, **options)
    return Peer(name, rebounds, run, lambda: _velocities(run().rebounds))


def batch(name: str, rebounds: int, solver: Any = "compliant") -> Peer:
    """Return one call of simulate_batch for many copies."""
    settings = sledenv.Settings(solver, max_rebounds=rebounds)
    run = partial(sledenv.simulate_batch, BODY, LAW, SLOPE, np.tile(LAUNCH, (LANES, 1)), settings)
    return Peer(name, rebounds, run, lambda: _velocities(run(keep_rebounds=True).rebounds[-1]), LANES)


def engine(label: str, name: str, dt: float) -> Peer:
    """Return the steps of an engine alone, without reading the state after each; building the scene is not timed."""
    scene = engines.build(name, dt)

    def run() -> None:
        scene.reset()
        scene.advance(engines.steps_of(dt))

    return Peer(label, FEW, run, lambda: engines.velocities(engines.build(name, dt), dt))


def methods() -> list[Peer]:
    """Return all methods for the first rebounds; for many, settled rolling included, those that follow so far."""
    own = [
        peer
        for rebounds in (FEW, MANY)
        for peer in (
            batch("sledenv compliant, simulate_batch", rebounds),
            called("sledenv compliant, simulate()", rebounds),
            called("explicit Euler 2.5e-7, sledenv", rebounds, euler_descent, step=2.5e-7),
        )
    ]
    return [
        *own,
        batch("sledenv rigid, simulate_batch", FEW, "rigid"),
        called("sledenv rigid, simulate()", FEW, solver="rigid"),
        engine("MuJoCo 1e-4", "mujoco", 1e-4),
        engine("MuJoCo 2e-3", "mujoco", 2e-3),
        engine("pymunk 1e-3", "pymunk", 1e-3),
        engine("Box2D 1e-3", "box2d", 1e-3),
    ]


def measure() -> None:
    """Measure time and error of all methods on the reference descent, and show them in docs/performance.md."""
    os.environ["NUMBA_NUM_THREADS"] = "1"
    peers = methods()
    times = take_turns({i: timed(peer.run, peer.copies * peer.rebounds) for i, peer in enumerate(peers)}, ROUNDS)
    rows = [
        {
            "rebounds": str(peer.rebounds),
            "method": peer.name,
            "µs per rebound": spread(1e6 * own),
            "velocity error": worst(peer.answer(), peer.rebounds),
        }
        for peer, own in zip(peers, times.values(), strict=True)
    ]
    publish("peers", sorted(rows, key=lambda row: (int(row["rebounds"]), row["µs per rebound"]["median"])))
