"""The reference descent, known to 32 digits, with the error of an answer to it; random launches of its disc."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import sledenv
from perf.harness import ROOT, Floats

_RECORD: dict[str, Any] = json.loads((ROOT / "tests" / "data" / "reference_descent.json").read_text())["reference"]
_GIVEN: dict[str, float] = _RECORD["parameters"]
_REBOUNDS = _RECORD["rebounds"]  # extended precision, from the same double inputs

BODY = sledenv.segment(*(_GIVEN[name] for name in ("mass", "radius", "eccentricity", "inertia")))
LAW = sledenv.ContactLaw(*(_GIVEN[name] for name in ("stiffness", "asymmetry", "friction", "rolling_arm")))
SLOPE = sledenv.Slope(_GIVEN["slope"], gravity=_GIVEN["gravity"])
LAUNCH = sledenv.State(**_RECORD["state"])
DOWNHILL, INWARD = SLOPE.gravity * math.sin(SLOPE.angle), SLOPE.gravity * math.cos(SLOPE.angle)
EXACT: Floats = np.array([[float(row[name]) for name in ("u", "v", "omega")] for row in _REBOUNDS])  # after each
TIMES: Floats = np.array([float(row["time"]) for row in _REBOUNDS])
FEW, MANY = 5, 20  # rebounds; the seventh of the many settles and rolls for 0.59 s


def launches(lanes: int, seed: int = 0) -> Floats:
    """Return random launches of the disc, shape (lanes, 6)."""
    rng = np.random.default_rng(seed)
    phi = rng.uniform(-math.pi, math.pi, lanes)
    lowest = BODY.radius - BODY.eccentricity * np.cos(phi)
    drop, u, v, spin = (rng.uniform(*ends, lanes) for ends in ((0.05, 0.5), (0.0, 3.0), (-1.0, 0.0), (-8.0, 8.0)))
    return np.column_stack([np.zeros(lanes), lowest + drop, phi, u, v, spin])


def errors(velocities: ArrayLike) -> Floats:
    """Return the error of the velocities (u, v, omega) after each of the first n rebounds, an array of shape (n, 3).

    It is the length of the difference of (u, v, r omega) over that of the exact one, or 1 where there is no number.
    """
    weights = np.array([1.0, 1.0, BODY.radius])
    found = np.asarray(velocities, dtype=float).reshape(-1, 3)
    exact = EXACT[: len(found)]
    error: Floats = np.linalg.norm((found - exact) * weights, axis=1) / np.linalg.norm(exact * weights, axis=1)
    return np.where(np.isfinite(error), error, 1.0)


def worst(velocities: ArrayLike, rebounds: int) -> float:
    """Return the largest error of the first ``rebounds`` rebounds; 1 if some are missing."""
    found = errors(np.asarray(velocities, dtype=float).reshape(-1, 3)[:rebounds])
    return float(found.max()) if len(found) == rebounds else 1.0
