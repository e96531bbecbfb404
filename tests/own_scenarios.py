"""Scenarios that the tests have of their own: round sleds, whose launches may be anything, and rides over bumps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import sledenv

_FOLDER = Path(__file__).parent / "data" / "scenarios"


def own_scenario(name: str) -> str:
    """Return the path of a scenario of the tests."""
    file = _FOLDER / f"{name}.yaml"
    assert file.is_file(), file
    return str(file)


def ride_over_bumps(**rider: float) -> sledenv.Scenario:
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
    return sledenv.Scenario.model_validate(content)
