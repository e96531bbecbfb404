"""Planar oblique impact with sliding and rolling friction: a segment-shaped sled that hops down an icy incline.

Importing it registers two environments with Gymnasium, alone or as a native batch:

    gymnasium.make("sledenv/SledLaunch-v0", scenario="sled_snow")       # choose the launch: one step, a descent
    gymnasium.make("sledenv/SledDescent-v0", scenario="sled_rollers")   # trim the spin of every flight of a ride
    gymnasium.make_vec("sledenv/SledLaunch-v0", num_envs=1024)

``scenario_names()`` lists the scenarios. Without an environment, ``simulate`` follows one descent and
``simulate_batch`` many; ``evaluate`` says how well a policy does. The classes behind the ids are in
:mod:`sledenv.envs.launch`, :mod:`sledenv.envs.descent` and :mod:`sledenv.envs.vector`; ``sledenv --help`` is the
command line.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if not Path(__file__).is_file():
    raise ImportError(f"sledenv cannot be imported from an archive, {__file__}: install it with pip, which unpacks it")

if sys.argv[:1] == ["-m"]:  # until Python has found the module that it is to run
    from sledenv.machine import starting as _starting

    _starting.tell_in_one_line()

if not Path(__file__).with_name("configs").exists():  # a checkout
    from sledenv.machine import checkout as _checkout

    _checkout.find_at_the_top()

import sledenv.pages as _pages  # noqa: F401  registers how a notebook shows a descent
from sledenv.envs import register as _register
from sledenv.machine.extras import Missing as _Missing
from sledenv.machine.extras import MissingPackage as _MissingPackage

if TYPE_CHECKING:
    from sledenv.benchmark.evaluation import Evaluation, evaluate
    from sledenv.closed_forms.wheel import WheelImpact, collide_wheel
    from sledenv.identification.choice import identify
    from sledenv.identification.tables import recorded_poses, recorded_rebounds
    from sledenv.scenarios.scenario import Context, Scenario, ScenarioError, load_scenario, scenario_names
    from sledenv.simulation.bodies import Body, Segment, segment
    from sledenv.simulation.outcomes import Descent, DescentBatch
    from sledenv.simulation.outlines import Arc
    from sledenv.simulation.records import STATUS_OF_CODE, Energy, Feature, Mode, Status
    from sledenv.simulation.ride import Ride, RideBatch
    from sledenv.simulation.rigid_impact import Phase, RigidImpact, rigid_impact
    from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
    from sledenv.simulation.sensitivity import Sensitivity, sensitivity
    from sledenv.simulation.settings import Settings
    from sledenv.simulation.shapes import circular_segment, disc, hull, polygon, rod
    from sledenv.simulation.simulate import simulate, simulate_batch, simulate_blocks
    from sledenv.simulation.sleds import sled
    from sledenv.uncertainty import Study, StudyResult, load_study, study, study_names

__version__ = "0.1.0"

__all__ = [
    "STATUS_OF_CODE",
    "Arc",
    "Body",
    "ContactLaw",
    "Context",
    "Descent",
    "DescentBatch",
    "Energy",
    "Evaluation",
    "Feature",
    "Mode",
    "Phase",
    "Ride",
    "RideBatch",
    "RigidImpact",
    "Scenario",
    "ScenarioError",
    "Segment",
    "Sensitivity",
    "Settings",
    "Slope",
    "State",
    "Status",
    "Study",
    "StudyResult",
    "WheelImpact",
    "Zone",
    "circular_segment",
    "collide_wheel",
    "disc",
    "evaluate",
    "hull",
    "identify",
    "load_scenario",
    "load_study",
    "polygon",
    "recorded_poses",
    "recorded_rebounds",
    "rigid_impact",
    "rod",
    "scenario_names",
    "segment",
    "sensitivity",
    "simulate",
    "simulate_batch",
    "simulate_blocks",
    "sled",
    "study",
    "study_names",
]

# Loaded where they are first asked for, so that `import sledenv` is quick: what each module has.
_MODULES = {
    "sledenv.benchmark.evaluation": ("Evaluation", "evaluate"),
    "sledenv.closed_forms.wheel": ("WheelImpact", "collide_wheel"),
    "sledenv.identification.choice": ("identify",),
    "sledenv.identification.tables": ("recorded_poses", "recorded_rebounds"),
    "sledenv.simulation.records": ("STATUS_OF_CODE", "Energy", "Feature", "Mode", "Status"),
    "sledenv.scenarios.scenario": ("Context", "Scenario", "ScenarioError", "load_scenario", "scenario_names"),
    "sledenv.simulation.bodies": ("Body", "Segment", "segment"),
    "sledenv.simulation.outlines": ("Arc",),
    "sledenv.simulation.shapes": ("circular_segment", "disc", "hull", "polygon", "rod"),
    "sledenv.simulation.sleds": ("sled",),
    "sledenv.simulation.sensitivity": ("Sensitivity", "sensitivity"),
    "sledenv.simulation.outcomes": ("Descent", "DescentBatch"),
    "sledenv.simulation.ride": ("Ride", "RideBatch"),
    "sledenv.simulation.rigid_impact": ("Phase", "RigidImpact", "rigid_impact"),
    "sledenv.simulation.scene": ("ContactLaw", "Slope", "State", "Zone"),
    "sledenv.simulation.settings": ("Settings",),
    "sledenv.simulation.simulate": ("simulate", "simulate_batch", "simulate_blocks"),
    "sledenv.uncertainty": ("Study", "StudyResult", "load_study", "study", "study_names"),
}
_HOME = {name: module for module, names in _MODULES.items() for name in names}

_register()


def __getattr__(name: str) -> Any:
    """Load a public name; where its packages are missing, what stands for it until they are installed."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        found = getattr(importlib.import_module(_HOME[name]), name)
    except _MissingPackage as error:
        return _Missing(f"{__name__}.{name}", error)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
