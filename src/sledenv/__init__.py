"""Planar oblique impact with sliding and rolling friction: a segment-shaped sled that hops down an icy incline."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from sledenv.derivatives import Sensitivity, sensitivity
from sledenv.descent import Descent, DescentBatch, simulate, simulate_batch, simulate_blocks
from sledenv.envs import register as _register
from sledenv.impact import Phase, RigidImpact, rigid_impact
from sledenv.kernel.records import Energy, Feature, Mode, Status
from sledenv.params import Body, ContactLaw, Slope, State, circular_segment, sled
from sledenv.ride import Ride, RideBatch
from sledenv.scenario import Context, Scenario, ScenarioError, load_scenario, scenario_names
from sledenv.wheel import WheelImpact, collide_wheel

if TYPE_CHECKING:
    from sledenv.identification.choice import identify
    from sledenv.uncertainty import Study, StudyResult, load_study, study, study_names

__all__ = [
    "Body",
    "ContactLaw",
    "Context",
    "Descent",
    "DescentBatch",
    "Energy",
    "Feature",
    "Mode",
    "Phase",
    "Ride",
    "RideBatch",
    "RigidImpact",
    "Scenario",
    "ScenarioError",
    "Sensitivity",
    "Slope",
    "State",
    "Status",
    "Study",
    "StudyResult",
    "WheelImpact",
    "circular_segment",
    "collide_wheel",
    "identify",
    "load_scenario",
    "load_study",
    "rigid_impact",
    "scenario_names",
    "sensitivity",
    "simulate",
    "simulate_batch",
    "simulate_blocks",
    "sled",
    "study",
    "study_names",
]

# What needs the extra "analysis" is loaded where it is first asked for: the module of each name.
_ANALYSIS = {
    "identify": "sledenv.identification.choice",
    **dict.fromkeys(("Study", "StudyResult", "load_study", "study", "study_names"), "sledenv.uncertainty"),
}

_register()


def __getattr__(name: str) -> Any:
    """Load a function that needs scipy and pandas."""
    if name not in _ANALYSIS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(importlib.import_module(_ANALYSIS[name]), name)
    except ModuleNotFoundError as error:
        raise ImportError(f"sledenv.{name}: {error}: pip install 'sledenv[analysis]'") from error
