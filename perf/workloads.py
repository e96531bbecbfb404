"""What ``python -m perf versus`` times, and the process that times it in one of two trees, one order a line.

Both trees are given the same work by the same code, that of this folder, which knows public names of sledenv alone;
only the loop around the scalar kernel is the tree's own. Everything runs on one thread: NUMBA_NUM_THREADS says so.
"""

from __future__ import annotations

import importlib
import json
import logging
import math
import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

import sledenv
from perf.env import IDS, vector
from perf.harness import timed
from perf.reference import BODY, FEW, LAUNCH, LAW, MANY, SLOPE, contexts, launches, problem, settings
from perf.startup import BASE, STEP, first

_LEAST, _SLICE = 0.2, 0.005  # [s] that one timing, and each of its slices, should take
_CUT_DISC = str(Path(__file__).with_name("cut_disc.yaml"))
_KIND, _LANES, SCENARIO = "SledLaunch", 1024, "sled_mat"
_SINGLE = 64  # copies of the reference descent in a compiled loop, and episodes of an environment
_SAMPLES = 16_384  # of one short training run
_DECISIONS = 60  # of a ride at most

Prepared = tuple[Callable[[], float], float]  # measures the time [s] of a unit of work; units that one run does


class Workload(NamedTuple):
    """A piece of work that is timed."""

    about: str
    unit: str  # of work
    prepare: Callable[[], Prepared]
    once: bool = False  # takes so long that it is timed once, and only if asked for


def _timed(run: Callable[[], Any], units: float) -> Prepared:
    return timed(run, units, _SLICE, _LEAST), units


def _loop(solver: str, states: Any, rebounds: int) -> Prepared:
    """Prepare the loop around the scalar kernel that the tree itself has, where this process runs."""
    # At the end of the path, where their neighbours hide no other module; older trees have another name for the folder.
    sys.path += [str(Path.cwd() / folder) for folder in ("perf", "benchmarks")]
    loop = importlib.import_module("scalar_loop").scalar_loop
    run = loop(BODY, LAW, SLOPE, states, solver=solver, max_rebounds=rebounds)
    return _timed(run, float(run()["rebounds"].sum()))


def _batch(what: tuple[tuple[Any, ...], dict[str, Any]], hops: bool, **more: Any) -> Prepared:
    """Prepare what simulate_batch takes, with the fields of its settings; the units are its hops, or its descents."""
    given, fields = what
    run = partial(sledenv.simulate_batch, *given, **settings(**fields | more))
    ends = run().outcomes
    return _timed(run, float(ends["rebounds"].sum() if hops else len(ends)))


def _random(count: int, solver: str) -> Prepared:
    return _batch(((BODY, LAW, SLOPE, launches(count)), {"max_rebounds": FEW}), True, solver=solver)


def _scenario(name: str, solver: str) -> Prepared:
    return _batch(problem(name, contexts(name, 500)), False, solver=solver)


def _one_hop(phi: float, around: float) -> Prepared:
    """Prepare drops of a cut disc without spin from orientations around one [rad], up to the rebound."""
    found = contexts(_CUT_DISC, 500, orientation=(phi - around, phi + around), spin=(0.0, 0.0))
    return _batch(problem(_CUT_DISC, found), True, max_rebounds=1)


def episodes() -> Callable[[], list[float]]:
    """Return a run of episodes of one step each, which gives their rewards."""
    env = gym.make(IDS[_KIND], scenario=SCENARIO, info=("jam",), launch_noise=(0.0, 0.0))
    action = np.zeros(env.action_space.shape or (), np.float32)

    def episode(i: int) -> float:
        env.reset(seed=None if i else 0)
        return float(env.step(action)[1])

    return lambda: [episode(i) for i in range(_SINGLE)]


def descents_of_episodes() -> tuple[tuple[Any, ...], dict[str, Any]]:
    """What simulate_batch takes for the descents of these episodes, and the fields of its settings."""
    env = gym.make(IDS[_KIND], scenario=SCENARIO, launch_noise=(0.0, 0.0))
    drawn = np.array([[*env.reset(seed=None if i else 0)[1]["context"].values()] for i in range(_SINGLE)])
    drawn[:, sledenv.Context._fields.index("spin")] = 0.0  # what the zero action chooses
    return problem(SCENARIO, drawn)


def _rides(name: str) -> Prepared:
    """Prepare rides of a scenario with a rider who trims at random; the units are flights that are decided on."""
    given, fields = problem(name, contexts(name, 256))
    rider: Any = sledenv.load_scenario(name).rider  # of a ride there is one
    rotor: dict[str, Any] = {"rotor_inertia": rider.rotor_inertia_kg_m2, "shortest_flight": rider.shortest_flight_s}
    spins = rider.trim_rad_s * np.random.default_rng(0).uniform(-1.0, 1.0, (_DECISIONS, 256))
    running = sledenv.STATUS_OF_CODE.index(sledenv.Status.RUNNING)

    def run() -> int:
        rides = sledenv.RideBatch(*given, **(settings(**fields) | rotor))
        decisions = 0
        for trims in spins:
            decisions += int((rides.outcomes()["status"] == running).sum())
            rides.hop(trims)
        return decisions

    return _timed(run, float(run()))


