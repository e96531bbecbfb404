"""Planar oblique impact with sliding and rolling friction: a segment-shaped sled that hops down an icy incline."""

from typing import TYPE_CHECKING

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
    "Slope",
    "State",
    "Status",
    "WheelImpact",
    "circular_segment",
    "collide_wheel",
    "identify",
    "load_scenario",
    "rigid_impact",
    "scenario_names",
    "simulate",
    "simulate_batch",
    "simulate_blocks",
    "sled",
]

_register()

# What needs the extra "analysis" is loaded when it is first used: where it is, by its name.
_ANALYSIS = {"identify": "sledenv.identification.choice"}


def __getattr__(name: str) -> object:
    """Load a function that needs scipy and pandas."""
    if name not in _ANALYSIS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    try:
        return getattr(import_module(_ANALYSIS[name]), name)
    except ModuleNotFoundError as error:
        raise ImportError(f"sledenv.{name}: {error}: pip install 'sledenv[analysis]'") from error
