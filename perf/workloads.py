"""The worker of ``python -m perf versus``: times workloads of whichever tree its path leads to, one order a line.

Orders come on standard input, ``prepare NAME`` and ``time NAME``, and each is answered by a line of JSON. The worker is
run as a script and takes the work from its own folder, so that all trees are given the same; of a tree it uses public
names, and the tree's own loop around its kernel. Everything runs on one thread, except what a new process does.
"""

from __future__ import annotations

import gc
import importlib
import itertools
import json
import logging
import math
import os
import runpy
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

_LEAST, _SLICE = 0.2, 0.005  # [s] that one timing, and each of its slices, should take
_FEWEST = 2  # slices
_LOOPED = 64  # copies of the reference descent in a compiled loop
_LANES = {"compliant": 1_000, "rigid": 10_000}  # random launches of a batch, ...
_FEWER = 300  # ... and of a loop over rigid bodies
_DROPS = 500  # launches of bodies with corners
_NEAR = 0.002  # [rad] from lying flat: both ends of the chord touch
_ENV, _SCENARIO, _ENV_LANES = "sledenv/SledLaunch-v0", "brake_mat", 1024
_SAMPLES = 16_384  # of one short training run
_PPO: dict[str, Any] = {"n_steps": 16, "batch_size": 2048, "n_epochs": 10, "gamma": 0.0, "seed": 0, "device": "cpu"}
_START = f"""
import time
import gymnasium
start = time.perf_counter()
import sledenv
env = gymnasium.make({_ENV!r})
env.reset(seed=0)
env.step(env.action_space.sample())
print(time.perf_counter() - start)
"""

Measure = Callable[[], float]
Prepared = tuple[Measure, float]  # returns the time [s] of a unit of work; units that one run does


class Workload(NamedTuple):
    """A piece of work that is timed."""

    about: str
    unit: str  # of work
    prepare: Callable[[], Prepared]
    rate: bool = False  # shown as units a second instead of the time of one
    once: bool = False  # takes so long that it is timed once, and only if asked for


def _timed(run: Callable[[], Any], units: float) -> Prepared:
    """Return the measure of a run in this process; nothing is compiled after the first run, which is made here.

    A timing is the least of many short ones: what else the machine does only adds, and most of it in bursts.
    """
    run()
    repeats = 0

    def seconds() -> float:
        start = time.perf_counter()
        for _ in range(repeats):
            run()
        return time.perf_counter() - start

    def measure() -> float:
        nonlocal repeats
        gc.collect()
        gc.disable()
        try:
            if not repeats:
                repeats = 1
                while (found := seconds()) < 0.5 * _SLICE:
                    repeats *= 2
                repeats = max(1, round(repeats * _SLICE / found))
            slices = [seconds() for _ in range(_FEWEST)]
            while sum(slices) < _LEAST:
                slices.append(seconds())
        finally:
            gc.enable()
        return min(slices) / (repeats * units)

    return measure, units


def _work() -> dict[str, Any]:
    """Names of reference.py beside this file, with the tree's classes."""
    return runpy.run_path(str(Path(__file__).with_name("reference.py")))


def _loop(solver: str, launches: Callable[[dict[str, Any]], Any], rebounds: str) -> Callable[[], Prepared]:
    """Prepare the loop around the scalar kernel that the tree itself has."""

    def prepare() -> Prepared:
        folder = "perf" if Path("perf/scalar_loop.py").exists() else "benchmarks"  # its name in older trees
        loop = importlib.import_module(f"{folder}.scalar_loop").scalar_loop
        work = _work()
        given = work["BODY"], work["LAW"], work["SLOPE"], launches(work)
        run = loop(*given, solver=solver, max_rebounds=work[rebounds])
        return _timed(run, float(run()["rebounds"].sum()))

    return prepare


def _batch(solver: str) -> Callable[[], Prepared]:
    def prepare() -> Prepared:
        import numba

        import sledenv

        numba.set_num_threads(1)
        work = _work()
        given = work["BODY"], work["LAW"], work["SLOPE"], work["launches"](_LANES[solver])
        options: dict[str, Any] = work["settings"](solver=solver, max_rebounds=work["FEW"])

        def run() -> Any:
            return sledenv.simulate_batch(*given, **options)

        return _timed(run, float(run().outcomes["rebounds"].sum()))

    return prepare


def _drops(body: str, solver: str, per: str, phi: tuple[float, float] = (-math.pi, math.pi)) -> Callable[[], Prepared]:
    """Prepare descents of a body with corners from orientations within bounds [rad]; of a hop, up to the rebound."""

    def prepare() -> Prepared:
        import numba

        import sledenv

        numba.set_num_threads(1)
        work = _work()
        launches = work["drops"](work[body], _DROPS, phi, 0.0 if per == "hop" else work["SPIN"])
        options: dict[str, Any] = work["settings"](solver=solver, max_rebounds=1 if per == "hop" else 200)

        def run() -> Any:
            return sledenv.simulate_batch(work[body], work["MAT"], work["MAT_SLOPE"], launches, **options)

        ends = run().outcomes
        return _timed(run, float(ends["rebounds"].sum() if per == "hop" else len(ends)))

    return prepare


