"""Scenarios that the tests have of their own: round sleds, whose launches may be anything, and rides over bumps."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any, Final

import sledenv

_FOLDER = Path(__file__).parent / "data" / "scenarios"


def own_scenario(name: str) -> str:
    """Return the path of a scenario of the tests."""
    file = _FOLDER / f"{name}.yaml"
    assert file.is_file(), file
    return str(file)


GOOD: Final[dict[str, Any]] = {
    "id": "example",
    "title": "An example",
    "slope": {"angle_deg": [6, 12], "length_m": 10},
    "body": {"kind": "disc", "mass_kg": 100, "radius_m": 0.5, "eccentricity_m": 0.25, "inertia_kg_m2": 18.75},
    "contact": {"stiffness_n_m": 1e7, "restitution": [0.4, 0.6], "friction": [0.1, 0.3], "rolling_arm_m": 0.005},
    "launch": {
        "speed_m_s": [1, 3],
        "drop_m": [0.2, 1.0],
        "fall_m_s": [0, 2],
        "orientation_deg": [-90, 90],
        "spin_rad_s": [-2, 2],
    },
    "control": {"orientation_deg": [-180, 180], "spin_rad_s": [-8, 8]},
    "limits": {"max_time_s": 60, "max_rebounds": 200},
}
DELETE: Final = object()
POLYGON: Final = {"kind": "polygon", "mass_kg": 2, "points_m": [[0, 0], [0.4, 0], [0.3, 0.3], [0, 0.3]]}


def changed(**changes: Any) -> dict[str, Any]:
    """Return a copy of the good scenario; ``slope__length_m=5`` sets a key of a section, ``DELETE`` removes it."""
    content = copy.deepcopy(GOOD)
    for path, value in changes.items():
        *parents, key = path.split("__")
        target = content
        for parent in parents:
            target = target[parent]
        target[key] = value
        if value is DELETE:
            del target[key]
    return content


def ride_over_bumps(**rider: float) -> sledenv.scenarios.Scenario:
    """Return a scenario of rides of the shipped sled over bumps, with changes of what it says of the rider."""
    content: dict[str, Any] = {
        "id": "bumps",
        "title": "Bumps",
        "slope": {
            "angle_deg": [7, 11],
            "length_m": 40,
            "run_out_m": 4,
            "bumps": {"height_m": [0.15, 0.4], "face_m": [3, 6], "top_m": [0.2, 1.5], "gap_m": [2, 8]},
        },
        "body": {"kind": "sled"},
        "contact": {
            "stiffness_n_m": 1e7,
            "restitution": [0.05, 0.3],
            "friction": [0.01, 0.06],
            "rolling_arm_m": 0.001,
            "corner_rolling_arm_m": 0.001,
        },
        "launch": {"speed_m_s": [8, 14], "drop_m": [0.1, 0.4], "orientation_deg": [-5, 5]},
        "control": {"orientation_deg": [-40, 40], "spin_rad_s": [-1, 1]},
        "rider": {"trim_rad_s": 1.0, "rotor_inertia_kg_m2": 2.8, "shortest_flight_s": 0.12} | rider,
        "limits": {"max_time_s": 30, "max_rebounds": 200},
        "ends": {"touching": "rider"},
    }
    return sledenv.scenarios.Scenario.model_validate(content)
