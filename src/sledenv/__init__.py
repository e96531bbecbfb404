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

import sys
from pathlib import Path
from typing import TYPE_CHECKING

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
from sledenv.machine.lazy import lazy_names as _lazy_names

if TYPE_CHECKING:
    from sledenv.benchmark.evaluation import evaluate
    from sledenv.bodies import Body, circular_segment, disc, hull, polygon, rod, segment, sled
    from sledenv.closed_forms.wheel import collide_wheel
    from sledenv.identification.choice import identify
    from sledenv.scenarios.scenario import load_scenario, scenario_names
    from sledenv.simulation.records import Status
    from sledenv.simulation.ride import Ride
    from sledenv.simulation.rigid_impact import rigid_impact
    from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
    from sledenv.simulation.sensitivity import sensitivity
    from sledenv.simulation.settings import Settings
    from sledenv.simulation.simulate import simulate, simulate_batch
    from sledenv.uncertainty import study

__version__ = "0.1.0"

__all__ = [
    "Body",
    "ContactLaw",
    "Ride",
    "Settings",
    "Slope",
    "State",
    "Status",
    "Zone",
    "circular_segment",
    "collide_wheel",
    "disc",
    "evaluate",
    "hull",
    "identify",
    "load_scenario",
    "polygon",
    "rigid_impact",
    "rod",
    "scenario_names",
    "segment",
    "sensitivity",
    "simulate",
    "simulate_batch",
    "sled",
    "study",
]

# Loaded where they are first asked for, so that `import sledenv` is quick: what each module has.
__getattr__, __dir__ = _lazy_names(
    __name__,
    {
        "sledenv.benchmark.evaluation": ("evaluate",),
        "sledenv.bodies": ("Body", "circular_segment", "disc", "hull", "polygon", "rod", "segment", "sled"),
        "sledenv.closed_forms.wheel": ("collide_wheel",),
        "sledenv.identification.choice": ("identify",),
        "sledenv.scenarios.scenario": ("load_scenario", "scenario_names"),
        "sledenv.simulation.records": ("Status",),
        "sledenv.simulation.ride": ("Ride",),
        "sledenv.simulation.rigid_impact": ("rigid_impact",),
        "sledenv.simulation.scene": ("ContactLaw", "Slope", "State", "Zone"),
        "sledenv.simulation.sensitivity": ("sensitivity",),
        "sledenv.simulation.settings": ("Settings",),
        "sledenv.simulation.simulate": ("simulate", "simulate_batch"),
        "sledenv.uncertainty": ("study",),
    },
    submodules=(
        "benchmark",
        "bodies",
        "closed_forms",
        "identification",
        "plot",
        "scenarios",
        "simulation",
        "uncertainty",
    ),
)

_register()
