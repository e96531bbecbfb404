"""Planar oblique impact with sliding and rolling friction: a segment-shaped sled that hops down an icy incline."""

from sledenv.derivatives import Sensitivity, sensitivity
from sledenv.descent import Descent, DescentBatch, simulate, simulate_batch, simulate_blocks
from sledenv.envs import register as _register
from sledenv.impact import Phase, RigidImpact, rigid_impact
from sledenv.kernel.records import Energy, Feature, Mode, Status
from sledenv.params import Body, ContactLaw, Slope, State, circular_segment, sled
from sledenv.ride import Ride, RideBatch
from sledenv.scenario import Context, Scenario, ScenarioError, load_scenario, scenario_names
from sledenv.wheel import WheelImpact, collide_wheel

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
    "WheelImpact",
    "circular_segment",
    "collide_wheel",
    "load_scenario",
    "rigid_impact",
    "scenario_names",
    "sensitivity",
    "simulate",
    "simulate_batch",
    "simulate_blocks",
    "sled",
]

_register()
