"""Synthetic drop tests: bodies, laws and launches drawn at random, and noisy poses of what follows from them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pandas as pd

from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.interpolation import drawable_rows, states_at
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Solver
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height
from tests.bodies import bowl

BODIES = (
    circular_segment(1.0, 0.1, math.radians(110.0)),
    segment(1.0, 0.1, 0.02, 0.004),
    bowl(2.0, 0.3, 0.25, 0.02, 0.08),
)
NOISE = (1e-3, math.radians(0.2))  # [m], [rad]


class Drop(NamedTuple):
    body: Body
    law: ContactLaw
    slope: Slope
    launch: State

    @property
    def truth(self) -> dict[str, float]:
        return {
            "restitution": self.law.restitution,
            "friction": self.law.friction,
            "rolling_arm": self.law.rolling_arm,
            "corner_rolling_arm": 0.0,
            **self.launch._asdict(),
        }


def drop(rng: np.random.Generator, body: Body | None = None) -> Drop:
    """Draw a drop test of one of three bodies, or of a given one."""
    law = ContactLaw.from_restitution(
        rng.uniform(0.3, 0.9), stiffness=1e6, friction=rng.uniform(0.05, 0.5), rolling_arm=rng.uniform(0.0, 0.005)
    )
    slope = Slope(rng.uniform(0.0, 0.2))
    drawn = body or BODIES[rng.integers(len(BODIES))]
    return Drop(drawn, law, slope, launch(rng, drawn))


def launch(rng: np.random.Generator, body: Body) -> State:
    phi = rng.uniform(-0.6, 0.6)
    y = support_height(body, phi) + rng.uniform(0.1, 0.4)
    return State(0.0, y, phi, rng.uniform(-1.0, 1.5), rng.uniform(-0.5, 0.5), rng.uniform(-6.0, 6.0))


def descent(one: Drop, seconds: float, solver: Solver = "rigid") -> Descent:
    return simulate(*one, solver=solver, max_time=seconds, record="trajectory", sample_interval=seconds)


def track(
    one: Drop,
    rng: np.random.Generator,
    *,
    rate: float = 240.0,
    seconds: float = 1.0,
    solver: Solver = "rigid",
    noise: tuple[float, float] = NOISE,
    wrong: float = 0.0,
) -> pd.DataFrame:
    """Record a drop test: ``rate`` frames per second, a share ``wrong`` of them with a pose that is far off."""
    times = np.arange(round(rate * seconds)) / rate
    poses = states_at(drawable_rows(descent(one, seconds, solver)), times)[:, :3]
    poses += rng.normal(size=poses.shape) * [noise[0], noise[0], noise[1]]
    lost = rng.random(len(poses)) < wrong
    poses[lost] += rng.normal(size=(np.count_nonzero(lost), 3)) * [0.05, 0.05, 1.0]
    return pd.DataFrame({"t_s": times, "x_m": poses[:, 0], "y_m": poses[:, 1], "phi_rad": poses[:, 2]})