def _ppo() -> Prepared:
    import torch

    from perf.training import train
    from sledenv.envs.sb3 import make_vec_env

    torch.set_num_threads(1)
    env = make_vec_env(IDS[_KIND], _LANES, seed=0, env_kwargs={"scenario": SCENARIO})
    return lambda: 1.0 / train(env, _SAMPLES)[0], _SAMPLES


def _start(warm: bool) -> Prepared:
    measure = partial(first, STEP, os.environ["NUMBA_CACHE_DIR"] if warm else None, BASE)
    if warm:
        measure()
    return measure, 1.0


_COPIES = [LAUNCH] * _SINGLE
_CALL = partial(sledenv.simulate, BODY, LAW, SLOPE, LAUNCH, max_rebounds=FEW)
WORKLOADS: dict[str, Workload] = {
    "simulate": Workload("simulate() of the reference descent, 5 rebounds", "hop", lambda: _timed(_CALL, FEW)),
    "descent": Workload("the same in a compiled loop", "hop", lambda: _loop("compliant", _COPIES, FEW)),
    "descent-20": Workload("20 rebounds, with settled rolling", "hop", lambda: _loop("compliant", _COPIES, MANY)),
    "rigid": Workload("rigid solver in a loop, 300 launches", "hop", lambda: _loop("rigid", launches(300), FEW)),
    "compliant-batch": Workload("simulate_batch, 1,000 random launches", "hop", lambda: _random(1_000, "compliant")),
    "rigid-batch": Workload("the same, rigid solver, 10,000 launches", "hop", lambda: _random(10_000, "rigid")),
    "sled": Workload("500 of sled_snow as a batch", "descent", lambda: _scenario("sled_snow", "compliant")),
    "sled-rigid": Workload("the same, rigid solver", "descent", lambda: _scenario("sled_snow", "rigid")),
    "mat": Workload("500 of sled_mat as a batch", "descent", lambda: _scenario("sled_mat", "compliant")),
    "mat-rigid": Workload("the same, rigid solver", "descent", lambda: _scenario("sled_mat", "rigid")),
    "arc-hop": Workload("one hop of a cut disc on its arc", "hop", lambda: _one_hop(0.0, 0.5)),
    "chord-hop": Workload("one on its chord, both ends of which touch", "hop", lambda: _one_hop(math.pi, 0.002)),
    "rollers": Workload("256 rides of sled_rollers, trimmed at random", "decision", lambda: _rides("sled_rollers")),
    "terraces": Workload("the same on sled_terraces", "decision", lambda: _rides("sled_terraces")),
    "step": Workload("SledLaunch on sled_mat, info=('jam',)", "reset and step", lambda: _timed(episodes(), _SINGLE)),
    "step-kernel": Workload("these descents as a batch", "descent", lambda: _batch(descents_of_episodes(), False)),
    "env": Workload(
        "the native vector env of it", "step", lambda: _timed(vector(_KIND, _LANES, scenario=SCENARIO), _LANES)
    ),
    "ppo": Workload(f"PPO of stable-baselines3 on that, {_SAMPLES:,} samples", "sample", _ppo),
    "warm": Workload("first make, reset and step of a process, not the first", "start", lambda: _start(True)),
    "cold": Workload(
        "the same in the first process: nothing is kept of others", "start", lambda: _start(False), once=True
    ),
}


def _foreign() -> list[str]:
    """Modules of sledenv that have come from another tree: an installed one fills the gaps of an incomplete one."""
    package = Path(sledenv.__file__).parent
    loaded = [(name, module.__file__) for name, module in sys.modules.items() if name.startswith("sledenv.")]
    return [name for name, file in loaded if file and not Path(file).is_relative_to(package)]


def main() -> None:
    """Answer orders until there are no more: ``prepare NAME`` by units of work, ``time NAME`` by seconds for one."""
    logging.getLogger("sledenv").setLevel("ERROR")  # that an older tree compiles is no news here
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what a library prints is no answer
    prepared: dict[str, Prepared] = {}
    for order in sys.stdin:
        verb, name = order.split()
        try:
            if verb == "prepare":
                prepared[name] = WORKLOADS[name].prepare()
                if foreign := _foreign():
                    raise ImportError(f"{', '.join(foreign)} missing in this tree")
            answer: Any = prepared[name][1] if verb == "prepare" else prepared[name][0]()
        except Exception as error:
            answer = f"{type(error).__name__}: {error}".splitlines()[0]
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