def _env() -> Prepared:
    import gymnasium as gym
    import numba
    from gymnasium.vector import AutoresetMode

    import sledenv  # noqa: F401  (registers the environments)

    numba.set_num_threads(1)
    env: Any = gym.make_vec(
        _ENV,
        num_envs=_ENV_LANES,
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.SAME_STEP.value,
        scenario=_SCENARIO,
    )
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = itertools.cycle([env.action_space.sample() for _ in range(8)])
    return _timed(lambda: env.step(next(actions)), _ENV_LANES)


def _ppo() -> Prepared:
    import numba
    import torch
    from stable_baselines3 import PPO

    from sledenv.envs.sb3 import make_vec_env

    numba.set_num_threads(1)
    torch.set_num_threads(1)
    env = make_vec_env(_ENV, _ENV_LANES, seed=0, env_kwargs={"scenario": _SCENARIO})
    return _timed(lambda: PPO("MlpPolicy", env, **_PPO).learn(_SAMPLES), _SAMPLES)


def _start(cache: str) -> float:
    """Time [s] of a first step in a new process, ``import gymnasium`` not counted."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    command = [sys.executable, "-P", "-c", _START]
    done = subprocess.run(
        command, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"a new process has failed: {done.stderr.strip().splitlines()[-1:]}")
    return float(done.stdout.split()[-1])


def _warm() -> Prepared:
    cache = os.environ["NUMBA_CACHE_DIR"]
    _start(cache)
    return lambda: _start(cache), 1.0


def _cold() -> Prepared:
    def measure() -> float:
        with tempfile.TemporaryDirectory() as cache:
            return _start(cache)

    return measure, 1.0


def _copies(work: dict[str, Any]) -> list[Any]:
    return [work["LAUNCH"]] * _LOOPED


def _random(work: dict[str, Any]) -> Any:
    return work["launches"](_FEWER)


WORKLOADS: dict[str, Workload] = {
    "descent": Workload(
        "compliant reference descent in a compiled loop, 5 rebounds", "hop", _loop("compliant", _copies, "FEW")
    ),
    "descent-20": Workload("the same, 20 rebounds with settled rolling", "hop", _loop("compliant", _copies, "MANY")),
    "rigid": Workload(
        f"rigid solver in a compiled loop, {_FEWER} random launches", "hop", _loop("rigid", _random, "FEW")
    ),
    "compliant-batch": Workload(f"simulate_batch, {_LANES['compliant']:,} random launches", "hop", _batch("compliant")),
    "rigid-batch": Workload(f"the same, rigid solver, {_LANES['rigid']:,} launches", "hop", _batch("rigid")),
    "sled": Workload(
        f"simulate_batch, {_DROPS} descents of a shallow segment, half-angle 35 degrees, radius .9 m, on a slope as"
        f" in {_SCENARIO}; trees whose descents end elsewhere do other work",
        "descent",
        _drops("SHALLOW", "compliant", "descent"),
        rate=True,
    ),
    "sled-rigid": Workload("the same, rigid solver", "descent", _drops("SHALLOW", "rigid", "descent"), rate=True),
    "mat": Workload(
        f"the same of the body of {_SCENARIO}, half-angle 110 degrees, radius .5 m",
        "descent",
        _drops("MAT_BODY", "compliant", "descent"),
        rate=True,
    ),
    "mat-rigid": Workload("the same, rigid solver", "descent", _drops("MAT_BODY", "rigid", "descent"), rate=True),
    "arc-hop": Workload(
        "the same body, one hop on its arc", "hop", _drops("MAT_BODY", "compliant", "hop", (-0.5, 0.5))
    ),
    "chord-hop": Workload(
        "one hop on its chord, both ends of which touch",
        "hop",
        _drops("MAT_BODY", "compliant", "hop", (math.pi - _NEAR, math.pi + _NEAR)),
    ),
    "env": Workload(f"native vector env of {_ENV} on {_SCENARIO}, {_ENV_LANES:,} lanes", "step", _env, rate=True),
    "ppo": Workload(f"PPO of stable-baselines3 on it, {_SAMPLES:,} samples", "sample", _ppo, rate=True),
    "warm": Workload("first gym.make, reset and step of a new process, kernels in the cache", "start", _warm),
    "cold": Workload("the same with an empty cache", "start", _cold, once=True),
}


def _foreign() -> list[str]:
    """Modules of sledenv that have come from another tree: an installed one fills the gaps of an incomplete one."""
    root = Path.cwd().resolve()
    loaded = [(name, getattr(module, "__file__", None)) for name, module in list(sys.modules.items())]
    ours = [
        (name, file) for name, file in loaded if file and name.partition(".")[0] in ("sledenv", "perf", "benchmarks")
    ]
    return [name for name, file in ours if not Path(file).resolve().is_relative_to(root)]


def main() -> None:
    """Answer orders until there are no more."""
    logging.getLogger("sledenv").setLevel("ERROR")  # that it compiles is no news here
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
                answer: dict[str, Any] = {"units": prepared[name][1]}
            else:
                answer = {"seconds": prepared[name][0]()}
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}".splitlines()[0]}
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
