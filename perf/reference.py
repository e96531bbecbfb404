"""The work that is timed: the reference descent, known to 32 digits, with the error of an answer; random launches.

Besides, bodies with corners, dropped onto a slope in the middle of the ranges of the scenario brake_mat.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import sledenv

Floats = NDArray[np.float64]

_RECORD: dict[str, Any] = json.loads(
    (Path(__file__).parents[1] / "tests" / "data" / "reference_descent.json").read_text()
)["reference"]
_GIVEN: dict[str, float] = _RECORD["parameters"]

BODY = sledenv.Body(_GIVEN["mass"], _GIVEN["radius"], _GIVEN["eccentricity"], _GIVEN["inertia"])
LAW = sledenv.ContactLaw(_GIVEN["stiffness"], _GIVEN["asymmetry"], _GIVEN["friction"], _GIVEN["rolling_arm"])
SLOPE = sledenv.Slope(_GIVEN["slope"], gravity=_GIVEN["gravity"])
LAUNCH = sledenv.State(**_RECORD["state"])
DOWNHILL, INWARD = SLOPE.gravity * math.sin(SLOPE.angle), SLOPE.gravity * math.cos(SLOPE.angle)

# Velocities (u, v, omega) after each rebound, and its time: extended precision, from the same double inputs.
EXACT: Floats = np.array(
    [[float(row[name]) for name in ("u", "v", "omega")] for row in _RECORD["rebounds_from_double_inputs"]]
)
TIMES: Floats = np.array([float(row["time"]) for row in _RECORD["rebounds_from_double_inputs"]])

FEW, MANY = 5, 20  # rebounds; the seventh of the many settles and rolls for .59 s


SHALLOW, MAT_BODY = (
    sledenv.circular_segment(100.0, radius, math.radians(half)) for radius, half in ((0.9, 35.0), (0.5, 110.0))
)
MAT = sledenv.ContactLaw.from_restitution(0.5, stiffness=1e7, friction=0.4, rolling_arm=0.005)
MAT_SLOPE = sledenv.Slope(math.radians(10.0), length=10.0)
SPIN = 8.0  # [rad/s] largest of a drop


def settings(**fields: Any) -> dict[str, Any]:
    """Return the arguments by which batches and rides are told how to simulate; older trees take them one by one."""
    return {"settings": sledenv.Settings(**fields)} if hasattr(sledenv, "Settings") else fields


def launches(lanes: int, seed: int = 0) -> Floats:
    """Random launches of the reference's disc, shape (lanes, 6)."""
    rng = np.random.default_rng(seed)
    phi = rng.uniform(-math.pi, math.pi, lanes)
    lowest = BODY.radius - BODY.eccentricity * np.cos(phi)
    return np.stack(
        [
            np.zeros(lanes),
            lowest + rng.uniform(0.05, 0.5, lanes),
            phi,
            rng.uniform(0.0, 3.0, lanes),
            rng.uniform(-1.0, 0.0, lanes),
            rng.uniform(-8.0, 8.0, lanes),
        ],
        axis=-1,
    )


def drops(body: sledenv.Body, lanes: int, phi: tuple[float, float], spin: float, seed: int = 0) -> Floats:
    """Random launches of a body with corners, shape (lanes, 6): orientations [rad] within bounds, spins up to one."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(*phi, lanes)
    # Written out, for older trees have it elsewhere.
    local = angle - 2.0 * math.pi * np.rint(angle / (2.0 * math.pi))
    along = body.eccentricity - body.radius * math.cos(body.half_angle)
    across = body.radius * math.sin(body.half_angle)
    on_corner = across * np.abs(np.sin(local)) - along * np.cos(local)
    on_arc = body.radius - body.eccentricity * np.cos(local)
    lowest = np.where(np.abs(local) <= body.half_angle, on_arc, on_corner)
    return np.stack(
        [
            np.zeros(lanes),
            lowest + rng.uniform(0.1, 1.5, lanes),
            angle,
            rng.uniform(1.0, 6.0, lanes),
            np.zeros(lanes),
            rng.uniform(-spin, spin, lanes),
        ],
        axis=-1,
    )


def errors(velocities: ArrayLike) -> Floats:
    """Velocity error of each rebound, relative to the exact velocity after it.

    Parameters
    ----------
    velocities : array_like, shape (n, 3)
        u, v [m/s] and omega [rad/s] after the first n rebounds. A missing rebound counts as an error of 1.

    Returns
    -------
    ndarray, shape (n,)
        Length of the difference of (u, v, r omega) over that of the exact one.
    """
    weights = np.array([1.0, 1.0, BODY.radius])
    found = np.asarray(velocities, dtype=float).reshape(-1, 3)
    exact = EXACT[: len(found)]
    error: Floats = np.linalg.norm((found - exact) * weights, axis=1) / np.linalg.norm(exact * weights, axis=1)
    return np.where(np.isfinite(error), error, 1.0)


def worst(velocities: ArrayLike, rebounds: int) -> float:
    """Largest error of the first ``rebounds`` rebounds; 1 if some are missing."""
    found = np.asarray(velocities, dtype=float).reshape(-1, 3)[:rebounds]
    return float(errors(found).max()) if len(found) == rebounds else 1.0
