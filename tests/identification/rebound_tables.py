"""Synthetic rebounds, whose truth is known."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from sledenv import Body, circular_segment, hull, rigid_impact, segment
from sledenv.identification.law import ImpactModel
from sledenv.identification.plausibility import read_rebounds
from sledenv.identification.rebounds import AFTER, ARMS, BEFORE
from sledenv.simulation.scene import ContactLaw, State

GYRATION = 0.02
TRUTH = {"restitution": 0.6, "friction": 0.15, "rolling_arm": 0.0006}


def told_by_arms(rng: np.random.Generator, n: int, spread: float = 0.012) -> pd.DataFrame:
    """Touches of an ellipse-like body as a recording has them, in every direction."""
    a, b = rng.uniform(-spread, spread, n), rng.uniform(0.024, 0.035, n)
    u, v = rng.uniform(-1.2, 1.2, n), rng.uniform(-3.0, -1.5, n)
    return pd.DataFrame(np.stack([a, b, u, v, rng.uniform(-25.0, 25.0, n)], axis=1), columns=[*ARMS, *BEFORE])


def rebounding(
    touches: pd.DataFrame, rng: np.random.Generator, noise: float = 0.0, hypothesis: str = "energetic", **truth: float
) -> pd.DataFrame:
    """Add velocities after, each with an error of ``noise`` times the speed before."""
    rebounds = read_rebounds(touches.assign(**dict.fromkeys(AFTER, 0.0)), gyration_radius=GYRATION)
    values = {"corner_rolling_arm": 0.0, "softening": 0.0} | TRUTH | truth
    model = ImpactModel(hypothesis, {}, truth.get("reference_speed", 2.0))  # type: ignore[arg-type]
    names = [one.name for one in model.parameters(GYRATION)]
    after = model.velocities(rebounds, np.array([values[name] for name in names]))
    after += noise * rng.normal(size=after.shape) * rebounds.speed[:, None] / rebounds.scales
    return touches.assign(**dict(zip(AFTER, after.T, strict=True)))


def of_body(body: Body, law: ContactLaw, e: float, rng: np.random.Generator, n: int) -> pd.DataFrame:
    """Rebounds of a body in random orientations, by rigid_impact."""
    rows = []
    while len(rows) < n:
        state = State(0.0, 0.0, rng.uniform(-7.0, 7.0), rng.normal(), -rng.uniform(1.0, 3.0), 2.0 * rng.normal())
        after = rigid_impact(body, law, state, restitution=e)
        if after.phases:
            rows.append((state.phi, *state[3:], *after.state[3:]))
    return pd.DataFrame(rows, columns=["phi_rad", *BEFORE, *AFTER])


DISC = segment(2.0, 0.1, 0.0, 0.01)
ECCENTRIC = segment(2.0, 0.1, 0.05, 0.01)
SEGMENT = circular_segment(3.0, 0.2, math.radians(70.0))
SKATE = hull(
    3.0,
    [(-0.15, 0.0, 0.04), (0.1, 0.02, 0.08), (0.0, 0.12, 0.0)],
    ["heel", "toe", "top"],
    inertia=0.03,
    centre=(0.0, 0.0),
)
