"""Studies whose answers are known."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from sledenv.kernel import params
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
from sledenv.simulation.scenes import Scenes
from sledenv.uncertainty import Study, run
from tests.own_scenarios import own_scenario

# A disc that falls onto level ground and is stopped there, at its first rebound.
DROP: dict[str, Any] = {
    "id": "drop",
    "title": "A drop",
    "solver": "rigid",
    "slope": {"angle_deg": 0, "length_m": 100},
    "body": {"kind": "disc", "mass_kg": 2, "radius_m": 0.1, "eccentricity_m": 0, "inertia_kg_m2": 0.01},
    "contact": {"stiffness_n_m": 1e7, "restitution": 0.5, "friction": 0, "rolling_arm_m": 0},
    "launch": {"speed_m_s": 3, "drop_m": {"kind": "uniform", "low": 0.5, "high": 2}},
    "limits": {"max_time_s": 60, "max_rebounds": 1},
    "stations_m": [0.5, 1, 1.5],
    "launches": 256,
}
PUSH: dict[str, Any] = {
    "id": "push",
    "title": "A push-off",
    "scenario": own_scenario("bowl_snow"),
    "slope": {"angle_deg": 8},
    "contact": {"friction": {"kind": "uniform", "low": 0.1, "high": 0.6}, "restitution": 0.1},
    "launch": {
        "speed_m_s": {"kind": "normal", "mean": 5, "sd": 0.5},
        "drop_m": 0.3,
        "orientation_deg": {"kind": "normal", "mean": 0, "sd": 30},
        "spin_rad_s": 0,
    },
    "launches": 300,
}

# A sled on ice and mats, of which where they begin and how rough they are is uncertain.
ZONED: dict[str, Any] = {
    "id": "zoned",
    "title": "Onto mats",
    "scenario": "sled_mat",
    "slope": {"angle_deg": 3, "run_out_m": 0},
    "zone": {
        "begin_m": {"kind": "uniform", "low": 2, "high": 5},
        "friction": {"kind": "uniform", "low": 0.2, "high": 0.5},
    },
    "contact": {"friction": 0.02, "restitution": 0.2},
    "launch": {"speed_m_s": 8, "drop_m": 0.2, "orientation_deg": {"kind": "normal", "mean": 0, "sd": 10}},
    "launches": 200,
}

# A sled that rides over the bumps of a shipped scenario, without trims.
ROLLERS: dict[str, Any] = {
    "id": "rollers",
    "title": "Over rollers",
    "scenario": "sled_rollers",
    "slope": {"angle_deg": 4.5},
    "contact": {"friction": {"kind": "uniform", "low": 0.004, "high": 0.012}, "restitution": 0.1},
    "launch": {"speed_m_s": {"kind": "normal", "mean": 9, "sd": 0.5}},
    "stations_m": [10, 20, 30, 50],
    "launches": 40,
}


UNIFORM: dict[str, Any] = {"kind": "uniform", "low": 0.3, "high": 0.5}
SECTION: list[list[Any]] = [[0, 40, "rock"], [10, 34, "rock"], [40, 12, "soil"], [60, 6, "soil"], [100, 4, "soil"]]
HILL: dict[str, Any] = {
    "id": "hill",
    "title": "A hill",
    "terrain": {"section": SECTION},
    "materials": {
        "rock": {"restitution": 0.4, "friction": UNIFORM, "rolling_arm_m": 0.01, "stiffness_n_m": 2e7},
        "soil": {"restitution": 0.3, "friction": 0.6, "rolling_arm_m": 0.08, "stiffness_n_m": 1e7},
    },
    "start_m": {"kind": "uniform", "low": 1, "high": 4},
    "heights_m": [0.5, 1],
    "body": {"kind": "rock", "length_m": {"kind": "uniform", "low": 0.4, "high": 0.8}, "shape": 0.7},
    "launch": {"speed_m_s": 1, "drop_m": 0.2, "orientation_deg": {"kind": "uniform", "low": -180, "high": 180}},
    "limits": {"max_time_s": 100, "max_rebounds": 500},
    "stations_m": [10, 25, 40, 55, 70, 85, 100],
    "launches": 200,
}


def mapping(base: dict[str, Any], **changes: Any) -> dict[str, Any]:
    """A study with some keys of its sections changed, dots in their names written as two underscores; None removes."""
    content = {key: dict(value) if isinstance(value, dict) else value for key, value in base.items()}
    for name, value in changes.items():
        part, _, key = name.partition("__")
        place, last = (content.setdefault(part, {}), key) if key else (content, part)
        place.pop(last, None)
        if value is not None:
            place[last] = value
    return content


def made(base: dict[str, Any], **changes: Any) -> Study:
    return Study.model_validate(mapping(base, **changes))


def drawn(study: Study, launches: int | None = None) -> Scenes:
    """Scenes of the first launches of a study, of all by default."""
    return study.scenes(study.values(run.draws(study)[:launches]))


class Lane(NamedTuple):
    """Law, slope and launch of one descent, as simulate takes them."""

    law: ContactLaw
    slope: Slope
    launch: State


def lane_of(scenes: Scenes, lane: int) -> Lane:
    """Read one of many descents, field by field."""
    row = scenes.rows[lane]
    law, slope, launch = (
        [float(row[name]) for name in kind._fields] for kind in (params.ContactLaw, params.Slope, params.State)
    )
    own = scenes.zones[int(row["zones"]) : int(row["zones_end"])].tolist()
    zones = [Zone(*[None if math.isnan(number) else number for number in zone]) for zone in own]
    x, y, radius = (scenes.grounds()[lane][name] for name in ("x", "y", "radius"))
    incline = Slope(*slope[:3], zones, np.column_stack([x, y]), radius, slope[3])
    return Lane(ContactLaw(*law), incline, State(*launch))


def batch_of(scenes: Scenes) -> tuple[np.ndarray, list[ContactLaw], list[Slope], list[State]]:
    """Return bodies, laws, slopes and launches of descents, as simulate_batch takes them."""
    laws, slopes, launches = zip(*[lane_of(scenes, lane) for lane in range(len(scenes.rows))], strict=True)
    return scenes.bodies[scenes.body], list(laws), list(slopes), list(launches)
