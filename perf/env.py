"""CPU time of environment steps on one thread, beside the bare simulator and two environments of others.

A step of SledLaunch is a whole descent, one of SledDescent a flight; resets are included.
"""

from __future__ import annotations

import importlib.util
import itertools
import os
import time
from collections.abc import Callable, Iterable
from typing import Any
from unittest import mock

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

import sledenv
from perf import show
from perf.harness import ratio, spread, take_turns, timed

ROUNDS = 9
IDS = {"SledLaunch": "sledenv/SledLaunch-v0", "SledDescent": "sledenv/SledDescent-v0"}
PEERS: dict[str, tuple[str, int, Callable[[Any], float]]] = {  # module needed, steps of a run, steps in 1 s of motion
    "BipedalWalker-v3": ("Box2D", 64, lambda env: env.metadata["render_fps"]),
    "highway-v0": ("highway_env", 8, lambda env: env.unwrapped.config["policy_frequency"]),
}
LANES = (64, 1024)
SINGLE = 64  # steps of a scalar environment in one run, lanes of a SyncVectorEnv
MAKE, BARE = "gym.make", "bare simulator"
_PART = 0.1  # CPU time [s] of a turn, at least
_BANK = 4096  # scenes that the bare simulator takes at random
_WARM = 16  # steps before the first turn: then lanes are no longer all in the same flight
_USUAL: dict[str, dict[str, Any]] = {"": {}, ", info=()": {"info": ()}}
_LESS = {", info=(), no landings": {"info": (), "columns": ("context", "state", "ground")}}
_OPTIONS = {"SledLaunch": _USUAL, "SledDescent": _USUAL | _LESS}


def _parts(run: Callable[[], Any], lanes: int) -> Callable[[], Any]:
    """Return what measures CPU times [s] a lane: of a step, and of its own hops or descents and first flights."""
    from sledenv.simulation.simulator import Simulator

    parts = dict.fromkeys(("step", "hop", "run", "wait"), 0.0)

    def watched(name: str, call: Callable[..., Any]) -> Callable[..., None]:
        def spend(*given: Any) -> None:
            start = time.process_time()
            call(*given)
            parts[name] += time.process_time() - start

        return spend

    calls: Any = {name: watched(name, getattr(Simulator, name)) for name in ("hop", "run", "wait")}

    def measure() -> Any:
        parts.update(dict.fromkeys(parts, 0.0), steps=0)
        with mock.patch.multiple(Simulator, **calls):
            while parts["step"] < _PART:
                watched("step", run)()
                parts["steps"] += lanes
        return np.array([parts["step"], parts["hop"] + parts["run"], parts["wait"]]) / parts["steps"]

    for _ in range(_WARM):
        run()
    return measure


def _bare(kind: str, lanes: int) -> Callable[[], None]:
    """Return a run of one step of the simulator alone, given scenes and actions as the environment draws them."""
    from sledenv.envs.inputs import read_options

    rng = np.random.default_rng(0)
    task = gym.make(IDS[kind]).unwrapped.task  # type: ignore[attr-defined]
    bank = task.begin(read_options(None, None, _BANK), lambda drawn: rng.random((len(drawn), task.draws)))
    actions = rng.uniform(-1.0, 1.0, (_BANK, *task.action_space.shape))
    if kind == "SledLaunch":
        aimed = task.aimed(bank, actions)
        return lambda: task.simulator(aimed.take(rng.integers(_BANK, size=lanes))).run()
    spins = task.spins(bank, actions, np.zeros(_BANK, np.int64))
    simulator = task.rides(bank.take(np.arange(lanes)))
    running = sledenv.STATUS_OF_CODE.index(sledenv.Status.RUNNING)

    def hop() -> None:
        simulator.hop(spins[rng.integers(_BANK, size=lanes)])
        ended = np.flatnonzero(simulator.flights["status"] != running)
        if ended.size:
            simulator.launch(ended, bank.take(rng.integers(_BANK, size=ended.size)))
            simulator.wait(ended)

    return hop


def _scalar(env: Any, steps: int = SINGLE) -> Callable[[], float]:
    """Return a run of random steps, which gives the seconds of motion in the sleds' episodes that have ended."""
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(steps)]

    def run() -> float:
        motion = 0.0
        for action in actions:
            _, _, terminated, truncated, info = env.step(action)
            if terminated or truncated:
                motion += info["descent"]["time"] if "descent" in info else 0.0
                env.reset()
        return motion

    return run


def vector(kind: str, lanes: int, mode: str = "vector_entry_point", **given: Any) -> Callable[[], Any]:
    """Return a run of one step of all lanes, the next episode begun in the same step."""
    same = AutoresetMode.SAME_STEP
    if mode == "sb3":
        from sledenv.envs.sb3 import make_vec_env

        env: Any = make_vec_env(IDS[kind], lanes, seed=0)
        env.reset()
    else:
        options = {"vector_kwargs": {"autoreset_mode": same}} if mode == "sync" else {"autoreset_mode": same.value}
        env = gym.make_vec(IDS[kind], num_envs=lanes, vectorization_mode=mode, **options, **given)
        env.reset(seed=0)
    shape = 16, lanes, env.action_space.shape[-1]
    actions = itertools.cycle(np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32))
    return lambda: env.step(next(actions))


def _ways(kind: str, sizes: tuple[int, ...]) -> dict[str, Callable[[], Any]]:
    """Return what measures the CPU time [s] of a step, by the name of the way to step."""
    ways = {BARE: _parts(_bare(kind, 1), 1)}
    for name, options in _OPTIONS[kind].items():
        ways[MAKE + name] = timed(_scalar(gym.make(IDS[kind], **options)), SINGLE, _PART, cpu=True)
    ways[f"SyncVectorEnv, {SINGLE} lanes"] = timed(vector(kind, SINGLE, "sync"), SINGLE, _PART, cpu=True)
    for lanes in sizes:
        ways[f"{BARE}, {lanes:,} lanes"] = _parts(_bare(kind, lanes), lanes)
        for name, options in _OPTIONS[kind].items():
            ways[f"native vector env, {lanes:,} lanes{name}"] = _parts(vector(kind, lanes, **options), lanes)
        ways[f"SB3 adapter, {lanes:,} lanes"] = _parts(vector(kind, lanes, "sb3"), lanes)
    return ways


def measure(rounds: int = ROUNDS, sizes: tuple[int, ...] = LANES, peers: Iterable[str] = PEERS) -> dict[str, Any]:
    """Measure all environments in turn, on one thread."""
    ways: dict[tuple[str, str], Callable[[], Any]] = {}
    motion = {}  # [s] of a step
    with mock.patch.dict(os.environ, NUMBA_NUM_THREADS="1"):
        for env, key in IDS.items():
            ways |= {(env, name): way for name, way in _ways(env, sizes).items()}
            motion[env] = _scalar(gym.make(key, info=("descent",)), 16 * SINGLE)() / (16 * SINGLE)
        for env in peers:
            module, steps, rate = PEERS[env]
            if importlib.util.find_spec(module) is None:
                print(f"{env} is skipped: there is no {module}")
                continue
            made = gym.make(f"{module}:{env}")
            ways[env, MAKE], motion[env] = timed(_scalar(made, steps), steps, _PART, cpu=True), 1.0 / rate(made)
        times = take_turns(ways, rounds)
    rows = []
    for (env, name), found in times.items():
        own = found if found.ndim == 1 else found[:, 1] + found[:, 2] if name.startswith(BARE) else found[:, 0]
        row = {"env": env, "name": name, "us": spread(1e6 * own), "times_make": ratio(times[env, MAKE], own)}
        if name == BARE or name.startswith(MAKE):
            row["motion"] = spread(motion[env] / own)
        if found.ndim > 1:
            row |= {"beyond_us": spread(1e6 * (own - found[:, 1])), "first_us": spread(1e6 * found[:, 2])}
        rows.append(row)
    return {"rounds": rounds, "rows": rows}


def _shown(key: str) -> Callable[[Any], str]:
    return lambda row: show.median(row[key]) if key in row else "-"


COLUMNS: show.Columns = {
    "environment": lambda row: row["env"],
    "how": lambda row: row["name"],
    "µs a step": _shown("us"),
    "times gym.make": _shown("times_make"),
    "s of motion a second": _shown("motion"),
    "µs beyond the hop": _shown("beyond_us"),
    "of these first flights": _shown("first_us"),
}
